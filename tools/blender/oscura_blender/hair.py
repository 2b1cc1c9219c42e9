"""Hair: Curves objects and hair particles as files of strands in world space."""

import itertools
import math
import os
import struct
from collections import namedtuple

import numpy as np

from . import generated_coordinates, hair_colors, meshes, node_trees, scene_file
from .node_links import as_triple, constant, linked, output_node

# Of curves without the attribute, in metres.
DEFAULT_RADIUS = 0.005

# The format's limit of a strand.
MAX_POINTS = 65_536

# Inputs that may vary.
COLOR_INPUTS = ("Color", "Base Color", "Melanin")

# Strands of an object or particle system: name, strands, matrix, material, and entries of visibility.
StrandsEntry = namedtuple("StrandsEntry", ("name", "strands", "matrix", "material", "visibility"))


class Roots:
    """Values of the surface at the roots of strands: generated coordinates, UV maps and color attributes by name, and the default UV map."""

    def __init__(self, generated, uvs=None, colors=None, default_uv=None):
        self.generated, self.uvs, self.colors, self.default_uv = generated, uvs or {}, colors or {}, default_uv

    def select(self, mask):
        selected = lambda layers: {name: rows[mask] for name, rows in layers.items()}
        return Roots(self.generated[mask], selected(self.uvs), selected(self.colors), self.default_uv)


class Strands:
    """The points of all strands one after another, the number of points of each strand, and the radii of points."""

    def __init__(self, points, counts, radii, roots):
        self.points, self.counts, self.radii, self.roots = points, counts, radii, roots

    def select(self, mask):
        """Some of the strands."""
        of_points = np.repeat(mask, self.counts)
        return Strands(self.points[of_points], self.counts[mask], self.radii[of_points], self.roots.select(mask))

    def first(self):
        """The index of the first point of each strand."""
        return np.cumsum(self.counts) - self.counts

    def lengths(self):
        """The length of the strand up to each point."""
        steps = np.linalg.norm(np.diff(self.points, axis=0, prepend=self.points[:1]), axis=1)
        first = self.first()
        steps[first] = 0
        length = np.cumsum(steps)
        return length - np.repeat(length[first], self.counts)

    def write(self, path, matrix, colors=None):
        """Writes a file in the HAIR format of Cem Yuksel, transformed by a matrix, with colors of points, if any."""
        matrix = np.array(matrix, np.float32)
        positions = self.points @ matrix[:3, :3].T + matrix[:3, 3]
        thickness = 2 * self.radii * abs(np.linalg.det(matrix[:3, :3])) ** (1 / 3)
        arrays = [(self.counts - 1, "<u2"), (positions, "<f4"), (thickness, "<f4")]
        flags = 1 | 2 | 4  # segments, points, thickness
        if colors is not None:
            arrays.append((colors, "<f4"))
            flags |= 16
        with open(path, "wb") as file:
            file.write(struct.pack("<4sIII", b"HAIR", len(self.counts), len(positions), flags).ljust(128, b"\0"))
            for values, dtype in arrays:
                file.write(np.ascontiguousarray(values, dtype).tobytes())


class Collector:
    def __init__(self, export):
        self.export = export
        self.particles = {}  # strands by object and particle system

    def add_curves(self, instance, visibility):
        obj = instance.object
        material = obj.material_slots[0].material if obj.material_slots else None
        self._add(obj.original.name, _of_curves(obj.data), instance, material, visibility)

    def add_particles(self, instance, visibility):
        """Adds the hair particles of an object."""
        obj = instance.object
        for modifier in obj.modifiers:
            system = modifier.particle_system if modifier.type == "PARTICLE_SYSTEM" else None
            if system is None or system.settings.type != "HAIR" or system.settings.render_type != "PATH" or not modifier.show_render:
                continue
            slots, number = obj.material_slots, system.settings.material - 1
            material = slots[min(number, len(slots) - 1)].material if slots else None
            key = (obj.name, system.name)
            if key not in self.particles:
                self.particles[key] = _of_particles(obj, modifier, system, _has_varying_color(material and material.original))
            self._add(f"{obj.original.name}/{system.name}", self.particles[key], instance, material, visibility)

    def _add(self, name, strands, instance, material, visibility):
        original = material and material.original
        self.export.strands.append(StrandsEntry(name, strands, instance.matrix_world.copy(), original, visibility))


def _of_curves(data):
    counts = np.diff(meshes.read(data.curve_offset_data, "value", 1, np.int32).ravel())
    points = meshes.read(data.points, "position", 3, np.float32)
    radii = np.full(len(points), DEFAULT_RADIUS, np.float32)
    if (given := data.attributes.get("radius")) is not None and given.domain == "POINT":
        radii = meshes.attribute_values(given).ravel()
    roots = points[np.cumsum(counts) - counts]
    low, size = roots.min(0, initial=0), np.ptp(roots, axis=0) if len(roots) else 1
    found = Roots((roots - low) / np.where(size == 0, 1, size))
    if (given := data.attributes.get("surface_uv_coordinate")) is not None and given.domain == "CURVE":
        found.uvs, found.default_uv = {given.name: meshes.attribute_values(given)}, given.name
    return Strands(points, counts, radii, found).select(counts > 1)


def _of_particles(obj, modifier, system, has_varying_color):
    """The strands of an evaluated particle system in object space; layers of the surface are read for varying colors only."""
    settings = system.settings
    steps = 2**settings.render_step + 1 + (settings.kink_extra_steps if settings.kink == "SPIRAL" else 0)
    parents, children = len(system.particles), len(system.child_particles)
    # Cycles renders parents where there are no children, whatever the settings.
    numbers = range(0 if children == 0 else parents, parents + children)
    points = _rows((system.co_hair(obj, particle_no=i, step=step) for i in numbers for step in range(steps)), 3)
    points = points.reshape(len(numbers), steps, 3)
    exists = _points_before_end(points)
    inverse = np.array(obj.matrix_world.inverted_safe(), np.float32)
    points = points.reshape(-1, 3) @ inverse[:3, :3].T + inverse[:3, 3]
    roots = Roots(generated_coordinates.coordinates(obj.data, points[::steps]))
    if has_varying_color:
        _add_layers(roots, obj.data, modifier, system, numbers)
    counts = exists.sum(1, dtype=np.int32)
    strands = Strands(points[exists.ravel()], counts, np.zeros(counts.sum(), np.float32), roots).select(counts > 1)
    strands.radii = _radii(settings, strands, steps)
    return strands


def _rows(vectors, size):
    """An array of vectors; from a list of them, NumPy makes it twenty times slower."""
    return np.fromiter(itertools.chain.from_iterable(vectors), np.float32).reshape(-1, size)


def _points_before_end(points):
    """Which points (strands, steps, 3) exist: after the end of a strand that is cut off, they are at the world's origin, or all the same."""
    up_to_last = lambda marks: np.logical_or.accumulate(marks[:, ::-1], axis=1)[:, ::-1]
    exists = up_to_last((points != 0).any(2))
    goes_on = (points[:, 1:] != points[:, :-1]).any(2) & exists[:, 1:]
    return np.concatenate([exists[:, :1], up_to_last(goes_on)], 1)


def _add_layers(roots, mesh, modifier, system, numbers):
    """Adds UV maps and colors of the surface at roots."""
    of = lambda i: {"particle": system.particles[min(i, len(system.particles) - 1)], "particle_no": i}
    for k, layer in enumerate(mesh.uv_layers):
        roots.uvs[layer.name] = _rows((system.uv_on_emitter(modifier, **of(i), uv_no=k) for i in numbers), 2)
        if layer.active_render:
            roots.default_uv = layer.name
    corners = (color for color in mesh.color_attributes if color.domain == "CORNER" and color.data_type == "BYTE_COLOR")
    for k, layer in enumerate(corners):
        rows = _rows((system.mcol_on_emitter(modifier, **of(i), vcol_no=k) for i in numbers), 3)
        roots.colors[layer.name] = np.concatenate([rows, np.ones((len(rows), 1), np.float32)], 1)


def _radii(settings, strands, steps):
    """Radii by the length from the root. Tips are closed only of strands with all their steps."""
    root, tip = (0.5 * settings.radius_scale * r for r in (settings.root_radius, settings.tip_radius))
    lengths, tips = strands.lengths(), np.cumsum(strands.counts) - 1
    left = np.clip(1 - lengths / np.repeat(lengths[tips], strands.counts), 0, 1)
    power = 1 + settings.shape if settings.shape < 0 else 1 / max(1 - settings.shape, 1e-6)
    radii = left**power * (root - tip) + tip
    if settings.use_close_tip:
        radii[tips[strands.counts == steps]] = 0
    return radii.astype(np.float32)


# Tables.


def tables(export):
    """The tables of strands and their materials; files go to the folder."""
    curves, materials = [], {}
    for number, entry in enumerate(export.strands):
        strands, is_short = entry.strands, entry.strands.counts <= MAX_POINTS
        if not is_short.all():
            export.report.warn(entry.name, f"{(~is_short).sum()} strands of more than {MAX_POINTS} points are left out")
            strands = strands.select(is_short)
        if not len(strands.counts):
            continue
        name = f"{entry.material.name if entry.material is not None else ''} (strands)"
        if name not in materials:
            materials[name] = _material(entry.material, export.report)
        settings, colors_of = materials[name]
        colors = None if colors_of is None else np.clip(colors_of(strands, entry.matrix), 0, 1)
        file = f"{export.name}.{number}.hair"
        strands.write(os.path.join(export.folder, file), scene_file.Y_UP @ entry.matrix, colors)
        table = {"name": entry.name, "file": file, "basis": "catmull-rom", "material": name, **entry.visibility}
        curves.append(("[[curves]]", table))
    return [(f"[materials.{scene_file.value(name)}]", settings) for name, (settings, _) in materials.items()] + curves


GRAY = {"type": "pbr", "base_color": [0.8, 0.8, 0.8], "roughness": 0.5}


def _surface_node(material):
    """The shader node of a material; None without one."""
    end = output_node(node_trees.tree_of(material)) if material is not None else None
    source = linked(end.inputs["Surface"]) if end is not None else None
    return source.node if source is not None else None


def _has_varying_color(material):
    node = _surface_node(material)
    if node is None or node.bl_idname not in READERS:
        return False
    return any(socket.name in COLOR_INPUTS and constant(socket) is None for socket in node.inputs)


def _material(material, report):
    """The settings of a material of strands, and a function for colors of points, with which these are multiplied, or None."""
    if material is None:
        return GRAY, None
    if node_trees.tree_of(material) is None:
        return {**GRAY, "base_color": list(material.diffuse_color[:3])}, None
    node = _surface_node(material)
    if node is None or node.bl_idname not in READERS:
        what = "materials without a surface" if node is None else f"the shader {node.bl_label}"
        report.warn(material.name, f"{what} is not supported for hair: it is rendered gray")
        return GRAY, None
    inputs = _Inputs(node, material, report)
    return READERS[node.bl_idname](inputs), inputs.colors_of


class _Inputs:
    """The inputs of a shader node for hair."""

    def __init__(self, node, material, report):
        self.node, self.material, self.report = node, material, report
        self.colors_of = None  # a function of strands and the matrix of their object

    def __call__(self, name, default):
        """A constant input; the default for one that varies, or that the node doesn't have."""
        if name not in self.node.inputs:
            return default
        value = constant(self.node.inputs[name])
        if value is None:
            self.report.warn(self.material.name, f"{name} may not vary along or among strands: it is taken as {default}")
            return default
        return as_triple(value) if isinstance(default, list) else value

    def color(self, name):
        """A constant color, or white for one that varies."""
        value = constant(self.node.inputs[name])
        if value is not None:
            return as_triple(value)
        self.colors_of = lambda strands, matrix: self.evaluate(name, strands, matrix)
        return [1.0, 1.0, 1.0]

    def evaluate(self, name, strands, matrix):
        return hair_colors.evaluate(self.material, self.node, name, strands, matrix)


def _principled_hair(inputs):
    node = inputs.node
    if node.model != "CHIANG":
        inputs.report.note(inputs.material.name, "the hair model Huang is replaced by Chiang")
    settings = {
        "type": "hair",
        "roughness": inputs("Roughness", 0.3),
        "radial_roughness": inputs("Radial Roughness", 0.3),
        "coat": inputs("Coat", 0.0),
        "ior": inputs("IOR", 1.55),
        "tilt": math.degrees(inputs("Offset", 0.0349)),
    }
    if node.parametrization == "ABSORPTION":
        return {**settings, "absorption": inputs("Absorption Coefficient", [0.245, 0.52, 1.365])}
    if node.parametrization == "MELANIN":
        return {**settings, **_melanin(inputs, settings["radial_roughness"])}
    return {**settings, "color": inputs.color("Color")}


def _melanin(inputs, radial_roughness):
    """The color by melanin, which may vary randomly among strands."""
    redness, tint, random = inputs("Melanin Redness", 1.0), inputs("Tint", [1.0] * 3), inputs("Random Color", 0.0)
    amount = constant(inputs.node.inputs["Melanin"])
    if amount is not None and random <= 0:
        if min(tint) >= 1:
            return {"melanin": amount, "melanin_redness": redness}
        return {"color": hair_colors.of_melanin([amount], redness, tint, radial_roughness)[0].tolist()}

    def colors_of(strands, matrix):
        melanin = np.full(len(strands.points), amount) if amount is not None else inputs.evaluate("Melanin", strands, matrix)[:, 0]
        factors = 1 + 2 * (hair_colors.random(len(strands.counts)) - 0.5) * min(random, 1.0)
        melanin = np.clip(melanin * np.repeat(factors, strands.counts), 0, 1)
        return hair_colors.of_melanin(melanin, redness, tint, radial_roughness)

    inputs.colors_of = colors_of
    return {"color": [1.0, 1.0, 1.0]}


def _principled(inputs):
    values = {"base_color": inputs.color("Base Color"), "roughness": inputs("Roughness", 0.5), "metallic": inputs("Metallic", 0.0)}
    return {"type": "pbr", **values}


def _diffuse(inputs):
    return {"type": "lambert", "color": inputs.color("Color")}


READERS = {
    "ShaderNodeBsdfHairPrincipled": _principled_hair,
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
}
