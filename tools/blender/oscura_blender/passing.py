"""Light that passes surfaces diffusely. What a surface reflects and what it lets through are shares of the light that it gets:
glTF has one factor for them, on which a colour each comes. Where the colour that passes differs from place to place, it is baked
as a second picture on the coordinates of the base colour's."""

import bpy
import numpy as np

from . import mixes, shaders, trees, views

# Rows of the node that chooses between the colours when they are baked.
REFLECTED, PASSED = 0, 1

# Inputs that have a say in what the base colour means.
OTHERS = ("Metallic", "Transmission Weight", "Subsurface Weight")

BASE = "what passes a translucent surface has the colour of what it reflects"
MEAN = "the colour of what passes a translucent surface varies: its mean is taken"
BRIGHT = "translucency of varying strength between bright colours is weaker: neither of them exceeds white"
TOO_BRIGHT = "reflects and lets through more light than it gets (Add Shader): it does less of both"


def share_of(reflected, passed):
    """The share of light that passes where two colours are meant wholly, so that each of them over its share is 1 at most."""
    a, b = _peaks(reflected, passed)
    if a + b > 1 and isinstance(reflected, tuple) != isinstance(passed, tuple):
        # Rather the brightest parts of a picture than all of an even colour.
        a, b = (a, 1 - a) if isinstance(reflected, tuple) else (1 - b, b)
    return b / (a + b) if a + b > 0 else 0.5


def exceeds(reflected, passed):
    """Is that more light than there is?"""
    return sum(_peaks(reflected, passed)) > 1 + 1e-3


def _peaks(*colors):
    """The largest channels of two colours. One that isn't known takes what the other one leaves."""
    a, b = (_peak(color) for color in colors)
    if a is None and b is None:
        return 0.5, 0.5
    return (1 - b, b) if a is None else (a, 1 - a) if b is None else (a, b)


def _peak(color):
    """The largest channel of a colour or of a picture; None where a tree changes it."""
    if isinstance(color, tuple):
        return min(max(*color, 0.0), 1.0)
    pixels = _pixels(color)
    return None if pixels is None else float(min(max(pixels.max(), 0.0), 1.0))


def _pixels(socket):
    """The linear colours of a picture whose colour a socket is."""
    image = getattr(socket.node, "image", None) if socket.name == "Color" else None
    if image is None or not image.size[0] or image.channels < 3:
        return None
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(-1, image.channels)[:, :3]
    if image.is_float or image.colorspace_settings.name != "sRGB":
        return pixels
    return np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)


def settle(material, shader, found, report):
    """Keeps what is known of light that passes diffusely: its share and its colour, None for that of the base. A share that
    varies goes into the colours."""
    share, color, base = (found.get(name) for name in ("Translucent Weight", "Translucent Color", "Base Color"))
    if share is None or share == 0.0:
        return
    has_picture = all(found.get(name, 0.0) == 0.0 for name in OTHERS) and not _differ_with_view(share, color, base)
    if not isinstance(share, float) and has_picture:
        if exceeds(base, color):
            report.warn(material.name, BRIGHT)
        weight, share = share, share_of(base, color)
        base, color = _varied(material.node_tree, base, color, weight, share)
    if not isinstance(share, float):
        report.warn(material.name, "translucency of varying strength is not carried over: half of the light passes")
        share = 0.5
    if not isinstance(color, tuple) and color != base and has_picture:
        _choose(material.node_tree, shader, base, color)
        rows = {"rows": [[REFLECTED] * 3, [PASSED] * 3], mixes.PASSES: share}
        trees.settle(material, **{mixes.WANTED: {"Base Color": rows}})
        color = None
    elif not isinstance(color, tuple):
        color = None if color == base else _mean(material, color, report)
    trees.settle(material, translucency=(share, color))


def _mean(material, color, report):
    """The mean of a picture's colour; None where a tree changes it."""
    pixels = _pixels(color)
    report.warn(material.name, MEAN if pixels is not None else BASE)
    return None if pixels is None else tuple(float(c) for c in np.clip(pixels.mean(0), 0, 1))


def _differ_with_view(*values):
    nodes = set()
    for value in values:
        if isinstance(value, bpy.types.NodeSocket):
            nodes.add(value.node)
            for entry in value.node.inputs:
                trees.upstream(entry, nodes)
    inner = (n for node in nodes if getattr(node, "node_tree", None) for _, n in trees.nodes_with_trees(node.node_tree, views.DIRECTED))
    return any(node.bl_idname in views.DIRECTED and _is_directed(node) for node in [*nodes, *inner])


def _is_directed(node):
    return any(out.is_linked and out.name in views.DIRECTED[node.bl_idname] for out in node.outputs)


def _varied(tree, base, color, weight, share):
    """Both colours, each times its varying share over the even one."""
    rest = _node(tree, "Math", "SUBTRACT", 1.0, weight)
    reflected = _scaled(tree, base, _node(tree, "Math", "DIVIDE", rest, max(1 - share, 1e-6)))
    return reflected, _scaled(tree, color, _node(tree, "Math", "DIVIDE", weight, max(share, 1e-6)))


def _scaled(tree, color, factor):
    return _node(tree, "VectorMath", "MULTIPLY", color, factor)


def _node(tree, kind, operation, first, second):
    node = tree.nodes.new(f"ShaderNode{kind}")
    node.operation = operation
    for entry, value in zip(node.inputs, (first, second)):
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, entry)
        else:
            entry.default_value = value
    return node.outputs[0]


def _choose(tree, shader, reflected, passed):
    """Feeds the base colour by what is reflected, or by what passes while that is baked."""
    node, row = tree.nodes.new("ShaderNodeMix"), tree.nodes.new("ShaderNodeValue")
    node.data_type = "RGBA"
    row.outputs[0].default_value = 0.0
    row[shaders.BY_COSINE] = [0.0, 1.0, *[0.0] * (views.ROWS - 1)]
    inputs = {entry.identifier: entry for entry in node.inputs}
    tree.links.new(row.outputs[0], inputs["Factor_Float"])
    for entry, value in ((inputs["A_Color"], reflected), (inputs["B_Color"], passed)):
        if isinstance(value, tuple):
            entry.default_value = (*value, 1.0)
        else:
            tree.links.new(value, entry)
    result = next(out for out in node.outputs if out.identifier == "Result_Color")
    tree.links.new(result, shader.inputs["Base Color"])
