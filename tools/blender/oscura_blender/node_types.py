"""How nodes of each type are written to scene files, but for shaders (`closures.py`)."""

import bpy

from . import image_files, mesh_files

# Samples of curves and color ramps that are written as tables.
SAMPLES = 256

# Color spaces of images, by their names in Blender.
COLOR_SPACES = {
    "sRGB": "srgb", "Non-Color": "non-color", "Raw": "non-color", "Generic Data": "non-color", "Linear Rec.709": "linear", "Linear": "linear",
}  # fmt: skip

# Names of sockets that differ from Blender's, which are "Fac" or "Factor" depending on the version.
SOCKET_NAMES = {"Fac": "factor", "Val": "value", "Bright": "brightness"}


class Unsupported(Exception):
    """A node, one of its modes or one of its outputs that oscura can't evaluate."""


def _key(name):
    return SOCKET_NAMES.get(name, name.lower().replace(" ", "_"))


def _sockets(text):
    """Names in scene files by names or identifiers in Blender: the same in lower case unless it says "Name=key"."""
    pairs = (entry.strip().partition("=") for entry in text.split(",") if entry.strip())
    return {name: key or _key(name) for name, _, key in pairs}


class NodeType:
    """A node type of scene files: its inputs, outputs and settings, which are properties of the node in Blender. Sockets that are not listed have no
    counterpart. `extra` returns more settings; a vector input without a link is the texture coordinate `implicit`."""

    def __init__(self, name, inputs="", outputs="", settings="", extra=None, implicit="generated"):
        self.name, self.inputs, self.outputs, self.settings = name, _sockets(inputs), _sockets(outputs), _sockets(settings)
        self.extra, self.implicit = extra, implicit

    def entries(self, graph, node, groups):
        if getattr(node, "from_instancer", False):
            raise Unsupported(f"{node.bl_label} of the instancer")
        entries = {"type": self.name}
        for key, name in self.settings.items():
            value = getattr(node, key)
            entries[name] = value.lower() if node.bl_rna.properties[key].type == "ENUM" else value
        more = self.extra(graph, node) or {} if self.extra is not None else {}
        for socket in node.inputs:
            name = self.inputs.get(socket.identifier, self.inputs.get(socket.name))
            if socket.enabled and name is not None:
                graph.put(entries, name, socket, groups, self.implicit)
            elif socket.enabled and socket.is_linked:
                raise Unsupported(f"{socket.name} of {node.bl_label}")
        return {**entries, **more}


def entries(graph, node, groups):
    """The entries of a node, whose inputs are added to a graph."""
    if node.bl_idname not in NODE_TYPES:
        raise Unsupported(node.bl_label)
    return NODE_TYPES[node.bl_idname].entries(graph, node, groups)


def output_name(node, output):
    """The name of an output in scene files."""
    outputs = NODE_TYPES[node.bl_idname].outputs
    name = outputs.get(output.identifier, outputs.get(output.name))
    if name is None:
        raise Unsupported(f"{output.name} of {node.bl_label}")
    return name


# Settings that are more than a property. Functions return further entries, or None.


def _mix(_graph, node):
    if node.data_type not in ("FLOAT", "VECTOR", "RGBA"):
        raise Unsupported(f"{node.bl_label} of {node.data_type}")
    if node.data_type == "RGBA":
        return {"blend_type": node.blend_type.lower(), "clamp_result": node.clamp_result}
    return {"factor_mode": "non_uniform"} if node.data_type == "VECTOR" and node.factor_mode == "NON_UNIFORM" else None


def _mix_rgb(_graph, node):
    return {"data_type": "rgba", "blend_type": node.blend_type.lower(), "clamp_result": node.use_clamp}


def _geometry(graph, node):
    for output, name in (("Pointiness", "pointiness"), ("Random Per Island", "random_per_island")):
        if any(link.is_valid for link in node.outputs[output].links):
            graph.attributes.add(name)


def _ambient_occlusion(_graph, node):
    """A distance of 0 is that of the world, 10 m by default."""
    distance, world = node.inputs["Distance"], bpy.context.scene.world
    if distance.is_linked or distance.default_value != 0.0:
        return None
    return {"distance": float(world.light_settings.distance) if world is not None else 10.0}


def _color_ramp(_graph, node):
    """Stops; a table for other interpolations and color modes."""
    ramp = node.color_ramp
    if ramp.color_mode == "RGB" and ramp.interpolation in ("LINEAR", "CONSTANT"):
        stops = sorted(([e.position, *e.color] for e in ramp.elements), key=lambda stop: stop[0])
        return {"stops": stops, "interpolation": ramp.interpolation.lower()}
    return {"stops": [[i / SAMPLES, *ramp.evaluate(i / SAMPLES)] for i in range(SAMPLES + 1)], "interpolation": "linear"}


def _curves(_graph, node):
    """Curves as a table. The fourth of RGB Curves is the combined one, which comes before the others."""
    mapping = node.mapping
    mapping.initialize()
    is_rgb = node.bl_idname == "ShaderNodeRGBCurve"
    curves = list(mapping.curves)[:3]
    points = [p.location[0] for curve in curves for p in curve.points]
    low, high = min(points), max(points)
    combined = (lambda x: mapping.evaluate(mapping.curves[3], x)) if is_rgb else lambda x: x
    positions = [combined(low + (high - low) * i / SAMPLES) for i in range(SAMPLES + 1)]
    table = [[mapping.evaluate(curve, x) for curve in curves] for x in positions]
    return {"table": table, "min": low, "max": high, "extrapolate": mapping.extend == "EXTRAPOLATED"}


def _texture_coordinate(graph, node):
    if any(link.is_valid for link in node.outputs["Generated"].links):
        graph.attributes.add(mesh_files.GENERATED)
    if node.object is None:
        return None
    inverse = node.object.matrix_world.inverted_safe()
    return {"object_matrix": [float(x) for row in list(inverse)[:3] for x in row]}


def _uv_map(graph, node):
    """UV Map and Normal Map."""
    if node.uv_map and getattr(node, "space", "TANGENT") == "TANGENT":
        graph.attributes.add(node.uv_map)


def _attribute(graph, node):
    if node.attribute_type != "GEOMETRY" or not node.attribute_name:
        raise Unsupported(f"{node.bl_label} of {node.attribute_type.lower()} '{node.attribute_name}'")
    graph.attributes.add(node.attribute_name)


def _color_attribute(graph, node):
    if not node.layer_name:
        raise Unsupported(f"{node.bl_label} without a name")
    graph.attributes.add(node.layer_name)


def _object_info(graph, _node):
    graph.reads_object = True


def _tangent(graph, node):
    if node.direction_type == "UV_MAP" and node.uv_map:
        graph.baker.warn(f"{node.bl_label} of the UV map '{node.uv_map}' is that of the active one")


def _bump(_graph, node):
    width = node.inputs.get("Filter Width")  # since Blender 4.3
    return {"filter_width": float(width.default_value)} if width is not None else None


def _normal(_graph, node):
    return {"direction": [float(x) for x in node.outputs[0].default_value]}


def is_tiled(node):
    """Does an image texture have an image of tiles (UDIM), in a known color space?"""
    if node.bl_idname != "ShaderNodeTexImage" or node.image is None:
        return False
    return node.image.source == "TILED" and node.image.colorspace_settings.name in COLOR_SPACES


def _image(graph, node):
    image, file = node.image, None
    if image is None:
        return image_settings(node, graph.images.missing())
    if image.source == "SEQUENCE":
        file = graph.images.frame(image, node.image_user)
    elif image.source in ("FILE", "GENERATED"):
        file = graph.images.file(image)
    if file is None and image_files.is_missing(image):
        file = graph.images.missing()
    return image_settings(node, file)


def image_settings(node, file):
    """The settings of an image or environment texture with a file; without an image, that of a missing one."""
    image = node.image
    if file is None:
        raise Unsupported(f"the image '{image.name}'")
    color_space = "sRGB" if image is None else image.colorspace_settings.name
    if color_space not in COLOR_SPACES:
        raise Unsupported(f"the color space {color_space}")
    settings = {"file": file, "color_space": COLOR_SPACES[color_space]}
    keys = ("interpolation", "extension", "projection")
    settings.update({key: getattr(node, key).lower() for key in keys if hasattr(node, key)})
    if node.bl_idname == "ShaderNodeTexImage":
        settings["alpha_mode"] = "straight" if image is None else image.alpha_mode.lower()
    if node.projection == "BOX":
        settings["blend"] = node.projection_blend
    return settings


def _environment(graph, node):
    return image_settings(node, graph.images.file(node.image) if node.image.source in ("FILE", "GENERATED") else None)


FACTOR = "Color, Fac, Factor"
RAYS = ", ".join(f"Is {kind} Ray" for kind in "Camera,Shadow,Diffuse,Glossy,Singular,Reflection,Transmission,Volume Scatter".split(","))
GEOMETRY = "Position, Normal, Tangent, True Normal, Incoming, Parametric, Backfacing, Pointiness, Random Per Island"
VORONOI = "Vector, W, Scale, Detail, Roughness, Lacunarity, Smoothness, Exponent, Randomness"
GABOR = "Vector, Scale, Frequency, Anisotropy, Orientation 2D, Orientation 3D"
WAVE = "Vector, Scale, Distortion, Detail, Detail Scale, Detail Roughness, Phase Offset"
BRICK = "Vector, Color1, Color2, Mortar, Scale, Mortar Size, Mortar Smooth, Bias, Brick Width, Row Height"
NOISE = "Vector, W, Scale, Detail, Roughness, Lacunarity, Offset, Gain, Distortion"
MAP_RANGE = "Value, Vector=value, From Min, From Max, To Min, To Max, Steps"
MIX = "Factor_Float=factor, Factor_Vector, A_Float=a, B_Float=b, A_Vector=a, B_Vector=b, A_Color=a, B_Color=b"
COORDINATES = "Generated, Normal, UV, Object, Camera, Window, Reflection"

NODE_TYPES = {
    "ShaderNodeMath": NodeType("math", "Value=a, Value_001=b, Value_002=c", "Value", "operation, use_clamp"),
    "ShaderNodeVectorMath": NodeType("vector_math", "Vector=a, Vector_001=b, Vector_002=c, Scale", "Vector, Value", "operation"),
    "ShaderNodeClamp": NodeType("clamp", "Value, Min, Max", "Result", "clamp_type"),
    "ShaderNodeMapping": NodeType("mapping", "Vector, Location, Rotation, Scale", "Vector", "vector_type"),
    "ShaderNodeVectorRotate": NodeType("vector_rotate", "Vector, Center, Axis, Angle, Rotation", "Vector", "rotation_type, invert"),
    "ShaderNodeVectorTransform": NodeType("vector_transform", "Vector", "Vector", "vector_type, convert_from, convert_to"),
    "ShaderNodeCombineXYZ": NodeType("combine_xyz", "X, Y, Z", "Vector"),
    "ShaderNodeSeparateXYZ": NodeType("separate_xyz", "Vector", "X, Y, Z"),
    "ShaderNodeCombineColor": NodeType("combine_color", "Red, Green, Blue", "Color", "mode"),
    "ShaderNodeSeparateColor": NodeType("separate_color", "Color", "Red, Green, Blue", "mode"),
    "ShaderNodeHueSaturation": NodeType("hue_saturation", "Hue, Saturation, Value, Fac, Factor, Color", "Color"),
    "ShaderNodeBrightContrast": NodeType("brightness_contrast", "Color, Bright, Brightness, Contrast", "Color"),
    "ShaderNodeGamma": NodeType("gamma", "Color, Gamma", "Color"),
    "ShaderNodeInvert": NodeType("invert", "Fac, Factor, Color", "Color"),
    "ShaderNodeRGBToBW": NodeType("rgb_to_bw", "Color", "Val, Value"),
    "ShaderNodeTexNoise": NodeType("noise_texture", NOISE, FACTOR, "noise_type, normalize, noise_dimensions=dimensions"),
    "ShaderNodeTexVoronoi": NodeType(
        "voronoi_texture", VORONOI, "Distance, Color, Position, W, Radius", "distance, feature, normalize, voronoi_dimensions=dimensions"
    ),
    "ShaderNodeTexWave": NodeType("wave_texture", WAVE, FACTOR, "wave_type, bands_direction, rings_direction, wave_profile"),
    "ShaderNodeTexMagic": NodeType("magic_texture", "Vector, Scale, Distortion", FACTOR, "turbulence_depth"),
    "ShaderNodeTexGradient": NodeType("gradient_texture", "Vector", FACTOR, "gradient_type"),
    "ShaderNodeTexChecker": NodeType("checker_texture", "Vector, Scale, Color1, Color2", FACTOR),
    "ShaderNodeTexBrick": NodeType("brick_texture", BRICK, FACTOR, "offset, offset_frequency, squash, squash_frequency"),
    "ShaderNodeTexWhiteNoise": NodeType("white_noise", "Vector, W", "Value, Color", "noise_dimensions=dimensions"),
    "ShaderNodeTexGabor": NodeType("gabor_texture", GABOR, "Value, Phase, Intensity", "gabor_type=dimensions"),
    "ShaderNodeAmbientOcclusion": NodeType(
        "ambient_occlusion", "Color, Distance, Normal", "Color, AO", "samples, inside, only_local", _ambient_occlusion
    ),
    "ShaderNodeBevel": NodeType("bevel", "Radius, Normal", "Normal", "samples"),
    "ShaderNodeFresnel": NodeType("fresnel", "IOR, Normal", "Fac, Factor"),
    "ShaderNodeLayerWeight": NodeType("layer_weight", "Blend, Normal", "Fresnel, Facing"),
    "ShaderNodeBlackbody": NodeType("blackbody", "Temperature", "Color"),
    "ShaderNodeWavelength": NodeType("wavelength", "Wavelength", "Color"),
    "ShaderNodeNewGeometry": NodeType("geometry", "", GEOMETRY, "", _geometry),
    "ShaderNodeWireframe": NodeType("wireframe", "Size", FACTOR, "use_pixel_size"),
    "ShaderNodeLightPath": NodeType("light_path", "", f"{RAYS}, Ray Length, Ray Depth"),
    "ShaderNodeCameraData": NodeType("camera_data", "", "View Vector, View Z Depth, View Distance"),
    "ShaderNodeMapRange": NodeType("map_range", MAP_RANGE, "Result, Vector=result", "clamp, interpolation_type"),
    "ShaderNodeMix": NodeType("mix", MIX, "Result", "data_type, clamp_factor", _mix),
    "ShaderNodeMixRGB": NodeType("mix", "Fac, Factor, Color1=a, Color2=b", "Color=result", "", _mix_rgb),
    "ShaderNodeValToRGB": NodeType("color_ramp", "Fac, Factor", "Color, Alpha", "", _color_ramp),
    "ShaderNodeRGBCurve": NodeType("rgb_curves", "Fac, Factor, Color", "Color", "", _curves),
    "ShaderNodeVectorCurve": NodeType("vector_curves", "Fac, Factor, Vector", "Vector", "", _curves),
    "ShaderNodeFloatCurve": NodeType("float_curve", "Factor, Value", "Value", "", _curves),
    "ShaderNodeNormal": NodeType("normal", "Normal", "Normal, Dot", "", _normal),
    "ShaderNodeNormalMap": NodeType("normal_map", "Strength, Color", "Normal", "space, uv_map", _uv_map),
    "ShaderNodeBump": NodeType("bump", "Strength, Distance, Height, Normal", "Normal", "invert", _bump),
    "ShaderNodeTangent": NodeType("tangent", "", "Tangent", "direction_type, axis", _tangent),
    "ShaderNodeUVMap": NodeType("uv_map", "", "UV", "uv_map=name", _uv_map),
    "ShaderNodeAttribute": NodeType("attribute", "", "Color, Vector, Fac, Factor, Alpha", "attribute_name=name", _attribute),
    "ShaderNodeVertexColor": NodeType("color_attribute", "", "Color, Alpha", "layer_name=name", _color_attribute),
    "ShaderNodeObjectInfo": NodeType("object_info", "", "Location, Color, Alpha, Object Index, Material Index, Random", "", _object_info),
    "ShaderNodeTexCoord": NodeType("texture_coordinate", "", COORDINATES, "", _texture_coordinate),
    "ShaderNodeTexImage": NodeType("image_texture", "Vector", "Color, Alpha", "", _image, "uv"),
    "ShaderNodeTexEnvironment": NodeType("environment_texture", "Vector", "Color", "", _environment, "position"),
}
