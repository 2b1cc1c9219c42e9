"""Volumes that are the same everywhere: what scatters, absorbs and glows, each metre; in solids, and around everything."""

import math

from . import shaders

BLACK = (0.0, 0.0, 0.0)


class Filling:
    """What a metre of a medium does to light: scattered, absorbed and added, by channel; and the mean cosine of scattering."""

    def __init__(self, scattered=BLACK, absorbed=BLACK, glow=BLACK, cosine=0.0):
        self.scattered, self.absorbed, self.glow, self.cosine = scattered, absorbed, glow, cosine

    def __add__(self, other):
        ours, theirs = sum(self.scattered), sum(other.scattered)
        cosine = (self.cosine * ours + other.cosine * theirs) / (ours + theirs) if ours + theirs > 0 else 0.0
        both = lambda a, b: tuple(x + y for x, y in zip(a, b))
        absorbed, glow = both(self.absorbed, other.absorbed), both(self.glow, other.glow)
        return Filling(both(self.scattered, other.scattered), absorbed, glow, cosine)

    def times(self, share):
        parts = (tuple(share * x for x in part) for part in (self.scattered, self.absorbed, self.glow))
        return Filling(*parts, self.cosine)

    def is_nothing(self):
        return not any((*self.scattered, *self.absorbed, *self.glow))

    def entries(self, factor=1.0):
        """As files of settings have it; what shines is multiplied."""
        density = [s + a for s, a in zip(self.scattered, self.absorbed)]
        color = [s / d if d > 0 else 0.0 for s, d in zip(self.scattered, density)]
        found = {"density": [min(d, 1e9) for d in density], "color": color}
        if self.cosine:
            found["anisotropy"] = max(min(self.cosine, 0.99), -0.99)
        if any(self.glow):
            found["emission"] = [factor * g for g in self.glow]
        return found


class Varying(Exception):
    """The medium is not the same everywhere; the message names the node that says so."""


def read(socket):
    """What feeds a volume's input.

    Raises Varying for what can't be said in numbers.
    """
    source = shaders.source(socket)
    if source is None:
        return Filling()
    node = source.node
    reader = _READERS.get(node.bl_idname)
    if reader is None or node.mute:
        raise Varying(node.bl_label)
    return reader(node)


def _value(node, name):
    value = shaders.constant(node.inputs[name])
    if value is None:
        raise Varying(f"{node.bl_label}, {name}")
    return value


def _color(node, name="Color"):
    return tuple(max(c, 0.0) for c in shaders.as_type(_value(node, name), True))


def _density(node):
    return max(_value(node, "Density"), 0.0)


def _absorption(node):
    density = _density(node)
    return Filling(absorbed=tuple(max(1 - c, 0.0) * density for c in _color(node)))


def _scatter(node):
    density = _density(node)
    cosine = _value(node, "Anisotropy") if getattr(node, "phase", "HENYEY_GREENSTEIN") == "HENYEY_GREENSTEIN" else 0.0
    return Filling(scattered=tuple(c * density for c in _color(node)), cosine=cosine)


def _coefficients(node):
    scattered = _color(node, "Scatter Coefficients")
    absorbed = _color(node, "Absorption Coefficients")
    return Filling(scattered, absorbed, _color(node, "Emission Coefficients"), _value(node, "Anisotropy"))


def _principled(node):
    density = _density(node)
    color, hidden = _color(node), _color(node, "Absorption Color")
    scattered = tuple(c * density for c in color)
    absorbed = tuple(max(1 - c, 0.0) * max(1 - math.sqrt(h), 0.0) * density for c, h in zip(color, hidden))
    strength = max(_value(node, "Emission Strength"), 0.0)
    glow = tuple(strength * c for c in _color(node, "Emission Color"))
    if _value(node, "Blackbody Intensity") > 0:
        raise Varying(f"{node.bl_label}, Blackbody Intensity")
    return Filling(scattered, absorbed, glow, _value(node, "Anisotropy"))


def _emission(node):
    strength = max(_value(node, "Strength"), 0.0)
    return Filling(glow=tuple(strength * c for c in _color(node)))


def _sum(node):
    return read(node.inputs[0]) + read(node.inputs[1])


def _mix(node):
    share = min(max(_value(node, node.inputs[0].name), 0.0), 1.0)
    return read(node.inputs[1]).times(1 - share) + read(node.inputs[2]).times(share)


_READERS = {
    "ShaderNodeVolumeAbsorption": _absorption,
    "ShaderNodeVolumeScatter": _scatter,
    "ShaderNodeVolumePrincipled": _principled,
    "ShaderNodeVolumeCoefficients": _coefficients,
    "ShaderNodeEmission": _emission,
    "ShaderNodeAddShader": _sum,
    "ShaderNodeMixShader": _mix,
}
