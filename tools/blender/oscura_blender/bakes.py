"""Nodes that oscura can't evaluate (Script, images in unknown color spaces, ...) are baked by Cycles to float images, on a UV map made for it.
Inputs that may not vary over a surface get the mean."""

import os

import bpy
import numpy as np

from . import cache, cycles, fingerprint, node_trees
from .node_links import converted, output_node

UV_MAP = "oscura bake"

# Resolution of images, and of images for means.
RESOLUTION, RESOLUTION_OF_MEANS = 1024, 128

# Meshes with more faces are not baked: unwrapping them takes minutes.
MAX_FACES = 400_000

# Vectors are encoded as v / RANGE + 0.5, since emission has no sign.
VECTOR_RANGE = 16.0

# The quantile of texels that is taken for the maximum of a color.
MAXIMUM = 0.999


class BakeRequests:
    """Stands for `Baker` while a material is read for the first time: collects what would be baked, without a mesh."""

    def __init__(self):
        self.reasons = []
        self.warnings = []

    def image(self, source, reason):
        self.reasons.append(reason)

    def mean(self, source, reason, default):
        self.reasons.append(reason)
        return default

    def maximum(self, source, reason):
        self.reasons.append(reason)
        return [1.0, 1.0, 1.0]

    def warn(self, message):
        self.warnings.append(message)


class Baker:
    """Bakes outputs of nodes of a material on a mesh."""

    def __init__(self, export, entry, material):
        self.export, self.entry, self.material = export, entry, material
        self.resolution = min(RESOLUTION, export.options.bake or RESOLUTION)
        self.is_possible = len(entry.object.data.polygons) <= MAX_FACES

    def warn(self, message):
        self.export.report.warn(self.material.name, message)

    def image(self, source, reason):
        """The file with an output, and whether it holds vectors; None for meshes that aren't baked."""
        if not self.is_possible:
            self.warn(f"{reason} is left out: the mesh {self.entry.object.data.name} has too many faces to bake it")
            return None
        self.export.report.note(self.material.name, f"{reason} is baked, since it can't be evaluated")
        file = self.export.new_file("baked", ".exr")
        cycles.save(self._pixels(source, self.resolution), os.path.join(self.export.folder, file))
        return file, source.output.type == "VECTOR"

    def mean(self, source, reason, default):
        """The mean of an output, a number or three as the default."""
        texels = self._texels(source)
        if not len(texels):
            return default
        mean = [float(c) for c in texels.mean(0)]
        self.warn(f"{reason} may not vary over a surface: its mean is taken")
        return mean if isinstance(default, list) else converted(mean, source.output.type, "VALUE")

    def maximum(self, source, reason):
        """The maximum of each channel of a color."""
        texels = self._texels(source)
        return np.clip(np.quantile(texels, MAXIMUM, axis=0), 1e-3, 1.0).tolist() if len(texels) else [1.0, 1.0, 1.0]

    def _texels(self, source):
        if not self.is_possible:
            return np.zeros((0, 3))
        pixels = self._pixels(source, min(RESOLUTION_OF_MEANS, self.resolution)).reshape(-1, 4).astype(np.float64)
        colors = pixels[pixels[:, 3] > 0][:, :3]
        return (colors - 0.5) * VECTOR_RANGE if source.output.type == "VECTOR" else colors

    def _pixels(self, source, resolution):
        """The baked image of an output; alpha is 0 outside faces."""
        unwrap(self.entry.object)
        copy = node_trees.copy_material(self.material)
        try:
            tree = copy.node_tree
            color = _top_level_output(tree, source)
            if source.output.type == "VECTOR":
                color = node_trees.link_operation(tree, "ShaderNodeVectorMath", "MULTIPLY_ADD", color, (1 / VECTOR_RANGE,) * 3, (0.5,) * 3)
            return self._bake(copy, color, resolution)
        finally:
            bpy.data.materials.remove(copy)

    def _bake(self, copy, color, resolution):
        """Bakes the color as the emission of a copy of the material; faces of other materials are black."""
        original = self.entry.object.data
        mesh, black = original.copy(), bpy.data.materials.new("oscura idle")
        black.use_nodes = True
        target = bpy.data.objects.new("oscura baked", mesh)
        for slot, material in enumerate(original.materials):
            mesh.materials[slot] = copy if material == self.material else black
        target.matrix_world = self.entry.placements[0].matrix

        def make():
            with cycles.baking_scene(target):
                trees = [copy.node_tree, black.node_tree]
                emission, _ = (cycles.add_emission(tree, output_node(tree)) for tree in trees)
                copy.node_tree.links.new(color, emission.inputs["Color"])
                pixels = cycles.bake_emission(resolution, resolution, trees, margin=8, uv_layer=UV_MAP)
            return np.nan_to_num(pixels, posinf=0).astype(np.float16)

        digest = cache.new_digest("bake", resolution, color.node.name, color.identifier)
        digest.update(repr([tuple(row) for row in target.matrix_world]).encode())
        fingerprint.add_mesh(digest, mesh)
        fingerprint.add_tree(digest, copy.node_tree)
        try:
            return self.export.cache.get(digest, make)
        finally:
            bpy.data.meshes.remove(mesh)
            bpy.data.materials.remove(black)


def unwrap(obj):
    """Adds a UV map without overlaps to a mesh object. The map that textures use by default stays the same."""
    layers = obj.data.uv_layers
    if UV_MAP in layers:
        return
    rendered = next((layer.name for layer in layers if layer.active_render), None)
    layers.new(name=UV_MAP)
    layers.active = layers[UV_MAP]
    with cycles.baking_scene(obj):
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.reveal()
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.uv.smart_project(angle_limit=1.15, island_margin=0.004)
        bpy.ops.object.mode_set(mode="OBJECT")
    if rendered is not None:
        layers[rendered].active_render = True


def _top_level_output(tree, source):
    """An output in a copy of a tree; one within groups is passed through new outputs of the groups."""
    trees = [tree]
    for group in source.groups:
        trees.append(trees[-1].nodes[group.name].node_tree)
    output = next(s for s in trees[-1].nodes[source.node.name].outputs if s.identifier == source.output.identifier)
    socket_type = {"RGBA": "NodeSocketColor", "VECTOR": "NodeSocketVector"}.get(output.type, "NodeSocketFloat")
    for inner, outer, group in reversed(list(zip(trees[1:], trees, source.groups))):
        made = inner.interface.new_socket("oscura", in_out="OUTPUT", socket_type=socket_type)
        end = next(n for n in inner.nodes if n.bl_idname == "NodeGroupOutput" and n.is_active_output)
        inner.links.new(output, next(s for s in end.inputs if s.identifier == made.identifier))
        output = next(s for s in outer.nodes[group.name].outputs if s.identifier == made.identifier)
    return output

