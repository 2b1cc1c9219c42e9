"""Glass and Refraction shaders, and sums of them: the trick by which Cycles is given glass that splits colours, a node each for red, green
and blue light, with different indices of refraction."""

from . import shaders

# Wavelengths in nanometres: where indices of refraction are given, between which the Abbe number is, and for which red and blue stand.
D_LINE, F_LINE, C_LINE = 587.6, 486.1, 656.3
RED, BLUE = 611.4, 464.2

# Less is rounding.
LEAST_DISPERSION = 1e-5

# Shaders that light passes, and what they reflect; see `glass_reflection` of the file of settings.
REFLECTIONS = {"ShaderNodeBsdfGlass": "tinted", "ShaderNodeBsdfRefraction": "none"}

# What inputs say of glass that the Principled shader has no word for.
REFLECTION, DISPERSION = "Glass Reflection", "Dispersion"


def inputs(node, color, roughness, ior):
    """The inputs that stand for one of these shaders; its colour is that of light that has passed two surfaces, as the Principled
    shader's is."""
    found = {"Base Color": color, "Transmission Weight": 1.0, "Roughness": roughness, "IOR": ior}
    reflection = REFLECTIONS[node.bl_idname]
    # White glass reflects as all glass does.
    return found if reflection == "tinted" and color == (1.0, 1.0, 1.0) else {**found, REFLECTION: reflection}


def parts(node):
    """The shaders that a sum is of, sums of sums included; None where one is missing or muted."""
    if node.bl_idname != "ShaderNodeAddShader":
        return [node]
    found = []
    for entry in node.inputs:
        feeding = shaders.source(entry)
        within = parts(feeding.node) if feeding is not None and not feeding.node.mute else None
        if within is None:
            return None
        found += within
    return found


def summed(node, warn):
    """The colour, the index of refraction and the dispersion of a sum of glass that differs in these alone, and one of its shaders; None
    for other sums."""
    nodes = parts(node)
    if nodes is None or nodes[0].bl_idname not in REFLECTIONS or not all(_is_alike(n, nodes[0]) for n in nodes):
        return None
    colors, iors = ([shaders.constant(n.inputs[name]) for n in nodes] for name in ("Color", "IOR"))
    if None in colors or None in iors:
        return None
    total = tuple(sum(channel) for channel in zip(*colors))
    if max(total) > 1 + 1e-6:
        warn("a sum of glass that adds light is white where it does")
    by_channel = [_mean(iors, [color[c] for color in colors]) for c in range(3)]
    ior, dispersion = _dispersion(by_channel)
    if dispersion < LEAST_DISPERSION:
        if dispersion < -LEAST_DISPERSION:
            warn("glass that bends red more than blue bends all light alike here")
        ior, dispersion = _mean(by_channel, total), 0.0
    return tuple(min(c, 1.0) for c in total), ior, dispersion, nodes[0]


def _is_alike(node, first):
    """Does glass differ from other glass in nothing but its colour and its index?"""
    if node.bl_idname != first.bl_idname or node.distribution != first.distribution:
        return False
    for entry in first.inputs:
        if entry.name in ("Color", "IOR") or not entry.enabled:
            continue
        one, other = shaders.source(entry), shaders.source(node.inputs[entry.name])
        if one != other or one is None and shaders.constant(entry) != shaders.constant(node.inputs[entry.name]):
            return False
    return True


def _mean(values, weights):
    total = sum(weights)
    if total <= 0:
        return sum(values) / len(values)
    return sum(v * w for v, w in zip(values, weights)) / total


def _dispersion(by_channel):
    """An index of refraction and 20 / Abbe number of glass by Cauchy's law that bends red and blue by these indices; negative where red is
    bent more."""
    red, _, blue = by_channel
    inverse_square = lambda nm: (1000 / nm) ** 2
    slope = (blue - red) / (inverse_square(BLUE) - inverse_square(RED))
    ior = red - slope * (inverse_square(RED) - inverse_square(D_LINE))
    spread = slope * (inverse_square(F_LINE) - inverse_square(C_LINE))
    return ior, 20 * spread / max(ior - 1, 1e-6)
