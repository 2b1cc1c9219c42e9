#!/usr/bin/env python3
"""Fetches three scanned statues and two pictures into meshes/ (6 MB), and writes them as PLY.

The scans are of the project Three D Scans (threedscans.com), which puts its scans under no copyright; it was made ready for
games by Keijiro Takahashi (github.com/keijiro/ThreeDScans). Files that are there already are only checked.
"""

import os
import struct
import sys
import zlib

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from fetch import fetch  # noqa: E402
from shapes import Mesh, arc, lathe  # noqa: E402

OUT = os.path.join(HERE, "meshes")
SOURCE = "https://raw.githubusercontent.com/keijiro/ThreeDScans/d7c6be2a997fb38ec850d7a0f03fa627bd736216/Assets/ThreeDScans/"
FILES = {
    "Plato/Plato.fbx": "ac44a8d368c80bb3aaff03b1128e4ba621eb69890c12ee17ef2e58f08dd033a8",
    "Plato/Plato_normals.png": "35d105d1b293136c87d713fc8f808f15c20598f6fb4c4817565275d88dcfe6b4",
    "Plato/Plato_occlusion.png": "01c96205e8b137c36e2cb739831193bad4302b56edfc127c5ee836261eb4bda1",
    "Athena/Athena.fbx": "083a018d02405b0b2326da31ec74b1d211104083a0ac776a58a5d4f37d800aad",
    "Nymph/Nymph.fbx": "c899f68a20d001c3490a21306741f74b44fe48fe5fdb797efcc9914be8cafd2f",
}


class Fbx:
    """The nodes of a binary FBX file of version 7500 or later: tuples of a name, values, and nodes within."""

    SCALARS = {"Y": "<h", "C": "<b", "I": "<i", "F": "<f", "D": "<d", "L": "<q"}

    def __init__(self, path):
        with open(path, "rb") as file:
            self.data = file.read()
        if not self.data.startswith(b"Kaydara FBX Binary") or struct.unpack_from("<I", self.data, 23)[0] < 7500:
            sys.exit("%s: no binary FBX of version 7500 or later" % path)
        self.nodes = self.children(27, len(self.data))

    def children(self, at, end):
        nodes = []
        while at < end:
            stop, count, _, length = struct.unpack_from("<QQQB", self.data, at)
            if stop == 0:
                break
            at += 25
            name = self.data[at:at + length].decode()
            at += length
            values = []
            for _ in range(count):
                value, at = self.value(at)
                values.append(value)
            nodes.append((name, values, self.children(at, stop)))
            at = stop
        return nodes

    def value(self, at):
        kind = chr(self.data[at])
        at += 1
        if kind in self.SCALARS:
            form = self.SCALARS[kind]
            return struct.unpack_from(form, self.data, at)[0], at + struct.calcsize(form)
        if kind in "SR":
            length, = struct.unpack_from("<I", self.data, at)
            return self.data[at + 4:at + 4 + length], at + 4 + length
        count, packed, length = struct.unpack_from("<III", self.data, at)
        raw = self.data[at + 12:at + 12 + length]
        raw = zlib.decompress(raw) if packed else raw
        return struct.unpack("<%d%s" % (count, kind.replace("l", "q")), raw), at + 12 + length


def inside(nodes, *names):
    for name in names:
        nodes = next(node for node in nodes if node[0] == name)
        values, nodes = nodes[1], nodes[2]
    return values


def read_mesh(path):
    """The mesh in metres; points are split where texture coordinates differ."""
    geometry = [node for node in Fbx(path).nodes if node[0] == "Objects"][0][2]
    numbers = inside(geometry, "Geometry", "Vertices")[0]
    corners = inside(geometry, "Geometry", "PolygonVertexIndex")[0]
    uv = inside(geometry, "Geometry", "LayerElementUV", "UV")[0]
    uv_of = inside(geometry, "Geometry", "LayerElementUV", "UVIndex")[0]
    mesh, known, face = Mesh(uvs=[]), {}, []
    for corner, t in zip(corners, uv_of):
        point = corner if corner >= 0 else ~corner
        st = (uv[2 * t], uv[2 * t + 1])
        if (point, st) not in known:
            known[point, st] = len(mesh.points)
            mesh.points.append(tuple(numbers[3 * point:3 * point + 3]))
            mesh.uvs.append(st)
        face.append(known[point, st])
        if corner < 0:
            mesh.faces.append(tuple(face))
            face = []
    return mesh


def pedestal(radius, height):
    """A turned foot and top, and a shaft between them."""
    profile = [(0, 0), (radius * 1.3, 0), (radius * 1.3, 0.04)] + arc((radius * 1.1, 0.04), radius * 0.2, 0, 90, 8)
    profile += [(radius, 0.09), (radius, height - 0.09)] + arc((radius * 1.12, height - 0.075), radius * 0.12, 180, 90, 8)
    profile += [(radius * 1.25, height - 0.05), (radius * 1.25, height - 0.006), (radius * 1.25 - 0.006, height), (0, height)]
    return lathe(profile, 128)


def main():
    os.makedirs(OUT, exist_ok=True)
    for name, checksum in FILES.items():
        fetch(SOURCE + name, os.path.join(OUT, os.path.basename(name)), checksum)
    for name in ("Plato", "Athena", "Nymph"):
        mesh = read_mesh(os.path.join(OUT, name + ".fbx"))
        low, high = ([f(c) for c in zip(*mesh.points)] for f in (min, max))
        mesh = mesh.moved(-(low[0] + high[0]) / 2, -low[1], -(low[2] + high[2]) / 2)
        mesh.save(os.path.join(OUT, name.lower() + ".ply"))
        print(name, len(mesh.points), "points,", " x ".join("%.2f" % (b - a) for a, b in zip(low, high)), "m")
    pedestal(0.26, 1.0).save(os.path.join(OUT, "pedestal.ply"))


main()
