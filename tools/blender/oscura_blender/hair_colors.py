"""Colors of strands that vary: Cycles bakes them at points along strands, as small triangles with the attributes of the strand."""

import math

import bpy
import numpy as np

from . import bakes, cycles, generated_coordinates, meshes, node_trees, object_info
from .node_links import output_node

# Points along a strand where colors are baked if they vary along it, and the limit for all strands of an object.
SAMPLES, MAX_SAMPLES = 9, 2_000_000

HAIR_INFO = "ShaderNodeHairInfo"

# Nodes whose values vary along strands.
VARYING_NODES = (HAIR_INFO, "ShaderNodeNewGeometry", "ShaderNodeTexCoord", "ShaderNodeAttribute", "ShaderNodeCameraData")

# Attributes for the outputs of Hair Info.
INFO_ATTRIBUTES = {name: f"oscura {name.lower()}" for name in ("Intercept", "Length", "Thickness", "Random")}

# Corners of a triangle relative to the center of its texel, in texels.
CORNERS = np.array([(-0.45, -0.45), (0.45, -0.45), (0.0, 0.45)])

# Absorption of eumelanin and pheomelanin per concentration and radius.
EUMELANIN, PHEOMELANIN = np.array([0.506, 0.841, 1.653]), np.array([0.343, 0.733, 1.924])


def random(count):
    """Cycles' random values of strands."""
    return object_info.hashed(np.arange(count)) / object_info.MASK


def of_melanin(melanin, redness, tint, radial_roughness):
    """The colors of fibers by melanin (an array) and its redness, both from 0 to 1, and by a tint."""
    amount = -np.log(np.maximum(1 - np.asarray(melanin, float), 1e-4))[:, None]
    slope = _log_color_slope(radial_roughness)
    absorption = amount * ((1 - redness) * EUMELANIN + redness * PHEOMELANIN) + (np.log(np.clip(tint, 1e-5, 1)) / slope) ** 2
    return np.exp(-np.sqrt(absorption) * slope)


def _log_color_slope(b):
    """The logarithm of the color over the square root of the absorption (Chiang et al. 2016, equation 9)."""
    return 5.969 - 0.215 * b + 2.532 * b**2 - 10.73 * b**3 + 5.574 * b**4 + 0.245 * b**5


def evaluate(material, node, name, strands, matrix):
    """An input of a material's node at each point of strands, shape (points, 3)."""
    count, samples = len(strands.counts), 1
    if node_trees.has_linked(material.node_tree, VARYING_NODES):
        samples = max(1, min(SAMPLES, MAX_SAMPLES // max(count, 1)))
    copy = node_trees.copy_material(material)
    tree = copy.node_tree
    source = tree.nodes[node.name].inputs[name]
    _use_attributes(tree)
    mesh = _triangles(strands, np.linspace(0, 1, samples) if samples > 1 else np.zeros(1), copy)
    obj = bpy.data.objects.new("oscura strands", mesh)
    obj.matrix_world = matrix
    size = math.ceil(math.sqrt(count * samples))
    try:
        with cycles.baking_scene(obj):
            node_trees.link_input(tree, source, cycles.add_emission(tree, output_node(tree)).inputs["Color"])
            pixels = cycles.bake_emission(size, size, [tree], margin=0, uv_layer=bakes.UV_MAP)
    finally:
        bpy.data.meshes.remove(mesh)
        bpy.data.materials.remove(copy)
    colors = np.nan_to_num(pixels.reshape(-1, 4)[: count * samples, :3].reshape(count, samples, 3))
    return _interpolated(colors, strands)


def _use_attributes(tree):
    generated_coordinates.use_attribute(tree)
    for inner, node in list(node_trees.find_nodes(tree, (HAIR_INFO,))):
        node_trees.replace_output(inner, node.outputs["Is Strand"], 1.0)
        for name, attribute in INFO_ATTRIBUTES.items():
            if targets := [link.to_socket for link in node.outputs[name].links]:
                node_trees.link_attribute(inner, targets, attribute, "Fac")


def _triangles(strands, positions, material):
    """A mesh with a triangle for each strand and position along it (from 0 to 1), which covers a texel."""
    count, samples = len(strands.counts), len(positions)
    total, size = count * samples, math.ceil(math.sqrt(count * samples))
    first = strands.first()
    last = first + strands.counts - 1
    at = positions * (strands.counts[:, None] - 1)
    low = np.floor(at).astype(np.int64)
    mix = at - low
    low += first[:, None]
    high = np.minimum(low + 1, last[:, None])
    sampled = lambda values: (values[low].T * (1 - mix).T + values[high].T * mix.T).T
    lengths = strands.lengths()
    info = {
        "Intercept": sampled(lengths) / np.maximum(lengths[last], 1e-12)[:, None],
        "Length": np.repeat(lengths[last], samples),
        "Thickness": sampled(2 * strands.radii),
        "Random": np.repeat(random(count), samples),
    }
    small = 1e-5 * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    vertices = (sampled(strands.points).reshape(total, 1, 3) + small).reshape(-1, 3)
    mesh = meshes.from_triangles("oscura strands", vertices, np.arange(3 * total).reshape(-1, 3))
    for name, values in info.items():
        meshes.add_attribute(mesh, INFO_ATTRIBUTES[name], "FLOAT", "POINT", np.repeat(values.ravel(), 3))
    of_roots = lambda rows: np.repeat(rows, 3 * samples, axis=0).astype(np.float32).ravel()
    for name, rows in strands.roots.uvs.items():
        mesh.uv_layers.new(name=name).uv.foreach_set("vector", of_roots(rows))
    for name, rows in strands.roots.colors.items():
        meshes.add_attribute(mesh, name, "FLOAT_COLOR", "POINT", of_roots(rows))
    meshes.add_attribute(mesh, generated_coordinates.ATTRIBUTE, "FLOAT_VECTOR", "POINT", of_roots(strands.roots.generated))
    texels = np.stack([np.arange(total) % size, np.arange(total) // size], 1)[:, None] + 0.5 + CORNERS
    mesh.uv_layers.new(name=bakes.UV_MAP).uv.foreach_set("vector", (texels / size).astype(np.float32).ravel())
    if strands.roots.uvs:
        mesh.uv_layers[strands.roots.default_uv].active_render = True
    mesh.materials.append(material)
    return mesh


def _interpolated(colors, strands):
    """Colors (strands, samples, 3) at the points of strands."""
    count, samples = colors.shape[:2]
    strand, counts = (np.repeat(values, strands.counts) for values in (np.arange(count), strands.counts))
    share = (np.arange(len(strands.points)) - np.repeat(strands.first(), strands.counts)) / np.maximum(counts - 1, 1)
    at = share * (samples - 1)
    low = np.minimum(np.floor(at).astype(int), samples - 1)
    mix = (at - low)[:, None]
    return colors[strand, low] * (1 - mix) + colors[strand, np.minimum(low + 1, samples - 1)] * mix
