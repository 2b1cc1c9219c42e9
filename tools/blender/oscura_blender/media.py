"""Volumes of solids and of the world: what each metre scatters, absorbs and adds. What differs from place to place is a graph of nodes."""

from . import node_graph, shaders
from .node_graph import feed

# Radiance of a metre of a black body over the fourth power of its temperature in Cycles.
BODY = 5.670373e-14 / 3.14159265


class Varying(Exception):
    """The medium can't be said; the message names the node."""


class Part:
    """A shader of volumes: its extinction per metre, the share that it scatters, and the mean cosine of that."""

    def __init__(self, density, color, cosine=0.0):
        self.density, self.color, self.cosine = density, color, cosine


class Filling:
    """What fills a volume: parts, and what each metre adds. Values are numbers, lists of three, or outputs of nodes of a graph."""

    def __init__(self, exposure=1.0):
        self.graph = node_graph.Graph(exposure)
        self.parts, self.glow, self.exposure = [], 0.0, exposure

    # Arithmetic of values, folded where they are constant.

    def _made(self, operation, fold, a, b):
        if not isinstance(a, str) and not isinstance(b, str):
            pairs = zip(_triple(a), _triple(b), strict=True)
            return [fold(x, y) for x, y in pairs] if isinstance(a, list) or isinstance(b, list) else fold(a, b)
        return f"{self.graph.made({'type': 'vector_math', 'operation': operation, 'a': a, 'b': b})}.vector"

    def sum(self, a, b):
        return b if _is(a, 0.0) else a if _is(b, 0.0) else self._made("add", lambda x, y: x + y, a, b)

    def difference(self, a, b):
        return a if _is(b, 0.0) else self._made("subtract", lambda x, y: x - y, a, b)

    def product(self, a, b):
        if _is(a, 0.0) or _is(b, 0.0):
            return 0.0
        return b if _is(a, 1.0) else a if _is(b, 1.0) else self._made("multiply", lambda x, y: x * y, a, b)

    def ratio(self, a, b):
        return a if _is(b, 1.0) else self._made("divide", lambda x, y: x / y if y else 0.0, a, b)

    def lesser(self, a, b):
        return self._made("minimum", min, a, b)

    def positive(self, a):
        return self._made("maximum", max, a, 0.0)

    def power(self, a, exponent):
        if not isinstance(a, str):
            return [x**exponent for x in a] if isinstance(a, list) else a**exponent
        return f"{self.graph.made({'type': 'vector_math', 'operation': 'power', 'a': a, 'b': [exponent] * 3})}.vector"

    def value(self, node, name, groups):
        """An input of a node, not below 0."""
        socket = node.inputs[name]
        plain = shaders.constant(socket) if not groups else None
        found = self.graph.value(feed(socket, groups), socket.type) if plain is None else plain
        return self.positive(list(found) if isinstance(found, tuple) else found)

    def cosine(self, node, groups):
        if getattr(node, "phase", "HENYEY_GREENSTEIN") != "HENYEY_GREENSTEIN":
            return 0.0
        found = self.graph.value(feed(node.inputs["Anisotropy"], groups), "VALUE")
        if isinstance(found, str):
            raise Varying(f"{node.bl_label}, Anisotropy")
        return found

    def add(self, density, color, cosine=0.0):
        if not _is(density, 0.0):
            self.parts.append(Part(density, color, cosine))

    def shine(self, light):
        self.glow = self.sum(self.glow, light)

    def is_nothing(self):
        return not self.parts and _is(self.glow, 0.0)

    def is_varying(self):
        return any(isinstance(value, str) for value in (self.glow, *(x for p in self.parts for x in (p.density, p.color))))

    def entries(self):
        """As files of settings have it."""
        density, color, cosine = self._whole()
        glow = self.product(self.glow, self.exposure)
        found = {"density": _capped(density), "color": color if isinstance(color, str) else [min(c, 1.0) for c in _triple(color)]}
        if cosine:
            found["anisotropy"] = max(min(cosine, 0.99), -0.99)
        if not _is(glow, 0.0):
            found["emission"] = glow if isinstance(glow, str) else _triple(glow)
        if self.is_varying():
            found.update(up="z", nodes=self.graph.nodes)
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
        known = [(sum(_triple(self.product(p.density, p.color))), p) for p in self.parts if not isinstance(p.density, str) and not isinstance(p.color, str)]
        weights = known if len(known) == len(self.parts) else [(0.0 if _is(p.color, 0.0) else 1.0, p) for p in self.parts]
        total = sum(weight for weight, _ in weights)
        cosine = sum(weight * part.cosine for weight, part in weights) / total if total > 0 else 0.0
        return density, self.ratio(scattered, density), cosine


def _triple(value):
    return value if isinstance(value, list) else [value] * 3


def _is(value, number):
    return not isinstance(value, str) and all(x == number for x in _triple(value))


def _capped(density):
    return density if isinstance(density, str) else [min(d, 1e9) for d in _triple(density)]


def read(socket, exposure=1.0):
    """What feeds a volume's input.

    Raises Varying for what can't be said.
    """
    filling = Filling(exposure)
    _read(filling, feed(socket), 1.0)
    if filling.graph.baker.reasons:
        raise Varying(filling.graph.baker.reasons[0])
    return filling


def _read(filling, found, share):
    node = found.node
    if node is None or _is(share, 0.0):
        return
    reader = _READERS.get(node.bl_idname)
    if reader is None:
        raise Varying(node.bl_label)
    reader(filling, node, found.groups, share)


def _absorption(filling, node, groups, share):
    lost = filling.positive(filling.difference(1.0, filling.value(node, "Color", groups)))
    density = filling.product(filling.value(node, "Density", groups), share)
    filling.add(filling.product(density, lost), 0.0)


def _scatter(filling, node, groups, share):
    density = filling.product(filling.value(node, "Density", groups), share)
    filling.add(filling.product(density, filling.value(node, "Color", groups)), 1.0, filling.cosine(node, groups))


def _coefficients(filling, node, groups, share):
    coefficient = lambda kind: filling.product(filling.value(node, f"{kind} Coefficients", groups), share)
    filling.add(coefficient("Scatter"), 1.0, filling.cosine(node, groups))
    filling.add(coefficient("Absorption"), 0.0)
    filling.shine(coefficient("Emission"))


def _principled(filling, node, groups, share):
    density = filling.product(filling.value(node, "Density", groups), share)
    color, hidden = (filling.value(node, name, groups) for name in ("Color", "Absorption Color"))
    # What isn't scattered is absorbed, but for the root of the other colour.
    rest = filling.positive(filling.difference(1.0, color))
    lost = rest if _is(hidden, 0.0) else filling.product(rest, filling.positive(filling.difference(1.0, filling.power(hidden, 0.5))))
    taken = 1.0 if lost is rest and not isinstance(color, str) and max(_triple(color)) <= 1.0 else filling.sum(color, lost)
    filling.add(filling.product(density, taken), filling.ratio(color, taken), filling.cosine(node, groups))
    light = filling.product(filling.value(node, "Emission Strength", groups), filling.value(node, "Emission Color", groups))
    filling.shine(filling.product(light, share))
    _black_body(filling, node, groups, share)


def _black_body(filling, node, groups, share):
    intensity = filling.value(node, "Blackbody Intensity", groups)
    if _is(intensity, 0.0):
        return
    kelvin = filling.value(node, "Temperature", groups)
    if isinstance(kelvin, str):
        color = f"{filling.graph.made({'type': 'blackbody', 'temperature': kelvin})}.color"
    else:
        color = list(max(c, 0.0) for c in shaders.blackbody(kelvin))
    # Intensity mixes between 1 and the fourth power.
    power = filling.power(kelvin, 4.0)
    power = filling.sum(1.0, filling.product(intensity, filling.difference(power, 1.0)))
    light = filling.product(filling.product(power, BODY), filling.product(color, filling.value(node, "Blackbody Tint", groups)))
    filling.shine(filling.product(light, share))


def _emission(filling, node, groups, share):
    light = filling.product(filling.value(node, "Strength", groups), filling.value(node, "Color", groups))
    filling.shine(filling.product(light, share))


def _sum(filling, node, groups, share):
    for socket in node.inputs[:2]:
        _read(filling, feed(socket, groups), share)


def _mix(filling, node, groups, share):
    factor = filling.lesser(filling.value(node, node.inputs[0].name, groups), 1.0)
    for socket, part in zip(node.inputs[1:3], (filling.difference(1.0, factor), factor)):
        _read(filling, feed(socket, groups), filling.product(share, part))


_READERS = {
    "ShaderNodeVolumeAbsorption": _absorption,
    "ShaderNodeVolumeScatter": _scatter,
    "ShaderNodeVolumePrincipled": _principled,
    "ShaderNodeVolumeCoefficients": _coefficients,
    "ShaderNodeEmission": _emission,
    "ShaderNodeAddShader": _sum,
    "ShaderNodeMixShader": _mix,
}
