#!/usr/bin/env python3
"""Builds the meshes of the perfume bottle in meshes/, in a second."""

import math
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from shapes import Mesh, arc, grid, lathe, offset, rounded_box, rounded_rectangle, tube  # noqa: E402

OUT = os.path.join(HERE, "meshes")
WIDTH, DEPTH, HEIGHT = 0.056, 0.030, 0.072
WALL, FLOOR = 0.0048, 0.010
NECK, BORE = 0.0085, 0.006


def shell(width, depth, corner, low, high, shoulder, neck, top, edge):
    """A body of round-cornered cross sections whose shoulder closes to a round neck."""
    outline = rounded_rectangle(width, depth, corner, 12)
    n = len(outline)
    rings = []
    for k in range(7):
        a = math.radians(-90 + 15 * k)
        rings.append((offset(outline, edge * (1 - math.cos(a))), low + edge * (1 + math.sin(a))))
    for k in range(9):
        a = math.radians(90 * k / 8)
        rings.append((offset(outline, shoulder * (1 - math.cos(a))), high - shoulder * (1 - math.sin(a))))
    circle = [(neck * math.cos(math.atan2(y, x)), neck * math.sin(math.atan2(y, x))) for x, y in outline]
    inner = rings[-1][0]
    for t in (0.3, 0.6, 0.85, 1):
        rings.append(([(x + (u - x) * t, y + (v - y) * t) for (x, y), (u, v) in zip(inner, circle)], high + 0.0002 * t))
    rings.append((circle, top))
    points = [(x, h, -y) for ring, h in rings for x, y in ring]
    faces = [(k * n + i, k * n + (i + 1) % n, (k + 1) * n + (i + 1) % n, (k + 1) * n + i)
             for k in range(len(rings) - 1) for i in range(n)]
    return Mesh(points, faces), n, len(rings)


def glass():
    """The outer wall, the cavity turned inside out, and the rim that joins them."""
    outer, n, k = shell(WIDTH, DEPTH, 0.007, 0, HEIGHT, 0.004, NECK, HEIGHT + 0.010, 0.0016)
    inner, _, l = shell(WIDTH - 2 * WALL, DEPTH - 2 * WALL, 0.004, FLOOR, HEIGHT - 0.005, 0.003, BORE, HEIGHT + 0.010, 0.003)
    outer.faces.append(tuple(reversed(range(n))))
    inner.faces.append(tuple(reversed(range(n))))
    start = len(outer.points)
    mesh = outer.add(inner.flipped())
    for i in range(n):
        j = (i + 1) % n
        a, b = (k - 1) * n, start + (l - 1) * n
        mesh.faces.append((a + i, a + j, b + j, b + i))
    return mesh


def liquid():
    """Reaches a little into the glass, whose priority is higher."""
    level, reach = HEIGHT - 0.017, 0.0006
    outline = rounded_rectangle(WIDTH - 2 * WALL + 2 * reach, DEPTH - 2 * WALL + 2 * reach, 0.004, 12)
    n = len(outline)
    heights = [FLOOR - reach, level]
    points = [(x, h, -y) for h in heights for x, y in outline]
    faces = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    faces += [tuple(reversed(range(n))), tuple(range(n, 2 * n))]
    return Mesh(points, faces)


def collar():
    """A ring of ridges around the neck."""
    low, high = HEIGHT + 0.0006, HEIGHT + 0.0075
    ridges = 90

    def point(u, v):
        a = 2 * math.pi * u
        profile = [(NECK + 0.0002, low), (0.0136, low), (0.0140, low + 0.0004), (0.0140, low + 0.001), (0.0131, low + 0.0014),
                   (0.0131, high - 0.0014), (0.0140, high - 0.001), (0.0140, high - 0.0004), (0.0136, high), (0.006, high)]
        k = min(int(v * 9 + 0.5), 9)
        r, h = profile[k]
        if 4 <= k <= 5:
            r += 0.00022 * math.cos(ridges * a)
        return (r * math.cos(a), h, -r * math.sin(a))

    return grid(ridges * 8, 9, point, closed_u=True)


def cap():
    return rounded_box(0.030, 0.030, 0.023, 0.0022, 6).moved(0, HEIGHT + 0.0228, 0)


def sweep():
    """Floor and wall in one bent sheet."""
    bend = [(-0.28 + x, y) for x, y in arc((0, 0.26), 0.26, -90, -180, 24)]
    profile = [(1.6, 0.0)] + bend + [(-0.54, 1.8)]
    return grid(1, len(profile) - 1, lambda u, v: (-2 + 4 * u, profile[round(v * (len(profile) - 1))][1],
                                                   profile[round(v * (len(profile) - 1))][0]))


def plinth(radius, height, bevel=0.0015):
    profile = [(0, 0), (radius - bevel, 0)] + arc((radius - bevel, bevel), bevel, -90, 0, 5)
    profile += arc((radius - bevel, height - bevel), bevel, 0, 90, 5) + [(0, height)]
    return lathe(profile, 192)


def frame():
    """The gold line on the front of the bottle."""
    path = [(x, y + 0.036, DEPTH / 2 + 0.0001) for x, y in rounded_rectangle(0.030, 0.036, 0.0012, 5)]
    mesh = tube(path, 0.00028, 8, closed=True)
    for k in range(3):
        ring = [(0.0046 * (1 - 0.28 * k) * math.cos(math.tau * i / 72), 0.036 + 0.0046 * (1 - 0.28 * k) * math.sin(math.tau * i / 72),
                 DEPTH / 2 + 0.0001) for i in range(72)]
        mesh.add(tube(ring, 0.00022, 8, closed=True))
    return mesh


def dip_tube():
    path = [(0.0, HEIGHT + 0.006, 0.0), (0.0004, HEIGHT - 0.02, 0.0003), (0.002, 0.03, 0.001), (0.005, FLOOR + 0.002, 0.002)]
    return tube(path, 0.0011, 24)


def main():
    os.makedirs(OUT, exist_ok=True)
    for make in (glass, liquid, collar, cap, sweep, frame, dip_tube):
        make().save(os.path.join(OUT, make.__name__ + ".ply"))
    plinth(0.062, 0.022).save(os.path.join(OUT, "plinth.ply"))
    plinth(0.036, 0.10).save(os.path.join(OUT, "column.ply"))


main()
