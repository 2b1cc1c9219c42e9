"""Values of node trees that are the same everywhere."""

import bpy

from . import stills

_MATH = {
    "ADD": lambda a, b: a + b,
    "SUBTRACT": lambda a, b: a - b,
    "MULTIPLY": lambda a, b: a * b,
    "DIVIDE": lambda a, b: a / b if b else 0.0,
    "POWER": lambda a, b: a**b if a >= 0 else 0.0,
    "MINIMUM": min,
    "MAXIMUM": max,
    "GREATER_THAN": lambda a, b: float(a > b),
    "LESS_THAN": lambda a, b: float(a < b),
}


def source(socket):
    """The socket that feeds an input, past reroutes; None without a link."""
    while socket.is_linked:
        link = socket.links[0]
        if link.is_muted:
            return None
        if link.from_node.bl_idname != "NodeReroute":
            return link.from_socket
        socket = link.from_node.inputs[0]
    return None


def constant(socket):
    """The value of an input (a number, or a tuple of three) if it is the same everywhere, else None."""
    feeding = source(socket)
    if feeding is None:
        return None if socket.is_linked else _plain(socket.default_value)
    node = feeding.node
    if node.mute:
        return None
    if node.bl_idname in ("ShaderNodeRGB", "ShaderNodeValue"):
        return as_type(_plain(feeding.default_value), socket.type in ("RGBA", "VECTOR"))
    if node.bl_idname == "ShaderNodeCombineXYZ":
        parts = tuple(constant(entry) for entry in node.inputs)
        return None if None in parts else as_type(parts, socket.type in ("RGBA", "VECTOR"))
    if node.bl_idname == "ShaderNodeBlackbody":
        temperature = constant(node.inputs[0])
        return None if temperature is None else blackbody(temperature)
    if node.bl_idname == "ShaderNodeMath" and node.operation in _MATH:
        a, b = (constant(node.inputs[i]) for i in (0, 1))
        if node.operation == "MULTIPLY" and 0.0 in (a, b):
            return 0.0
        if a is None or b is None:
            return None
        result = _MATH[node.operation](float(a), float(b))
        return min(max(result, 0.0), 1.0) if node.use_clamp else result
    return None


def _plain(value):
    return float(value) if isinstance(value, (int, float)) else tuple(value)[:3]


def as_type(value, is_triple):
    """A number or a triple, as it is wanted."""
    if not is_triple and isinstance(value, tuple):
        return 0.2126 * value[0] + 0.7152 * value[1] + 0.0722 * value[2]
    return (value,) * 3 if is_triple and isinstance(value, float) else value


def blackbody(temperature):
    """The colour of a black body in kelvin, as Blender has it."""
    light = bpy.data.lights.new("oscura", "POINT")
    try:
        if not hasattr(light, "temperature_color"):
            return _evaluated_blackbody(temperature)
        # Lights are white until they are told to have a temperature.
        light.use_temperature = True
        light.temperature = temperature
        return tuple(light.temperature_color)
    finally:
        bpy.data.lights.remove(light)


def _evaluated_blackbody(temperature):
    """The same where lights don't tell it (before Blender 4.5): a world of that colour."""
    world = bpy.data.worlds.new("oscura body")
    world.use_nodes = True
    body = world.node_tree.nodes.new("ShaderNodeBlackbody")
    body.inputs[0].default_value = temperature
    world.node_tree.links.new(body.outputs[0], world.node_tree.nodes["Background"].inputs["Color"])
    with stills.around(world) as scene:
        stills.look_along(scene, 1.0)
        stills.prepare(scene, (4, 4), 1)
        return tuple(float(c) for c in stills.shown(scene)[2, 2])


def end(tree):
    """The output of a material, a light or a world in Cycles; None without one."""
    return tree.get_output_node("CYCLES") or tree.get_output_node("ALL")


def output(tree):
    """The node that feeds the surface of a material, a light or a world in Cycles; None without one."""
    node = end(tree)
    feeding = source(node.inputs["Surface"]) if node else None
    return feeding.node if feeding else None


def feed(tree, socket, target):
    """Gives an input what another one has."""
    feeding = source(socket)
    if feeding is not None:
        tree.links.new(feeding, target)
        return
    value = socket.default_value
    is_color = target.type == "RGBA"
    target.default_value = (value,) * 3 + (1,) if isinstance(value, float) and is_color else value


def emission_of_light(tree):
    """Strength and colour of a light's node tree if it is one plain Emission, and the node of the profile (IES) that its
    strength is multiplied by, if there is one; else None."""
    node = output(tree)
    if node is None:
        return 0.0, (1.0,) * 3, None
    if node.bl_idname != "ShaderNodeEmission" or node.mute:
        return None
    color, strength, profile = constant(node.inputs["Color"]), constant(node.inputs["Strength"]), None
    if strength is None:
        strength, profile = _profiled(node.inputs["Strength"])
    return None if color is None or strength is None else (strength, color, profile)


def _profiled(socket):
    """A factor and the node of a profile, where a socket's value is their product; else twice None."""
    feeding = source(socket)
    node = feeding.node if feeding is not None else None
    if node is None or node.mute:
        return None, None
    if node.bl_idname == "ShaderNodeTexIES":
        return (constant(node.inputs["Strength"]), node) if source(node.inputs["Vector"]) is None else (None, None)
    if node.bl_idname == "ShaderNodeMath" and node.operation in ("MULTIPLY", "DIVIDE") and not node.use_clamp:
        first, second = node.inputs[0], node.inputs[1]
        for varying, other in ((first, second), (second, first)):
            factor, (strength, profile) = constant(other), _profiled(varying)
            if factor is None or strength is None or (node.operation == "DIVIDE" and (varying != first or factor == 0)):
                continue
            return strength * factor if node.operation == "MULTIPLY" else strength / factor, profile
    return None, None
