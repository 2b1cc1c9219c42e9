"""Volumes of solids and of the world: what each metre scatters, absorbs and adds. What differs from place to place is a graph of nodes."""

from . import node_graph, shaders
from .node_graph import as_triple, feed, is_number

# Radiance of a metre of a black body over the fourth power of its temperature in Cycles.
BODY = 5.670373e-14 / 3.14159265


class Varying(Exception):
    """The medium can't be said; the message names the node."""


class Part:
    """A shader of volumes: its extinction per metre, the share that it scatters, and the mean cosine of that."""

    def __init__(self, density, color, cosine=0.0):
        self.density, self.color, self.cosine = density, color, cosine


class Filling(node_graph.Graph):
    """What fills a volume: parts, and what each metre adds. Values are numbers, lists of three, or outputs of nodes."""

    def __init__(self, exposure=1.0):
        super().__init__(exposure)
        self.parts, self.glow, self.exposure = [], 0.0, exposure

    def difference(self, a, b):
        return a if is_number(b, 0.0) else self.folded("subtract", lambda x, y: x - y, a, b)

    def ratio(self, a, b):
        return a if is_number(b, 1.0) else self.folded("divide", lambda x, y: x / y if y else 0.0, a, b)

    def lesser(self, a, b):
        return self.folded("minimum", min, a, b)

    def positive(self, a):
        return self.folded("maximum", max, a, 0.0)

    def power(self, a, exponent):
        if not isinstance(a, str):
            return [x**exponent for x in a] if isinstance(a, list) else a**exponent
        return f"{self.made({'type': 'vector_math', 'operation': 'power', 'a': a, 'b': [exponent] * 3})}.vector"

    def given(self, node, name, groups):
        """An input of a node, not below 0."""
        socket = node.inputs[name]
        plain = shaders.constant(socket) if not groups else None
        found = super().value(feed(socket, groups), socket.type) if plain is None else plain
        return self.positive(list(found) if isinstance(found, tuple) else found)

    def cosine(self, node, groups):
        if getattr(node, "phase", "HENYEY_GREENSTEIN") != "HENYEY_GREENSTEIN":
            return 0.0
        found = super().value(feed(node.inputs["Anisotropy"], groups), "VALUE")
        if isinstance(found, str):
            raise Varying(f"{node.bl_label}, Anisotropy")
        return found

    def by_name(self, node, density):
        """The density of a shader that may name a grid for it."""
        return density

    def black_body(self, node, groups, share):
        intensity = self.given(node, "Blackbody Intensity", groups)
        if is_number(intensity, 0.0):
            return
        kelvin = self.given(node, "Temperature", groups)
        if isinstance(kelvin, str):
            color = f"{self.made({'type': 'blackbody', 'temperature': kelvin})}.color"
        else:
            color = list(max(c, 0.0) for c in shaders.blackbody(kelvin))
        # Intensity mixes between 1 and the fourth power.
        power = self.sum(1.0, self.product(intensity, self.difference(self.power(kelvin, 4.0), 1.0)))
        light = self.product(self.product(power, BODY), self.product(color, self.given(node, "Blackbody Tint", groups)))
        self.shine(self.product(light, share))

    def read(self, found, share):
        """Adds what a shader says, times a share."""
        if found.node is None or is_number(share, 0.0):
            return
        if found.node.bl_idname not in READERS:
            raise Varying(found.node.bl_label)
        READERS[found.node.bl_idname](self, found.node, found.groups, share)

    def add(self, density, color, cosine=0.0):
        if not is_number(density, 0.0):
            self.parts.append(Part(density, color, cosine))

    def shine(self, light):
        self.glow = self.sum(self.glow, light)

    def is_nothing(self):
        return not self.parts and is_number(self.glow, 0.0)

    def is_varying(self):
        return any(isinstance(value, str) for value in (self.glow, *(x for p in self.parts for x in (p.density, p.color))))

    def entries(self):
        """As scene files have it."""
        density, color, cosine = self._whole()
        glow = self.product(self.glow, self.exposure)
        found = {"density": _capped(density), "color": color if isinstance(color, str) else [min(c, 1.0) for c in as_triple(color)]}
        if cosine:
            found["anisotropy"] = max(min(cosine, 0.999), -0.999)
        if not is_number(glow, 0.0):
            found["emission"] = glow if isinstance(glow, str) else as_triple(glow)
        if self.is_varying():
            found.update(up="z", nodes=self.nodes)
        return found

    def _whole(self):
        """The extinction of all parts, the share that is scattered, and the mean cosine."""
        if len(self.parts) <= 1:
            return next(((p.density, p.color, p.cosine) for p in self.parts), (0.0, 0.0, 0.0))
        density = scattered = 0.0
        for part in self.parts:
            density = self.sum(density, part.density)
            scattered = self.sum(scattered, self.product(part.density, part.color))
        # By how much each part scatters, where that is known.
        known = [(sum(as_triple(self.product(p.density, p.color))), p) for p in self.parts if not isinstance(p.density, str) and not isinstance(p.color, str)]
        weights = known if len(known) == len(self.parts) else [(0.0 if is_number(p.color, 0.0) else 1.0, p) for p in self.parts]
        total = sum(weight for weight, _ in weights)
        cosine = sum(weight * part.cosine for weight, part in weights) / total if total > 0 else 0.0
        return density, self.ratio(scattered, density), cosine


def _capped(density):
    return density if isinstance(density, str) else [min(d, 1e9) for d in as_triple(density)]


def read(socket, exposure=1.0):
    """What feeds a volume's input.

    Raises Varying for what can't be said.
    """
    filling = Filling(exposure)
    filling.read(feed(socket), 1.0)
    if filling.baker.reasons:
        raise Varying(filling.baker.reasons[0])
    return filling


def _absorption(filling, node, groups, share):
    lost = filling.positive(filling.difference(1.0, filling.given(node, "Color", groups)))
    density = filling.product(filling.given(node, "Density", groups), share)
    filling.add(filling.product(density, lost), 0.0)


def _scatter(filling, node, groups, share):
    density = filling.product(filling.given(node, "Density", groups), share)
    filling.add(filling.product(density, filling.given(node, "Color", groups)), 1.0, filling.cosine(node, groups))


def _coefficients(filling, node, groups, share):
    coefficient = lambda kind: filling.product(filling.given(node, f"{kind} Coefficients", groups), share)
    filling.add(coefficient("Scatter"), 1.0, filling.cosine(node, groups))
    filling.add(coefficient("Absorption"), 0.0)
    filling.shine(coefficient("Emission"))


def _principled(filling, node, groups, share):
    density = filling.by_name(node, filling.product(filling.given(node, "Density", groups), share))
    color, hidden = (filling.given(node, name, groups) for name in ("Color", "Absorption Color"))
    # What isn't scattered is absorbed, but for the root of the other colour.
    rest = filling.positive(filling.difference(1.0, color))
    lost = rest if is_number(hidden, 0.0) else filling.product(rest, filling.positive(filling.difference(1.0, filling.power(hidden, 0.5))))
    taken = 1.0 if lost is rest and not isinstance(color, str) and max(as_triple(color)) <= 1.0 else filling.sum(color, lost)
    filling.add(filling.product(density, taken), filling.ratio(color, taken), filling.cosine(node, groups))
    light = filling.product(filling.given(node, "Emission Strength", groups), filling.given(node, "Emission Color", groups))
    filling.shine(filling.product(light, share))
    filling.black_body(node, groups, share)


def _emission(filling, node, groups, share):
    light = filling.product(filling.given(node, "Strength", groups), filling.given(node, "Color", groups))
    filling.shine(filling.product(light, share))


def _sum(filling, node, groups, share):
    for socket in node.inputs[:2]:
        filling.read(feed(socket, groups), share)


def _mix(filling, node, groups, share):
    factor = filling.lesser(filling.given(node, node.inputs[0].name, groups), 1.0)
    for socket, part in zip(node.inputs[1:3], (filling.difference(1.0, factor), factor)):
        filling.read(feed(socket, groups), filling.product(share, part))


READERS = {
    "ShaderNodeVolumeAbsorption": _absorption,
    "ShaderNodeVolumeScatter": _scatter,
    "ShaderNodeVolumePrincipled": _principled,
    "ShaderNodeVolumeCoefficients": _coefficients,
    "ShaderNodeEmission": _emission,
    "ShaderNodeAddShader": _sum,
    "ShaderNodeMixShader": _mix,
}
