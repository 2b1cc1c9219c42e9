"""Shader nodes as inputs of one Principled shader: constants, or sockets of the tree that feed them. A mix of shaders becomes
a mix of their inputs."""

from . import facing, glasses, passing, shaders, trees, views

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)

# The inputs that are colours.
COLORS = ("Base Color", "Emission Color", "Sheen Tint", "Coat Tint", "Specular Tint", "Translucent Color")

# Inputs that nothing comes of where they are 0, beside those that are called weights.
SHARES = ("Anisotropic", "Diffuse Roughness", "Thin Film Thickness")

# The inputs that are directions: without a link they are the surface's own.
NORMALS = ("Normal", "Coat Normal", "Tangent")

# What inputs are where a shader doesn't say.
DEFAULTS = {
    "Base Color": WHITE,
    "Metallic": 0.0,
    "Roughness": 0.5,
    "IOR": 1.5,
    "Alpha": 1.0,
    "Specular IOR Level": 0.5,
    "Transmission Weight": 0.0,
    "Emission Color": BLACK,
    "Emission Strength": 0.0,
    "Coat Tint": WHITE,
    "Sheen Tint": WHITE,
    "Specular Tint": WHITE,
}


def diffuse(color, normal=None):
    found = {"Base Color": color, "Roughness": 1.0, "Specular IOR Level": 0.0}
    return {**found, "Normal": normal} if normal is not None else found


def invisible():
    return {**diffuse(BLACK), "Alpha": 0.0}


def build(tree, inputs, end=None):
    """Gives a tree one Principled shader with these inputs."""
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    for name, value in inputs.items():
        if value is None or name not in node.inputs:
            continue
        socket = node.inputs[name]
        if isinstance(value, (int, float)):
            socket.default_value = value
        elif isinstance(value, tuple):
            socket.default_value = value if len(socket.default_value) == len(value) else (*value, 1.0)
        else:
            tree.links.new(value, socket)
    end = end or tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], end.inputs["Surface"])
    make_active(tree, end)


def make_active(tree, end):
    """The exporter looks at the active output."""
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeOutputMaterial":
            node.is_active_output = node == end
    end.target = "ALL"


class Reader:
    """Reads the shaders of a material."""

    def __init__(self, tree, material, report):
        self.tree, self.material, self.name, self.report = tree, material, material.name, report

    def read(self, socket):
        """The inputs that stand for what feeds a shader's input."""
        node = socket.node if socket is not None else None
        if node is None:
            return {**diffuse(BLACK)}
        if node.mute:
            self.report.warn(self.name, "a muted shader is left out")
            return diffuse(BLACK)
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
            return self._group(node, socket.identifier)
        reader = getattr(self, "_" + node.bl_idname.removeprefix("ShaderNode"), None)
        if reader is None:
            kind = node.bl_label
            self.report.warn(self.name, f"the shader {kind} is not supported: it is diffuse")
            return diffuse(self._value(node, "Color") if "Color" in node.inputs else (0.8, 0.8, 0.8))
        return reader(node)

    def _group(self, node, identifier):
        """The shader that a group gives. Sockets within it become outputs of the group, and its inputs what feeds them."""
        # Other users of the group keep theirs.
        node.node_tree = node.node_tree.copy()
        inner = node.node_tree
        _settle_entries(node)
        ends = [n for n in inner.nodes if n.bl_idname == "NodeGroupOutput"]
        end = next((n for n in ends if n.is_active_output), None)
        within = next((s for s in end.inputs if s.identifier == identifier), None) if end else None
        if within is None:
            return diffuse(BLACK)
        found = Reader(inner, self.material, self.report).read(shaders.source(within))
        return {name: self._from_group(node, end, name, value) for name, value in found.items()}

    @staticmethod
    def _from_group(node, end, name, value):
        if value is None or isinstance(value, (int, float, tuple, str)):
            return value
        if value.node.bl_idname == "NodeGroupInput":
            outer = next(s for s in node.inputs if s.identifier == value.identifier)
            constant = shaders.constant(outer)
            return shaders.source(outer) if constant is None else shaders.as_type(constant, name in COLORS)
        kind = "Color" if name in COLORS else "Vector" if name in NORMALS else "Float"
        made = node.node_tree.interface.new_socket(name, in_out="OUTPUT", socket_type=f"NodeSocket{kind}")
        target = next(s for s in end.inputs if s.identifier == made.identifier)
        node.node_tree.links.new(value, target)
        return next(s for s in node.outputs if s.identifier == made.identifier)

    def _value(self, node, name):
        """The constant or the socket that feeds an input."""
        socket = node.inputs[name]
        value = shaders.constant(socket)
        return shaders.source(socket) if value is None else value

    def _normal(self, node):
        return shaders.source(node.inputs["Normal"]) if "Normal" in node.inputs else None

    def _BsdfPrincipled(self, node):
        found = {i.name: self._value(node, i.name) for i in node.inputs if i.enabled and i.type != "SHADER"}
        return {k: v for k, v in found.items() if k not in NORMALS or not isinstance(v, (tuple, float, type(None)))}

    def _BsdfDiffuse(self, node):
        found = diffuse(self._value(node, "Color"), self._normal(node))
        return {**found, "Diffuse Roughness": self._value(node, "Roughness")}

    def _BsdfAnisotropic(self, node):
        found = {"Base Color": self._value(node, "Color"), "Metallic": 1.0, "Roughness": self._value(node, "Roughness")}
        if "Anisotropy" in node.inputs:
            found["Anisotropic"] = self._value(node, "Anisotropy")
        return {**found, "Normal": self._normal(node)}

    _BsdfGlossy = _BsdfAnisotropic

    def _BsdfGlass(self, node):
        return self._clear(node, self._value(node, "Color"), self._value(node, "IOR"))

    def _clear(self, node, color, ior):
        """Glass, which tints at both surfaces, where the Principled shader does so once on the whole way."""
        found = glasses.inputs(node, self._squared(color), self._value(node, "Roughness"), ior)
        return {**found, "Normal": self._normal(node)}

    def _squared(self, color):
        if isinstance(color, tuple):
            return tuple(c * c for c in color)
        node = self.tree.nodes.new("ShaderNodeVectorMath")
        node.operation = "MULTIPLY"
        for entry in node.inputs[:2]:
            self.tree.links.new(color, entry)
        return node.outputs[0]

    _BsdfRefraction = _BsdfGlass

    def _BsdfTransparent(self, node):
        color = self._value(node, "Color")
        if color == WHITE:
            return invisible()
        # A sheet of one surface that colours what passes and reflects nothing.
        trees.settle(self.material, volume=False)
        found = {"Base Color": color, "Transmission Weight": 1.0, "Roughness": 0.0, "IOR": 1.0}
        return {**found, "Specular IOR Level": 0.0}

    def _BsdfTranslucent(self, node):
        color = self._value(node, "Color")
        return {**diffuse(color, self._normal(node)), "Translucent Weight": 1.0, "Translucent Color": color}

    def _BsdfSheen(self, node):
        found = {"Sheen Tint": self._value(node, "Color"), "Sheen Roughness": self._value(node, "Roughness")}
        if node.distribution != "MICROFIBER":
            self.report.warn(self.name, f"sheen of the distribution {node.distribution} is that of microfibres here")
        return {**diffuse(BLACK, self._normal(node)), "Sheen Weight": 1.0, **found}

    def _SubsurfaceScattering(self, node):
        found = {f"Subsurface {name}": self._value(node, name) for name in ("Radius", "Scale", "Anisotropy") if name in node.inputs}
        return {**diffuse(self._value(node, "Color"), self._normal(node)), "Subsurface Weight": 1.0, **found}

    def _BsdfMetallic(self, node):
        found = {"Metallic": 1.0, "Roughness": self._value(node, "Roughness"), "Normal": self._normal(node)}
        if node.fresnel_type == "F82":
            return {**found, "Base Color": self._value(node, "Base Color"), "Specular Tint": self._value(node, "Edge Tint")}
        n, k = self._value(node, "IOR"), self._value(node, "Extinction")
        if not isinstance(n, tuple) or not isinstance(k, tuple):
            self.report.warn(self.name, "a metal's index of refraction that varies is not carried over: it is grey")
            return {**found, "Base Color": (0.6, 0.6, 0.6)}
        return {**found, "Base Color": tuple(((a - 1) ** 2 + b * b) / ((a + 1) ** 2 + b * b) for a, b in zip(n, k))}

    def _Emission(self, node):
        glow = {"Emission Color": self._value(node, "Color"), "Emission Strength": self._value(node, "Strength")}
        return {**diffuse(BLACK), **glow}

    _Background = _Emission

    def _Holdout(self, _node):
        self.report.warn(self.name, "a holdout is black here")
        return diffuse(BLACK)

    def _AddShader(self, node):
        found = glasses.summed(node, lambda message: self.report.warn(self.name, message))
        if found is not None:
            color, ior, dispersion, first = found
            return {**self._clear(first, color, ior), **({glasses.DISPERSION: dispersion} if dispersion else {})}
        first, second = (self.read(shaders.source(i)) for i in node.inputs)
        if not _shines(second):
            first, second = second, first
        if not _shines(second) and not _shines(first):
            both = self._both_sides(first, second) or self._both_sides(second, first)
            if both is not None:
                return both
        if not _shines(second) or _shines(first):
            self.report.warn(self.name, "a sum of shaders is taken for their mix")
            return self._mixed(0.5, first, second)
        return {**first, **{k: second[k] for k in ("Emission Color", "Emission Strength")}}

    def _both_sides(self, over, under):
        """What reflects diffusely and lets light through diffusely, each with its whole colour."""
        if under.get("Translucent Weight") != 1.0 or "Translucent Weight" in over or over.get("Metallic") == 1.0:
            return None
        reflected, passed = over.get("Base Color"), under.get("Translucent Color")
        if passing.exceeds(reflected, passed):
            self.report.warn(self.name, passing.TOO_BRIGHT)
        # Each takes a share of the light, and more of that.
        share = passing.share_of(reflected, passed)
        front, back = self._brightened(reflected, 1 - share), self._brightened(passed, share)
        return {**over, "Base Color": front, "Translucent Weight": share, "Translucent Color": back}

    def _brightened(self, color, share):
        """A colour over a share, or white where that is more."""
        factor = 1 / max(share, 1e-6)
        if isinstance(color, tuple):
            return tuple(min(factor * c, 1.0) for c in color)
        for operation, value in (("MULTIPLY", factor), ("MINIMUM", 1.0)):
            node = self.tree.nodes.new("ShaderNodeVectorMath")
            node.operation, node.inputs[1].default_value = operation, (value,) * 3
            self.tree.links.new(color, node.inputs[0])
            color = node.outputs[0]
        return color

    def _MixShader(self, node):
        factor = self._value(node, node.inputs[0].name)
        first, second = (shaders.source(i) for i in list(node.inputs)[1:3])
        a, b = self.read(first), self.read(second)
        glazed = self._glazed(node, a, b)
        return glazed if glazed is not None else self._mixed(factor, a, b)

    def _glazed(self, node, under, over):
        """Gloss over something, mixed by Fresnel or a layer's weight: what the Principled shader is made for."""
        source = shaders.source(node.inputs[0])
        if self._is_mirror_over_diffuse(node, under, over):
            # Of the light that such a layer reflects none is lost, and the rest reaches what is below.
            trees.settle(self.material, mirror=True)
            found = {"Specular IOR Level": source, "Roughness": over["Roughness"], "Specular Tint": over["Base Color"]}
            return {**under, **found}
        if source is None or source.node.bl_idname not in ("ShaderNodeFresnel", "ShaderNodeLayerWeight"):
            return None
        if over.get("Metallic") != 1.0 or source.name == "Facing" and _has_gloss(under) or (ior := self._index(source)) is None:
            return None
        if under.get("Alpha") == 0.0 and not _shines(under):
            # A sheet that reflects once, where one of glass does twice: it is there in part, by the angle of view.
            return None
        if under.get("Transmission Weight") == 1.0:
            # What reflects is the gloss, and not what refracts.
            colored = under.get(glasses.REFLECTION) == "tinted"
            return {k: v for k, v in under.items() if colored or k != glasses.REFLECTION} | {"IOR": ior}
        if under.get("Metallic", 0.0) != 0.0:
            return None
        if under.get("Specular IOR Level") == 0.0:
            found = {"Specular IOR Level": 0.5, "IOR": ior, "Roughness": over["Roughness"]}
            return {**under, **found, "Specular Tint": over["Base Color"]}
        if over["Base Color"] != WHITE:
            self.report.warn(self.name, "a coloured gloss over a shader with its own is white here")
        # The layer of glTF has an index of 1.5.
        weight = min(((ior - 1) / (ior + 1)) ** 2 / 0.04, 1.0)
        return {**under, "Coat Weight": weight, "Coat Roughness": over["Roughness"]}

    @staticmethod
    def _is_mirror_over_diffuse(node, under, over):
        """Is gloss mixed into diffuse reflection by the angle of view, otherwise than a dielectric would?"""
        source = shaders.source(node.inputs[0])
        if source is None or source.node.bl_idname == "ShaderNodeFresnel" or source.name == "Fresnel":
            return False
        if over.get("Metallic") != 1.0 or under.get("Metallic", 0.0) != 0.0 or under.get("Alpha", 1.0) != 1.0:
            return False
        return under.get("Specular IOR Level") == 0.0 and facing.is_by_facing(node.inputs[0])

    def _index(self, source):
        """The index of refraction of what reflects as a weight says; None for one that differs from place to place."""
        if source.node.bl_idname == "ShaderNodeFresnel":
            return shaders.constant(source.node.inputs["IOR"])
        blend = shaders.constant(source.node.inputs["Blend"])
        if blend is None:
            return None
        if source.name == "Fresnel":
            return 1 / max(1 - blend, 1e-3)
        ior = views.index_of(views.mean(source.node, "Facing"))
        self.report.warn(self.name, f"Layer Weight (Facing) mixes gloss in: an index of refraction of {ior:.3g} is used instead")
        return ior

    def _mixed(self, factor, a, b):
        """Two sets of inputs, mixed."""
        for inputs, other, weight in ((a, b, factor), (b, a, self._complement(factor))):
            if inputs.get("Alpha") == 0.0 and not _shines(inputs):
                # Nothing is mixed in: the other is there in part.
                return {**other, "Alpha": self._product(weight, other.get("Alpha", 1.0))}
        a, b = _with_ground(a, b), _with_ground(b, a)
        mixed = {}
        for name in {**a, **b}:
            mixed[name] = self._mix(name, factor, a.get(name, self._idle(name, b)), b.get(name, self._idle(name, a)))
        if a.keys() - {"Normal"} and not (_shines(a) or _shines(b)):
            self.report.note(self.name, "a mix of shaders is taken for a shader of mixed inputs")
        return mixed

    @staticmethod
    def _idle(name, other):
        """An input that a shader doesn't have: no share of anything, and else that of the other."""
        if name in ("Emission Color", "IOR"):
            return other.get(name)
        if name in DEFAULTS:
            return DEFAULTS[name]
        return 0.0 if name.endswith(" Weight") or name in SHARES else other.get(name)

    def _mix(self, name, factor, a, b):
        if a == b or b is None:
            return a
        if a is None:
            return b
        if name == glasses.REFLECTION:
            return "tinted"
        if name == "Normal":
            return a
        if isinstance(factor, float) and isinstance(a, (float, tuple)) and isinstance(b, (float, tuple)):
            if isinstance(a, tuple):
                return tuple(x + (y - x) * factor for x, y in zip(a, b))
            return a + (b - a) * factor
        node = self.tree.nodes.new("ShaderNodeMix")
        node.data_type = "RGBA" if name in COLORS else "FLOAT"
        kind = "Color" if name in COLORS else "Float"
        inputs = {s.identifier: s for s in node.inputs}
        self._feed(inputs["Factor_Float"], factor)
        self._feed(inputs[f"A_{kind}"], a)
        self._feed(inputs[f"B_{kind}"], b)
        return next(s for s in node.outputs if s.identifier == f"Result_{kind}")

    def _complement(self, factor):
        if isinstance(factor, float):
            return 1.0 - factor
        return self._math("SUBTRACT", 1.0, factor)

    def _product(self, a, b):
        if b == 1.0:
            return a
        return a * b if isinstance(a, float) and isinstance(b, float) else self._math("MULTIPLY", a, b)

    def _math(self, operation, a, b):
        node = self.tree.nodes.new("ShaderNodeMath")
        node.operation = operation
        self._feed(node.inputs[0], a)
        self._feed(node.inputs[1], b)
        return node.outputs[0]

    def _feed(self, socket, value):
        if isinstance(value, float):
            socket.default_value = value if socket.type == "VALUE" else (value,) * len(socket.default_value)
        elif isinstance(value, tuple):
            socket.default_value = (*value, 1.0)[: len(socket.default_value)]
        else:
            self.tree.links.new(value, socket)


def _with_ground(inputs, other):
    """What only lets light through diffusely, mixed with what reflects: that other one with all of its light let through."""
    if inputs.get("Translucent Weight") != 1.0 or "Translucent Weight" in other:
        return inputs
    return {**other, **{name: inputs[name] for name in ("Translucent Weight", "Translucent Color")}}


def _settle_entries(group):
    """Puts the inputs of a group that are the same everywhere into its tree, so that what is made of them is known there."""
    for entries in [n for n in group.node_tree.nodes if n.bl_idname == "NodeGroupInput"]:
        for inner, outer in zip(entries.outputs, group.inputs):
            if inner.type in ("VALUE", "RGBA", "VECTOR") and (value := shaders.constant(outer)) is not None:
                trees.replace(group.node_tree, inner, shaders.as_type(value, inner.type != "VALUE"))


def _has_gloss(inputs):
    """Is it there, opaque and glossy itself? Gloss that facing mixes in is then rather a metal's than a coat's."""
    return inputs.get("Specular IOR Level") != 0.0 and inputs.get("Transmission Weight") != 1.0 and inputs.get("Alpha") != 0.0


def _shines(inputs):
    strength = inputs.get("Emission Strength", 0.0)
    return not (isinstance(strength, float) and strength == 0.0)

