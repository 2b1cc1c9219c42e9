#!/usr/bin/env python3
"""Builds the meshes of the glass of wine in meshes/, in seconds."""

import math
import os
import random
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from shapes import Mesh, grid, lathe, rounded_box, smooth_profile, tube  # noqa: E402

OUT = os.path.join(HERE, "meshes")
OUTER = [(0.0345, 0.0006), (0.0365, 0.0004), (0.0378, 0.0014), (0.0365, 0.0026), (0.022, 0.0046), (0.008, 0.0078),
         (0.0042, 0.016), (0.0034, 0.035), (0.0034, 0.065), (0.0040, 0.082), (0.0075, 0.0905), (0.018, 0.098),
         (0.032, 0.113), (0.0415, 0.133), (0.0440, 0.152), (0.0422, 0.175), (0.0378, 0.200), (0.0338, 0.2215)]
BOWL = OUTER[11:]
WALL = 0.0011


def inner_profile():
    """The inside of the bowl from its middle to the rim."""
    curve = smooth_profile([(0.0, 0.0955), (0.008, 0.0962)] + [(r - WALL * 0.9, h + WALL * (1.1 if h < 0.12 else 0.15)) for r, h in BOWL], 10)
    return [(max(r, 0.0), h) for r, h in curve]


def glass():
    outer = [(0.0, 0.0012), (0.012, 0.0012)] + smooth_profile(OUTER, 10)
    inner = inner_profile()
    (a, h), (b, _) = outer[-1], inner[-1]
    middle, radius = (a + b) / 2, (a - b) / 2
    rim = [(middle + radius * math.cos(t), h + radius * math.sin(t)) for t in (math.pi * k / 6 for k in range(1, 6))]
    return lathe(outer + rim + inner[::-1], 192)


def wine(level=0.146, reach=0.0005):
    """Reaches a little into the glass, whose priority is higher; its edge climbs the wall."""
    side = [(r + reach if r > 0 else 0.0, h - reach * 0.8) for r, h in inner_profile() if h < level]
    radius = side[-1][0]
    top = [(radius - 0.0022 * k / 6 - reach * (k > 0), level + 0.0012 * (1 - k / 6) ** 2) for k in range(7)]
    return lathe(side + top + [(radius * 0.5, level), (0.0, level)], 192)


BOTTLE = [(0.030, 0.0), (0.0355, 0.0015), (0.0372, 0.006), (0.0375, 0.05), (0.0375, 0.17), (0.036, 0.188), (0.028, 0.206), (0.0175, 0.222),
          (0.0145, 0.240), (0.0142, 0.280), (0.0140, 0.288), (0.0155, 0.2895), (0.0158, 0.297), (0.0148, 0.2995)]


def bottle():
    outer = [(0, 0.012), (0.014, 0.009), (0.027, 0.0005)] + smooth_profile(BOTTLE, 8)
    inner = [(max(r - 0.003, 0.0), max(h, 0.016)) for r, h in outer[3:]]
    return lathe(outer + [(0.0125, 0.3)] + inner[::-1] + [(0.0, 0.019)], 128)


def bottle_wine():
    side = [(r - 0.0025, max(h, 0.0155)) for r, h in smooth_profile(BOTTLE, 8) if h < 0.118]
    return lathe([(0.0, 0.0185)] + side + [(0.0, 0.118)], 128)


def label():
    return lathe([(0.03772, 0.055), (0.03772, 0.125)], 64, 195, 345)


def cork():
    points = [(0.0, -0.022), (0.0115, -0.022), (0.0121, -0.0214), (0.0119, -0.01), (0.0121, 0.0214), (0.0115, 0.022), (0.0, 0.022)]
    return lathe(points, 64).turned("z", 90).moved(0, 0.0121, 0)


def grapes(seed=4):
    """Balls that fall onto a heap, one after another, and their stems."""
    random.seed(seed)
    placed, stems = [], Mesh()
    for _ in range(46):
        best = None
        for _ in range(220):
            t = random.random()
            x, z = (t - 0.5) * 0.14, random.gauss(0, 0.019 * math.sin(math.pi * min(t * 0.9 + 0.1, 1)))
            radius = random.uniform(0.0095, 0.0122)
            y = radius
            for bx, by, bz, br in placed:
                flat = (x - bx) ** 2 + (z - bz) ** 2
                reach = (radius + br) * 0.97
                if flat < reach * reach:
                    y = max(y, by + math.sqrt(reach * reach - flat))
            if best is None or y < best[1]:
                best = (x, y, z, radius)
        placed.append(best)
    for x, y, z, radius in placed[::2]:
        path = [(x, y + radius * 0.8, z), (x * 0.9, y + radius + 0.004, z * 0.6), (x * 0.75 + 0.01, 0.034, 0.0)]
        stems.add(tube(path, [0.0011, 0.0009, 0.0012], 8))
    spine = [(-0.05, 0.034, 0.0), (0.0, 0.038, 0.002), (0.05, 0.036, 0.0), (0.085, 0.03, -0.004), (0.105, 0.034, -0.006)]
    stems.add(tube([tuple(p) for p in smooth_profile(spine, 6)], 0.0017, 10))
    balls = Mesh()
    for x, y, z, radius in placed:
        tilt, turn = random.uniform(-25, 25), random.uniform(0, 360)
        profile = [(radius * math.sin(math.pi * k / 20), -radius * 1.08 * math.cos(math.pi * k / 20)) for k in range(21)]
        profile[0], profile[-1] = (0.0, profile[0][1]), (0.0, profile[-1][1])
        balls.add(lathe(profile, 32).turned("x", tilt).turned("y", turn).moved(x, y, z))
    return balls, stems


def leaf(size, droop):
    """A vine leaf in x and z, its stalk at the origin, its tip towards +z: five lobes with teeth, folded along the veins."""
    lobes = [(0, 1.0), (52, 0.86), (-52, 0.86), (108, 0.62), (-108, 0.62)]
    columns, rows = 240, 12

    def point(u, v):
        degrees = -168 + 336 * u
        reach = max(length * math.exp(-((degrees - middle) / 27) ** 2) for middle, length in lobes)
        near = min(abs(degrees - middle) for middle, _ in lobes)
        reach = size * (0.36 + 0.64 * reach) * (1 + 0.035 * math.sin(math.radians(degrees * 22)) * v**6)
        r, angle = reach * v, math.radians(degrees)
        fold = 0.05 * min(near / 27, 1) * r - droop * r * r / size
        return (r * math.sin(angle), fold + 0.04 * size * v * math.sin(5 * angle + 1), r * math.cos(angle))

    return grid(columns, rows, point)


def leaves():
    """Two leaves on the spine of the grapes, one over them and one that hangs beside."""
    over = leaf(0.052, 0.35).turned("x", 12).turned("y", 205).moved(0.055, 0.047, -0.006)
    beside = leaf(0.044, 0.5).turned("z", -24).turned("y", 70).moved(0.062, 0.040, 0.012)
    both = over.add(beside)
    both.uvs = None
    return both


def table():
    """Planks with round edges."""
    planks = Mesh()
    for k in range(-4, 8):
        planks.add(rounded_box(2.4, 0.04, 0.138, 0.0025, 3).moved(0.13 * (k % 3), -0.02, -0.14 * k + 0.06))
    return planks


def main():
    os.makedirs(OUT, exist_ok=True)
    for make in (glass, wine, bottle, bottle_wine, label, cork, table, leaves):
        make().save(os.path.join(OUT, make.__name__ + ".ply"))
    balls, stems = grapes()
    balls.save(os.path.join(OUT, "grapes.ply"))
    stems.save(os.path.join(OUT, "stems.ply"))


main()
