"""Inputs of shaders that differ with the direction of view alone, as Layer Weight and Fresnel nodes make them: tables over the
cosine of the angle of view, which the file of settings has as textures."""

import bpy
import numpy as np

from . import flat, glow, shaders, trees, views

# Inputs that may have a table, by the keys of the file of settings. Light is the product of two.
INPUTS = {
    "Base Color": "base_color",
    "Metallic": "metallic",
    "Roughness": "roughness",
    "Specular IOR Level": "specular",
    "Alpha": "opacity",
}
LIGHT = ("Emission Color", "Emission Strength")


def is_by_facing(socket):
    """Does what feeds an input differ with the angle of view, and with nothing else?"""
    return _kind(socket) == "facing"


def _kind(socket):
    """What an input differs with: nothing ("even"), the angle of view ("facing"), or something else (None)."""
    source = shaders.source(socket)
    if source is None:
        return None if socket.is_linked else "even"
    node = source.node
    if node.mute:
        return None
    if node.bl_idname in views.DIRECTED:
        return "facing" if views.is_known(node) and source.name in views.DIRECTED[node.bl_idname] else None
    kinds = {_kind(entry) for entry in node.inputs if entry.enabled}
    if getattr(node, "node_tree", None):
        kinds |= {_kind_within(inner) for inner in node.node_tree.nodes}
    elif node.bl_idname not in flat.PURE:
        return None
    return None if None in kinds else "facing" if "facing" in kinds else "even"


def _kind_within(node):
    """The same of a node of a group."""
    if node.bl_idname in flat.IN_GROUPS:
        return "even"
    return "facing" if node.bl_idname in views.DIRECTED and views.is_known(node) else None


def take(material, shader, exposure):
    """Puts tables in the place of what differs with the angle of view, as far as the file of settings can have them."""
    names = _wanted(material, shader)
    light = [name for name in LIGHT if is_by_facing(shader.inputs[name])]
    if any(_kind(shader.inputs[name]) is None for name in LIGHT):
        light = []
    if not names and not light:
        return
    tables = {INPUTS[name]: _table(material, [name]) for name in names}
    if light:
        tables["emission"] = _table(material, LIGHT) * exposure
    for name in names + light:
        for link in list(shader.inputs[name].links):
            material.node_tree.links.remove(link)
    if light:
        # All of it is in the table.
        shader.inputs["Emission Strength"].default_value = 0.0
    for key, table in tables.items():
        if key != "emission":
            table = np.minimum(table, 1.0)
        texture = f"{material.name} {key} by facing"
        grey = np.ptp(table, axis=1).max() < 1e-6 or key not in ("base_color", "emission")
        trees.TEXTURES[texture] = {"type": "facing", "colors": [entry(row, grey) for row in table]}
        trees.settle(material, **{key: texture})


def entry(row, is_grey):
    """A row of a table for the file of settings."""
    return float(row.mean()) if is_grey else [float(c) for c in row]


def _wanted(material, shader):
    """The inputs that get tables."""
    names = [name for name in INPUTS if is_by_facing(shader.inputs[name])]
    left_out = set()
    if shaders.constant(shader.inputs["Subsurface Weight"]) != 0 or shaders.constant(shader.inputs["Transmission Weight"]) != 0:
        left_out |= {"Base Color", "Specular IOR Level"}
    if not trees.SETTINGS.get(material.name, {}).get("mirror"):
        # There it is the reflectance, else a factor on that along the normal.
        left_out.add("Specular IOR Level")
    return [name for name in names if name not in left_out]


def _table(material, names):
    """What inputs of a material's shader give by the cosine of the angle of view, as colours: one input, or the product of two."""
    own = trees.copied(material)
    images = []
    for tree, node in list(trees.nodes_with_trees(own.node_tree, views.DIRECTED)):
        for out in node.outputs:
            if out.is_linked and views.is_known(node) and out.name in views.DIRECTED[node.bl_idname]:
                images.append(put(tree, out, views.rows(node, out.name)))
    try:
        with glow.board([own]):
            return _shone(own, names)
    finally:
        bpy.data.materials.remove(own)
        for image in images:
            bpy.data.images.remove(image)


def put(tree, out, values, place=None):
    """A picture of values along u in the place of an output; u is that of the texture coordinates, or of a place."""
    image = glow.picture(views.ROWS, 1)
    image.pixels.foreach_set(np.repeat(np.array(values, np.float32), 4))
    image.update()
    image.pack()
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation, node.extension = image, "Closest", "EXTEND"
    if place is not None:
        tree.links.new(place, node.inputs["Vector"])
    for link in list(out.links):
        tree.links.new(node.outputs["Color"], link.to_socket)
    return image


def _shone(material, names):
    """What a material shines with if inputs of its shader are colour and strength of its light."""
    tree = material.node_tree
    shader = shaders.output(tree)

    def feed(inputs):
        for name, target in zip(names, ("Color", "Strength")):
            shaders.feed(tree, shader.inputs[name], inputs[target])

    pixels = glow.baked(views.ROWS, 1, [lambda image: glow.shine(tree, shaders.end(tree), shader, image, feed)])
    return np.maximum(np.nan_to_num(pixels[0, :, :3]), 0.0)
