#!/usr/bin/env python3
"""Builds a furnished room in meshes/, in seconds: walls with windows, curtains, a sofa, a table, a lamp, a plant, pictures and books."""

import math
import os
import random
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from shapes import TAU, Mesh, cross, grid, lathe, normalized, rounded_box, smooth_profile, tube  # noqa: E402

OUT = os.path.join(HERE, "meshes")
LEFT, RIGHT, BACK, FRONT, HIGH = -2.6, 2.8, -2.4, 4.2, 2.8  # metres
SILL, LINTEL = 0.42, 2.45
WINDOWS = ((-1.75, -0.45), (0.25, 1.55))  # along z, in the left wall
parts = {}


def put(part, mesh):
    mesh.uvs = None
    parts.setdefault(part, Mesh()).add(mesh)


def box(x0, x1, y0, y1, z0, z1, radius=0.0):
    """A box between two corners, with sharp or round edges."""
    if radius:
        mesh = rounded_box(x1 - x0, y1 - y0, z1 - z0, radius)
        return mesh.moved((x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2)
    points = [(x, y, z) for x in (x0, x1) for y in (y0, y1) for z in (z0, z1)]
    return Mesh(points, [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])


def walls():
    thick = 0.32
    put("floor", box(LEFT - thick, RIGHT, -0.2, 0.0, BACK, FRONT))
    put("ceiling", box(LEFT - thick, RIGHT, HIGH, HIGH + 0.2, BACK, FRONT))
    put("wall", box(LEFT - thick, RIGHT, 0.0, HIGH, BACK - 0.2, BACK))
    put("wall", box(LEFT - thick, RIGHT, 0.0, HIGH, FRONT, FRONT + 0.2))
    put("wall", box(RIGHT, RIGHT + 0.2, 0.0, HIGH, BACK, FRONT))
    edges = [BACK] + [z for window in WINDOWS for z in window] + [FRONT]
    for z0, z1 in zip(edges[::2], edges[1::2]):
        put("wall", box(LEFT - thick, LEFT, 0.0, HIGH, z0, z1))
    for z0, z1 in WINDOWS:
        put("wall", box(LEFT - thick, LEFT, 0.0, SILL, z0, z1))
        put("wall", box(LEFT - thick, LEFT, LINTEL, HIGH, z0, z1))
        put("trim", box(LEFT - 0.18, LEFT + 0.10, SILL, SILL + 0.035, z0 - 0.05, z1 + 0.05, 0.008))
    for z in (BACK + 0.012,):
        put("trim", box(LEFT, RIGHT, 0.0, 0.11, z - 0.012, z + 0.006, 0.004))
    for z0, z1 in zip(edges[::2], edges[1::2]):
        put("trim", box(LEFT - 0.005, LEFT + 0.016, 0.0, 0.11, z0, z1, 0.004))
    for z0, z1 in WINDOWS:
        put("trim", box(LEFT - 0.005, LEFT + 0.016, 0.0, 0.11, z0, z1, 0.004))


def windows():
    """Two casements each, of two panes over each other."""
    x, frame, bar = LEFT - 0.2, 0.055, 0.03
    for z0, z1 in WINDOWS:
        y0, middle = SILL + 0.035, (z0 + z1) / 2
        for a, b in ((z0, middle), (middle, z1)):
            put("trim", box(x - 0.03, x + 0.03, y0, LINTEL, a, a + frame, 0.006))
            put("trim", box(x - 0.03, x + 0.03, y0, LINTEL, b - frame, b, 0.006))
            put("trim", box(x - 0.03, x + 0.03, y0, y0 + frame, a, b, 0.006))
            put("trim", box(x - 0.03, x + 0.03, LINTEL - frame, LINTEL, a, b, 0.006))
            for k in (1, 2):
                y = y0 + (LINTEL - y0) * k / 3
                put("trim", box(x - 0.018, x + 0.018, y - bar / 2, y + bar / 2, a, b, 0.004))
            corners = [(x, y0, a), (x, LINTEL, a), (x, LINTEL, b), (x, y0, b)]
            put("panes", Mesh(corners, [(0, 1, 2, 3)]))


def curtain(z0, z1, seed):
    """A gathered sheet that hangs from a rod."""
    rng = random.Random(seed)
    folds, phase = 7, rng.uniform(0, TAU)
    wander = [rng.uniform(-0.6, 0.6) for _ in range(5)]

    def point(u, v):
        angle = TAU * folds * u + phase + 0.8 * math.sin(TAU * u * 2 + wander[0])
        depth = (0.035 + 0.02 * v) * math.sin(angle + 0.35 * v * wander[1]) + 0.012 * math.sin(2.3 * angle + wander[2] + v)
        along = z0 + (z1 - z0) * (u + 0.016 * math.sin(2 * angle) + 0.02 * v * math.sin(3 * u + wander[3]))
        return (LEFT + 0.13 + depth, 2.63 - 2.61 * v, along)

    put("curtains", grid(260, 50, point))


def cushion(x, y, z, full=0.5):
    """A square cushion, thick in the middle, around the origin."""

    def point(u, v):
        longitude, latitude = TAU * u, math.pi * (v - 0.5)
        power = lambda value, p: math.copysign(abs(value) ** p, value)  # noqa: E731
        a, b = power(math.cos(longitude), full), power(math.sin(longitude), full)
        rim = power(math.cos(latitude), 0.55)
        reach = max(abs(a), abs(b))
        swell = 1.0 - 0.25 * reach * rim
        return (a * rim * x / 2, b * rim * y / 2, power(math.sin(latitude), 0.9) * z / 2 * swell)

    return grid(96, 48, point, closed_u=True)


def sofa(x, z):
    """Three seats, with its back to the wall."""
    wide, deep = 2.15, 0.92
    put("sofa", box(x - wide / 2, x + wide / 2, 0.16, 0.34, z, z + deep, 0.04))
    put("sofa", box(x - wide / 2, x + wide / 2, 0.30, 0.78, z, z + 0.20, 0.07))
    for side in (-1, 1):
        at = x + side * (wide / 2 - 0.09)
        put("sofa", box(at - 0.10, at + 0.10, 0.16, 0.60, z, z + deep, 0.07))
    inner = wide - 0.40
    for k in range(2):
        a = x - inner / 2 + k * inner / 2
        put("sofa", box(a + 0.004, a + inner / 2 - 0.004, 0.32, 0.475, z + 0.18, z + deep + 0.02, 0.06))
        back = box(-inner / 4 + 0.006, inner / 4 - 0.006, -0.22, 0.22, -0.085, 0.085, 0.075).turned("x", -12)
        put("sofa", back.moved(a + inner / 4, 0.67, z + 0.27))
    for dx in (-wide / 2 + 0.12, wide / 2 - 0.12):
        for dz in (0.1, deep - 0.1):
            leg = lathe([(0.0, 0.0), (0.014, 0.0), (0.024, 0.18), (0.0, 0.18)], 24)
            put("walnut", leg.moved(x + dx, 0.0, z + dz))
    put("ochre", cushion(0.48, 0.48, 0.17).turned("z", 8).turned("x", -24).turned("y", 22).moved(x - 0.66, 0.70, z + 0.44))
    put("linen", cushion(0.44, 0.44, 0.16).turned("z", -6).turned("x", -26).turned("y", -14).moved(x + 0.64, 0.68, z + 0.44))
    put("blue", cushion(0.52, 0.34, 0.15).turned("x", -30).turned("y", -8).moved(x + 0.36, 0.62, z + 0.56))


def blanket(x, z):
    """A throw over the arm of the sofa."""

    def point(u, v):
        t = (v - 0.5) * 1.5
        over = 0.125
        if abs(t) < over:
            px, py = t, 0.618 + 0.004 * math.cos(t * 20)
        else:
            px, py = math.copysign(over + 0.012, t), 0.61 - (abs(t) - over)
        wave = 0.010 * math.sin(14 * u + 5 * v) + 0.012 * math.sin(31 * u + 2) * min(abs(t), 0.5)
        drop = 0.05 * math.sin(3.2 * u + 0.6) if abs(t) > over else 0.0
        return (x + px + wave * (1 if t > 0 else -1), max(py + drop * (abs(t) - over), 0.02), z + (u - 0.5) * (0.55 + 0.03 * math.sin(5 * v)))

    put("wool", grid(70, 120, point))


def table(x, z):
    """A round table of walnut on three legs, with books, a bowl and a cup."""
    top = [(0.0, 0.405), (0.40, 0.405), (0.435, 0.416), (0.442, 0.425), (0.435, 0.434), (0.43, 0.436), (0.0, 0.436)]
    put("walnut", lathe(top, 160).moved(x, 0, z))
    for k in range(3):
        a = TAU * k / 3 + 0.4
        foot, head = (0.37 * math.cos(a), 0.0, 0.37 * math.sin(a)), (0.24 * math.cos(a), 0.41, 0.24 * math.sin(a))
        put("walnut", tube([foot, head], [0.013, 0.022], 24).moved(x, 0, z))
    height = 0.436
    for k, (w, d, h, turn) in enumerate(((0.24, 0.31, 0.030, 12), (0.21, 0.28, 0.024, 22), (0.17, 0.24, 0.018, 5))):
        book(f"cover{k}", w, d, h, turn, x - 0.16, height, z + 0.06)
        height += h
    bowl = smooth_profile([(0.03, 0.0), (0.055, 0.006), (0.105, 0.045), (0.135, 0.085)], 6)
    inside = [(r - 0.005, h + 0.004) for r, h in reversed(bowl)]
    put("ceramic", lathe([(0.0, 0.0)] + bowl + inside + [(0.0, 0.008)], 96).moved(x + 0.17, 0.436, z - 0.11))
    fruit = smooth_profile([(0.0, -0.034), (0.022, -0.030), (0.038, 0.0), (0.024, 0.029), (0.006, 0.027), (0.0, 0.024)], 8)
    for dx, dy, dz in ((-0.035, 0.052, 0.02), (0.042, 0.053, 0.015), (0.0, 0.055, -0.05), (0.005, 0.095, 0.0)):
        put("lemons", lathe(fruit, 48).scaled(1, 1.15, 1).turned("x", 70 * dx * 20).turned("y", 2000 * dz).moved(x + 0.17 + dx, 0.436 + dy, z - 0.11 + dz))
    cup = [(0.0, 0.0), (0.026, 0.0), (0.031, 0.012), (0.034, 0.07), (0.0315, 0.07), (0.0285, 0.014), (0.0, 0.008)]
    put("ceramic", lathe(cup, 72).moved(x + 0.14, 0.436, z + 0.2))
    ring = [(0.034 + 0.018 * math.cos(TAU * k / 24 - 1.2), 0.036 + 0.02 * math.sin(TAU * k / 24 - 1.2), 0.0) for k in range(17)]
    put("ceramic", tube(ring, 0.0035, 12).turned("y", 200).moved(x + 0.14, 0.436, z + 0.2))


def book(cover, w, d, h, turn, x, y, z):
    shell = box(-w / 2, w / 2, 0, 0.003, -d / 2, d / 2).add(box(-w / 2, w / 2, h - 0.003, h, -d / 2, d / 2))
    shell.add(box(-w / 2, -w / 2 + 0.003, 0, h, -d / 2, d / 2))
    put(cover, shell.turned("y", turn).moved(x, y, z))
    put("paper", box(-w / 2 + 0.003, w / 2 - 0.004, 0.003, h - 0.003, -d / 2 + 0.004, d / 2 - 0.004).turned("y", turn).moved(x, y, z))


def lamp(x, z):
    """A floor lamp: an arc of brass with a shade of linen."""
    put("brass", lathe([(0.0, 0.0), (0.15, 0.0), (0.15, 0.018), (0.03, 0.026), (0.0, 0.026)], 96).moved(x, 0, z))
    put("brass", tube([(x, 0.02, z), (x, 1.52, z)], 0.010, 20))
    shade = [(0.21, 1.36), (0.15, 1.66)]
    put("shade", lathe(shade, 120).moved(x, 0, z))
    put("brass", lathe([(0.0, 1.50), (0.02, 1.50), (0.02, 1.56), (0.0, 1.56)], 24).moved(x, 0, z))


def leaf(length, width, fold, curl):
    """A broad leaf along z with a drooping tip, its front upwards."""

    def point(u, v):
        t, s = v, 2 * u - 1
        w = width / 2 * (0.004 + 0.996 * max(math.sin(math.pi * t ** 0.75), 0.0) ** 0.8)
        wave = 0.02 * length * math.sin(9 * t) * s * s
        return (s * w, fold * abs(s) * w - curl * length * t * t + wave, length * t)

    return grid(10, 18, point)


def plant(x, z):
    """A rubber tree in a pot."""
    rng = random.Random(5)
    pot = [(0.0, 0.0), (0.135, 0.0), (0.150, 0.02), (0.185, 0.34), (0.190, 0.36), (0.178, 0.36), (0.170, 0.33), (0.0, 0.32)]
    put("terracotta", lathe(pot, 96).moved(x, 0, z))
    put("soil", lathe([(0.0, 0.325), (0.172, 0.325), (0.0, 0.335)][:2] + [(0.0, 0.338)], 48).moved(x, 0, z))
    for k, (lean, turn, height) in enumerate(((0.10, 0.3, 1.75), (0.28, 2.2, 1.35), (0.22, 4.4, 1.5))):
        line = []
        for i in range(24):
            t = i / 23
            reach = lean * (0.12 + t * t) + 0.02 * math.sin(7 * t + k)
            line.append((x + reach * math.cos(turn), 0.32 + (height - 0.32) * t, z + reach * math.sin(turn)))
        put("stem", tube(line, [0.013 * (1 - 0.6 * i / 23) for i in range(24)], 12))
        for i in range(5, 24):
            angle = 2.4 * i + k
            lift = 0.55 - 0.9 * (1 - i / 23) + rng.uniform(-0.15, 0.15)
            along = normalized((math.cos(angle), lift, math.sin(angle)))
            side = normalized(cross((0, 1, 0), along))
            over = cross(along, side)
            size = rng.uniform(0.24, 0.36) * (0.75 + 0.25 * (23 - i) / 18)
            shape = leaf(size, size * 0.48, 0.22, rng.uniform(0.15, 0.5))
            at = line[i]
            place = lambda px, py, pz: tuple(at[m] + px * side[m] + py * over[m] + pz * along[m] + 0.02 * along[m] for m in range(3))  # noqa: B023, E731
            put("leaves", shape.map(place))


def frame(x, y, w, h, picture):
    """A picture on the back wall."""
    z, f, d = BACK, 0.022, 0.03
    for a, b, c, e in ((-w / 2, w / 2, h / 2 - f, h / 2), (-w / 2, w / 2, -h / 2, -h / 2 + f), (-w / 2, -w / 2 + f, -h / 2, h / 2), (w / 2 - f, w / 2, -h / 2, h / 2)):
        put("walnut", box(x + a, x + b, y + c, y + e, z, z + d, 0.003))
    put("paper", box(x - w / 2 + f, x + w / 2 - f, y - h / 2 + f, y + h / 2 - f, z, z + 0.008))
    iw, ih = w * 0.62, h * 0.66
    put(picture, box(x - iw / 2, x + iw / 2, y - ih / 2, y + ih / 2, z + 0.008, z + 0.010))


def cabinet(middle):
    """A low cabinet at the back wall, with a vase of dried flowers. It is built along z, before it turns to the wall."""
    start = {name: len(mesh.points) for name, mesh in parts.items()}
    x = z = 0.0
    put("walnut", box(x - 0.42, x, 0.18, 0.62, z - 0.75, z + 0.75, 0.012))
    for k in range(3):
        put("walnut", box(x - 0.436, x - 0.42, 0.20, 0.60, z - 0.735 + 0.49 * k, z - 0.735 + 0.49 * k + 0.475, 0.006))
    for dx, dz in ((-0.36, -0.68), (-0.06, -0.68), (-0.36, 0.68), (-0.06, 0.68)):
        put("brass", tube([(x + dx, 0, z + dz), (x + dx, 0.19, z + dz)], 0.012, 16))
    vase = smooth_profile([(0.05, 0.0), (0.085, 0.06), (0.10, 0.14), (0.06, 0.23), (0.035, 0.28), (0.045, 0.31)], 8)
    inside = [(r - 0.004, h) for r, h in reversed(vase)]
    put("glaze", lathe([(0.0, 0.0)] + vase + inside + [(0.0, 0.006)], 96).moved(x - 0.2, 0.62, z - 0.45))
    rng = random.Random(8)
    for k in range(9):
        a, r = rng.uniform(0, TAU), rng.uniform(0.10, 0.24)
        line = [(x - 0.2 + r * t * t * math.cos(a), 0.66 + (0.36 + 0.3 * rng.random()) * t + 0.2 * t, z - 0.45 + r * t * t * math.sin(a)) for t in (0, 0.25, 0.5, 0.75, 1)]
        put("stem", tube(line, 0.0025, 6))
        for _ in range(26):
            t = rng.uniform(0.55, 1.0)
            i = min(int(t * 4), 3)
            p = [line[i][m] + (line[i + 1][m] - line[i][m]) * (t * 4 - i) for m in range(3)]
            ball = lathe(smooth_profile([(0.0, -0.009), (0.008, -0.004), (0.008, 0.005), (0.0, 0.010)], 3), 10)
            put("blossom", ball.moved(*[p[m] + rng.gauss(0, 0.014) for m in range(3)]))
    for name, mesh in parts.items():
        first = start.get(name, 0)
        mesh.points[first:] = [(middle + 0.76 * b, y, BACK + 0.02 - a) for a, y, b in mesh.points[first:]]


def rug():
    def point(u, v):
        x, z = -1.25 + 2.9 * u, -0.95 + 2.0 * v
        return (x, 0.012 + 0.0012 * math.sin(260 * u) * math.sin(190 * v), z)

    put("rug", grid(240, 160, point).flipped())
    put("rug", box(-1.25, 1.65, 0.0, 0.0105, -0.95, 1.05))


def main():
    os.makedirs(OUT, exist_ok=True)
    walls()
    windows()
    curtain(-2.18, -1.72, 1)
    curtain(-0.50, 0.30, 2)
    curtain(1.50, 2.0, 3)
    put("brass", tube([(LEFT + 0.13, 2.66, -2.3), (LEFT + 0.13, 2.66, 2.15)], 0.012, 16))
    sofa(0.35, BACK + 0.06)
    blanket(0.35 + 1.075 - 0.09, BACK + 0.62)
    table(0.15, -0.15)
    lamp(-1.15, BACK + 0.32)
    plant(-1.95, -1.75)
    frame(-0.05, 1.58, 0.56, 0.72, "print0")
    frame(0.72, 1.66, 0.44, 0.56, "print1")
    cabinet(2.12)
    rug()
    for name, mesh in parts.items():
        mesh.save(os.path.join(OUT, name + ".ply"))


if __name__ == "__main__":
    main()
