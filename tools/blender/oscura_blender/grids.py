"""Volumes whose shaders read grids: by which grid each part of a medium goes, and what it is taken times."""

from . import media, shaders
from .node_graph import as_triple, feed

# Inputs of shaders that may go by a grid, besides those of Emission.
GRIDDED = (
    "Density", "Emission Strength", "Emission Color", "Temperature", "Scatter Coefficients", "Absorption Coefficients", "Emission Coefficients",
)  # fmt: skip

# The grids that outputs of Volume Info have.
VOLUME_INFO = {"Color": "color", "Density": "density", "Flame": "flame", "Temperature": "temperature"}

# The radiance of a metre of a black body of 1500 K in Cycles, whose law is that of Stefan and Boltzmann: a constant over pi, times
# a millionth.
BODY_OF_1500_KELVIN = media.BODY * 1500.0**4


class Part:
    """A coefficient by channel and the grid that it is taken times; None where it is the same everywhere."""

    def __init__(self, kind, factor, grid=None, kelvin=None, cosine=0.0):
        self.kind, self.factor, self.grid, self.kelvin, self.cosine = kind, factor, grid, kelvin, cosine


class Gridded:
    """A number or three, and the grid that they are taken times."""

    def __init__(self, factor, grid):
        self.factor, self.grid = factor, grid


class Medium(media.Filling):
    """What a tree says about a volume that has some grids."""

    def __init__(self, name, known):
        super().__init__()
        self.name, self.known = name, known
        self.asked = set()  # grids that the tree speaks of
        self.remarks = []  # what can't be said

    def has(self, grid):
        """Is there such a grid? Without it a shader of Blender has no factor."""
        if grid:
            self.asked.add(grid)
        return grid in self.known

    def read(self, found, share):
        """Adds what a shader says; what can't be said is left out."""
        try:
            super().read(found, share)
        except media.Varying as varying:
            reason = f"varies by {varying}, and is" if found.node.bl_idname in media.READERS else "is"
            self.remarks.append(f"the {found.node.bl_label} of its volume {reason} left out")

    def given(self, node, name, groups):
        """An input of a shader: one that goes by a grid, or else is the same everywhere."""
        may_vary = name in GRIDDED or node.bl_idname == "ShaderNodeEmission"
        try:
            value = self._factor(node.inputs[name], groups)
        except media.Varying:
            if may_vary:
                raise
            value = None
        if may_vary or not (value is None or isinstance(value, Gridded)):
            return self.positive(value)
        is_color = node.inputs[name].type == "RGBA"
        self.remarks.append(f"{node.bl_label}, {name} of its volume varies and is taken as {'white' if is_color else 0}")
        return [1.0] * 3 if is_color else 0.0

    def _factor(self, socket, groups):
        value = shaders.constant(socket) if not groups else None
        if value is not None:
            return list(value) if isinstance(value, tuple) else value
        found = feed(socket, groups)
        node, kind = found.node, found.node.bl_idname if found.node is not None else ""
        parts = lambda *sockets: [self._factor(entry, found.groups) for entry in sockets]
        if node is None:
            return found.value
        if kind == "ShaderNodeAttribute" and node.attribute_type == "GEOMETRY" and found.output.name != "Alpha":
            return self._by_grid(node.attribute_name)
        if kind == "ShaderNodeVolumeInfo":
            return self._by_grid(VOLUME_INFO[found.output.name])
        if kind == "ShaderNodeMath" and node.operation in ("MULTIPLY", "DIVIDE") and not node.use_clamp:
            first, second = parts(*node.inputs[:2])
            return self.product(first, second) if node.operation == "MULTIPLY" else self.ratio(first, second)
        if kind == "ShaderNodeVectorMath" and node.operation in ("MULTIPLY", "SCALE"):
            return self.product(*parts(node.inputs[0], node.inputs["Scale" if node.operation == "SCALE" else 1]))
        raise media.Varying(node.bl_label)

    def _by_grid(self, name):
        # What asks for a grid that isn't there gets nothing.
        return Gridded(1.0, name) if self.has(name) else 0.0

    def folded(self, operation, fold, a, b):
        names = {value.grid for value in (a, b) if isinstance(value, Gridded)}
        if not names:
            return super().folded(operation, fold, a, b)
        if len(names) > 1 or operation == "divide" and isinstance(b, Gridded):
            raise media.Varying("two grids")
        factors = (value.factor if isinstance(value, Gridded) else value for value in (a, b))
        return Gridded(super().folded(operation, fold, *factors), names.pop())

    def cosine(self, node, groups):
        phase = getattr(node, "phase", "HENYEY_GREENSTEIN")
        if phase != "HENYEY_GREENSTEIN":
            self.remarks.append(f"scattering by {phase.replace('_', ' ').title()} is the same to all sides here")
            return 0.0
        value = shaders.constant(node.inputs["Anisotropy"])
        return self.given(node, "Anisotropy", groups) if value is None else value

    def by_name(self, node, density):
        grid = node.inputs["Density Attribute"].default_value
        if self.has(node.inputs["Color Attribute"].default_value):
            self.remarks.append("the colours of its grid are left out")
        if not self.has(grid):
            return density
        if not isinstance(density, Gridded):
            return Gridded(density, grid)
        if density.grid != grid:
            raise media.Varying("Density of two grids")
        self.remarks.append(f"its density goes by the square of '{grid}' in Blender, and by '{grid}' here")
        return density

    def black_body(self, node, groups, share):
        intensity = self.given(node, "Blackbody Intensity", groups)
        if intensity <= 0:
            return
        kelvin, named = self.given(node, "Temperature", groups), node.inputs["Temperature Attribute"].default_value
        if self.has(named):
            if isinstance(kelvin, Gridded):
                raise media.Varying("Temperature of two grids")
            kelvin = Gridded(kelvin, named)
        light = self.product(self.product(self.given(node, "Blackbody Tint", groups), intensity * share), BODY_OF_1500_KELVIN)
        if isinstance(kelvin, Gridded):
            self._add("heat", Gridded(light, kelvin.grid), kelvin=kelvin.factor)
        else:
            self._add("shine", self.product(self.product(light, (kelvin / 1500.0) ** 4), [max(c, 0.0) for c in shaders.blackbody(kelvin)]))

    def add(self, density, color, cosine=0.0):
        self._add("scatter", self.product(density, color), cosine=cosine)
        self._add("absorb", self.product(density, self.positive(self.difference(1.0, color))))

    def shine(self, light):
        self._add("shine", light)

    def _add(self, kind, value, **more):
        factor, grid = (value.factor, value.grid) if isinstance(value, Gridded) else (value, None)
        if any(as_triple(factor)):
            self.parts.append(Part(kind, tuple(map(float, as_triple(factor))), grid, **more))

    def entries(self, place, scale, report):
        """As scene files have it, densities times a scale; None for what does nothing."""
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
            found["anisotropy"] = max(min(cosine, 0.999), -0.999)
    return found


def read(material, known, report):
    """What a material says of a volume with grids of some names."""
    medium = Medium(material.name, known)
    end = shaders.end(material.node_tree) if material.use_nodes and material.node_tree is not None else None
    if end is not None and (shown := feed(end.inputs["Volume"])).node is not None:
        medium.read(shown, 1.0)
    elif end is not None and feed(end.inputs["Surface"]).node is not None:
        medium.remarks.append("has a surface and no volume: objects that are volumes show nothing of it")
    return medium
