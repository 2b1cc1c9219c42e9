"""Node trees that only change pictures on their way: they are baked over the unit square of texture coordinates, so that the
results repeat as the pictures do, are as sharp, and serve all meshes."""

import bpy

from . import pictures, shaders

# Nodes whose outputs follow from their inputs alone.
PURE = {
    f"ShaderNode{kind}"
    for kind in (
        "Math", "VectorMath", "Mix", "MixRGB", "HueSaturation", "BrightContrast", "Gamma", "RGBCurve", "VectorCurve",
        "FloatCurve", "ValToRGB", "Invert", "SeparateColor", "CombineColor", "SeparateRGB", "CombineRGB", "SeparateXYZ",
        "CombineXYZ", "RGBToBW", "Clamp", "MapRange", "RGB", "Value", "Blackbody",
    )
}  # fmt: skip
# What groups of them consist of.
IN_GROUPS = PURE | {"NodeGroupInput", "NodeGroupOutput", "NodeReroute", "NodeFrame"}

# Largest edge of the results.
WIDEST = 4096


class Tiles:
    """What a tree looks up: the name of its texture coordinates (empty for those that are active), and the size of a picture
    that holds all of it."""

    def __init__(self):
        self.uv = None
        self.size = 0

    def add(self, socket):
        """Adds what feeds an input; false if it is more than changed pictures."""
        source = shaders.source(socket)
        if source is None:
            return not socket.is_linked
        node = source.node
        if node.mute:
            return False
        if node.bl_idname == "ShaderNodeTexImage":
            return self._add_picture(node)
        return node.bl_idname in PURE and all(self.add(i) for i in node.inputs if i.enabled)

    def _add_picture(self, node):
        image = node.image
        is_plain = image is not None and image.source in ("FILE", "GENERATED") and image.size[0]
        if not is_plain or node.projection != "FLAT" or node.extension != "REPEAT":
            return False
        found = _lookup(node.inputs["Vector"])
        if found is None or self.uv not in (None, found[0]):
            return False
        self.uv = found[0]
        self.size = max(self.size, *(int(n * found[1]) for n in image.size))
        return True


def _lookup(vector):
    """The name of the texture coordinates and how often the picture repeats over the unit square; None if it doesn't."""
    source = shaders.source(vector)
    if source is None:
        return None if vector.is_linked else ("", 1)
    node = source.node
    if node.bl_idname == "ShaderNodeUVMap":
        return None if node.from_instancer else (node.uv_map, 1)
    if node.bl_idname == "ShaderNodeTexCoord":
        return ("", 1) if source.name == "UV" else None
    if node.bl_idname != "ShaderNodeMapping" or node.mute or node.vector_type != "POINT":
        return None
    rotation, scale = (shaders.constant(node.inputs[n]) for n in ("Rotation", "Scale"))
    if shaders.constant(node.inputs["Location"]) is None or rotation != (0.0, 0.0, 0.0) or scale is None:
        return None
    times = [abs(s) for s in scale[:2]]
    if any(t < 1 or abs(t - round(t)) > 1e-6 for t in times) or not node.inputs["Vector"].is_linked:
        return None
    before = _lookup(node.inputs["Vector"])
    return (before[0], before[1] * max(times)) if before else None


def tiles(node, names):
    """What the inputs of a shader look up together; None if one of them is more than changed pictures."""
    found = Tiles()
    is_flat = all(pictures.INPUTS[n] != pictures.NORMAL and found.add(node.inputs[n]) for n in names)
    if not is_flat or found.size == 0:
        return None
    # Twice as fine, where that is little: what is interpolated once more is softer.
    found.size = min(found.size * 2 if found.size <= 1024 else found.size, WIDEST)
    return found


def square(material, uv):
    """An object that shows the unit square of texture coordinates."""
    mesh = bpy.data.meshes.new("oscura square")
    corners = ((0, 0), (1, 0), (1, 1), (0, 1))
    mesh.from_pydata([(x, y, 0) for x, y in corners], [], [(0, 1, 2, 3)])
    layer = mesh.uv_layers.new(name=uv or "UVMap")
    for loop, corner in zip(layer.data, corners):
        loop.uv = corner
    mesh.materials.append(material)
    return bpy.data.objects.new("oscura square", mesh)
