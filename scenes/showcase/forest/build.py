#!/usr/bin/env python3
"""Builds the forest in meshes/, in seconds: trees, ferns, grass, fallen leaves, and the places where they stand."""

import array
import math
import os
import random
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from shapes import TAU, Mesh, cross, grid, normalized, tube  # noqa: E402

OUT = os.path.join(HERE, "meshes")


def wave(x, z):
    """Hills of the ground, metres."""
    return (
        0.35 * math.sin(0.21 * x + 1.3) * math.cos(0.17 * z + 0.4)
        + 0.10 * math.sin(0.83 * x - 0.6 * z)
        + 0.035 * math.sin(2.3 * x + 1.7 * z) * math.cos(2.9 * z - 0.8 * x)
    )


def path(z):
    """Where the middle of the path is."""
    return 1.3 * math.sin(0.16 * z + 0.55) - 0.68


def ground(x, z):
    away = abs(x - path(z))
    return wave(x, z) * min(1.0, 0.25 + away / 4) + 0.02 * min(away, 8.0) ** 1.5 - 0.10 * math.exp(-((away / 0.8) ** 2))


def leaf(length, width, fold, curl):
    """A leaf from the origin along z, folded along its midrib, curled downwards, its front upwards."""
    shape = [(0.0, 0.0), (0.62, 0.22), (1.0, 0.48), (0.6, 0.78), (0.0, 1.0)]
    points = []
    for side in (-1, 0, 1):
        points += [(side * w * width / 2, abs(side) * w * fold * width - curl * length * t * t, t * length) for w, t in shape]
    n, faces = len(shape), []
    for k in range(n - 1):
        for first in (0, n):
            a, b = first + k, first + n + k
            face = [a, a + 1, b + 1, b]
            places = [points[i] for i in face]
            face = [i for j, i in enumerate(face) if places[j] != places[j - 1]]
            if len(face) > 2:
                faces.append(tuple(face))
    return Mesh(points, faces)


def aligned(mesh, origin, along, up, size):
    """A mesh whose z axis runs along a direction, its y axis as near to another as may be."""
    along = normalized(along)
    side = normalized(cross(up, along))
    over = cross(along, side)
    return mesh.scaled(size).map(lambda x, y, z: tuple(origin[i] + x * side[i] + y * over[i] + z * along[i] for i in range(3)))


class Tree:
    """A trunk with branches of two generations, and leaves on the younger ones."""

    def __init__(self, seed, height, leaves):
        self.random, self.wood, self.leaves, self.count = random.Random(seed), Mesh(), Mesh(), leaves
        self.kinds = [leaf(1.0, 0.62, 0.2, c) for c in (0.1, 0.25, 0.4)]
        trunk = self.trunk(height)
        twigs = []
        for k in range(17):
            t = 0.34 + 0.64 * (k + self.random.random()) / 17
            reach = height * 0.28 * (1.15 - t) + 0.7
            twigs += self.branch(self.on(trunk, t), self.random.uniform(0, TAU), reach, 0.075 * (1.25 - t))
        for _ in range(leaves):
            line = self.random.choice(twigs)
            place = self.on(line, self.random.uniform(0.15, 1.0))
            spread = [place[i] + self.random.gauss(0, 0.10) for i in range(3)]
            angle = self.random.uniform(0, TAU)
            along = (math.cos(angle), self.random.uniform(-0.7, 0.25), math.sin(angle))
            up = (self.random.gauss(0, 0.35), 1.0, self.random.gauss(0, 0.35))
            size = self.random.uniform(0.10, 0.17)
            self.leaves.add(aligned(self.random.choice(self.kinds), spread, along, up, size))

    def on(self, line, t):
        at = t * (len(line) - 1)
        i = min(int(at), len(line) - 2)
        return tuple(a + (b - a) * (at - i) for a, b in zip(line[i], line[i + 1]))

    def trunk(self, height):
        lean, phase = self.random.uniform(0.0, 0.05), self.random.uniform(0, TAU)
        line = []
        for k in range(25):
            t = k / 24
            y = height * t - 0.3
            sway = 0.16 * math.sin(3.1 * t + phase) + 0.05 * math.sin(9 * t + 2 * phase)
            line.append((lean * y + sway * t, y, sway * 0.8 * t - lean * y * 0.5))
        radii = [0.21 * (1 - 0.86 * k / 24) + 0.16 * math.exp(-((k / 24 * height) / 0.55)) for k in range(25)]
        self.wood.add(tube(line, radii, 14))
        return line

    def branch(self, start, angle, length, radius):
        """Lines of the twigs of a branch."""
        line, rise = [start], self.random.uniform(0.25, 0.65)
        step = length / 7
        for k in range(7):
            angle += self.random.gauss(0, 0.16)
            rise += self.random.gauss(0, 0.09) - 0.02
            x, y, z = line[-1]
            line.append((x + step * math.cos(angle), y + step * rise, z + step * math.sin(angle)))
        self.wood.add(tube(line, [radius * (1 - 0.8 * k / 7) for k in range(8)], 6))
        twigs = []
        for k in range(6):
            side = angle + (1 if k % 2 else -1) * self.random.uniform(0.5, 1.1)
            at, reach = self.on(line, 0.3 + 0.12 * k), length * self.random.uniform(0.25, 0.45)
            twig = [at]
            for _ in range(4):
                side += self.random.gauss(0, 0.2)
                x, y, z = twig[-1]
                twig.append((x + reach / 4 * math.cos(side), y + reach / 4 * self.random.uniform(-0.1, 0.5), z + reach / 4 * math.sin(side)))
            self.wood.add(tube(twig, [radius * 0.35 * (1 - 0.18 * i) for i in range(5)], 4))
            twigs.append(twig)
        return [*twigs, line]


def fern(seed):
    """Fronds around a middle, each of pairs of leaflets."""
    rng, mesh = random.Random(seed), Mesh()
    leaflet = leaf(1.0, 0.36, 0.1, 0.15)
    for k in range(11):
        angle, length, lift = TAU * k / 11 + rng.uniform(-0.2, 0.2), rng.uniform(0.42, 0.66), rng.uniform(0.55, 0.95)
        out = (math.cos(angle), 0.0, math.sin(angle))
        line = []
        for i in range(15):
            t = i / 14
            y = length * (lift * t - 0.75 * lift * t * t * t)
            line.append((out[0] * length * t, y, out[2] * length * t))
        mesh.add(tube(line, [0.004 * (1 - 0.9 * i / 14) for i in range(15)], 3))
        for i in range(1, 15):
            along = tuple(b - a for a, b in zip(line[i - 1], line[i]))
            up = cross(cross(along, (0, 1, 0)), along)
            side = normalized(cross(along, up))
            size = 0.17 * length / 0.5 * math.sin(math.pi * (0.12 + 0.86 * (1 - i / 14))) ** 0.8
            for sign in (-1, 1):
                way = tuple(sign * s + 0.45 * a for s, a in zip(side, normalized(along)))
                mesh.add(aligned(leaflet, line[i], way, up, size))
    return mesh


def tuft(seed):
    """Blades of grass."""
    rng, mesh = random.Random(seed), Mesh()
    for _ in range(46):
        angle, lean, height = rng.uniform(0, TAU), rng.uniform(0.1, 0.8), rng.uniform(0.12, 0.34)
        x, z = rng.gauss(0, 0.05), rng.gauss(0, 0.05)
        out, across = (math.cos(angle), math.sin(angle)), rng.uniform(0.003, 0.006)
        points = []
        for k in range(5):
            t = k / 4
            w = across * (1 - t) + 2e-4
            px, pz, y = x + out[0] * lean * height * t * t, z + out[1] * lean * height * t * t, height * t * (1 - 0.25 * lean * t)
            points += [(px - out[1] * w, y, pz + out[0] * w), (px + out[1] * w, y, pz - out[0] * w)]
        mesh.add(Mesh(points, [(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(4)]))
    return mesh


class Places:
    """Places of copies: `instances` of objects."""

    NAMES = ("x", "y", "z", "qx", "qy", "qz", "qw", "scale", "random")

    def __init__(self, seed):
        self.rows, self.random = [], random.Random(seed)

    def add(self, x, y, z, scale, lean=0.0):
        """Turned about the vertical as chance has it, and leaning by so many radians to any side."""
        turn, way, tilt = self.random.uniform(0, TAU), self.random.uniform(0, TAU), self.random.gauss(0, lean) if lean else 0.0
        c, s = math.cos(turn / 2), math.sin(turn / 2)
        a, b, d = math.sin(tilt / 2) * math.cos(way), math.sin(tilt / 2) * math.sin(way), math.cos(tilt / 2)
        # The lean after the turn: a product of quaternions.
        self.rows.append((x, y, z, a * c - b * s, d * s, b * c + a * s, d * c, scale, self.random.random()))

    def save(self, name):
        head = "ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(self.rows)
        head += "".join("property float %s\n" % n for n in self.NAMES) + "end_header\n"
        values = array.array("f", [v for row in self.rows for v in row])
        if sys.byteorder == "big":
            values.byteswap()
        with open(os.path.join(OUT, name), "wb") as file:
            file.write(head.encode() + values.tobytes())


def scatter(name, seed, wanted, scale, keep, lean=0.0, lift=0.0, depth=(-34.0, 7.0)):
    """Places on the ground, as many as are wanted, where `keep` of the distance from the path likes them."""
    places = Places(seed)
    rng = places.random
    while len(places.rows) < wanted:
        x, z = rng.uniform(-16, 16), rng.uniform(*depth)
        if rng.random() < keep(abs(x - path(z)), x, z):
            places.add(x, ground(x, z) + lift, z, rng.uniform(*scale), lean)
    places.save(name)


def main():
    os.makedirs(OUT, exist_ok=True)
    for k, (height, leaves) in enumerate(((15.0, 5200), (17.5, 6000), (13.0, 4600), (16.0, 5600))):
        tree = Tree(10 + k, height, leaves)
        tree.wood.save(os.path.join(OUT, f"wood{k}.ply"))
        tree.leaves.save(os.path.join(OUT, f"crown{k}.ply"))
    # Trees keep their distance from the path and from each other.
    rng, stems = random.Random(3), []
    while len(stems) < 150:
        x, z = rng.uniform(-20, 20), rng.uniform(-52, 5)
        away = abs(x - path(z))
        near = min((math.hypot(x - a, z - b) for a, b in stems), default=9.0)
        if away > 1.9 and near > 1.7 and not (z > 1.5 and away < 2.6):
            stems.append((x, z))
    for k in range(4):
        places = Places(20 + k)
        for x, z in stems[k::4]:
            places.add(x, ground(x, z), z, places.random.uniform(0.8, 1.2), 0.025)
        places.save(f"trees{k}.ply")
    bushes = Tree(18, 2.4, 2600).leaves
    bushes.save(os.path.join(OUT, "bush.ply"))
    scatter("bushes.ply", 80, 130, (0.7, 1.7), lambda away, x, z: 1.0 if away > 2.6 and z < -7 else 0.0, 0.05, 0.0, (-50.0, 0.0))
    for k in range(2):
        fern(30 + k).save(os.path.join(OUT, f"fern{k}.ply"))
        scatter(f"ferns{k}.ply", 40 + k, 190, (0.7, 1.5), lambda away, x, z: min(max((away - 0.9) / 1.6, 0), 1), 0.12)
        tuft(50 + k).save(os.path.join(OUT, f"tuft{k}.ply"))
        scatter(f"tufts{k}.ply", 60 + k, 1500, (0.6, 1.4), lambda away, x, z: 0.05 if away < 0.55 else math.exp(-((away - 1.2) ** 2)), 0.1)
    for k, curl in enumerate((0.05, 0.3, -0.25)):
        leaf(1.0, 0.62, 0.25, curl).moved(0, 0, -0.5).save(os.path.join(OUT, f"litter{k}.ply"))
        scatter(f"litter_places{k}.ply", 70 + k, 14000, (0.05, 0.10), lambda away, x, z: 0.35 + 0.65 * min(away, 1), 0.3, 0.012, (-26.0, 6.5))
    grid(220, 330, lambda u, v: (48 * u - 24, ground(48 * u - 24, 8 - 68 * v), 8 - 68 * v)).flipped().save(os.path.join(OUT, "ground.ply"))


if __name__ == "__main__":
    main()
