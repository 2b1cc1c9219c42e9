#!/usr/bin/env python3
"""Builds a vaulted hall in meshes/, in seconds: piers, ribs, vaults, walls with lancet windows, benches."""

import math
import os
import random
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from shapes import Mesh, grid, lathe, rounded_box, tube  # noqa: E402

OUT = os.path.join(HERE, "meshes")
BAY, BAYS, NAVE, AISLE = 5.0, 8, 4.2, 4.0  # metres; the nave is 2 NAVE wide
SPRING, RISE = 7.0, 5.0
GALLERY, HIGH = 10.6, 12.5  # where the upper windows begin, and the vault of the nave
parts = {}


def put(part, mesh):
    mesh.uvs = None
    parts.setdefault(part, Mesh()).add(mesh)


def pointed(t, half, rise):
    """A pointed arch from (-half, 0) over (0, rise) to (half, 0), t from 0 to 1."""
    side, s = (-1, t * 2) if t < 0.5 else (1, 2 - t * 2)
    radius = (half * half + rise * rise) / (2 * half)
    angle = s * math.asin(min(rise / radius, 1.0))
    return side * (half - radius + radius * math.cos(angle)), radius * math.sin(angle)


def pier(x, z):
    """A round pier with four shafts, a base and a capital."""
    base = [(0.0, 0.0), (0.85, 0.0), (0.85, 0.25), (0.78, 0.3), (0.72, 0.42), (0.62, 0.5), (0.55, 0.55)]
    capital = [(0.50, SPRING - 0.7), (0.54, SPRING - 0.65), (0.52, SPRING - 0.6), (0.58, SPRING - 0.35), (0.74, SPRING - 0.15), (0.82, SPRING - 0.12),
               (0.82, SPRING), (0.0, SPRING)]
    put("stone", lathe(base + capital, 48).moved(x, 0, z))
    for k in range(4):
        a = math.tau * k / 4
        shaft = [(0.2, 0.4), (0.17, 0.6), (0.17, SPRING - 0.7), (0.26, SPRING - 0.3), (0.26, SPRING - 0.1)]
        put("stone", lathe(shaft, 20).moved(x + 0.52 * math.cos(a), 0, z + 0.52 * math.sin(a)))


def arch(a, b, rise, radius, spring=SPRING, steps=32):
    """A rib over two points of the plane at the height of the capitals."""
    half = math.hypot(b[0] - a[0], b[1] - a[1]) / 2
    path = []
    for k in range(steps + 1):
        s, h = pointed(k / steps, half, rise)
        t = (s + half) / (2 * half)
        path.append((a[0] + (b[0] - a[0]) * t, spring + h, a[1] + (b[1] - a[1]) * t))
    put("stone", tube(path, radius, 10))


def vault(x0, x1, z0, z1, rise, spring=SPRING):
    """Four webs: over each point the higher of the two crossing arches."""
    hx, hz = (x1 - x0) / 2, (z1 - z0) / 2

    def height(s, half):
        return pointed((s / half + 1) / 2, half, rise)

    def along(half, s):
        lo, hi = 0.0, 0.5
        for _ in range(40):
            mid = (lo + hi) / 2
            if pointed(mid, half, rise)[0] < -abs(s):
                lo = mid
            else:
                hi = mid
        return pointed(lo, half, rise)[1]

    def point(u, v):
        sx, sz = (2 * u - 1) * hx, (2 * v - 1) * hz
        return ((x0 + x1) / 2 + sx, spring + max(along(hx, sx), along(hz, sz)) + 0.05, (z0 + z1) / 2 + sz)

    put("web", grid(32, 32, point))


def lancet_wall(x, z0, z1, sill, spring, half, top, low=0.0, thick=0.7):
    """A thick wall with a pointed window; the reveal is splayed."""
    m, n = (z0 + z1) / 2, 24
    outline = [(-half, sill)] + [(pointed(k / n, half, half * 1.9)[0], spring + pointed(k / n, half, half * 1.9)[1]) for k in range(n + 1)] + [(half, sill)]
    side = 1 if x > 0 else -1
    inner, outer = x - side * thick / 2, x + side * thick / 2
    hole_in = [(1.35 * a, sill - 0.3 if h == sill else spring + (h - spring) * 1.25) for a, h in outline]
    def sheet(depth, hole):
        # Left strip, right strip, below, above.
        left, right = (z0 - m), (z1 - m)
        mid = len(hole) // 2
        pts, faces = [], []

        def quad(*corners):
            start = len(pts)
            pts.extend((depth, h, m + a) for a, h in corners)
            faces.append(tuple(range(start, start + len(corners))))

        quad((left, low), (right, low), (hole[-1][0], hole[-1][1]), (hole[0][0], hole[0][1]))
        quad((left, low), hole[0], (hole[1][0], hole[1][1]), (left, hole[1][1]))
        quad((right, low), (right, hole[-2][1]), hole[-2], hole[-1])
        for (a, h), (b, g) in zip(hole[1:mid + 1], hole[2:mid + 1]):
            quad((left, h), (a, h), (b, g), (left, g))
        for (a, h), (b, g) in zip(hole[mid:-1], hole[mid + 1:-1]):
            quad((a, h), (right, h), (right, g), (b, g))
        quad((left, hole[mid][1]), (right, hole[mid][1]), (right, top), (left, top))
        return Mesh(pts, faces)

    put("wall", sheet(inner, hole_in))
    put("wall", sheet(outer, outline))
    points = [(inner, h, m + a) for a, h in hole_in] + [(outer, h, m + a) for a, h in outline]
    k = len(outline)
    put("wall", Mesh(points, [(i, (i + 1) % k, k + (i + 1) % k, k + i) for i in range(k)]))
    bar = [(x, h, m) for h in (sill, spring + half * 1.8)]
    put("lead", tube(bar, 0.05, 8))
    for h in range(1, 6):
        y = sill + (spring - sill) * h / 5
        put("lead", tube([(x, y, m - half), (x, y, m + half)], 0.025, 6))


def spandrel(x, z0, z1):
    """The wall over an arch of the arcade, and a string course on it."""
    def point(u, v):
        s, h = pointed(u, BAY / 2, RISE * 0.7)
        return (x, SPRING + h + (GALLERY - SPRING - h) * v, (z0 + z1) / 2 + s)

    put("stone", grid(32, 2, point))
    put("stone", rounded_box(0.9, 0.22, BAY, 0.04, 2).moved(x, GALLERY, (z0 + z1) / 2))


def bench(x, z, width):
    put("wood", rounded_box(width, 0.05, 0.38, 0.015, 2).moved(x, 0.45, z))
    put("wood", rounded_box(width, 0.42, 0.04, 0.015, 2).turned("x", -8).moved(x, 0.74, z + 0.2))
    for s in (-1, 1):
        put("wood", rounded_box(0.07, 1.0, 0.48, 0.02, 2).moved(x + s * width / 2, 0.5, z + 0.03))


def main():
    os.makedirs(OUT, exist_ok=True)
    rng = random.Random(2)
    length = BAY * BAYS
    for k in range(BAYS + 1):
        z = -k * BAY
        for side in (-1, 1):
            pier(side * NAVE, z)
            arch((side * NAVE, z), (side * (NAVE + AISLE), z), RISE * 0.7, 0.16)
            put("stone", lathe([(0.24, SPRING), (0.2, SPRING + 0.2), (0.2, HIGH - 0.4), (0.34, HIGH - 0.1), (0.34, HIGH)], 20).moved(side * (NAVE - 0.36), 0, z))
        arch((-NAVE, z), (NAVE, z), RISE, 0.26, HIGH)
    for k in range(BAYS):
        z0, z1 = -k * BAY, -(k + 1) * BAY
        arch((-NAVE, z0), (NAVE, z1), RISE, 0.17, HIGH)
        arch((NAVE, z0), (-NAVE, z1), RISE, 0.17, HIGH)
        vault(-NAVE, NAVE, z1, z0, RISE, HIGH)
        for side in (-1, 1):
            arch((side * NAVE, z0), (side * NAVE, z1), RISE * 0.7, 0.24)
            vault(*sorted((side * NAVE, side * (NAVE + AISLE))), z1, z0, RISE * 0.7)
            lancet_wall(side * (NAVE + AISLE), z1, z0, 2.2, 7.0, 0.75, GALLERY + 0.6, 0.0, 0.4)
            lancet_wall(side * NAVE, z1, z0, GALLERY + 0.6, 14.2, 0.55, 19.0, GALLERY, 0.2)
            spandrel(side * NAVE, z0, z1)
            if side > 0 and k % 3 != 2:
                # Shutters: beams are told apart where not all windows are open.
                put("wood", rounded_box(0.06, 5.6, 1.9, 0.01, 1).moved(side * (NAVE + 0.2), GALLERY + 3.2, (z0 + z1) / 2))
            roof = sorted((side * NAVE, side * (NAVE + AISLE + 0.4)))
            put("web", rounded_box(roof[1] - roof[0], 0.2, BAY, 0.01, 1).moved(sum(roof) / 2, GALLERY + 0.6, (z0 + z1) / 2))
    # The end: three lancets, made as side walls and turned.
    lancet_walls, parts["wall"], bars, parts["lead"] = parts["wall"], Mesh(), parts["lead"], Mesh()
    for x, half, spring in ((-2.9, 0.75, 6.2), (0.0, 0.95, 8.0), (2.9, 0.75, 6.2)):
        lancet_wall(0.0, x - 1.45, x + 1.45, 2.6, spring, half, 24.0)
    for a in (-1, 1):
        put("wall", rounded_box(0.7, 24.0, 4.6, 0.02, 1).moved(0, 12.0, a * 6.65))
    parts["wall"] = lancet_walls.add(parts["wall"].turned("y", 90).moved(0, 0, -length))
    parts["lead"] = bars.add(parts["lead"].turned("y", 90).moved(0, 0, -length))
    for k in range(15):
        for side in (-1, 1):
            if rng.random() < 0.93:
                bench(side * 2.15 + rng.uniform(-0.03, 0.03), -5.5 - 1.35 * k, 2.9)
    for name, mesh in parts.items():
        mesh.save(os.path.join(OUT, name + ".ply"))
        print(name, len(mesh.faces), length)


main()
