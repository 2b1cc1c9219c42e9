"""Node trees as graphs that oscura evaluates: each node of Blender becomes one of the scene file, with groups, reroutes and muted
nodes resolved. Nodes without a counterpart are baked (`bakes.py`), and shaders without one become the most similar one."""

from . import bakes, facets, image_files, mesh_files, shaders


class Unsupported(Exception):
    """A node, or a mode of it, that oscura can't evaluate."""


class Kind:
    """How a node is written: its type, its inputs and outputs by Blender's identifiers, its settings by Blender's properties."""

    def __init__(self, name, inputs, outputs, settings=(), **renamed):
        self.name, self.inputs, self.outputs = name, inputs, outputs
        self.settings = {**{key: key for key in settings}, **renamed}


def _same(*names):
    """Sockets whose names here are Blender's in lower case."""
    return {name: name.lower().replace(" ", "_") for name in names}


COORDINATES = "texture_coordinate"

# Inputs of the node Mapping by the properties of a mapping that a texture node has of its own.
MAPPING = {"location": "translation", "rotation": "rotation", "scale": "scale"}

FACTOR = {"Color": "color", "Fac": "factor", "Factor": "factor"}
TEXTURE = {"Vector": "vector", "Scale": "scale"}

KINDS = {
    "ShaderNodeMath": Kind("math", {"Value": "a", "Value_001": "b", "Value_002": "c"}, {"Value": "value"}, ("operation", "use_clamp")),
    "ShaderNodeVectorMath": Kind(
        "vector_math",
        {"Vector": "a", "Vector_001": "b", "Vector_002": "c", "Scale": "scale"},
        {"Vector": "vector", "Value": "value"},
        ("operation",),
    ),
    "ShaderNodeClamp": Kind("clamp", _same("Value", "Min", "Max"), {"Result": "result"}, ("clamp_type",)),
    "ShaderNodeMapping": Kind("mapping", _same("Vector", "Location", "Rotation", "Scale"), {"Vector": "vector"}, ("vector_type",)),
    "ShaderNodeVectorRotate": Kind(
        "vector_rotate", _same("Vector", "Center", "Axis", "Angle", "Rotation"), {"Vector": "vector"}, ("rotation_type", "invert")
    ),
    "ShaderNodeCombineXYZ": Kind("combine_xyz", _same("X", "Y", "Z"), {"Vector": "vector"}),
    "ShaderNodeSeparateXYZ": Kind("separate_xyz", _same("Vector"), _same("X", "Y", "Z")),
    "ShaderNodeCombineColor": Kind("combine_color", _same("Red", "Green", "Blue"), {"Color": "color"}, ("mode",)),
    "ShaderNodeSeparateColor": Kind("separate_color", _same("Color"), _same("Red", "Green", "Blue"), ("mode",)),
    "ShaderNodeCombineRGB": Kind("combine_color", {"R": "red", "G": "green", "B": "blue"}, {"Image": "color"}),
    "ShaderNodeSeparateRGB": Kind("separate_color", {"Image": "color"}, {"R": "red", "G": "green", "B": "blue"}),
    "ShaderNodeHueSaturation": Kind(
        "hue_saturation", {**_same("Hue", "Saturation", "Value", "Color"), "Fac": "factor", "Factor": "factor"}, {"Color": "color"}
    ),
    "ShaderNodeBrightContrast": Kind(
        "brightness_contrast", {"Color": "color", "Bright": "brightness", "Brightness": "brightness", "Contrast": "contrast"}, {"Color": "color"}
    ),
    "ShaderNodeGamma": Kind("gamma", _same("Color", "Gamma"), {"Color": "color"}),
    "ShaderNodeInvert": Kind("invert", {"Fac": "factor", "Factor": "factor", "Color": "color"}, {"Color": "color"}),
    "ShaderNodeRGBToBW": Kind("rgb_to_bw", _same("Color"), {"Val": "value", "Value": "value"}),
    "ShaderNodeTexNoise": Kind(
        "noise_texture",
        {**TEXTURE, **_same("W", "Detail", "Roughness", "Lacunarity", "Offset", "Gain", "Distortion")},
        FACTOR,
        ("noise_type", "normalize"),
        noise_dimensions="dimensions",
    ),
    "ShaderNodeTexVoronoi": Kind(
        "voronoi_texture",
        {**TEXTURE, **_same("W", "Detail", "Roughness", "Lacunarity", "Smoothness", "Exponent", "Randomness")},
        _same("Distance", "Color", "Position", "W", "Radius"),
        ("distance", "feature", "normalize"),
        voronoi_dimensions="dimensions",
    ),
    "ShaderNodeTexWave": Kind(
        "wave_texture",
        {**TEXTURE, **_same("Distortion", "Detail", "Detail Scale", "Detail Roughness", "Phase Offset")},
        FACTOR,
        ("wave_type", "bands_direction", "rings_direction", "wave_profile"),
    ),
    "ShaderNodeTexMagic": Kind("magic_texture", {**TEXTURE, "Distortion": "distortion"}, FACTOR, ("turbulence_depth",)),
    "ShaderNodeTexGradient": Kind("gradient_texture", {"Vector": "vector"}, FACTOR, ("gradient_type",)),
    "ShaderNodeTexChecker": Kind("checker_texture", {**TEXTURE, **_same("Color1", "Color2")}, FACTOR),
    "ShaderNodeTexBrick": Kind(
        "brick_texture",
        {**TEXTURE, **_same("Color1", "Color2", "Mortar", "Mortar Size", "Mortar Smooth", "Bias", "Brick Width", "Row Height")},
        FACTOR,
        ("offset", "offset_frequency", "squash", "squash_frequency"),
    ),
    "ShaderNodeTexWhiteNoise": Kind("white_noise", {"Vector": "vector", "W": "w"}, _same("Value", "Color"), noise_dimensions="dimensions"),
    "ShaderNodeFresnel": Kind("fresnel", _same("IOR", "Normal"), {"Fac": "factor", "Factor": "factor"}),
    "ShaderNodeLayerWeight": Kind("layer_weight", _same("Blend", "Normal"), _same("Fresnel", "Facing")),
    "ShaderNodeBlackbody": Kind("blackbody", _same("Temperature"), _same("Color")),
    "ShaderNodeWavelength": Kind("wavelength", _same("Wavelength"), _same("Color")),
    "ShaderNodeNewGeometry": Kind("geometry", {}, _same("Position", "Normal", "Tangent", "True Normal", "Incoming", "Parametric", "Backfacing")),
    "ShaderNodeWireframe": Kind("wireframe", _same("Size"), FACTOR, ("use_pixel_size",)),
    "ShaderNodeLightPath": Kind(
        "light_path",
        {},
        _same(
            *(f"Is {kind} Ray" for kind in ("Camera", "Shadow", "Diffuse", "Glossy", "Singular", "Reflection", "Transmission", "Volume Scatter")),
            *("Ray Length", "Ray Depth"),
        ),
    ),
    "ShaderNodeCameraData": Kind("camera_data", {}, _same("View Vector", "View Z Depth", "View Distance")),
    "ShaderNodeVectorTransform": Kind(
        "vector_transform", _same("Vector"), _same("Vector"), ("vector_type", "convert_from", "convert_to")
    ),
}

# Inputs of shaders by the names of Blender's sockets; those that aren't named are left out where they have no link.
SHADERS = {
    "ShaderNodeBsdfPrincipled": "principled_bsdf",
    "ShaderNodeBsdfDiffuse": "diffuse_bsdf",
    "ShaderNodeBsdfAnisotropic": "glossy_bsdf",
    "ShaderNodeBsdfGlossy": "glossy_bsdf",
    "ShaderNodeBsdfMetallic": "metallic_bsdf",
    "ShaderNodeBsdfGlass": "glass_bsdf",
    "ShaderNodeBsdfRefraction": "refraction_bsdf",
    "ShaderNodeBsdfTranslucent": "translucent_bsdf",
    "ShaderNodeBsdfTransparent": "transparent_bsdf",
    "ShaderNodeBsdfSheen": "sheen_bsdf",
    "ShaderNodeBsdfToon": "toon_bsdf",
    "ShaderNodeBsdfVelvet": "velvet_bsdf",
    "ShaderNodeSubsurfaceScattering": "subsurface_scattering",
    "ShaderNodeEmission": "emission",
    "ShaderNodeBackground": "emission",
    # The likest.
    "ShaderNodeBsdfHair": "diffuse_bsdf",
    "ShaderNodeBsdfHairPrincipled": "diffuse_bsdf",
    "ShaderNodeEeveeSpecular": "diffuse_bsdf",
    "ShaderNodeHoldout": "diffuse_bsdf",
}

# Those whose likest is another.
LIKE = {
    "ShaderNodeBsdfHair": "a diffuse surface",
    "ShaderNodeBsdfHairPrincipled": "a diffuse surface",
    "ShaderNodeEeveeSpecular": "a diffuse surface",
    "ShaderNodeHoldout": "a black surface",
}

# What fills a volume does nothing on a surface.
FILLINGS = ("ShaderNodeVolumeAbsorption", "ShaderNodeVolumeScatter", "ShaderNodeVolumePrincipled", "ShaderNodeVolumeCoefficients")

# Inputs of shaders that oscura knows, by their type's.
KNOWN = {
    "principled_bsdf": "Base Color,Metallic,Roughness,IOR,Alpha,Diffuse Roughness,Subsurface Weight,Subsurface Radius,Subsurface Scale,"
    "Subsurface Anisotropy,Specular IOR Level,Specular Tint,Anisotropic,Anisotropic Rotation,Transmission Weight,Coat Weight,"
    "Coat Roughness,Coat IOR,Coat Tint,Sheen Weight,Sheen Roughness,Sheen Tint,Emission Color,Emission Strength,"
    "Thin Film Thickness,Thin Film IOR",
    "diffuse_bsdf": "Color,Roughness",
    "glossy_bsdf": "Color,Roughness,Anisotropy,Rotation",
    "metallic_bsdf": "Base Color,Edge Tint,Roughness,Anisotropy,Rotation",
    "glass_bsdf": "Color,Roughness,IOR",
    "refraction_bsdf": "Color,Roughness,IOR",
    "translucent_bsdf": "Color",
    "transparent_bsdf": "Color",
    "sheen_bsdf": "Color,Roughness",
    "velvet_bsdf": "Color,Roughness",
    "toon_bsdf": "Color,Size,Smooth",
    "toon_highlight_bsdf": "Color,Size,Smooth",
    "subsurface_scattering": "Color,Roughness,Scale,Radius,IOR,Anisotropy",
    "emission": "Color,Strength",
}


# Inputs that oscura takes as constants only.
CONSTANT = {
    "IOR", "Anisotropic", "Anisotropic Rotation", "Anisotropy", "Rotation", "Subsurface Weight", "Subsurface Radius", "Subsurface Scale",
    "Subsurface Anisotropy", "Coat IOR", "Coat Tint", "Thin Film Thickness", "Thin Film IOR", "Edge Tint", "Scale", "Radius",
}  # fmt: skip

# Nodes that hold a value.
PLAIN = ("ShaderNodeValue", "ShaderNodeRGB")

# Samples of a curve.
SAMPLES = 256


class Feed:
    """An output of a node with the groups around it, or a value of a type of sockets."""

    def __init__(self, output=None, groups=(), value=None, type=None):
        self.output, self.groups, self.value, self.type = output, groups, value, type

    @property
    def node(self):
        return self.output.node if self.output is not None else None


# A node that Cycles doesn't have: inputs that it is linked to have their own values.
SHADER_TO_RGB = "ShaderNodeShaderToRGB"


def feed(socket, groups=()):
    """What feeds an input, past reroutes, muted nodes and the borders of groups."""
    while True:
        links = [link for link in socket.links if not link.is_muted and link.is_valid]
        if not links:
            return Feed(value=_default(socket), groups=groups, type=socket.type)
        output = links[0].from_socket
        node = output.node
        if node.bl_idname == "NodeReroute":
            socket = node.inputs[0]
        elif node.mute:
            inner = next((link.from_socket for link in node.internal_links if link.to_socket == output), None)
            if inner is None:
                return Feed(value=_zero(output), groups=groups)
            socket = inner
        elif node.bl_idname == "NodeGroupInput":
            if not groups:
                return Feed(value=_zero(output), groups=groups)
            outer, groups = groups[-1], groups[:-1]
            socket = next(s for s in outer.inputs if s.identifier == output.identifier)
        elif node.bl_idname == "ShaderNodeGroup":
            ends = [n for n in node.node_tree.nodes if n.bl_idname == "NodeGroupOutput"] if node.node_tree else []
            end = next((n for n in ends if n.is_active_output), None)
            inner = next((s for s in end.inputs if s.identifier == output.identifier), None) if end else None
            if inner is None:
                return Feed(value=_zero(output), groups=groups)
            socket, groups = inner, (*groups, node)
        elif node.bl_idname == SHADER_TO_RGB:
            return Feed(value=_default(socket), groups=groups, type=socket.type)
        elif node.bl_idname in ("ShaderNodeTexImage", "ShaderNodeTexEnvironment") and _is_even(node):
            return Feed(value=_without_image(node.image, output), groups=groups, type=output.type)
        else:
            return Feed(output, groups)


def _default(socket):
    if socket.type == "SHADER" or not hasattr(socket, "default_value"):
        return None
    value = socket.default_value
    return float(value) if isinstance(value, (int, float)) else [float(x) for x in tuple(value)[:3]]


def _converted(value, kind, to):
    """A value of a type of sockets as another type has it: numbers of colours are their luminance, of vectors the mean."""
    if to != "VALUE" or not isinstance(value, list):
        return value
    weights = (0.2126729, 0.7151522, 0.0721750) if kind == "RGBA" else (1 / 3, 1 / 3, 1 / 3)
    return sum(weight * part for weight, part in zip(weights, value, strict=True))


def _is_even(node):
    """Does an image node give the same everywhere for want of an image? Where an image ends, so does the texel in its place."""
    return node.image is None or (image_files.is_missing(node.image) and getattr(node, "extension", "") != "CLIP")


def _without_image(image, output):
    """What an image node gives where there is nothing to see: black without an image, magenta where its file is missing."""
    if image is None:
        return _zero(output)
    return 1.0 if output.type == "VALUE" else [1.0, 0.0, 1.0]


def _zero(output):
    return None if output.type == "SHADER" else 0.0 if output.type == "VALUE" else [0.0, 0.0, 0.0]


def as_triple(value):
    return [value] * 3 if isinstance(value, (int, float)) else value


def is_number(value, number):
    """Is a value this number, in all of its parts?"""
    return isinstance(value, (int, float, list)) and all(part == number for part in as_triple(value))


class Graph:
    """The nodes of a material, written one after another."""

    def __init__(self, exposure=1.0, images=None, baker=None):
        self.nodes = {}
        self.attributes = set()  # of meshes
        self.asks_object = False  # does a node ask about the object?
        self.images = images
        self.baker = baker if baker is not None else bakes.BakeRequests()
        self.bumps = None  # the normal of the surface with these
        self.relief = None  # height, scale and exponent of the object's scale of bumps on all of the surface
        self.brushed = None  # the axis around which it is brushed; empty along texture coordinates
        self._known = {}
        self._refused = {}  # why nodes are baked
        self._pictures = {}  # of outputs that are baked, or of many tiles
        self._exposure = exposure

    def _add(self, node, groups, entries):
        # Keys without quotes are of ASCII.
        base = "".join(c if c.isascii() and c.isalnum() else "_" for c in node.name.lower()).strip("_")
        base = base or node.bl_idname.removeprefix("ShaderNode").lower()
        name, number = base, 1
        while name in self.nodes:
            number += 1
            name = f"{base}_{number}"
        self.nodes[name] = entries
        self._known[(node, groups)] = name
        return name

    def made(self, entries):
        """The name of a node that stands for none of Blender's."""
        name = f"{entries['type']}_{len(self.nodes)}"
        self.nodes[name] = entries
        return name

    # Arithmetic of values, which are numbers, lists of three, or outputs of nodes: folded where they are constant.

    def folded(self, operation, fold, a, b):
        if isinstance(a, str) or isinstance(b, str):
            return f"{self.made({'type': 'vector_math', 'operation': operation, 'a': a, 'b': b})}.vector"
        pairs = zip(as_triple(a), as_triple(b), strict=True)
        return [fold(x, y) for x, y in pairs] if isinstance(a, list) or isinstance(b, list) else fold(a, b)

    def sum(self, a, b):
        return b if is_number(a, 0.0) else a if is_number(b, 0.0) else self.folded("add", lambda x, y: x + y, a, b)

    def product(self, a, b):
        if is_number(a, 0.0) or is_number(b, 0.0):
            return 0.0
        return b if is_number(a, 1.0) else a if is_number(b, 1.0) else self.folded("multiply", lambda x, y: x * y, a, b)

    def shader(self, found):
        """The name of a shader; None for none."""
        node = found.node
        if node is None:
            return None
        if (node, found.groups) in self._known and found.output.type == "SHADER":
            return self._known[(node, found.groups)]
        if node.bl_idname == "ShaderNodeMixShader":
            factor, first, second = node.inputs[0], node.inputs[1], node.inputs[2]
            entries = {"type": "mix_shader", "factor": self.value(feed(factor, found.groups), "VALUE")}
        elif node.bl_idname == "ShaderNodeAddShader":
            entries, (first, second) = {"type": "add_shader"}, node.inputs
        elif node.bl_idname in SHADERS:
            return self._add(node, found.groups, self._in_part(self._closure(node, found.groups)))
        elif node.bl_idname in FILLINGS:
            return None
        elif found.output.type != "SHADER":
            # Cycles takes a colour for an emission.
            color = self.value(found)
            return self.made({"type": "emission", "color": color, "strength": self._exposure})
        else:
            self.baker.warn(f"the shader {node.bl_label} is not supported: it is grey")
            return self.made({"type": "diffuse_bsdf"})
        for key, socket in (("a", first), ("b", second)):
            part = feed(socket, found.groups)
            name = self.shader(part)
            if name is not None:
                entries[key] = name
        return self._add(node, found.groups, entries)

    def _closure(self, node, groups):
        kind = _kind(node)
        known = KNOWN[kind].split(",")
        if node.bl_idname in LIKE:
            self.baker.warn(f"the shader {node.bl_label} is not supported: it is {LIKE[node.bl_idname]}")
        if kind == "metallic_bsdf" and node.fresnel_type != "F82":
            return self._metal(node, groups)
        entries = {"type": kind}
        for socket in node.inputs:
            if not socket.enabled or socket.type == "SHADER":
                continue
            name, found = socket.name, feed(socket, groups)
            if name == "Normal":
                self._turn(entries, found)
                continue
            if name not in known:
                if found.node is not None and name not in ("Weight", "Subsurface IOR", "Tangent"):
                    self.baker.warn(f"{name} of {node.bl_label} is not carried over")
                continue
            value = self._constant(node, socket, found) if name in CONSTANT else None
            entries[name.lower().replace(" ", "_")] = self.value(found, socket.type) if value is None else value
        self._as_skin(node, entries, groups)
        if node.bl_idname == "ShaderNodeHoldout":
            entries["color"] = [0.0, 0.0, 0.0]
        entries.update(_facets(node))
        self._lift(entries)
        self._brush(node, entries, groups)
        if kind == "emission" or kind == "principled_bsdf":
            self._expose(entries, "strength" if kind == "emission" else "emission_strength")
        return self._with_body(node, entries, groups)

    def _as_skin(self, node, entries, groups):
        """The index of refraction of Random Walk (Skin), which says what its radius means; 0 of Christensen-Burley, where light enters diffusely."""
        is_principled = entries["type"] == "principled_bsdf"
        method, prefix = ("subsurface_method", "Subsurface ") if is_principled else ("falloff", "")
        if is_principled and entries.get("subsurface_weight", 0.0) == 0.0:
            return
        if getattr(node, method, "") == "BURLEY":
            entries["subsurface_ior" if is_principled else "ior"] = 0.0
        if getattr(node, method, "") == "RANDOM_WALK_SKIN":
            socket = node.inputs[f"{prefix}IOR"]
            found = feed(socket, groups)
            value = self._constant(node, socket, found)
            entries[f"{prefix.lower().replace(' ', '_')}skin_ior"] = self.value(found, "VALUE") if value is None else value

    def _in_part(self, entries):
        """A shader, or where a share of it scatters beneath the surface a mix of two: a body is all or nothing, and has neither metal nor glass."""
        weight, metal, glass = (entries.get(name, 0.0) for name in ("subsurface_weight", "metallic", "transmission_weight"))
        if weight == 0.0 or not isinstance(weight, float):
            return entries
        share = weight * (1 - metal) * (1 - glass)
        if share >= 1.0:
            return entries
        if share <= 0.0:
            return {**entries, "subsurface_weight": 0.0}
        without = {key: value for key, value in entries.items() if key != "subsurface_body"}
        # The other part has all of the metal and the glass.
        metals, glasses = metal / (1 - share), (1 - metal) * glass / max(1 - share - metal, 1e-6)
        other = {**without, "subsurface_weight": 0.0, "metallic": metals, "transmission_weight": min(glasses, 1.0)}
        body = {**entries, "subsurface_weight": 1.0, "metallic": 0.0, "transmission_weight": 0.0}
        return {"type": "mix_shader", "factor": share, "a": self.made(other), "b": self.made(body)}

    def _turn(self, entries, found):
        """The normal that a shader is given: a node's, or the colour of an image that is missing."""
        value = found.value if isinstance(found.value, list) else [found.value or 0.0] * 3
        if found.node is not None or any(value):
            entries["normal"] = self.value(found) if found.node is not None else value

    def _lift(self, entries):
        """Adds the bumps of all of the surface to a shader's normal."""
        if self.relief is None or entries["type"] in ("emission", "transparent_bsdf"):
            return
        height, scale, object_scale = self.relief
        bump = {"type": "bump", "strength": 1.0, "height": height, "distance": scale, "object_scale": object_scale}
        if self.bumps is None:
            self.bumps = f"{self.made(bump)}.normal"
        if "normal" not in entries:
            entries["normal"] = self.bumps
        elif not self._is_mapped(entries["normal"]):
            entries["normal"] = f"{self.made({**bump, 'normal': entries['normal']})}.normal"

    def _is_mapped(self, normal):
        """Is a normal one of a map in tangent space, bumped or not? Those stand on the smooth normals, without bumps of all of the surface."""
        node = self.nodes.get(normal.rpartition(".")[0]) if isinstance(normal, str) else None
        if node is not None and node["type"] == "bump":
            return self._is_mapped(node.get("normal"))
        return node is not None and node["type"] == "normal_map" and node["space"] == "tangent"

    def _brush(self, node, entries, groups):
        """The direction in which a surface is brushed is one of the mesh: around an axis, or along its texture coordinates."""
        if not any(entries.get(name, 0.0) != 0.0 for name in ("anisotropic", "anisotropy")) or "Tangent" not in node.inputs:
            return
        tangent, axis = feed(node.inputs["Tangent"], groups).node, "Z"
        if tangent is not None and tangent.bl_idname != "ShaderNodeTangent":
            self.baker.warn("the direction in which it is brushed (Tangent) is not carried over: it runs around the vertical axis")
        elif tangent is not None:
            axis = "" if tangent.direction_type == "UV_MAP" else tangent.axis
        if axis and "normal" in entries:
            self.baker.warn("is brushed along its texture coordinates, as its normals are, not around an axis")
            axis = ""
        if self.brushed is None:
            self.brushed = axis

    def _with_body(self, node, entries, groups):
        """A shader whose colour may paint a body beneath it."""
        is_principled = entries["type"] == "principled_bsdf"
        if is_principled:
            weight, others = entries.get("subsurface_weight", 0.0), [entries.get(name, 0.0) for name in ("metallic", "transmission_weight")]
            if weight == 0.0:
                return entries
            if not all(isinstance(other, float) for other in others):
                self.baker.warn(f"subsurface scattering of weight {weight:.3g} beneath metal or glass that varies is taken for diffuse reflection")
                return {**entries, "subsurface_weight": 0.0}
        elif entries["type"] != "subsurface_scattering":
            return entries
        key, name, body = ("base_color", "Base Color", "subsurface_body") if is_principled else ("color", "Color", "body")
        if isinstance(entries.get(key), str):
            entries[body] = self.baker.brightest(feed(node.inputs[name], groups), name)
        return entries

    def _metal(self, node, groups):
        """A metal of physical constants, by its colours at normal incidence and at 82 degrees."""
        n, k = (self._numbers(node, name, groups) for name in ("IOR", "Extinction"))
        cosine = 1 / 7
        base = [((a - 1) ** 2 + b * b) / ((a + 1) ** 2 + b * b) for a, b in zip(n, k)]
        schlick = [f + (1 - f) * (1 - cosine) ** 5 for f in base]
        edge = [min(_conductor(a, b, cosine) / s, 1.0) for a, b, s in zip(n, k, schlick)]
        entries = {"type": "metallic_bsdf", "base_color": base, "edge_tint": edge, **_facets(node)}
        for name in ("Roughness", "Anisotropy", "Rotation"):
            found = feed(node.inputs[name], groups)
            value = self._constant(node, node.inputs[name], found) if name in CONSTANT else None
            entries[name.lower()] = self.value(found, "VALUE") if value is None else value
        self._turn(entries, feed(node.inputs["Normal"], groups))
        self._lift(entries)
        self._brush(node, entries, groups)
        return entries

    def _numbers(self, node, name, groups):
        found = feed(node.inputs[name], groups)
        value = self._constant(node, node.inputs[name], found)
        return value if value is not None else self.value(found, "VECTOR")

    def _constant(self, node, socket, found):
        """The number or triple of an input that may not vary; None where nothing calculates it."""
        if found.node is None or found.node.bl_idname in PLAIN:
            return None
        value = shaders.constant(socket)
        if value is None:
            default = _default(socket)
            return self.baker.mean(found, f"{socket.name} of {node.bl_label}", default)
        return list(value) if isinstance(value, tuple) else value

    def _expose(self, entries, key):
        if self._exposure != 1.0 and key in entries:
            factor = entries[key]
            if isinstance(factor, float):
                entries[key] = factor * self._exposure
            else:
                entries[key] = self.made({"type": "math", "operation": "multiply", "a": factor, "b": self._exposure})

    def value(self, found, to="RGBA"):
        """A number, a triple, or the output of a node, for an input of a type of sockets."""
        node = found.node
        if node is None:
            return 0.0 if found.value is None else _converted(found.value, found.type, to)
        if node.bl_idname in PLAIN:
            return _converted(_default(found.output), found.output.type, to)
        key = (node, found.groups)
        if node.bl_idname == "ShaderNodeTexImage" and node.image.source == "TILED" and node.image.colorspace_settings.name in SPACES:
            return self._tiled(found)
        if key not in self._known and key not in self._refused:
            try:
                self._write(*key)
            except Unsupported as reason:
                self._refused[key] = str(reason)
        if key not in self._refused:
            try:
                return f"{self._known[key]}.{self._output(node, found.output)}"
            except Unsupported as reason:
                return self._picture(found, str(reason))
        return self._picture(found, self._refused[key])

    def _picture(self, found, reason):
        """A picture of an output that is baked."""
        if found.node.bl_idname == "ShaderNodeLightPath":
            self.baker.warn(f"{reason} is taken as 0")
            return 0.0
        if getattr(found.node, "from_instancer", False):
            return 0.0
        key = (found.node, found.groups, found.output.identifier)
        if key not in self._pictures:
            self._pictures[key] = self._baked(found, reason)
        return self._pictures[key]

    def _baked(self, found, reason):
        baked = self.baker.image(found, reason)
        if baked is None:
            return _zero(found.output) or 0.0
        file, holds_vectors = baked
        self.attributes.add(bakes.UV)
        place = f"{self.made({'type': 'uv_map', 'name': bakes.UV})}.uv"
        image = {"type": "image_texture", "file": file, "color_space": "non-color", "extension": "extend", "alpha_mode": "none"}
        color = f"{self.made({**image, 'vector': place})}.color"
        if not holds_vectors:
            return color
        half = bakes.VECTOR_RANGE
        vector = {"type": "vector_math", "operation": "multiply_add", "a": color, "b": [half] * 3, "c": [-half / 2] * 3}
        vector = f"{self.made(vector)}.vector"
        if found.node.bl_idname != "ShaderNodeBevel":
            return vector
        turn = {"type": "vector_transform", "vector_type": "normal", "convert_from": "object", "convert_to": "world", "vector": vector}
        return f"{self.made(turn)}.vector"

    def _tiled(self, found):
        """The sum of the tiles of an image (UDIM), each of which is nothing outside its square."""
        key = (found.node, found.groups, found.output.identifier)
        if key in self._pictures:
            return self._pictures[key]
        node, entries, total = found.node, {}, None
        self.put(entries, "vector", node.inputs[0], found.groups, "uv")
        for number, file in self.images.tiles(node.image):
            corner = [float((number - 1001) % 10), float((number - 1001) // 10), 0.0]
            moved = {"type": "vector_math", "operation": "subtract", "a": entries["vector"], "b": corner}
            tile = {**_image_entries(node, file), "extension": "clip", "projection": "flat", "vector": f"{self.made(moved)}.vector"}
            value = f"{self.made(tile)}.{_by_name(node, found.output)}"
            if total is not None:
                value = f"{self.made({'type': 'vector_math', 'operation': 'add', 'a': total, 'b': value})}.vector"
            total = value
        self._pictures[key] = total if total is not None else _zero(found.output)
        return self._pictures[key]

    def _output(self, node, socket):
        if node.bl_idname in SPECIAL:
            return SPECIAL[node.bl_idname][1](node, socket)
        outputs = KINDS[node.bl_idname].outputs
        name = outputs.get(socket.identifier, outputs.get(socket.name))
        if name is None:
            raise Unsupported(f"{socket.name} of {node.bl_label}")
        return name

    def _write(self, node, groups):
        if node.bl_idname in SPECIAL:
            entries = SPECIAL[node.bl_idname][0](self, node, groups)
        elif node.bl_idname in KINDS:
            entries = self._plain(node, groups)
        else:
            raise Unsupported(node.bl_label)
        if getattr(node, "texture_mapping", None) is not None and "vector" in entries:
            entries["vector"] = self._mapped(entries["vector"], node.texture_mapping)
        self._add(node, groups, entries)

    def _mapped(self, place, mapping):
        """A place by the mapping that texture nodes have of their own, which only files of old versions and scripts set: it chooses
        axes, then it moves, turns and scales as a node Mapping does."""
        axes = [mapping.mapping_x, mapping.mapping_y, mapping.mapping_z]
        if axes != list("XYZ"):
            parts = self.made({"type": "separate_xyz", "vector": place})
            chosen = {out: 0.0 if axis == "NONE" else f"{parts}.{axis.lower()}" for out, axis in zip("xyz", axes)}
            place = f"{self.made({'type': 'combine_xyz', **chosen})}.vector"
        steps = {key: list(getattr(mapping, name)) for key, name in MAPPING.items()}
        if steps == {"location": [0.0] * 3, "rotation": [0.0] * 3, "scale": [1.0] * 3}:
            return place
        return f"{self.made({'type': 'mapping', 'vector_type': mapping.vector_type.lower(), 'vector': place, **steps})}.vector"

    def _plain(self, node, groups):
        kind = KINDS[node.bl_idname]
        entries = {"type": kind.name}
        for key, name in kind.settings.items():
            value = getattr(node, key)
            entries[name] = value.lower() if isinstance(value, str) else value
        for socket in node.inputs:
            name = kind.inputs.get(socket.identifier, kind.inputs.get(socket.name))
            if not socket.enabled or name is None:
                if socket.enabled and socket.is_linked:
                    raise Unsupported(f"{socket.name} of {node.bl_label}")
                continue
            self.put(entries, name, socket, groups)
        return entries

    def put(self, entries, name, socket, groups, implicit="generated"):
        """Writes an input; a texture's vector without a link is a coordinate of the surface."""
        found = feed(socket, groups)
        if found.node is None and socket.hide_value:
            # Normals without a link are the surface's, and places are without one.
            if name != "normal" and implicit != "position":
                entries[name] = self.coordinates(implicit)
            return
        entries[name] = self.value(found, socket.type)

    def coordinates(self, output):
        if output == "generated":
            self.attributes.add(mesh_files.GENERATED)
        if "coordinates" not in self.nodes:
            self.nodes["coordinates"] = {"type": COORDINATES}
        return f"coordinates.{output}"


def _kind(node):
    """What a shader is called in a graph."""
    if node.bl_idname == "ShaderNodeBsdfSheen" and getattr(node, "distribution", "MICROFIBER") == "ASHIKHMIN":
        return "velvet_bsdf"
    if node.bl_idname == "ShaderNodeBsdfToon" and node.component == "GLOSSY":
        return "toon_highlight_bsdf"
    return SHADERS[node.bl_idname]


def _facets(node):
    """What becomes of light among the facets of a shader, where that matters, and how they are distributed."""
    keeps = facets.keeps_all(node)
    entries = {} if keeps is None else {"multiscatter": float(keeps)}
    is_known = node.bl_idname.removeprefix("ShaderNodeBsdf") in ("Glass", "Refraction", "Glossy", "Anisotropic")
    return {**entries, "beckmann": 1.0} if is_known and node.distribution == "BECKMANN" else entries


def _conductor(n, k, cosine):
    """The reflectance of a metal of an index of refraction n + i k (Fresnel's equations for unpolarized light)."""
    squared, both = n * n + k * k, 2 * n * cosine
    s = (squared - both + cosine**2) / (squared + both + cosine**2)
    p = (squared * cosine**2 - both + 1) / (squared * cosine**2 + both + 1)
    return 0.5 * (s + p)


def scatters_within(entries):
    """Does a shader, as it is written, scatter light in the body beneath the surface?"""
    if entries["type"] != "principled_bsdf":
        return entries["type"] == "subsurface_scattering"
    weight, others = entries.get("subsurface_weight", 0.0), [entries.get(name, 0.0) for name in ("metallic", "transmission_weight")]
    return weight == 1.0 and others == [0.0, 0.0]


# Nodes with more than inputs and settings.


def _mix(graph, node, groups):
    kind = {"FLOAT": "Float", "VECTOR": "Vector", "RGBA": "Color"}.get(node.data_type)
    if kind is None:
        raise Unsupported(f"{node.bl_label} of {node.data_type}")
    entries = {"type": "mix", "data_type": node.data_type.lower(), "clamp_factor": node.clamp_factor}
    inputs = {socket.identifier: socket for socket in node.inputs}
    is_each = node.data_type == "VECTOR" and node.factor_mode == "NON_UNIFORM"
    if node.data_type == "RGBA":
        entries.update({"blend_type": node.blend_type.lower(), "clamp_result": node.clamp_result})
    if is_each:
        entries["factor_mode"] = "non_uniform"
    factor = ("factor_vector", "Factor_Vector") if is_each else ("factor", "Factor_Float")
    for name, identifier in (factor, ("a", f"A_{kind}"), ("b", f"B_{kind}")):
        graph.put(entries, name, inputs[identifier], groups)
    return entries


def _old_mix(graph, node, groups):
    entries = {"type": "mix", "data_type": "rgba", "blend_type": node.blend_type.lower(), "clamp_result": node.use_clamp}
    for name, socket in zip(("factor", "a", "b"), node.inputs):
        graph.put(entries, name, socket, groups)
    return entries


def _map_range(graph, node, groups):
    is_vector = node.data_type == "FLOAT_VECTOR"
    inputs = {socket.identifier: socket for socket in node.inputs}
    entries = {"type": "map_range", "clamp": node.clamp, "interpolation_type": node.interpolation_type.lower()}
    names = ("From Min", "From Max", "To Min", "To Max", "Steps")
    keys = [f"{name.replace(' ', '_')}_FLOAT3" if is_vector else name for name in names]
    graph.put(entries, "value", inputs["Vector" if is_vector else "Value"], groups)
    for name, key in zip(names, keys):
        if inputs[key].enabled:
            graph.put(entries, name.lower().replace(" ", "_"), inputs[key], groups)
    return entries


def _ramp(graph, node, groups):
    ramp = node.color_ramp
    is_plain = ramp.color_mode == "RGB" and ramp.interpolation in ("LINEAR", "CONSTANT")
    if is_plain:
        stops = sorted(([e.position, *e.color] for e in ramp.elements), key=lambda stop: stop[0])
    else:
        stops = [[i / SAMPLES, *ramp.evaluate(i / SAMPLES)] for i in range(SAMPLES + 1)]
    interpolation = "constant" if ramp.interpolation == "CONSTANT" and is_plain else "linear"
    entries = {"type": "color_ramp", "stops": stops, "interpolation": interpolation}
    graph.put(entries, "factor", node.inputs[0], groups)
    return entries


def _curves(name, count, key):
    def write(graph, node, groups):
        mapping = node.mapping
        mapping.initialize()
        curves = [mapping.curves[i] for i in range(count)]
        points = [p.location[0] for curve in curves for p in curve.points]
        low, high = min(points), max(points)
        common = mapping.curves[3] if name == "rgb_curves" else None
        at = lambda i: low + (high - low) * i / SAMPLES
        inner = lambda x: mapping.evaluate(common, x) if common is not None else x
        table = [[mapping.evaluate(curve, inner(at(i))) for curve in curves] for i in range(SAMPLES + 1)]
        entries = {"type": name, "table": table, "min": low, "max": high, "extrapolate": mapping.extend == "EXTRAPOLATED"}
        graph.put(entries, "factor", node.inputs[0], groups)
        graph.put(entries, key, node.inputs[1], groups)
        return entries

    return write


def _by_name(node, socket):
    return socket.name.lower().replace(" ", "_")


def _coordinates(graph, node, groups):
    if node.from_instancer:
        raise Unsupported(f"{node.bl_label} of the instancer")
    if any(link.is_valid for link in node.outputs["Generated"].links):
        graph.attributes.add(mesh_files.GENERATED)
    entries = {"type": "texture_coordinate"}
    if node.object is not None:
        inverse = node.object.matrix_world.inverted_safe()
        entries["object_matrix"] = [float(x) for row in list(inverse)[:3] for x in row]
    return entries


def _uv_map(graph, node, groups):
    if node.from_instancer:
        raise Unsupported(f"{node.bl_label} of the instancer")
    if node.uv_map:
        graph.attributes.add(node.uv_map)
    return {"type": "uv_map", "name": node.uv_map}


def _attribute(graph, node, groups):
    if node.attribute_type != "GEOMETRY" or not node.attribute_name:
        raise Unsupported(f"{node.bl_label} of {node.attribute_type.lower()} '{node.attribute_name}'")
    graph.attributes.add(node.attribute_name)
    return {"type": "attribute", "name": node.attribute_name}


def _color_attribute(graph, node, groups):
    if not node.layer_name:
        raise Unsupported(f"{node.bl_label} without a name")
    graph.attributes.add(node.layer_name)
    return {"type": "color_attribute", "name": node.layer_name}


def _object_info(graph, node, groups):
    graph.asks_object = True
    return {"type": "object_info"}


def _tangent(graph, node, groups):
    if node.direction_type == "UV_MAP" and node.uv_map:
        graph.baker.warn(f"{node.bl_label} of the UV map '{node.uv_map}' is that of the active one")
    return {"type": "tangent", "direction_type": node.direction_type.lower(), "axis": node.axis.lower()}


def _normal_map(graph, node, groups):
    graph_space = node.space.lower()
    if node.uv_map and graph_space == "tangent":
        graph.attributes.add(node.uv_map)
    entries = {"type": "normal_map", "space": graph_space, "uv_map": node.uv_map}
    for name in ("Strength", "Color"):
        graph.put(entries, name.lower(), node.inputs[name], groups)
    return entries


def _bump(graph, node, groups):
    entries = {"type": "bump", "invert": node.invert}
    width = node.inputs.get("Filter Width")
    if width is not None:
        if width.is_linked:
            raise Unsupported(f"Filter Width of {node.bl_label}")
        entries["filter_width"] = float(width.default_value)
    for name in ("Strength", "Distance", "Height", "Normal"):
        graph.put(entries, name.lower(), node.inputs[name], groups)
    return entries


def _normal(graph, node, groups):
    entries = {"type": "normal", "direction": [float(x) for x in node.outputs[0].default_value]}
    graph.put(entries, "normal", node.inputs[0], groups)
    return entries


def _image(graph, node, groups):
    image = node.image
    if image.source == "SEQUENCE":
        file = graph.images.frame(image, node.image_user)
    else:
        file = graph.images.file(image) if image.source in ("FILE", "GENERATED") else None
    if file is None and image_files.is_missing(image):
        file = graph.images.magenta()
    if file is None:
        raise Unsupported(f"the image '{image.name}'")
    entries = _image_entries(node, file)
    graph.put(entries, "vector", node.inputs[0], groups, "uv")
    return entries


def _environment(graph, node, groups):
    file = graph.images.file(node.image) if node.image.source in ("FILE", "GENERATED") else None
    if file is None:
        raise Unsupported(f"the image '{node.image.name}'")
    entries = {"type": "environment_texture", "file": file, "color_space": _space(node.image)}
    entries.update({"interpolation": node.interpolation.lower(), "projection": node.projection.lower()})
    graph.put(entries, "vector", node.inputs[0], groups, "position")
    return entries


def _space(image):
    space = SPACES.get(image.colorspace_settings.name)
    if space is None:
        raise Unsupported(f"the colour space {image.colorspace_settings.name}")
    return space


def _image_entries(node, file):
    image = node.image
    space = _space(image)
    entries = {
        "type": "image_texture",
        "file": file,
        "color_space": space,
        "interpolation": node.interpolation.lower(),
        "extension": node.extension.lower(),
        "projection": node.projection.lower(),
        "alpha_mode": image.alpha_mode.lower(),
    }
    if node.projection == "BOX":
        entries["blend"] = node.projection_blend
    return entries


# Colour spaces of images by Blender's names.
SPACES = {"sRGB": "srgb", "Non-Color": "non-color", "Raw": "non-color", "Linear Rec.709": "linear", "Linear": "linear", "Generic Data": "non-color"}


def _first(_node, socket):
    return {"Color": "color", "Alpha": "alpha", "Vector": "vector", "Value": "value", "Result": "result"}[socket.name]


SPECIAL = {
    "ShaderNodeTexCoord": (_coordinates, _by_name),
    "ShaderNodeUVMap": (_uv_map, _by_name),
    "ShaderNodeAttribute": (_attribute, lambda node, socket: {"Fac": "factor"}.get(socket.name, socket.name.lower())),
    "ShaderNodeVertexColor": (_color_attribute, _by_name),
    "ShaderNodeObjectInfo": (_object_info, _by_name),
    "ShaderNodeTangent": (_tangent, _by_name),
    "ShaderNodeNormalMap": (_normal_map, _by_name),
    "ShaderNodeBump": (_bump, _by_name),
    "ShaderNodeNormal": (_normal, _by_name),
    "ShaderNodeTexImage": (_image, _by_name),
    "ShaderNodeTexEnvironment": (_environment, _by_name),
    "ShaderNodeMix": (_mix, lambda node, socket: "result"),
    "ShaderNodeMixRGB": (_old_mix, lambda node, socket: "result"),
    "ShaderNodeMapRange": (_map_range, lambda node, socket: "result"),
    "ShaderNodeValToRGB": (_ramp, _first),
    "ShaderNodeRGBCurve": (_curves("rgb_curves", 3, "color"), _first),
    "ShaderNodeVectorCurve": (_curves("vector_curves", 3, "vector"), _first),
    "ShaderNodeFloatCurve": (_curves("float_curve", 1, "value"), _first),
}
