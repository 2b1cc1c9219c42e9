#!/usr/bin/env python3
"""Fetches the scanned head (0.4 MB) into meshes/, writes it as PLY, and grows hair, brows, lashes and a beard on it.

The scan: Infinite, 3D Head Scan by Lee Perry-Smith, CC BY 3.0, based on a work at www.triplegangers.com. Its mesh is
compressed: 'pip install DracoPy' brings the decoder.
"""

import json
import math
import os
import random
import struct
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from fetch import fetch  # noqa: E402
from shapes import Mesh, cross, dot, mix, normalized, smoothstep, subtract  # noqa: E402

OUT = os.path.join(HERE, "meshes")
SOURCE = "https://raw.githubusercontent.com/pooch1e/threeJsPortfolio/53e625a629a71872c4c813ba9f1322b96571a278/static/"
FILES = {
    "models/LeePerrySmith/LeePerrySmith.glb": ("LeePerrySmith.glb", "818d02e8c84ffdf640d1ba1085075c440857ebeb0d0152547ddb675a1fe14270"),
    "textures/leePerrySmith/color.jpg": ("color.jpg", "e976d73b31407f8d0967412bf468019ed26a5d5a32cf5811aabff7e816458a65"),
    "textures/leePerrySmith/normal.jpg": ("normal.jpg", "36925e51ad9b324b94e8faf4692da1b4132809f2762bb8d5bd549ffd215d4ca6"),
}
SCALE = 0.0535  # metres for a unit of the scan

# Where hair begins, seen from the side: how far in front of the ear, and how high, in units of the scan.
HAIRLINE = [(-9, 0.2), (-1.2, 0.25), (-0.8, 0.5), (-0.35, 1.0), (-0.22, 1.97), (0.40, 1.97), (0.43, 1.55), (0.72, 1.6), (0.86, 2.3),
            (1.1, 2.72), (1.5, 3.06), (1.9, 3.2), (9, 3.3)]
BROW = [(0.20, 2.02), (0.45, 2.09), (0.75, 2.13), (0.98, 2.04), (1.14, 1.92)]
LASHES = [(0.22, 1.71), (0.32, 1.64), (0.45, 1.59), (0.60, 1.57), (0.78, 1.61), (0.93, 1.66)]


def read_head(path):
    try:
        import DracoPy
    except ImportError:
        sys.exit("the head's mesh is compressed: 'pip install DracoPy' brings its decoder")
    with open(path, "rb") as file:
        data = file.read()
    length, = struct.unpack_from("<I", data, 12)
    view = json.loads(data[20:20 + length])["bufferViews"][0]
    start = 20 + length + 8 + view.get("byteOffset", 0)
    head = DracoPy.decode(data[start:start + view["byteLength"]])
    rows = [[tuple(float(v) for v in row) for row in part] for part in (head.points, head.tex_coord)]
    return Mesh(rows[0], [tuple(int(i) for i in face) for face in head.faces], rows[1])


def along(curve, x):
    """The value of a polyline at x."""
    for (a, p), (b, q) in zip(curve, curve[1:]):
        if x <= b:
            return mix(p, q, min(max((x - a) / (b - a), 0.0), 1.0))
    return curve[-1][1]


def distance(curve, x, y):
    best = 9.0
    for (a, b), (c, d) in zip(curve, curve[1:]):
        t = min(max(((x - a) * (c - a) + (y - b) * (d - b)) / ((c - a) ** 2 + (d - b) ** 2), 0.0), 1.0)
        best = min(best, math.hypot(x - mix(a, c, t), y - mix(b, d, t)))
    return best


class Skin:
    """Random points of the head, evenly over its area."""

    def __init__(self, mesh, rng):
        self.mesh, self.rng = mesh, rng
        areas, self.normals = [], {}
        for face in mesh.faces:
            a, b, c = (mesh.points[i] for i in face)
            n = cross(subtract(b, a), subtract(c, a))
            areas.append(math.sqrt(dot(n, n)))
            for i in face:
                key = mesh.points[i]
                old = self.normals.get(key, (0.0, 0.0, 0.0))
                self.normals[key] = tuple(p + q for p, q in zip(old, n))
        self.faces = mesh.faces
        self.areas = areas

    def points(self, count, inside):
        faces = [(f, a) for f, a in zip(self.faces, self.areas)
                 if any(inside(self.mesh.points[i]) > 0 for i in f)]
        chosen = self.rng.choices([f for f, _ in faces], [a for _, a in faces], k=count)
        for face in chosen:
            u, v = self.rng.random(), self.rng.random()
            if u + v > 1:
                u, v = 1 - u, 1 - v
            weights = (1 - u - v, u, v)
            corners = [self.mesh.points[i] for i in face]
            p = tuple(sum(w * c[k] for w, c in zip(weights, corners)) for k in range(3))
            n = normalized(tuple(sum(w * normalized(self.normals[c])[k] for w, c in zip(weights, corners)) for k in range(3)))
            if self.rng.random() < inside(p):
                yield p, n


def on_scalp(p):
    x, y, z = p
    edge = along(HAIRLINE, z) + 0.05 * math.sin(9 * x + 4 * z) + 0.03 * math.sin(23 * x - 17 * z)
    if -0.3 < z < 0.55 and abs(x) > 1.5 and y < 2.0:
        return 0.0
    return smoothstep(-0.02, 0.16, y - edge)


def on_beard(p):
    x, y, z = p
    if z < 0.35 or y < -0.75 or abs(x) > 1.45 + 0.2 * (z < 0.8):
        return 0.0
    upper = along([(0.3, 1.5), (0.75, 1.5), (0.95, 1.05), (1.3, 0.62), (1.8, 0.45), (2.0, 0.68), (9, 0.72)], z)
    lips = 1 - smoothstep(0.14, 0.2, math.hypot(x / 3.0, y - 0.33)) if z > 1.7 else 0.0
    front = smoothstep(0.35, 0.5, z)
    return front * smoothstep(-0.02, 0.25, upper - y) * (1 - lips) * smoothstep(-0.75, -0.45, y + 0.18 * (z - 1.2))


def on_brow(p):
    x, y, z = p
    return 1 - smoothstep(0.04, 0.085, distance(BROW, abs(x), y)) if z > 1.0 else 0.0


def strand(p, n, flow, length, lift, curl, rng, steps=5):
    """A strand that leaves along the normal and bends into the flow."""
    flow = tuple(f - dot(flow, n) * m for f, m in zip(flow, n))
    flow = normalized(tuple(f + rng.gauss(0, curl) for f in flow))
    points, q = [], tuple(a - 0.01 * b for a, b in zip(p, n))
    for k in range(steps):
        points.append(q)
        t = k / (steps - 1)
        way = normalized(tuple(mix(lift, lift * 0.25, t) * b + f for b, f in zip(n, flow)))
        q = tuple(a + length / (steps - 1) * w for a, w in zip(q, way))
    return points


def hair(skin, rng):
    strands = []
    for p, n in skin.points(78000, on_scalp):
        x, y, z = p
        up = smoothstep(0.0, 1.5, y - along(HAIRLINE, z))
        top = smoothstep(2.75, 3.35, y + 0.12 * z)
        length = mix(0.07 + 0.22 * up, 0.62, top) * rng.uniform(0.75, 1.1)
        lock = math.sin(5.1 * x + 3 * math.sin(2.3 * z)) * math.cos(4.3 * z + 2 * math.sin(3.1 * x))
        forward = (0.55 + 0.5 * lock, 0.25 * lock, 1.0)
        down = (0.0, -1.0, -0.25)
        flow = tuple(mix(a, b, top) for a, b in zip(down, forward))
        strands.append(strand(p, n, flow, length, mix(0.5, 0.75 + 0.45 * lock, top), mix(0.18, 0.22, top), rng))
    return strands


def beard(skin, rng):
    return [strand(p, n, (0.1 * p[0], -1.0, 0.35), rng.uniform(0.05, 0.11), 0.6, 0.3, rng) for p, n in skin.points(15000, on_beard)]


def brows(skin, rng):
    strands = []
    for p, n in skin.points(60000, on_brow):
        side = 1 if p[0] > 0 else -1
        outer = smoothstep(0.3, 1.0, abs(p[0]))
        flow = (side * 1.0, mix(0.9, -0.35, outer), 0.0)
        strands.append(strand(p, n, flow, rng.uniform(0.10, 0.19), 0.35, 0.16, rng))
    return rng.sample(strands, min(len(strands), 1300))


def lashes(skin, rng):
    """Roots along the closed lid, curved down and forward, then up."""
    front = [p for p in skin.mesh.points if p[2] > 0.9 and 1.3 < p[1] < 2.0 and 0.1 < abs(p[0]) < 1.1]
    strands = []
    for side in (-1, 1):
        for k in range(130):
            t = k / 129
            x = mix(LASHES[0][0], LASHES[-1][0], t)
            y = along(LASHES, x) + rng.gauss(0, 0.008)
            root = min(front, key=lambda p: (p[0] - side * x) ** 2 + (p[1] - y) ** 2)
            z, length = root[2], 0.15 * math.sin(math.pi * min(0.25 + 0.75 * t, 0.9)) * rng.uniform(0.8, 1.15)
            points = []
            for i in range(6):
                s = i / 5
                points.append((side * (x + length * 0.55 * (t - 0.35) * s), y - length * 0.55 * s + length * 0.35 * s * s,
                               z - 0.02 + length * 1.05 * s))
            strands.append(points)
    return strands


def save(strands, path):
    """A HAIR file whose strands all have as many points."""
    steps = len(strands[0])
    header = b"HAIR" + struct.pack("<4I5f", len(strands), len(strands) * steps, 2, steps - 1, 1.0, 0.0, 1.0, 1.0, 1.0)
    with open(path, "wb") as file:
        file.write(header.ljust(128, b"\0"))
        for points in strands:
            for p in points:
                file.write(struct.pack("<3f", *(SCALE * c for c in p)))
    print(os.path.basename(path), len(strands))


def main():
    os.makedirs(OUT, exist_ok=True)
    for source, (name, checksum) in FILES.items():
        fetch(SOURCE + source, os.path.join(OUT, name), checksum)
    head = read_head(os.path.join(OUT, "LeePerrySmith.glb"))
    rng = random.Random(7)
    skin = Skin(head, rng)
    for grow in (hair, beard, brows, lashes):
        save(grow(skin, rng), os.path.join(OUT, grow.__name__ + ".hair"))
    head.scaled(SCALE).save(os.path.join(OUT, "head.ply"))


main()
