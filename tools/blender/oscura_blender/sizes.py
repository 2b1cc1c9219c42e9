"""How large baked pictures are: about a texel for each pixel that shows them."""

import math

import numpy as np
from mathutils import Vector

from . import camera, meshes
from .settings import resolution

LEAST, MOST = 256, 4096

# Meshes of more faces keep their trees unbaked: laying out coordinates takes minutes for them.
MOST_FACES = 400_000

# Share of a picture that the faces of a mesh fill, and how much finer than pixels texels are.
FILLED, FINENESS = 0.6, 1.5

# What is around the camera is this part of its own size away, at least.
NEAREST = 0.15


class Sight:
    """The camera's view of things: how many pixels there are to a metre at a distance."""

    def __init__(self, eye, scene, most=None):
        self.most = most or MOST
        self.place = np.array(eye.matrix_world.translation) if eye else None
        self.is_parallel = bool(eye) and eye.data.type == "ORTHO"
        lens = camera.gltf(eye.data, scene) if eye else None
        height = resolution(scene)[1]
        if self.is_parallel:
            self.scale = height / (2 * lens["orthographic"]["ymag"])
        elif eye:
            self.scale = height / (2 * math.tan(lens["perspective"]["yfov"] / 2))

    def edge(self, mesh, matrices):
        """The edge of a picture for all faces of a mesh at its places, a power of two."""
        if self.place is None:
            return min(1024, self.most)
        areas = np.empty(len(mesh.polygons), np.float32)
        mesh.polygons.foreach_get("area", areas)
        positions = meshes.positions(mesh.vertices)
        low, high = positions.min(0), positions.max(0)
        wanted = max(self._pixels(float(areas.sum()), low, high, matrix) for matrix in matrices)
        power = math.ceil(math.log2(max(FINENESS * wanted, 1.0)))
        return max(min(2 ** min(power, 20), self.most), min(LEAST, self.most))

    def _pixels(self, area, low, high, matrix):
        """The edge of a square with as many pixels as faces of an area could cover."""
        size = abs(matrix.to_3x3().determinant()) ** (1 / 3)
        length = (area / FILLED) ** 0.5 * size
        if self.is_parallel:
            return length * self.scale
        corners = np.array([matrix @ Vector([(low, high)[k >> i & 1][i] for i in range(3)]) for k in range(8)])
        low, high = corners.min(0), corners.max(0)
        beside = np.maximum(np.maximum(low - self.place, self.place - high), 0)
        distance = max(np.linalg.norm(beside), NEAREST * np.linalg.norm(high - low), 1e-9)
        return length * self.scale / distance
