"""Colours of strands that vary: from strand to strand, with where they grow, and along them. Cycles evaluates their node trees on
small triangles, one for each place on a strand."""

import math

import bpy
import numpy as np

from . import bakes, glow, meshes, objectwise, shaders, trees, undeformed

# Places along a strand where colours are evaluated, if they vary there.
PLACES = 9

# Places on all strands of an object together.
MOST_PLACES = 2_000_000

# Nodes whose values vary along strands.
ALONG = ("ShaderNodeHairInfo", "ShaderNodeNewGeometry", "ShaderNodeTexCoord", "ShaderNodeAttribute", "ShaderNodeCameraData")

INFO = "ShaderNodeHairInfo"

# What the outputs of that node are called as attributes.
KNOWN = {name: f"oscura {name.lower()}" for name in ("Intercept", "Length", "Thickness", "Random")}

# How far the corners of a triangle lie from the centre of their pixel.
CORNERS = np.array([(-0.45, -0.45), (0.45, -0.45), (0.0, 0.45)])

# Absorption per radius by the concentration of brown and of red pigment.
BROWN, RED = np.array([0.506, 0.841, 1.653]), np.array([0.343, 0.733, 1.924])


def random(count):
    """The number of chance that Cycles gives each strand."""
    return objectwise.hashed(np.arange(count)) / objectwise.MASK


def of_pigment(melanin, redness, tint, radial_roughness):
    """The colours of fibres by their pigment: rows of melanin and a redness from 0 to 1, and a colour of dye."""
    amount = -np.log(np.maximum(1 - np.asarray(melanin, float), 1e-4))[:, None]
    of_dye = (np.log(np.clip(tint, 1e-5, 1)) / _steepness(radial_roughness)) ** 2
    absorption = amount * ((1 - redness) * BROWN + redness * RED) + of_dye
    return np.exp(-np.sqrt(absorption) * _steepness(radial_roughness))


def _steepness(b):
    """By how much colours fall with the root of absorption (Chiang et al. 2016, equation 9)."""
    return 5.969 - 0.215 * b + 2.532 * b**2 - 10.73 * b**3 + 5.574 * b**4 + 0.245 * b**5


def evaluate(material, node, key, strands, matrix):
    """What an input of a material's node is at each point of strands (rows of three numbers)."""
    count, along = len(strands.counts), _places_along(material, len(strands.counts))
    shares = np.linspace(0, 1, along) if along > 1 else np.zeros(1)
    own = trees.copied(material)
    source = own.node_tree.nodes[node.name].inputs[key]
    _rewrite(own.node_tree)
    mesh = _triangles(strands, shares, own)
    shown = bpy.data.objects.new("oscura strands", mesh)
    shown.matrix_world = matrix
    edge = math.ceil(math.sqrt(count * along))
    try:
        with glow.stage(shown):
            shaders.feed(own.node_tree, source, glow.light(own.node_tree, shaders.end(own.node_tree)).inputs["Color"])
            pixels = glow.baked(edge, edge, [own.node_tree], margin=0, uv_layer=bakes.UV)
    finally:
        bpy.data.meshes.remove(mesh)
        bpy.data.materials.remove(own)
    seen = np.nan_to_num(pixels.reshape(-1, 4)[: count * along, :3].reshape(count, along, 3))
    return _at_points(seen, strands)


def _places_along(material, count):
    has_info = trees.has(material.node_tree, ALONG)
    return max(1, min(PLACES, MOST_PLACES // max(count, 1))) if has_info else 1


def _rewrite(tree):
    """Puts attributes in the place of what only strands have."""
    undeformed.look_up(tree)
    for inner, node in list(trees.nodes_with_trees(tree, (INFO,))):
        trees.replace(inner, node.outputs["Is Strand"], 1.0)
        for name, attribute in KNOWN.items():
            if targets := [link.to_socket for link in node.outputs[name].links]:
                trees.feed_attribute(inner, targets, attribute, "Fac")


def _triangles(strands, shares, material):
    """A mesh with a triangle for each place, over a pixel of its own, with what is known of the strand there."""
    count, along = len(strands.counts), len(shares)
    total, edge = count * along, math.ceil(math.sqrt(count * along))
    first, (low, mix) = np.cumsum(strands.counts) - strands.counts, _between(strands.counts, shares)
    low += first[:, None]
    high = np.minimum(low + 1, (first + strands.counts - 1)[:, None])
    between = lambda values: (values[low].T * (1 - mix).T + values[high].T * mix.T).T
    lengths = strands.lengths()
    known = {
        KNOWN["Intercept"]: between(lengths) / np.maximum(lengths[first + strands.counts - 1], 1e-12)[:, None],
        KNOWN["Length"]: np.repeat(lengths[first + strands.counts - 1], along),
        KNOWN["Thickness"]: between(2 * strands.radii),
        KNOWN["Random"]: np.repeat(random(count), along),
    }
    small = 1e-5 * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    places = (between(strands.points).reshape(total, 1, 3) + small).reshape(-1, 3)
    mesh = meshes.of_triangles("oscura strands", places, np.arange(3 * total).reshape(-1, 3))
    for name, values in known.items():
        mesh.attributes.new(name, "FLOAT", "POINT").data.foreach_set("value", np.repeat(values.ravel(), 3).astype(np.float32))
    on_corners = lambda rows: np.repeat(rows, 3 * along, axis=0).astype(np.float32).ravel()
    for name, rows in strands.roots.uvs.items():
        mesh.uv_layers.new(name=name).uv.foreach_set("vector", on_corners(rows))
    for name, rows in strands.roots.colors.items():
        mesh.attributes.new(name, "FLOAT_COLOR", "POINT").data.foreach_set("color", on_corners(rows))
    generated = mesh.attributes.new(undeformed.ATTRIBUTE, "FLOAT_VECTOR", "POINT")
    generated.data.foreach_set("vector", on_corners(strands.roots.generated))
    own = mesh.uv_layers.new(name=bakes.UV)
    pixel = np.stack([np.arange(total) % edge, np.arange(total) // edge], 1)[:, None] + 0.5 + CORNERS
    own.uv.foreach_set("vector", (pixel / edge).astype(np.float32).ravel())
    if strands.roots.uvs:
        mesh.uv_layers[strands.roots.active].active_render = True
    mesh.materials.append(material)
    return mesh


def _between(counts, shares):
    """The points before places on strands (counted from each root), and how far the way to the next has been gone."""
    at = shares * (counts[:, None] - 1)
    low = np.floor(at).astype(np.int64)
    return low, at - low


def _at_points(seen, strands):
    """Colours at places, evenly along each strand, at its points."""
    count, along = seen.shape[:2]
    first = np.repeat(np.cumsum(strands.counts) - strands.counts, strands.counts)
    strand = np.repeat(np.arange(count), strands.counts)
    share = (np.arange(len(strands.points)) - first) / np.maximum(np.repeat(strands.counts, strands.counts) - 1, 1)
    at = share * (along - 1)
    low = np.minimum(np.floor(at).astype(int), along - 1)
    mix = (at - low)[:, None]
    return seen[strand, low] * (1 - mix) + seen[strand, np.minimum(low + 1, along - 1)] * mix
