"""Between which numbers an input of a node lies, as far as arithmetic tells: enough to know which part of a mix counts."""

import math

from . import shaders

ALL = (-math.inf, math.inf)

# Nodes whose outputs lie between 0 and 1.
SHARES = ("ShaderNodeFresnel", "ShaderNodeLayerWeight")


def of(socket):
    """The least and the largest number that an input can have."""
    value = shaders.constant(socket)
    if isinstance(value, float):
        return value, value
    source = shaders.source(socket)
    node = source.node if source is not None else None
    if node is None or node.mute:
        return ALL
    if node.bl_idname in SHARES:
        return 0.0, 1.0
    if node.bl_idname != "ShaderNodeMath":
        return ALL
    low, high = _calculated(node)
    return (min(max(low, 0.0), 1.0), min(max(high, 0.0), 1.0)) if node.use_clamp else (low, high)


def _calculated(node):
    (a, b), (c, d) = of(node.inputs[0]), of(node.inputs[1])
    match node.operation:
        case "ADD":
            return a + c, b + d
        case "SUBTRACT":
            return a - d, b - c
        case "MULTIPLY":
            products = [0.0 if 0.0 in (x, y) else x * y for x in (a, b) for y in (c, d)]
            return min(products), max(products)
        case "MAXIMUM":
            return max(a, c), max(b, d)
        case "MINIMUM":
            return min(a, c), min(b, d)
        case "GREATER_THAN" | "LESS_THAN" | "COMPARE":
            return 0.0, 1.0
    return ALL
