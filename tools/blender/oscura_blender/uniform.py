"""Inputs of shaders that node trees feed, but that are the same everywhere: all are evaluated at once by Cycles, and become
constants."""

from functools import partial

from . import flat, glow, shaders

# Edge of the part of the picture that each material has, pixels.
EDGE = 4
# So many materials are evaluated at once.
MOST = 4096


def fold(materials):
    """Makes constants of what is the same everywhere, in materials of one Principled shader each."""
    wanted = {material: names for material in materials if (names := _names(shaders.principled(material)))}
    # As many as a mesh may have.
    for first in range(0, len(wanted), MOST):
        _fold(list(wanted)[first : first + MOST], wanted)


def _names(shader):
    """The inputs of a shader that are alike everywhere and no constants yet."""
    if shader is None:
        return []
    return [s.name for s in shader.inputs if s.is_linked and s.type != "VECTOR" and s.enabled and _is_even(s)]


def _is_even(socket):
    source = shaders.source(socket)
    if source is None:
        return not socket.is_linked
    node = source.node
    if node.mute or shaders.BY_COSINE in node:
        return False
    if getattr(node, "node_tree", None):
        within = all(n.bl_idname in flat.IN_GROUPS and shaders.BY_COSINE not in n for n in node.node_tree.nodes)
        return within and all(_is_even(entry) for entry in node.inputs)
    return node.bl_idname in flat.PURE and all(_is_even(entry) for entry in node.inputs if entry.enabled)


def _fold(materials, wanted):
    with glow.board(materials) as columns:
        for name in dict.fromkeys(name for material in materials for name in wanted[material]):
            users = [material for material in materials if name in wanted[material]]
            values = _evaluate(name, materials, users, columns)
            for material in users:
                socket = shaders.principled(material).inputs[name]
                material.node_tree.links.remove(socket.links[0])
                value = values[materials.index(material)]
                socket.default_value = tuple(value) if socket.type == "RGBA" else float(value[:3].mean())


def _evaluate(name, materials, users, columns):
    """The values of an input, a row for each material."""
    shining = [partial(_shine, material, name if material in users else None) for material in materials]
    cells = glow.baked(EDGE * columns, EDGE * columns, shining).reshape(columns, EDGE, columns, EDGE, 4)
    return cells[:, EDGE // 2, :, EDGE // 2].reshape(-1, 4)


def _shine(material, name, image):
    """Lets a material shine with an input into a picture; gives what undoes it."""
    tree, shader = material.node_tree, shaders.principled(material)

    def feed(inputs):
        source = shaders.source(shader.inputs[name]) if name else None
        if source is not None:
            tree.links.new(source, inputs["Color"])

    return glow.shine(tree, shaders.end(tree), shader, image, feed)
