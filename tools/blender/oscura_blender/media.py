"""Participating media of meshes and of the world by volume shaders: extinction, single-scattering albedo and emission, each a constant or a graph
of nodes."""

from . import nodes
from .node_links import as_triple, blackbody, constant, follow, is_number
from .node_types import Unsupported

# Emission of a black body in Cycles over the fourth power of its temperature: the Stefan-Boltzmann constant / pi, times a millionth.
BLACKBODY = 5.670373e-14 / 3.14159265


class Part:
    """A shader's extinction per metre, albedo and mean cosine of scattering."""

    def __init__(self, extinction, albedo, cosine=0.0):
        self.extinction, self.albedo, self.cosine = extinction, albedo, cosine


class Medium(nodes.Graph):
    """The sum of volume shaders. Values are numbers, lists of three, or references to outputs of nodes."""

    def __init__(self, exposure=1.0, images=None):
        super().__init__(images)
        self.parts, self.emission, self.exposure = [], 0.0, exposure

    # Arithmetic besides that of `Graph`.

    def difference(self, a, b):
        return a if is_number(b, 0.0) else self.folded("subtract", lambda x, y: x - y, a, b)

    def ratio(self, a, b):
        return a if is_number(b, 1.0) else self.folded("divide", lambda x, y: x / y if y else 0.0, a, b)

    def positive(self, a):
        return self.folded("maximum", max, a, 0.0)

    def power(self, a, exponent):
        if isinstance(a, str):
            return self._vector_math("power", a=a, b=[exponent] * 3)
        return [x**exponent for x in a] if isinstance(a, list) else a**exponent

    # Inputs.

    def input(self, node, name, groups):
        """The value of an input, at least 0."""
        socket = node.inputs[name]
        value = constant(socket, groups)
        return self.positive(super().value(follow(socket, groups), socket.type) if value is None else value)

    def cosine(self, node, groups):
        """The mean cosine of a shader's phase function; others than Henyey-Greenstein's are taken as isotropic."""
        if getattr(node, "phase", "HENYEY_GREENSTEIN") != "HENYEY_GREENSTEIN":
            return 0.0
        value = super().value(follow(node.inputs["Anisotropy"], groups), "VALUE")
        if isinstance(value, str):
            raise Unsupported(f"{node.bl_label}, Anisotropy")
        return value

    def density(self, node, groups, weight):
        return self.product(self.input(node, "Density", groups), weight)

    # What shaders add, times the weight of mixes.

    def add_part(self, extinction, albedo, cosine=0.0):
        if not is_number(extinction, 0.0):
            self.parts.append(Part(extinction, albedo, cosine))

    def emit(self, emission):
        self.emission = self.sum(self.emission, emission)

    def emit_blackbody(self, node, groups, weight):
        intensity = self.input(node, "Blackbody Intensity", groups)
        if is_number(intensity, 0.0):
            return
        kelvin = self.input(node, "Temperature", groups)
        if isinstance(kelvin, str):
            color = f"{self.new({'type': 'blackbody', 'temperature': kelvin})}.color"
        else:
            color = [max(c, 0.0) for c in blackbody(kelvin)]
        # The intensity interpolates between 1 and the fourth power.
        power = self.sum(1.0, self.product(intensity, self.difference(self.power(kelvin, 4.0), 1.0)))
        emission = self.product(self.product(power, BLACKBODY), self.product(color, self.input(node, "Blackbody Tint", groups)))
        self.emit(self.product(emission, weight))

    def read(self, source, weight):
        if source.node is None or is_number(weight, 0.0):
            return
        if source.node.bl_idname not in READERS:
            raise Unsupported(source.node.bl_label)
        READERS[source.node.bl_idname](self, source.node, source.groups, weight)

    # The table.

    def is_empty(self):
        return not self.parts and is_number(self.emission, 0.0)

    def is_varying(self):
        values = [self.emission, *(value for part in self.parts for value in (part.extinction, part.albedo))]
        return any(isinstance(value, str) for value in values)

    def entries(self):
        extinction, albedo, cosine = self._total()
        emission = self.product(self.emission, self.exposure)
        entries = {
            "density": extinction if isinstance(extinction, str) else [min(x, 1e9) for x in as_triple(extinction)],
            "color": albedo if isinstance(albedo, str) else [min(x, 1.0) for x in as_triple(albedo)],
            **anisotropy(cosine),
        }
        if not is_number(emission, 0.0):
            entries["emission"] = as_triple(emission)
        if self.is_varying():
            entries.update(up="z", nodes=self.nodes)
        return entries

    def _total(self):
        """The extinction, albedo and mean cosine of all parts together."""
        if len(self.parts) <= 1:
            return next(((p.extinction, p.albedo, p.cosine) for p in self.parts), (0.0, 0.0, 0.0))
        extinction = scattered = 0.0
        for part in self.parts:
            extinction = self.sum(extinction, part.extinction)
            scattered = self.sum(scattered, self.product(part.extinction, part.albedo))
        if any(isinstance(value, str) for part in self.parts for value in (part.extinction, part.albedo)):
            weights = [0.0 if is_number(part.albedo, 0.0) else 1.0 for part in self.parts]
        else:
            weights = [sum(as_triple(self.product(part.extinction, part.albedo))) for part in self.parts]
        return extinction, self.ratio(scattered, extinction), mean_cosine(weights, self.parts)


def mean_cosine(weights, parts):
    total = sum(weights)
    return sum(weight * part.cosine for weight, part in zip(weights, parts)) / total if total > 0 else 0.0


def anisotropy(cosine):
    return {"anisotropy": max(min(cosine, 0.999), -0.999)} if cosine else {}


def read(socket, export):
    """The medium of a Volume input. Raises `Unsupported` for what oscura can't evaluate."""
    medium = Medium(export.exposure, export.images)
    medium.read(follow(socket), 1.0)
    if medium.baker.reasons:
        raise Unsupported(medium.baker.reasons[0])
    return medium


def _absorption(medium, node, groups, weight):
    absorbed = medium.positive(medium.difference(1.0, medium.input(node, "Color", groups)))
    medium.add_part(medium.product(medium.density(node, groups, weight), absorbed), 0.0)


def _scatter(medium, node, groups, weight):
    density = medium.density(node, groups, weight)
    medium.add_part(medium.product(density, medium.input(node, "Color", groups)), 1.0, medium.cosine(node, groups))


def _coefficients(medium, node, groups, weight):
    coefficient = lambda kind: medium.product(medium.input(node, f"{kind} Coefficients", groups), weight)
    medium.add_part(coefficient("Scatter"), 1.0, medium.cosine(node, groups))
    medium.add_part(coefficient("Absorption"), 0.0)
    medium.emit(coefficient("Emission"))


def _principled(medium, node, groups, weight):
    density = medium.density(node, groups, weight)
    color, absorption = (medium.input(node, name, groups) for name in ("Color", "Absorption Color"))
    # Cycles scatters by the color, and absorbs what is left times one minus the square root of the absorption color.
    rest = medium.positive(medium.difference(1.0, color))
    is_plain = is_number(absorption, 0.0)
    absorbed = rest if is_plain else medium.product(rest, medium.positive(medium.difference(1.0, medium.power(absorption, 0.5))))
    extinct = 1.0 if is_plain and not isinstance(color, str) and max(as_triple(color)) <= 1.0 else medium.sum(color, absorbed)
    medium.add_part(medium.product(density, extinct), medium.ratio(color, extinct), medium.cosine(node, groups))
    emission = medium.product(medium.input(node, "Emission Strength", groups), medium.input(node, "Emission Color", groups))
    medium.emit(medium.product(emission, weight))
    medium.emit_blackbody(node, groups, weight)


def _emission(medium, node, groups, weight):
    emission = medium.product(medium.input(node, "Strength", groups), medium.input(node, "Color", groups))
    medium.emit(medium.product(emission, weight))


def _add(medium, node, groups, weight):
    for socket in node.inputs[:2]:
        medium.read(follow(socket, groups), weight)


def _mix(medium, node, groups, weight):
    factor = medium.folded("minimum", min, medium.input(node, node.inputs[0].name, groups), 1.0)
    for socket, part in zip(node.inputs[1:3], (medium.difference(1.0, factor), factor)):
        medium.read(follow(socket, groups), medium.product(weight, part))


READERS = {
    "ShaderNodeVolumeAbsorption": _absorption,
    "ShaderNodeVolumeScatter": _scatter,
    "ShaderNodeVolumePrincipled": _principled,
    "ShaderNodeVolumeCoefficients": _coefficients,
    "ShaderNodeEmission": _emission,
    "ShaderNodeAddShader": _add,
    "ShaderNodeMixShader": _mix,
}
