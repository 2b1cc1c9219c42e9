"""Sources of inputs: links are followed through reroutes, muted nodes and groups, and constant values are computed."""

import bpy

from . import cycles, image_files

# Nodes that hold a value.
VALUE_NODES = ("ShaderNodeValue", "ShaderNodeRGB")

# Cycles doesn't have this node: inputs linked to it have their own value.
SHADER_TO_RGB = "ShaderNodeShaderToRGB"

# Weights of RGB in the luminance of a color, as in Cycles.
LUMINANCE = (0.2126729, 0.7151522, 0.0721750)


class Source:
    """The source of an input: an output with the group nodes around it, outermost first, or a value of a socket type, which is the default of an
    input without a link, or that of a node."""

    def __init__(self, output=None, groups=(), value=None, type=None, is_default=False):
        self.output, self.groups, self.value, self.type, self.is_default = output, groups, value, type, is_default

    @property
    def node(self):
        return self.output.node if self.output is not None else None


def follow(socket, groups=()):
    """The source of an input within groups. As in Cycles, an input has its own value where the last node has no source, such as a muted one."""
    while True:
        links = [link for link in socket.links if not link.is_muted and link.is_valid]
        own = Source(value=default(socket), groups=groups, type=socket.type, is_default=True)
        if not links:
            return own
        output = links[0].from_socket
        node = output.node
        if node.mute and node.bl_idname != "NodeReroute":
            socket = next((link.from_socket for link in node.internal_links if link.to_socket == output), None)
        elif node.bl_idname == "NodeReroute":
            socket = node.inputs[0]
        elif node.bl_idname == "NodeGroupInput":
            socket = _by_identifier(groups[-1].inputs, output) if groups else None
            groups = groups[:-1]
        elif node.bl_idname == "ShaderNodeGroup":
            nodes = node.node_tree.nodes if node.node_tree else ()
            end = next((n for n in nodes if n.bl_idname == "NodeGroupOutput" and n.is_active_output), None)
            socket, groups = _by_identifier(end.inputs, output) if end else None, (*groups, node)
        elif node.bl_idname == SHADER_TO_RGB:
            return own
        elif node.bl_idname in ("ShaderNodeTexImage", "ShaderNodeTexEnvironment") and _is_uniform(node):
            return Source(value=_without_image(output), groups=groups, type=output.type)
        else:
            return Source(output, groups)
        if socket is None:
            return own


def _by_identifier(sockets, wanted):
    return next((socket for socket in sockets if socket.identifier == wanted.identifier), None)


def linked(socket):
    """The output that an input is linked to, past reroutes; None without a link."""
    while socket.is_linked:
        link = socket.links[0]
        if link.is_muted:
            return None
        if link.from_node.bl_idname != "NodeReroute":
            return link.from_socket
        socket = link.from_node.inputs[0]
    return None


def output_node(tree):
    """The active output node of a material, light or world for Cycles; None without one."""
    return tree.get_output_node("CYCLES") or tree.get_output_node("ALL") if tree is not None else None


def default(socket):
    """The default value of a socket: a number or a list of three; None for other types."""
    if socket.type == "SHADER" or not hasattr(socket, "default_value"):
        return None
    value = socket.default_value
    return float(value) if isinstance(value, (int, float)) else [float(x) for x in tuple(value)[:3]]


def converted(value, socket_type, to):
    """A value converted from a type of sockets to another: to numbers, colors by their luminance and vectors by their mean."""
    if to != "VALUE" or not isinstance(value, list):
        return value
    weights = LUMINANCE if socket_type == "RGBA" else (1 / 3, 1 / 3, 1 / 3)
    return sum(weight * part for weight, part in zip(weights, value, strict=True))


def zero(output):
    """The value of an output without a source; None of shaders."""
    return None if output.type == "SHADER" else 0.0 if output.type == "VALUE" else [0.0, 0.0, 0.0]


def as_triple(value):
    return [value] * 3 if isinstance(value, (int, float)) else value


def is_number(value, number):
    """Are all parts of a value this number?"""
    return isinstance(value, (int, float, list)) and all(part == number for part in as_triple(value))


def _is_uniform(node):
    """Is an image texture the same everywhere since it has no image? With the extension Clip a missing one is visible in its square only."""
    is_missing = node.image is None or image_files.is_missing(node.image)
    return is_missing and getattr(node, "extension", "") != "CLIP"


def _without_image(output):
    """The value of an image texture without an image or with a missing file: magenta, as in Cycles."""
    return 1.0 if output.type == "VALUE" else [1.0, 0.0, 1.0]


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


def constant(socket, groups=()):
    """The value of an input, a number or a list of three, where it doesn't vary; otherwise None."""
    source = follow(socket, groups)
    node = source.node
    if node is None:
        # Inputs of a group are unknown without the group node.
        is_known = source.type is not None and source.value is not None
        return converted(source.value, source.type, socket.type) if is_known else None
    if node.bl_idname in VALUE_NODES:
        return converted(default(source.output), source.output.type, socket.type)
    if node.bl_idname == "ShaderNodeCombineXYZ":
        parts = [constant(entry, source.groups) for entry in node.inputs]
        return None if None in parts else converted(parts, "VECTOR", socket.type)
    if node.bl_idname == "ShaderNodeBlackbody":
        temperature = constant(node.inputs[0], source.groups)
        return None if temperature is None else converted(blackbody(temperature), "RGBA", socket.type)
    if node.bl_idname == "ShaderNodeMath" and node.operation in _MATH:
        a, b = (constant(node.inputs[i], source.groups) for i in (0, 1))
        if node.operation == "MULTIPLY" and 0.0 in (a, b):
            return 0.0
        if a is None or b is None:
            return None
        result = _MATH[node.operation](float(a), float(b))
        return min(max(result, 0.0), 1.0) if node.use_clamp else result
    return None


def blackbody(temperature):
    """The color of a black body of a temperature in kelvin, by Blender."""
    light = bpy.data.lights.new("oscura", "POINT")
    try:
        if not hasattr(light, "temperature_color"):
            return _rendered_blackbody(temperature)
        light.use_temperature = True  # otherwise the color is white
        light.temperature = temperature
        return list(light.temperature_color)
    finally:
        bpy.data.lights.remove(light)


def _rendered_blackbody(temperature):
    """The same before Blender 4.5, where lights have no temperature: a world of that color is rendered."""
    world = bpy.data.worlds.new("oscura body")
    world.use_nodes = True
    node = world.node_tree.nodes.new("ShaderNodeBlackbody")
    node.inputs[0].default_value = temperature
    world.node_tree.links.new(node.outputs[0], world.node_tree.nodes["Background"].inputs["Color"])
    with cycles.world_scene(world) as scene:
        cycles.add_orthographic_camera(scene, 1.0)
        cycles.set_up(scene, (4, 4), 1)
        return [float(c) for c in cycles.render(scene)[2, 2]]
