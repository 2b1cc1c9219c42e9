"""Hair: curves and the strands of particles, as files of strands beside the model, each placement in the place where it stands."""

import math
import os
import struct

import numpy as np

from . import shaders, sidecar

# Radius of curves without one, metres.
USUAL_RADIUS = 0.005

# Of a strand in a file.
MOST_POINTS = 65_536


class Strands:
    """Points of strands one after another, how many each has, and their radii."""

    def __init__(self, points, counts, radii):
        self.points, self.counts, self.radii = points, counts, radii

    def where(self, kept):
        """Some of the strands."""
        of_kept = np.repeat(kept, self.counts)
        return Strands(self.points[of_kept], self.counts[kept], self.radii[of_kept])

    def write(self, path, matrix):
        """Writes a file of Cem Yuksel's HAIR models, moved by a matrix."""
        matrix = np.array(matrix, np.float32)
        placed = self.points @ matrix[:3, :3].T + matrix[:3, 3]
        thickness = 2 * self.radii * abs(np.linalg.det(matrix[:3, :3])) ** (1 / 3)
        # Which arrays there are: segments, points, thicknesses.
        head = struct.pack("<4sIII", b"HAIR", len(self.counts), len(placed), 1 | 2 | 4)
        with open(path, "wb") as file:
            file.write(head.ljust(128, b"\0"))
            for values, kind in ((self.counts - 1, "<u2"), (placed, "<f4"), (thickness, "<f4")):
                file.write(np.ascontiguousarray(values, kind).tobytes())


def of_curves(data):
    """The strands of an evaluated Curves object's data."""
    counts = np.diff(_read(data.curve_offset_data, "value", 1, np.int32, len(data.curves) + 1))
    points = _read(data.points, "position", 3, np.float32, len(data.points))
    radii = np.full(len(points), USUAL_RADIUS, np.float32)
    if (given := data.attributes.get("radius")) is not None and given.domain == "POINT":
        radii = _read(given.data, "value", 1, np.float32, len(points))
    return Strands(points, counts, radii).where(counts > 1)


def of_particles(obj, system):
    """The strands of an evaluated object's particle system, in the object's own space."""
    settings = system.settings
    steps = 2**settings.render_step + 1
    parents, children = len(system.particles), len(system.child_particles)
    first = 0 if children == 0 or settings.use_parent_particles else parents
    numbers = range(first, parents + children)
    points = np.array([system.co_hair(obj, particle_no=i, step=step) for i in numbers for step in range(steps)], np.float32)
    points = points.reshape(len(numbers), steps, 3)
    # What is cut off ends in the world's origin.
    kept = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(1) > 0
    inverse = np.array(obj.matrix_world.inverted_safe(), np.float32)
    points = points.reshape(-1, 3) @ inverse[:3, :3].T + inverse[:3, 3]
    radii = np.tile(_profile(settings, steps), len(numbers))
    return Strands(points, np.full(len(numbers), steps, np.int32), radii).where(kept)


def _profile(settings, steps):
    """Radii from root to tip."""
    root, tip = (0.5 * settings.radius_scale * r for r in (settings.root_radius, settings.tip_radius))
    left = 1 - np.linspace(0, 1, steps)
    power = 1 + settings.shape if settings.shape < 0 else 1 / max(1 - settings.shape, 1e-6)
    radii = left**power * (root - tip) + tip
    if settings.use_close_tip:
        radii[-1] = 0
    return radii.astype(np.float32)


def _read(owner, name, size, kind, count):
    values = np.empty(count * size, kind)
    owner.foreach_get(name, values)
    return values.reshape(count, size) if size > 1 else values


def entries(found, turn, folder, name, report):
    """The tables of all strands and of their materials; the strands go to the folder, turned to the axes of models."""
    tables, materials = [], {}
    for number, (place, strands, matrix, material, traits) in enumerate(found.hair):
        is_short = strands.counts <= MOST_POINTS
        if not is_short.all():
            report.warn(place, f"{(~is_short).sum()} strands of more than {MOST_POINTS} points are left out")
            strands = strands.where(is_short)
        if not len(strands.counts):
            continue
        file = f"{name}.{number}.hair"
        strands.write(os.path.join(folder, file), turn @ matrix)
        key = material.name if material is not None else ""
        if key not in materials:
            materials[key] = _material(material, report)
        tables.append(("[[curves]]", {"name": place, "file": file, "basis": "catmull-rom", "material": f"{key} (strands)", **traits}))
    named = [(f"[materials.{sidecar.value(f'{key} (strands)')}]", settings) for key, settings in materials.items()]
    return named + tables


def _material(material, report):
    """The settings of the material of strands."""
    grey = {"type": "pbr", "base_color": [0.8, 0.8, 0.8], "roughness": 0.5}
    if material is None or not material.use_nodes or material.node_tree is None:
        return grey if material is None else {**grey, "base_color": list(material.diffuse_color[:3])}
    node = shaders.output(material.node_tree)
    read = {"ShaderNodeBsdfHairPrincipled": _fibre, "ShaderNodeBsdfPrincipled": _surface, "ShaderNodeBsdfDiffuse": _diffuse}
    if node is None or node.bl_idname not in read:
        what = "without a shader" if node is None else f"by {node.bl_label}"
        report.warn(material.name, f"strands {what} are grey")
        return grey
    return read[node.bl_idname](_Inputs(node, material.name, report))


class _Inputs:
    """The constants of a node's inputs."""

    def __init__(self, node, name, report):
        self.node, self.name, self.report = node, name, report

    def __call__(self, key, otherwise):
        if key not in self.node.inputs:
            return otherwise
        found = shaders.constant(self.node.inputs[key])
        if found is None:
            self.report.warn(self.name, f"{key} of strands varies and is taken as {otherwise}")
            return otherwise
        return list(found) if isinstance(found, tuple) else found


def _fibre(given):
    node = given.node
    if getattr(node, "model", "CHIANG") != "CHIANG":
        given.report.note(given.name, "hair by Huang is hair by Chiang here")
    settings = {
        "type": "hair",
        "roughness": given("Roughness", 0.3),
        "radial_roughness": given("Radial Roughness", 0.3),
        "coat": given("Coat", 0.0),
        "ior": given("IOR", 1.55),
        "tilt": math.degrees(given("Offset", 0.0349)),
    }
    if node.parametrization == "ABSORPTION":
        return {**settings, "absorption": given("Absorption Coefficient", [0.245, 0.52, 1.365])}
    if node.parametrization == "MELANIN":
        if min(given("Tint", [1.0] * 3)) < 1:
            given.report.warn(given.name, "the tint of pigment is left out")
        return {**settings, "melanin": given("Melanin", 0.8), "melanin_redness": given("Melanin Redness", 1.0)}
    return {**settings, "color": given("Color", [0.017, 0.006, 0.002])}


def _surface(given):
    return {
        "type": "pbr",
        "base_color": given("Base Color", [0.8] * 3),
        "roughness": given("Roughness", 0.5),
        "metallic": given("Metallic", 0.0),
    }


def _diffuse(given):
    return {"type": "lambert", "color": given("Color", [0.8] * 3)}


def shown_in_full(settings):
    """Makes the viewport's strands those of a final render."""
    settings.display_step, settings.display_percentage = settings.render_step, 100
    settings.child_percent = settings.rendered_child_count


def add_particles(found, obj, instance, traits):
    """Adds the strands that an evaluated object has grown."""
    for modifier in obj.modifiers:
        system = modifier.particle_system if modifier.type == "PARTICLE_SYSTEM" else None
        if system is None or system.settings.type != "HAIR" or system.settings.render_type != "PATH" or not modifier.show_render:
            continue
        slots, number = obj.material_slots, system.settings.material - 1
        material = slots[min(number, len(slots) - 1)].material if slots else None
        key = (obj.name, system.name)
        if key not in found.strands:
            found.strands[key] = of_particles(obj, system)
        place = f"{obj.original.name}/{system.name}"
        found.hair.append((place, found.strands[key], instance.matrix_world.copy(), _original(material), traits))


def add_curves(found, obj, instance, traits):
    """Adds a Curves object."""
    slots = obj.material_slots
    material = slots[0].material if slots else None
    found.hair.append((obj.original.name, of_curves(obj.data), instance.matrix_world.copy(), _original(material), traits))


def _original(material):
    return None if material is None else material.original
