"""Volumes whose shaders read grids: by which grid each part of a medium goes, and what it is taken times."""

from . import shaders
from .media import BODY, Varying

ONE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)

# The grids that outputs of Volume Info have.
VOLUME_INFO = {"Color": "color", "Density": "density", "Flame": "flame", "Temperature": "temperature"}

# The radiance of a metre of a black body of 1500 K in Cycles, whose law is that of Stefan and Boltzmann: a constant over pi, times
# a millionth.
BODY_OF_1500_KELVIN = BODY * 1500.0**4


class Part:
    """A coefficient by channel and the grid that it is taken times; None where it is the same everywhere."""

    def __init__(self, kind, factor, grid=None, kelvin=None, cosine=0.0):
        self.kind, self.factor, self.grid, self.kelvin, self.cosine = kind, factor, grid, kelvin, cosine


class Medium:
    """What a tree says about a volume that has some grids."""

    def __init__(self, name, known):
        self.name, self.known = name, known
        self.parts = []
        self.asked = set()  # grids that the tree speaks of
        self.remarks = []  # what can't be said

    def add(self, kind, factor, grid, **more):
        if any(factor):
            self.parts.append(Part(kind, tuple(float(f) for f in factor), grid, **more))

    def has(self, grid):
        """Is there such a grid? Without it a shader of Blender has no factor."""
        if grid:
            self.asked.add(grid)
        return grid in self.known

    def entries(self, place, scale, report):
        """As files of settings have it, densities times a scale; None for what does nothing."""
        for remark in self.remarks:
            report.warn(self.name, remark)
        dense = [part for part in self.parts if part.kind in ("scatter", "absorb")]
        shining = [part for part in self.parts if part.kind in ("shine", "heat")]
        grid = self._grid(dense, "density", report)
        dense = [part for part in dense if part.grid == grid]
        found = _coefficients(dense, scale)
        if shining:
            if not dense:
                grid = next((part.grid for part in shining if part.grid is not None), None)
            found.update(self._light(shining, grid, scale, report))
        if not any(found["density"]) and "emission" not in found:
            return None
        if grid is None:
            report.warn(place, "its volume goes by none of its grids: it fills the box around them")
            return found
        return {**found, "grid_name": grid}

    def _grid(self, parts, what, report):
        """The grid of most parts; others are left out."""
        names = [part.grid for part in parts]
        if not names:
            return None
        first = next((name for name in names if name is not None), None)
        if len(set(names)) > 1:
            lost = ", ".join(sorted("none" if name is None else f"'{name}'" for name in set(names) - {first}))
            report.warn(self.name, f"its {what} goes by several grids: '{first}' is kept, {lost} left out")
        return first

    def _light(self, parts, dense, scale, report):
        """The entries of what shines."""
        heat = [part for part in parts if part.kind == "heat"]
        if heat and len(heat) < len(parts):
            report.warn(self.name, "it shines as a black body and besides: the black body is kept")
        parts = heat or parts
        grid = self._grid(parts, "light", report)
        parts = [part for part in parts if part.grid == grid]
        emission = [scale * sum(part.factor[c] for part in parts) for c in range(3)]
        if grid is None:
            if dense is not None:
                report.warn(self.name, "its light is the same everywhere in Blender, and goes by the grid of densities here")
            return {"emission": emission}
        if not heat:
            return {"emission": emission, **({} if grid == dense else {"emission_grid": grid})}
        law = {"temperature_law": "stefan-boltzmann", "temperature": heat[0].kelvin}
        return {"emission": emission, "temperature_grid": grid, **law}


def _coefficients(parts, scale):
    scattered, lost = ([sum(p.factor[c] for p in parts if p.kind in kinds) for c in range(3)] for kinds in (("scatter",), ("scatter", "absorb")))
    found = {"density": [scale * l for l in lost], "color": [s / l if l > 0 else 0.0 for s, l in zip(scattered, lost)]}
    weights = [(sum(p.factor), p.cosine) for p in parts if p.kind == "scatter"]
    if (whole := sum(weight for weight, _ in weights)) > 0:
        cosine = sum(weight * cosine for weight, cosine in weights) / whole
        if cosine:
            found["anisotropy"] = max(min(cosine, 0.99), -0.99)
    return found


def read(material, known, report):
    """What a material says of a volume with grids of some names."""
    medium = Medium(material.name, known)
    end = shaders.end(material.node_tree) if material.use_nodes and material.node_tree is not None else None
    feeding = shaders.source(end.inputs["Volume"]) if end is not None else None
    if feeding is not None:
        _read(medium, feeding.node, 1.0)
    elif end is not None and shaders.source(end.inputs["Surface"]) is not None:
        medium.remarks.append("has a surface and no volume: objects that are volumes show nothing of it")
    return medium


def product(socket):
    """What an input is: a factor (a number or three), and the name of the grid that it is taken times or None.

    Raises Varying for all else.
    """
    value = shaders.constant(socket)
    if value is not None:
        return value, None
    feeding = shaders.source(socket)
    node = feeding.node if feeding is not None else None
    if node is None or node.mute:
        raise Varying(socket.node.bl_label)
    if node.bl_idname == "ShaderNodeAttribute" and node.attribute_type == "GEOMETRY" and feeding.name != "Alpha":
        return 1.0, node.attribute_name
    if node.bl_idname == "ShaderNodeVolumeInfo":
        return 1.0, VOLUME_INFO[feeding.name]
    if node.bl_idname == "ShaderNodeMath" and node.operation in ("MULTIPLY", "DIVIDE") and not node.use_clamp:
        return _combined(node, *(product(entry) for entry in node.inputs[:2]))
    if node.bl_idname == "ShaderNodeVectorMath" and node.operation in ("MULTIPLY", "SCALE"):
        return _combined(node, product(node.inputs[0]), product(node.inputs["Scale" if node.operation == "SCALE" else 1]))
    raise Varying(node.bl_label)


def _combined(node, first, second):
    (a, grid), (b, other) = first, second
    if node.operation == "DIVIDE":
        if other is not None or not isinstance(b, float) or b == 0:
            raise Varying(node.bl_label)
        b = 1 / b
    if grid is not None and other is not None:
        raise Varying(f"{node.bl_label} of two grids")
    if isinstance(a, float) and isinstance(b, float):
        return a * b, grid or other
    return tuple(x * y for x, y in zip(_triple(a), _triple(b))), grid or other


def _triple(value):
    return (value,) * 3 if isinstance(value, float) else tuple(value)


class _Inputs:
    """The inputs of a shader of volumes."""

    def __init__(self, medium, node):
        self.medium, self.node = medium, node

    def number(self, name):
        """An input that is the same everywhere; one that isn't is 0."""
        value = shaders.constant(self.node.inputs[name])
        if value is None:
            self.medium.remarks.append(f"{self.node.bl_label}, {name} of its volume varies and is taken as 0")
            return 0.0
        return value

    def color(self, name="Color", least=0.0):
        value = shaders.constant(self.node.inputs[name])
        if value is None:
            self.medium.remarks.append(f"{self.node.bl_label}, {name} of its volume varies and is taken as white")
            return ONE
        return tuple(max(c, least) for c in _triple(value))

    def factor(self, *names):
        """The product of inputs, white if they are none, and the grid that it is taken times."""
        factor, grid = ONE, None
        for name in names:
            own, other = product(self.node.inputs[name])
            if other is not None and not self.medium.has(other):
                # What asks for a grid that isn't there gets nothing.
                return BLACK, None
            if grid is not None and other is not None and grid != other:
                raise Varying(f"{self.node.bl_label} of two grids")
            factor, grid = tuple(a * max(b, 0.0) for a, b in zip(factor, _triple(own))), grid or other
        return factor, grid

    def named(self, name, otherwise=None):
        """The grid that an input names; None if there is none of that name."""
        grid = self.node.inputs[name].default_value
        return grid if self.medium.has(grid) else otherwise


def _read(medium, node, share):
    reader = _READERS.get(node.bl_idname)
    if reader is None or node.mute:
        medium.remarks.append(f"the {node.bl_label} of its volume is left out")
        return
    try:
        reader(medium, _Inputs(medium, node), share)
    except Varying as varying:
        medium.remarks.append(f"the {node.bl_label} of its volume varies by {varying}, and is left out")


def _times(factor, *more):
    for other in more:
        factor = tuple(f * o for f, o in zip(factor, _triple(other)))
    return factor


def _cosine(given):
    node = given.node
    phase = getattr(node, "phase", "HENYEY_GREENSTEIN")
    if phase != "HENYEY_GREENSTEIN":
        given.medium.remarks.append(f"scattering by {phase.replace('_', ' ').title()} is the same to all sides here")
        return 0.0
    return given.number("Anisotropy")


def _absorption(medium, given, share):
    density, grid = given.factor("Density")
    medium.add("absorb", _times(density, share, [max(1 - c, 0.0) for c in given.color()]), grid)


def _scatter(medium, given, share):
    density, grid = given.factor("Density")
    medium.add("scatter", _times(density, share, given.color()), grid, cosine=_cosine(given))


def _coefficients_node(medium, given, share):
    for name, kind in (("Scatter", "scatter"), ("Absorption", "absorb"), ("Emission", "shine")):
        factor, grid = given.factor(f"{name} Coefficients")
        medium.add(kind, _times(factor, share), grid, **({"cosine": _cosine(given)} if kind == "scatter" else {}))


def _emission(medium, given, share):
    factor, grid = given.factor("Strength", "Color")
    medium.add("shine", _times(factor, share), grid)


def _principled(medium, given, share):
    density, grid = given.factor("Density")
    named = given.named("Density Attribute")
    if grid is not None and named is not None and grid != named:
        raise Varying("Density of two grids")
    if grid is not None and grid == named:
        medium.remarks.append(f"its density goes by the square of '{grid}' in Blender, and by '{grid}' here")
    grid = grid or named
    if given.named("Color Attribute") is not None:
        medium.remarks.append("the colours of its grid are left out")
    color, hidden = given.color(), given.color("Absorption Color")
    density = _times(density, share)
    medium.add("scatter", _times(density, color), grid, cosine=_cosine(given))
    lost = [max(1 - c, 0.0) * max(1 - h**0.5, 0.0) for c, h in zip(color, hidden)]
    medium.add("absorb", _times(density, lost), grid)
    factor, shining = given.factor("Emission Strength", "Emission Color")
    medium.add("shine", _times(factor, share), shining)
    _black_body(medium, given, share)


def _black_body(medium, given, share):
    intensity = given.number("Blackbody Intensity")
    if intensity <= 0:
        return
    kelvin, grid = given.factor("Temperature")
    named = given.named("Temperature Attribute")
    if grid is not None and named is not None:
        raise Varying("Temperature of two grids")
    grid, kelvin = grid or named, kelvin[0]
    tint = _times(given.color("Blackbody Tint"), intensity * share)
    if grid is not None:
        medium.add("heat", _times(tint, BODY_OF_1500_KELVIN), grid, kelvin=kelvin)
        return
    light = BODY_OF_1500_KELVIN * (kelvin / 1500.0) ** 4
    medium.add("shine", _times(tint, light, [max(c, 0.0) for c in shaders.blackbody(kelvin)]), None)


def _sum(medium, given, share):
    for socket in given.node.inputs[:2]:
        if (feeding := shaders.source(socket)) is not None:
            _read(medium, feeding.node, share)


def _mix(medium, given, share):
    factor = min(max(given.number(given.node.inputs[0].name), 0.0), 1.0)
    for socket, part in zip(given.node.inputs[1:3], (1 - factor, factor)):
        if part > 0 and (feeding := shaders.source(socket)) is not None:
            _read(medium, feeding.node, share * part)


_READERS = {
    "ShaderNodeVolumeAbsorption": _absorption,
    "ShaderNodeVolumeScatter": _scatter,
    "ShaderNodeVolumePrincipled": _principled,
    "ShaderNodeVolumeCoefficients": _coefficients_node,
    "ShaderNodeEmission": _emission,
    "ShaderNodeAddShader": _sum,
    "ShaderNodeMixShader": _mix,
}
