#!/usr/bin/env python3
"""Builds the street in meshes/, in seconds: facades, cobbles, strings of lamps, cafe tables, someone with an umbrella."""

import math
import os
import random
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from shapes import Mesh, grid, lathe, rounded_box, tube  # noqa: E402

OUT = os.path.join(HERE, "meshes")
HALF = 3.1  # half the width of the street
parts = {}


def put(part, mesh):
    parts.setdefault(part, Mesh()).add(mesh)


def box(low, high, bevel=0.012):
    size = [b - a for a, b in zip(low, high)]
    middle = [(a + b) / 2 for a, b in zip(low, high)]
    return rounded_box(*size, min(bevel, min(size) * 0.4), 2).moved(*middle)


class Facade:
    """Places boxes by how far along the street, how high, and how far out of the wall."""

    def __init__(self, side, start, inset):
        self.side, self.start, self.face = side, start, HALF + inset

    def box(self, part, along, high, out, bevel=0.012):
        x = sorted(self.side * (self.face - o) for o in out)
        z = sorted(self.start - a for a in along)
        put(part, box((x[0], high[0], z[0]), (x[1], high[1], z[1]), bevel))

    def window(self, middle, low, width, height, lit, random):
        a, b = middle - width / 2, middle + width / 2
        glass = random.choice(["warm", "warm", "dim"]) if lit else "dark"
        self.box(glass, (a, b), (low, low + height), (-0.16, -0.15), 0.001)
        if glass != "dark":
            for k in range(2):
                c = a + k * width * 0.72
                self.box("curtain", (c, c + width * 0.28), (low, low + height), (-0.15, -0.13), 0.006)
        for c in (a, middle, b):
            self.box("frame", (c - 0.03, c + 0.03), (low, low + height), (-0.14, -0.08))
        for h in (low, low + height * 0.68, low + height):
            self.box("frame", (a, b), (h - 0.03, h + 0.03), (-0.14, -0.085))
        self.box("trim", (a - 0.14, b + 0.14), (low - 0.12, low - 0.03), (-0.1, 0.09))
        self.box("trim", (a - 0.10, b + 0.10), (low + height + 0.03, low + height + 0.16), (-0.1, 0.05))
        if random.random() < 0.55:
            for c in (a - width * 0.27, b + width * 0.27):
                self.box("shutter", (c - width * 0.25, c + width * 0.25), (low, low + height), (0.005, 0.045))
                for k in range(12):
                    h = low + height * (k + 0.5) / 12
                    self.box("shutter", (c - width * 0.21, c + width * 0.21), (h, h + 0.03), (0.04, 0.065), 0.004)

    def wall(self, part, width, height, holes):
        """A wall of strips around holes (low along, high along, low, high)."""
        columns = sorted({0.0, width} | {c for h in holes for c in h[:2]})
        rows = sorted({0.0, height} | {c for h in holes for c in h[2:]})
        for a, b in zip(columns, columns[1:]):
            for c, d in zip(rows, rows[1:]):
                x, y = (a + b) / 2, (c + d) / 2
                if not any(h[0] < x < h[1] and h[2] < y < h[3] for h in holes):
                    self.box(part, (a, b), (c, d), (-0.3, 0.0), 0.0005)


def building(side, start, width, index):
    rng = random.Random(100 * index + (side > 0))
    f = Facade(side, start, rng.uniform(-0.05, 0.15))
    floors, shop = rng.choice([3, 3, 4]), rng.random() < 0.65
    bays = max(2, round(width / 2.1))
    holes, windows = [], []
    top = 3.6 + 3.0 * (floors - 1)
    for floor in range(1, floors):
        for k in range(bays):
            middle, low = width * (k + 0.5) / bays, 3.6 + 3.0 * (floor - 1) + 0.75
            holes.append((middle - 0.5, middle + 0.5, low, low + 1.65))
            windows.append((middle, low))
    if shop:
        a, b = 0.45, width - 1.5
        holes += [(a, b, 0.55, 2.75), (width - 1.25, width - 0.3, 0.0, 2.55)]
    else:
        holes += [(width * 0.5 - 0.55, width * 0.5 + 0.55, 0.0, 2.6)]
    f.wall("wall%d" % rng.randrange(4), width, top, holes)
    for middle, low in windows:
        f.window(middle, low, 1.0, 1.65, rng.random() < 0.42, rng)
    for h in [3.45] + [top - 0.1]:
        f.box("trim", (-0.02, width + 0.02), (h, h + 0.12), (-0.05, 0.12))
    f.box("trim", (-0.05, width + 0.05), (top + 0.02, top + 0.28), (-0.3, 0.32))
    f.box("plinth", (0, width), (0, 0.5), (-0.05, 0.05))
    if shop:
        f.box("shop", (a, b), (0.55, 2.75), (-0.7, -0.69), 0.001)
        f.box("wood", (a, b), (0.5, 0.56), (-0.7, 0.02))
        for shelf in (0.56, 1.02, 1.48, 1.94):
            f.box("wood", (a, b), (shelf - 0.03, shelf), (-0.66, -0.36), 0.004)
            along = a + 0.08
            while along < b - 0.12:
                w, h = rng.uniform(0.06, 0.17), rng.uniform(0.10, 0.36)
                f.box("goods%d" % rng.randrange(3), (along, along + w), (shelf, shelf + h), (-0.60, -0.42), 0.03)
                along += w + rng.uniform(0.01, 0.09)
        count = max(2, round((b - a) / 1.0))
        for k in range(count + 1):
            c = a + (b - a) * k / count
            f.box("wood", (c - 0.035, c + 0.035), (0.55, 2.75), (-0.12, 0.01))
        f.box("wood", (a, b), (2.2, 2.26), (-0.12, 0.0))
        f.box("sign", (a - 0.1, width - 0.2), (2.85, 3.3), (0.0, 0.07))
        f.box("dim", (width - 1.15, width - 0.4), (1.2, 2.45), (-0.13, -0.12), 0.001)
        f.box("wood", (width - 0.8, width - 0.75), (1.2, 2.45), (-0.14, -0.1), 0.008)
        f.box("wood", (width - 1.15, width - 0.4), (1.8, 1.85), (-0.14, -0.1), 0.008)
        f.box("wood", (width - 1.25, width - 0.3), (0.0, 1.2), (-0.16, -0.08))
        for c in (width - 1.25, width - 0.3):
            f.box("wood", (c - 0.05, c + 0.05), (0.0, 2.55), (-0.16, -0.04))
        awning(f, a - 0.1, b + 0.1, rng)
    else:
        m = width * 0.5
        f.box("wood", (m - 0.55, m + 0.55), (0.0, 2.6), (-0.2, -0.12))
        for k in (-1, 1):
            for h in (0.25, 1.4):
                f.box("wood", (m + k * 0.27 - 0.19, m + k * 0.27 + 0.19), (h, h + 1.0), (-0.13, -0.095), 0.02)
        f.box("trim", (m - 0.75, m + 0.75), (2.6, 2.8), (-0.1, 0.1))
    lantern(f, rng.choice([0.12, width - 0.12]), 2.7)


def awning(f, a, b, rng):
    """Cloth that falls to the street, with stripes of two materials."""
    count = max(6, round((b - a) / 0.28))
    for k in range(count):
        c, d = a + (b - a) * k / count, a + (b - a) * (k + 1) / count
        profile = [(0.05, 2.95), (0.5, 2.78), (1.05, 2.5), (1.07, 2.32)]
        sheet = grid(1, 3, lambda u, v: (f.side * (f.face - profile[round(v * 3)][0]), profile[round(v * 3)][1],
                                         f.start - (c + (d - c) * u)))
        put("cloth%d" % (k % 2), sheet)


def lantern(f, along, high):
    x, z = f.side * (f.face - 0.38), f.start - along
    arm = [(f.side * f.face, high - 0.1, z), (f.side * (f.face - 0.2), high + 0.22, z), (x, high + 0.25, z), (x, high + 0.12, z)]
    put("iron", tube(arm, 0.014, 8))
    put("iron", lathe([(0.0, -0.2), (0.06, -0.2), (0.075, -0.17), (0.0, -0.165)], 6).moved(x, high, z))
    put("iron", lathe([(0.12, 0.06), (0.125, 0.075), (0.03, 0.14), (0.0, 0.15)], 6).moved(x, high, z))
    for k in range(6):
        t = math.tau * k / 6
        put("iron", tube([(x + 0.07 * math.cos(t), high - 0.18, z + 0.07 * math.sin(t)),
                          (x + 0.115 * math.cos(t), high + 0.07, z + 0.115 * math.sin(t))], 0.006, 6))
    put("lantern", ball(0.045).moved(x, high - 0.05, z))


def ball(radius, sides=10):
    profile = [(radius * math.sin(math.pi * k / 6), -radius * math.cos(math.pi * k / 6)) for k in range(7)]
    profile[0], profile[-1] = (0.0, -radius), (0.0, radius)
    return lathe(profile, sides)


def strings(count=17, bulbs=29):
    """Cables from house to house, zigzag, with lamps below them."""
    rng = random.Random(5)
    lamps = 0
    for k in range(count):
        z0, z1 = 1.6 - 2.05 * k, 1.6 - 2.05 * (k + 1) + 0.4
        side = 1 if k % 2 else -1
        high = 4.55 + 0.25 * rng.random()
        path = []
        for i in range(bulbs + 1):
            t = i / bulbs
            x = side * (HALF - 2 * HALF * t)
            path.append((x, high - 0.85 * 4 * t * (1 - t), z0 + (z1 - z0) * t))
        put("iron", tube(path, 0.008, 5))
        for i in range(bulbs):
            p, q = path[i], path[i + 1]
            x, y, z = [(a + b) / 2 for a, b in zip(p, q)]
            put("iron", lathe([(0.016, -0.06), (0.016, -0.01), (0.0, -0.008)], 6).moved(x, y, z))
            put("bulbs", ball(0.032, 8).moved(x, y - 0.09, z))
            lamps += 1
    return lamps


def cobbles():
    """Four metres square of stones; some lie lower, where water stands."""
    rng = random.Random(1)
    mesh, size = Mesh(), 0.125
    n = 32
    for j in range(n):
        for i in range(n):
            x = (i + 0.5 + (0.5 if j % 2 else 0.0)) * size - 2.0
            z = (j + 0.5) * size - 2.0
            w, d = size * rng.uniform(0.41, 0.465), size * rng.uniform(0.41, 0.465)
            sink = 0.010 * (math.sin(x * math.pi) * math.sin(z * math.pi * 0.5) + 0.6 * math.sin(x * math.pi * 1.5 + 2) * math.sin(z * math.pi + 1))
            high = 0.012 + sink + rng.uniform(-0.004, 0.004)
            ax, az = rng.uniform(-0.04, 0.04), rng.uniform(-0.04, 0.04)

            def point(u, v):
                a, b = 2 * u - 1, 2 * v - 1
                edge = (abs(a) ** 5 + abs(b) ** 5) ** 0.2
                drop = 0.012 * edge**4 + (0.04 if edge > 0.99 else 0.0)
                return (x + a * w, high - drop + ax * a * w + az * b * d, z - b * d)

            mesh.add(grid(6, 6, point))
    mesh.uvs = None
    return mesh


def table(x, z, turn):
    put("iron", lathe([(0.0, 0.0), (0.2, 0.0), (0.2, 0.012), (0.03, 0.04), (0.022, 0.1), (0.022, 0.68), (0.06, 0.7), (0.0, 0.705)], 24).moved(x, 0.01, z))
    put("wood", lathe([(0.0, 0.70), (0.31, 0.70), (0.32, 0.71), (0.32, 0.725), (0.31, 0.735), (0.0, 0.735)], 48).moved(x, 0.01, z))
    put("candle", lathe([(0.0, 0.76), (0.018, 0.76), (0.018, 0.80), (0.0, 0.80)], 16).moved(x, 0.01, z))
    for k in (0, 1):
        t = turn + 180 * k
        chair = Mesh()
        chair.add(rounded_box(0.4, 0.03, 0.4, 0.012).moved(0, 0.45, 0))
        chair.add(rounded_box(0.4, 0.16, 0.025, 0.01).moved(0, 0.80, 0.2))
        chair.add(rounded_box(0.4, 0.08, 0.025, 0.01).moved(0, 0.62, 0.2))
        for a in (-0.18, 0.18):
            chair.add(tube([(a, 0, -0.19), (a, 0.45, -0.17)], 0.014, 8))
            chair.add(tube([(a, 0, 0.22), (a, 0.45, 0.19), (a, 0.88, 0.21)], 0.014, 8))
        put("wood", chair.moved(0, 0.01, 0.58).turned("y", t).moved(x, 0, z))


def planter(x, z):
    rng = random.Random(round(31 * x + 7 * z))
    put("clay", lathe([(0.0, 0.0), (0.2, 0.0), (0.26, 0.42), (0.28, 0.43), (0.28, 0.48), (0.25, 0.48), (0.24, 0.44), (0.0, 0.44)], 40).moved(x, 0, z))
    leaves = Mesh()
    for _ in range(900):
        a, b, r = rng.uniform(0, math.tau), math.acos(rng.uniform(-1, 1)), 0.34 * rng.random() ** 0.35
        leaf = grid(2, 2, lambda u, v: ((u - 0.5) * 0.035 * math.sin(math.pi * (0.08 + 0.84 * v)), 0.008 * math.cos(3 * u), v * 0.07))
        leaf = leaf.turned("x", rng.uniform(-90, 90)).turned("y", rng.uniform(0, 360))
        leaves.add(leaf.moved(x + r * math.sin(b) * math.cos(a), 0.78 + 0.95 * r * math.cos(b), z + r * math.sin(b) * math.sin(a)))
    leaves.uvs = None
    put("leaves", leaves)


def walker(x, z):
    """Someone in a coat, under an umbrella, from behind."""
    coat = [(0.0, 0.42), (0.22, 0.42), (0.205, 0.6), (0.165, 0.95), (0.155, 1.12), (0.19, 1.3), (0.2, 1.4), (0.14, 1.47), (0.06, 1.5), (0.05, 1.56), (0.0, 1.57)]
    put("coat", lathe(coat, 32).scaled(1.0, 1.0, 0.62).moved(x, 0, z))
    put("coat", lathe([(0.0, -0.12), (0.075, -0.09), (0.095, 0.0), (0.085, 0.08), (0.0, 0.12)], 24).moved(x, 1.66, z))
    put("coat", tube([(x + 0.19, 1.4, z), (x + 0.25, 1.2, z - 0.05), (x + 0.16, 1.24, z - 0.22)], [0.06, 0.055, 0.045], 12))
    put("coat", tube([(x - 0.19, 1.4, z), (x - 0.25, 1.12, z), (x - 0.24, 0.88, z - 0.06)], [0.06, 0.055, 0.045], 12))
    for a, step in ((-0.08, 0.16), (0.08, -0.12)):
        put("coat", tube([(x + a, 0.5, z), (x + a, 0.25, z + step * 0.5), (x + a, 0.06, z + step)], [0.075, 0.06, 0.05], 12))
        put("coat", rounded_box(0.09, 0.08, 0.25, 0.035).moved(x + a, 0.05, z + step - 0.05))
    put("iron", tube([(x + 0.16, 1.2, z - 0.22), (x + 0.1, 2.12, z - 0.16)], 0.008, 8))

    def cloth(u, v):
        angle, radius = math.tau * u, 0.58 * v
        rib = abs(math.cos(4 * angle))
        return (radius * math.cos(angle), -0.26 * v * v * (1 - 0.0 * rib) - 0.03 * v * (1 - rib), -radius * math.sin(angle))

    put("umbrella", grid(96, 10, cloth, closed_u=True).turned("z", 4).moved(x + 0.1, 2.12, z - 0.16))


def end():
    """The house that closes the street."""
    for k in range(6):
        x = -5 + 2 * k
        for floor in range(3):
            low = 1.1 + 2.9 * floor
            put("warm" if (k * 5 + floor * 3) % 4 == 0 else "dark", box((x - 0.45, low, -36.99), (x + 0.45, low + 1.6, -36.97), 0.001))
            put("trim", box((x - 0.6, low - 0.12, -37), (x + 0.6, low, -36.85)))
            put("trim", box((x - 0.55, low + 1.6, -37), (x + 0.55, low + 1.74, -36.9)))
            for a in (-0.45, 0.0, 0.45):
                put("frame", box((x + a - 0.03, low, -36.97), (x + a + 0.03, low + 1.6, -36.92)))


def main():
    os.makedirs(OUT, exist_ok=True)
    rng = random.Random(12)
    for side in (-1, 1):
        z, index = 4.0, 0
        while z > -36:
            width = rng.choice([4.6, 5.4, 6.2, 7.0])
            building(side, z, width, index)
            z, index = z - width, index + 1
    print(strings(), "lamps")
    for x, z, turn in ((1.75, -4.2, 75), (1.85, -6.3, 100), (-1.95, -9.5, 80), (1.8, -11.2, 95)):
        table(x, z, turn)
    for x, z in ((2.55, -2.6), (2.6, -7.9), (-2.55, -3.2), (-2.6, -6.1), (-2.6, -12.6)):
        planter(x, z)
    walker(-0.55, -7.6)
    end()
    parts["cobbles"] = cobbles()
    for name, mesh in parts.items():
        mesh.uvs = None
        mesh.save(os.path.join(OUT, name + ".ply"))
        print(name, len(mesh.faces))


main()
