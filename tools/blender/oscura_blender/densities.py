"""Volumes in meshes whose density is a node tree: Cycles bakes it on slices through the mesh, and it becomes a grid beside the model."""

import os
import struct

import bpy
import numpy as np

from . import cache, fingerprint, glow, grids, media, shaders, sidecar, trees
from .glb import Y_UP
from .context import choose, opened
from .report import listed

# Voxels along the longest edge of the box around a mesh.
FINEST = 128

SHADERS = ("ShaderNodeVolumeAbsorption", "ShaderNodeVolumeScatter", "ShaderNodeVolumePrincipled")


def settle(holders, found, store, report):
    """Bakes the densities of volumes that differ from place to place, where nothing else of them does. Meshes at several places are left
    alone: grids stand in the world. Gives the tables of these materials."""
    made = {}
    placed = [holder for holder in holders if len(found.placements[holder.name]) == 1]
    known = {material: _filling(material) for material in trees.of_materials(placed)}
    varying = [(holder, m) for holder in placed for m in dict.fromkeys(holder.data.materials) if known.get(m) is not None]
    if not varying:
        return made
    report.note("", f"densities of volumes were baked to grids: of {listed(sorted({material.name for _, material in varying}))}")
    bake_scene = glow.new_scene()
    try:
        with opened(bake_scene):
            for number, (holder, material) in enumerate(varying):
                file = f"{found.grids.name}.density.{number}.vol"
                own = trees.own(holder, material)
                density = Density(holder, own, found.placements[holder.name][0][1])
                made[own] = density.entries(known[material], bake_scene, file, found, store, report)
    finally:
        bpy.data.scenes.remove(bake_scene)
    return made


def _shader(material):
    """The one shader of a material that is nothing but a volume; else None."""
    end = shaders.end(material.node_tree) if material.use_nodes and material.node_tree is not None else None
    if end is None or shaders.source(end.inputs["Surface"]) is not None:
        return None
    feeding = shaders.source(end.inputs["Volume"])
    node = feeding.node if feeding is not None else None
    return node if node is not None and node.bl_idname in SHADERS and not node.mute else None


def _filling(material):
    """What fills a volume whose density varies where that is 1; None for all else, and where more varies than the density."""
    node = _shader(material)
    if node is None or shaders.constant(node.inputs["Density"]) is not None:
        return None
    try:
        return _of_density_one(material)
    except media.Varying:
        return None


def _of_density_one(material):
    """What fills such a volume where its density is 1."""
    own = material.copy()
    try:
        density = _shader(own).inputs["Density"]
        own.node_tree.links.remove(density.links[0])
        density.default_value = 1.0
        return media.read(shaders.end(own.node_tree).inputs["Volume"])
    finally:
        bpy.data.materials.remove(own)


class Density:
    """The density of a mesh's volume on voxels in its own space, with one more around the box of the mesh."""

    def __init__(self, holder, material, matrix):
        self.material, self.matrix = material, matrix
        corners = np.array([vertex.co for vertex in holder.data.vertices] or [(0.0, 0.0, 0.0)])
        self.inner = corners.min(0), np.maximum(corners.max(0), corners.min(0) + 1e-6)
        extent = self.inner[1] - self.inner[0]
        along = extent * np.linalg.norm(np.array(matrix.to_3x3()), axis=0)
        counts = np.clip(np.ceil(FINEST * along / max(along.max(), 1e-30) - 1e-3).astype(int), 1, FINEST)
        self.step = extent / counts
        self.low, self.high, self.size = self.inner[0] - self.step, self.inner[1] + self.step, counts + 2

    def entries(self, filling, bake_scene, file, found, store, report):
        """Writes the grid; gives what the file of settings says about the material, None for nothing."""
        values = self._kept(bake_scene, store)
        if values.max() <= 0 or filling.is_nothing():
            return None
        self._write(os.path.join(found.grids.folder, file), values)
        entries = filling.entries(found.exposure)
        if "emission" in entries:
            report.warn(self.material.name, "the light of its volume goes by its density here")
            entries = grids.greyed(entries)
        return {"type": "medium", "grid": file, "transform": sidecar.placed(Y_UP @ self.matrix), **entries}

    def _kept(self, bake_scene, store):
        digest = cache.digest()
        digest.update(repr(("density", [tuple(row) for row in self.matrix], self.low.tolist(), self.high.tolist(), self.size.tolist())).encode())
        fingerprint.add_tree(digest, self.material.node_tree)
        key = digest.hexdigest()
        kept = store.get(key)
        if kept is None:
            kept = {"values": self._baked(bake_scene)}
            store.put(key, kept)
        return kept["values"]

    def _baked(self, bake_scene):
        """The values by slice, row and column."""
        nx, ny, nz = self.size
        columns = max(round((nz * ny / nx) ** 0.5), 1)
        rows = -(-nz // columns)
        mesh = self._slices(columns, rows)
        slices = bpy.data.objects.new("oscura slices", mesh)
        try:
            slices.matrix_world = self.matrix
            bake_scene.collection.objects.link(slices)
            choose(slices, bake_scene)
            pixels = glow.baked(int(columns * nx), int(rows * ny), [self._shine])
        finally:
            bpy.data.meshes.remove(mesh)
        tiles = pixels[..., 0].reshape(rows, ny, columns, nx).transpose(0, 2, 1, 3).reshape(rows * columns, ny, nx)
        return np.maximum(np.nan_to_num(tiles[:nz], posinf=0), 0).astype(np.float32)

    def _slices(self, columns, rows):
        """Squares across z through the middles of voxels, side by side on their texture coordinates."""
        corners, uvs = [], []
        for k in range(self.size[2]):
            z = self.low[2] + (k + 0.5) * self.step[2]
            for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)):
                corners.append(((self.low[0], self.high[0])[i], (self.low[1], self.high[1])[j], z))
                uvs.append(((k % columns + i) / columns, (k // columns + j) / rows))
        mesh = bpy.data.meshes.new("oscura slices")
        mesh.from_pydata(corners, [], [tuple(range(4 * k, 4 * k + 4)) for k in range(self.size[2])])
        mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", np.ravel(uvs))
        mesh.materials.append(self.material)
        # Generated coordinates are those of the mesh.
        mesh.use_auto_texspace = False
        mesh.texspace_location = (self.inner[0] + self.inner[1]) / 2
        mesh.texspace_size = (self.inner[1] - self.inner[0]) / 2
        return mesh

    def _shine(self, image):
        """Lets the material shine with its density alone; gives what undoes it."""
        tree, node = self.material.node_tree, _shader(self.material)
        end, target = shaders.end(tree), glow.aim(tree, image)
        light = tree.nodes.new("ShaderNodeEmission")
        shaders.feed(tree, node.inputs["Density"], light.inputs["Strength"])
        volume = end.inputs["Volume"].links[0].from_socket
        tree.links.remove(end.inputs["Volume"].links[0])
        tree.links.new(light.outputs[0], end.inputs["Surface"])

        def restore():
            tree.nodes.remove(target)
            tree.nodes.remove(light)
            tree.links.new(volume, end.inputs["Volume"])

        return restore

    def _write(self, path, values):
        """A grid as Mitsuba has it."""
        with open(path, "wb") as file:
            file.write(b"VOL\x03" + struct.pack("<5I6f", 1, *(int(n) for n in self.size), 1, *self.low, *self.high))
            file.write(np.ascontiguousarray(values, "<f4").tobytes())
