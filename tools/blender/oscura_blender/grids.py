"""Volume shaders of volume objects: each coefficient is a constant, or a constant times a grid of the object."""

from . import media
from .node_links import as_triple, blackbody, constant, follow, output_node
from .node_types import Unsupported

# Inputs that may be a grid, besides those of Emission.
GRID_INPUTS = (
    "Density", "Emission Strength", "Emission Color", "Temperature", "Scatter Coefficients", "Absorption Coefficients", "Emission Coefficients",
)  # fmt: skip

# Grids by the outputs of Volume Info.
VOLUME_INFO = {"Color": "color", "Density": "density", "Flame": "flame", "Temperature": "temperature"}

# Emission of a black body of 1500 K.
EMISSION_AT_1500_K = media.BLACKBODY * 1500.0**4


class Scaled:
    """A grid times a number or three."""

    def __init__(self, factor, grid):
        self.factor, self.grid = factor, grid


def _factor(value):
    return value.factor if isinstance(value, Scaled) else value


class Part:
    """A coefficient by channel, and its grid; None where it is the same everywhere. Kinds are "scatter", "absorb", "emit" and "blackbody", which
    also has the scale of its grid of temperatures."""

    def __init__(self, kind, value, kelvin=None, cosine=0.0):
        self.kind, self.kelvin, self.cosine = kind, kelvin, cosine
        self.factor, self.grid = tuple(map(float, as_triple(_factor(value)))), value.grid if isinstance(value, Scaled) else None


class GridMedium(media.Medium):
    """The sum of volume shaders of an object with some grids."""

    def __init__(self, name, grids):
        super().__init__()
        self.name, self.grids = name, grids
        self.used = set()  # names of grids in the node tree
        self.losses = []  # messages

    def read(self, source, weight):
        """Adds a shader; one that oscura can't evaluate is left out."""
        try:
            super().read(source, weight)
        except Unsupported as reason:
            why = f", since it varies by {reason}" if source.node.bl_idname in media.READERS else ""
            self.losses.append(f"the volume shader {source.node.bl_label} is left out{why}")

    def input(self, node, name, groups):
        may_vary = name in GRID_INPUTS or node.bl_idname == "ShaderNodeEmission"
        try:
            value = self._evaluate(node.inputs[name], groups)
        except Unsupported:
            if may_vary:
                raise
            value = None
        if may_vary or not (value is None or isinstance(value, Scaled)):
            return self.positive(value)
        is_color = node.inputs[name].type == "RGBA"
        self.losses.append(f"{name} of the volume shader {node.bl_label} varies and is taken as {'white' if is_color else 0}")
        return [1.0] * 3 if is_color else 0.0

    def _evaluate(self, socket, groups):
        """An input as a constant or a scaled grid."""
        value = constant(socket, groups)
        if value is not None:
            return value
        source = follow(socket, groups)
        node = source.node
        if node is None:
            return source.value
        kind = node.bl_idname
        if kind == "ShaderNodeAttribute" and node.attribute_type == "GEOMETRY" and source.output.name != "Alpha":
            return self._grid(node.attribute_name)
        if kind == "ShaderNodeVolumeInfo":
            return self._grid(VOLUME_INFO[source.output.name])
        operations = {"MULTIPLY": self.product, "SCALE": self.product, "DIVIDE": self.ratio}
        is_math = kind == "ShaderNodeMath" and not node.use_clamp or kind == "ShaderNodeVectorMath" and node.operation != "DIVIDE"
        if not is_math or node.operation not in operations:
            raise Unsupported(node.bl_label)
        second = node.inputs["Scale" if node.operation == "SCALE" else 1]
        return operations[node.operation](*(self._evaluate(entry, source.groups) for entry in (node.inputs[0], second)))

    def has(self, grid):
        if grid:
            self.used.add(grid)
        return grid in self.grids

    def _grid(self, name):
        return Scaled(1.0, name) if self.has(name) else 0.0

    def folded(self, operation, fold, a, b):
        grids = {value.grid for value in (a, b) if isinstance(value, Scaled)}
        if not grids:
            return super().folded(operation, fold, a, b)
        if len(grids) > 1 or operation == "divide" and isinstance(b, Scaled):
            raise Unsupported("two grids")
        return Scaled(super().folded(operation, fold, _factor(a), _factor(b)), grids.pop())

    def cosine(self, node, groups):
        phase = getattr(node, "phase", "HENYEY_GREENSTEIN")
        if phase != "HENYEY_GREENSTEIN":
            self.losses.append(f"the phase function {phase.replace('_', ' ').title()} is replaced by isotropic scattering")
            return 0.0
        value = constant(node.inputs["Anisotropy"], groups)
        return self.input(node, "Anisotropy", groups) if value is None else value

    def density(self, node, groups, weight):
        """The density of a shader, times the grid that it names."""
        density = super().density(node, groups, weight)
        if node.bl_idname != "ShaderNodeVolumePrincipled":
            return density
        if self.has(node.inputs["Color Attribute"].default_value):
            self.losses.append("the grid of its Color Attribute is left out")
        grid = node.inputs["Density Attribute"].default_value
        if not self.has(grid):
            return density
        if not isinstance(density, Scaled):
            return Scaled(density, grid)
        if density.grid != grid:
            raise Unsupported("Density of two grids")
        self.losses.append(f"its density is the grid '{grid}', not its square as in Cycles")
        return density

    def emit_blackbody(self, node, groups, weight):
        intensity = self.input(node, "Blackbody Intensity", groups)
        if intensity <= 0:
            return
        kelvin, grid = self.input(node, "Temperature", groups), node.inputs["Temperature Attribute"].default_value
        if self.has(grid):
            if isinstance(kelvin, Scaled):
                raise Unsupported("Temperature of two grids")
            kelvin = Scaled(kelvin, grid)
        light = self.product(self.product(self.input(node, "Blackbody Tint", groups), intensity * weight), EMISSION_AT_1500_K)
        if isinstance(kelvin, Scaled):
            self._add("blackbody", Scaled(light, kelvin.grid), kelvin=kelvin.factor)
        else:
            self.emit(self.product(self.product(light, (kelvin / 1500.0) ** 4), [max(c, 0.0) for c in blackbody(kelvin)]))

    def add_part(self, extinction, albedo, cosine=0.0):
        self._add("scatter", self.product(extinction, albedo), cosine=cosine)
        self._add("absorb", self.product(extinction, self.positive(self.difference(1.0, albedo))))

    def emit(self, emission):
        self._add("emit", emission)

    def _add(self, kind, value, **more):
        if any(as_triple(_factor(value))):
            self.parts.append(Part(kind, value, **more))

    # The table.

    def entries(self, obj, scale, report):
        """The table of the medium for an object, densities times a scale; None for an empty one."""
        for loss in self.losses:
            report.warn(self.name, loss)
        extinct = [part for part in self.parts if part.kind in ("scatter", "absorb")]
        emitting = [part for part in self.parts if part.kind in ("emit", "blackbody")]
        grid, extinct = self._of_one_grid(extinct, "density", report)
        entries = _coefficients(extinct, scale)
        if emitting:
            if not extinct:
                grid = next((part.grid for part in emitting if part.grid is not None), None)
            entries.update(self._emission(emitting, grid, scale, report))
        if not any(entries["density"]) and "emission" not in entries:
            return None
        if grid is None:
            report.warn(obj, "its material uses none of its grids: the volume fills its bounding box")
            return entries
        return {**entries, "grid_name": grid}

    def _of_one_grid(self, parts, what, report):
        """The first grid of parts, and the parts with it; others are left out."""
        grids = {part.grid for part in parts}
        first = next((part.grid for part in parts if part.grid is not None), None)
        if len(grids) > 1:
            lost = ", ".join(sorted("a constant" if grid is None else f"'{grid}'" for grid in grids - {first}))
            report.warn(self.name, f"its {what} has several grids: '{first}' is kept, and left out {lost}")
        return first, [part for part in parts if part.grid == first]

    def _emission(self, parts, density_grid, scale, report):
        blackbodies = [part for part in parts if part.kind == "blackbody"]
        if blackbodies and len(blackbodies) < len(parts):
            report.warn(self.name, "it has blackbody emission and another: the other is left out")
        grid, parts = self._of_one_grid(blackbodies or parts, "emission", report)
        emission = [scale * sum(part.factor[c] for part in parts) for c in range(3)]
        if blackbodies:
            law = {"temperature_law": "stefan-boltzmann", "temperature": blackbodies[0].kelvin}
            return {"emission": emission, "temperature_grid": grid, **law}
        if grid is None and density_grid is not None:
            report.warn(self.name, "its emission is uniform in Cycles, and proportional to the density here")
        return {"emission": emission, **({} if grid in (None, density_grid) else {"emission_grid": grid})}


def _coefficients(parts, scale):
    scattering = [part for part in parts if part.kind == "scatter"]
    scattered, extinct = ([sum(part.factor[c] for part in kind) for c in range(3)] for kind in (scattering, parts))
    cosine = media.mean_cosine([sum(part.factor) for part in scattering], scattering)
    albedo = [s / e if e > 0 else 0.0 for s, e in zip(scattered, extinct)]
    return {"density": [scale * e for e in extinct], "color": albedo, **media.anisotropy(cosine)}


def read(material, grids, report):
    """The medium of a material on an object with some grids."""
    medium = GridMedium(material.name, grids)
    end = output_node(material.node_tree) if material.use_nodes else None
    if end is not None and (source := follow(end.inputs["Volume"])).node is not None:
        medium.read(source, 1.0)
    elif end is not None and follow(end.inputs["Surface"]).node is not None:
        medium.losses.append("has a surface shader and no volume shader: volume objects with it are left out")
    return medium
