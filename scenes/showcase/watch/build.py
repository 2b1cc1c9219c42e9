#!/usr/bin/env python3
"""Builds the movement of a watch in meshes/, in seconds. Millimetres here; scene.toml scales them to metres."""

import math
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from shapes import Mesh, arc, extrude, grid, lathe, rounded_box, tube  # noqa: E402

OUT = os.path.join(HERE, "meshes")
parts = {}


def put(part, mesh, x=0.0, height=0.0, y=0.0):
    """Adds a mesh whose y is up at (x, y) of the dial, 12 o'clock along y."""
    parts.setdefault(part, Mesh()).add(mesh.moved(x, height, -y))


def flat(outline, thickness, bevel=0.06, steps=3):
    """A plate whose lower side lies at height 0."""
    return extrude(outline, thickness, bevel, steps).turned("x", -90).moved(0, thickness / 2, 0)


def circle(radius, count=96):
    return [(radius * math.cos(math.tau * k / count), radius * math.sin(math.tau * k / count)) for k in range(count)]


def fillet(corners, radius, steps=10):
    """A counter-clockwise polygon with round corners."""
    result, n = [], len(corners)
    for i, (x, y) in enumerate(corners):
        r = radius[i] if isinstance(radius, (list, tuple)) else radius
        (ax, ay), (bx, by) = corners[i - 1], corners[(i + 1) % n]
        la, lb = math.hypot(ax - x, ay - y), math.hypot(bx - x, by - y)
        ua, ub = ((ax - x) / la, (ay - y) / la), ((bx - x) / lb, (by - y) / lb)
        half = math.acos(max(-1, min(1, ua[0] * ub[0] + ua[1] * ub[1]))) / 2
        reach = min(r / math.tan(half), 0.48 * min(la, lb))
        p, q = (x + ua[0] * reach, y + ua[1] * reach), (x + ub[0] * reach, y + ub[1] * reach)
        for k in range(steps + 1):
            t = k / steps
            a, b, c = (1 - t) ** 2, 2 * t * (1 - t), t * t
            result.append((a * p[0] + b * x + c * q[0], a * p[1] + b * y + c * q[1]))
    return result


def ring(outer, inner, thickness, bevel):
    """A flat ring between two outlines of as many points, with bevels on both sides of each."""
    n = len(outer)

    def shifted(outline, d):
        return [(x * (1 - d / math.hypot(x, y)), y * (1 - d / math.hypot(x, y))) for x, y in outline]

    layers = [(shifted(outer, bevel), 0), (outer, bevel), (outer, thickness - bevel), (shifted(outer, bevel), thickness),
              (shifted(inner, -bevel), thickness), (inner, thickness - bevel), (inner, bevel), (shifted(inner, -bevel), 0)]
    points = [(x, h, -y) for outline, h in layers for x, y in outline]
    m = len(layers)
    faces = [(k * n + i, k * n + (i + 1) % n, (k + 1) % m * n + (i + 1) % n, (k + 1) % m * n + i) for k in range(m) for i in range(n)]
    return Mesh(points, faces)


def gear(teeth, radius, thickness=0.32, spokes=5, hub=None, rim=None):
    depth = 2.1 * radius / teeth
    rim = rim or max(0.5, radius * 0.13)
    hub = hub or radius * 0.2
    outer = []
    for k in range(teeth):
        for t, d in ((0.0, 1), (0.20, 1), (0.32, 0.35), (0.40, 0.06), (0.50, 0), (0.60, 0.06), (0.68, 0.35), (0.80, 1)):
            a = math.tau * (k + t) / teeth
            r = radius - depth * d
            outer.append((r * math.cos(a), r * math.sin(a)))
    inner = circle(radius - depth - rim, len(outer))
    mesh = ring(outer, inner, thickness, 0.035)
    for k in range(spokes):
        length = radius - depth - rim - hub * 0.8
        spoke = rounded_box(length + 0.2, thickness * 0.9, radius * 0.085, 0.04, 2).moved(hub * 0.8 + length / 2, thickness / 2, 0)
        mesh.add(spoke.turned("y", 360 * k / spokes))
    mesh.add(lathe([(hub * 0.35, 0.0), (hub, 0.0), (hub, thickness), (hub * 0.6, thickness + 0.12), (hub * 0.35, thickness + 0.12)], 48))
    return mesh


def screw(x, y, height, radius=0.55, turn=None):
    head = [(0.0, 0.0), (radius, 0.0), (radius, 0.20)] + arc((radius - 0.07, 0.20), 0.07, 0, 90, 4) + [(0.0, 0.29)]
    put("blued", lathe(head, 48), x, height, y)
    turn = turn if turn is not None else (x * 57 + y * 91) % 180
    put("slot", rounded_box(radius * 1.85, 0.02, radius * 0.26, 0.008, 1).turned("y", turn), x, height + 0.287, y)
    put("polished", ring(circle(radius + 0.16, 64), circle(radius + 0.02, 64), 0.06, 0.02), x, height - 0.02, y)


def jewel(x, y, height, radius=0.62):
    stone = [(radius * 0.14, 0.05), (radius, 0.05), (radius, 0.16)] + arc((radius * 0.62, 0.16), radius * 0.38, 0, 70, 6)
    stone += [(radius * 0.5, 0.2), (radius * 0.14, 0.12), (radius * 0.14, 0.05)]
    put("ruby", lathe(stone, 64), x, height, y)
    put("gold", ring(circle(radius + 0.26, 64), circle(radius + 0.005, 64), 0.2, 0.05), x, height, y)
    put("steel", lathe([(0.0, 0.0), (radius * 0.13, 0.0), (radius * 0.13, 0.22), (0.0, 0.26)], 24), x, height, y)


def balance(x, y, height):
    put("gold", ring(circle(4.3, 160), circle(3.72, 160), 0.5, 0.06), x, height, y)
    for k in range(3):
        put("gold", rounded_box(3.9, 0.3, 0.42, 0.06, 2).moved(1.95, 0.2, 0).turned("y", 120 * k + 20), x, height, y)
    for k in range(12):
        a = math.tau * (k + 0.5) / 12
        stud = lathe([(0.0, 0.0), (0.2, 0.0), (0.2, 0.28), (0.3, 0.28), (0.33, 0.32), (0.33, 0.52), (0.28, 0.56), (0.0, 0.56)], 24)
        put("polished", stud.turned("z", -90).moved(4.2, 0.25, 0).turned("y", math.degrees(a)), x, height, y)
    turns, path = 11, []
    for k in range(turns * 60 + 1):
        t = k / 60
        r = 0.55 + 0.165 * t
        path.append((r * math.cos(math.tau * t), 0.95, r * math.sin(math.tau * t)))
    put("spring", tube(path, 0.035, 6), x, height, y)
    put("polished", lathe([(0.0, 0.0), (0.5, 0.0), (0.5, 1.1), (0.2, 1.15), (0.16, 1.6), (0.0, 1.7)], 48), x, height, y)


def hand(length, width, tail, height):
    """A faceted hand along y: a ridge between two slopes."""
    top, sides = 0.28, [(0, -tail, 0.25), (width, 0, 1.0), (width * 0.42, length * 0.72, 0.9), (0, length, 0.1)]
    points, faces = [], []
    for w, y, ridge in sides:
        points += [(-w, 0.0, -y), (0.0, top * (0.25 + 0.75 * ridge), -y), (w, 0.0, -y)]
    for k in range(len(sides) - 1):
        a, b = 3 * k, 3 * k + 3
        faces += [(a, a + 1, b + 1, b), (a + 1, a + 2, b + 2, b + 1), (a, b, b + 2, a + 2)]
    mesh = Mesh([(x, y + height, z) for x, y, z in points], faces)
    return mesh


def dial():
    """The chapter ring, its marks, and the case around it."""
    put("chapter", grid(360, 1, lambda u, v: ((14.2 + 3.6 * v) * math.cos(math.tau * u), 3.1 + 0.9 * v, -(14.2 + 3.6 * v) * math.sin(math.tau * u)), closed_u=True).flipped())
    put("polished", ring(circle(14.35, 360), circle(14.0, 360), 0.5, 0.08), 0, 2.75, 0)
    for k in range(60):
        hour = k % 5 == 0
        size = (0.72, 0.34, 2.3) if hour else (0.13, 0.1, 0.8)
        mark = rounded_box(size[0], size[1], size[2], size[1] * 0.28, 3)
        mark = mark.turned("x", 14).moved(0, 3.75 if hour else 3.78, -(16.05 if hour else 16.9))
        put("gold" if hour else "mark", mark.turned("y", -6 * k))
    profile = [(17.7, 3.6), (17.9, 5.2), (18.3, 5.9), (19.4, 6.1), (20.6, 5.6), (21.3, 4.4), (21.5, 2.0), (21.5, -4), (17.7, -4)]
    put("case", lathe([(r, h) for r, h in reversed(profile)], 256))


def train():
    """Plates, bridges, wheels, jewels, screws."""
    put("plate", lathe([(0.0, -0.05), (17.6, -0.05), (17.6, 0.0), (0.0, 0.001)], 128))
    wheels = [("brass", 72, 5.6, -5.4, 5.2, 0.5), ("brass", 60, 4.0, 3.2, 6.6, 0.9), ("steelwheel", 48, 3.2, 8.6, 2.2, 0.55),
              ("brass", 54, 3.6, 6.4, -4.0, 1.0), ("brass", 40, 2.5, 0.4, 0.2, 1.55), ("steelwheel", 64, 4.8, -9.0, -2.6, 0.6),
              ("brass", 36, 2.2, 10.2, 7.4, 0.45), ("steelwheel", 30, 1.9, -2.2, 10.8, 0.7)]
    for part, teeth, radius, x, y, height in wheels:
        put(part, gear(teeth, radius), x, height, y)
        put("steel", lathe([(0.0, -0.5), (0.3, -0.5), (0.3, 0.8), (0.18, 1.0), (0.0, 1.05)], 32), x, height, y)
        put("steelwheel", gear(12, radius * 0.2, 0.5, 0, radius * 0.09, radius * 0.05), x, height + 0.3, y)
    bridges = [
        ([(-13.2, 3.0), (-9.6, 1.6), (-4.6, 3.4), (-1.2, 3.6), (1.0, 7.0), (0.6, 10.6), (-3.2, 13.2), (-8.2, 10.8)], 2.0, 1.3),
        ([(4.6, 12.6), (2.2, 8.2), (4.8, 5.4), (8.2, 1.0), (12.8, 0.4), (13.0, 4.6), (10.0, 9.6)], 1.8, 1.5),
        ([(13.4, -2.0), (7.6, -1.4), (3.6, -4.4), (2.8, -8.6), (6.4, -12.4), (11.0, -8.2)], 1.8, 1.45),
    ]
    for corners, radius, height in bridges:
        put("bridge", flat(fillet(list(reversed(corners)), radius), 0.9, 0.12, 3), 0, height, 0)
    cock = [(-12.6, -7.2), (-10.4, -9.6), (-5.2, -8.4), (-3.6, -7.0), (-4.2, -5.8), (-6.6, -5.6), (-10.6, -5.2)]
    put("bridge", flat(fillet(cock, 0.9), 0.8, 0.12, 3), 0, 2.9, 0)
    balance(-4.5, -7.2, 1.1)
    for x, y, h in ((-5.4, 5.2, 2.15), (-2.2, 10.8, 2.15), (3.2 + 1.2, 7.4, 2.35), (8.6, 2.2, 2.35), (10.2, 7.4, 2.35), (6.4, -4.0, 2.3), (7.2, -9.4, 2.3),
                    (-4.5, -7.0, 3.66)):
        jewel(x, y, h)
    for x, y, h in ((-11.2, 4.2, 2.2), (-7.4, 9.0, 2.2), (-0.6, 5.6, 2.2), (5.2, 10.8, 2.4), (11.9, 1.9, 2.4), (11.6, -3.0, 2.35), (4.4, -6.6, 2.35),
                    (8.9, -8.0, 2.35), (-11.2, -7.2, 3.7), (-8.3, -6.6, 3.7)):
        screw(x, y, h)


def hands():
    put("hand", hand(9.6, 0.85, 2.2, 4.6).turned("y", 52))
    put("hand", hand(14.0, 0.68, 2.6, 5.2).turned("y", -58))
    second = rounded_box(0.13, 0.12, 19.0, 0.04, 2).moved(0, 5.75, -5.6)
    second.add(ring(circle(0.75, 64), circle(0.42, 64), 0.14, 0.03).moved(0, 5.68, 3.9))
    put("second", second.turned("y", 168))
    put("polished", lathe([(0.0, 0.0), (1.0, 0.0), (1.0, 4.3), (0.75, 5.0), (0.75, 5.6), (0.5, 6.0), (0.0, 6.05)], 64))


def main():
    os.makedirs(OUT, exist_ok=True)
    train()
    dial()
    hands()
    for name, mesh in parts.items():
        mesh.uvs = mesh.uvs if name == "chapter" else None
        mesh.save(os.path.join(OUT, name + ".ply"))
        print(name, len(mesh.faces))


main()
