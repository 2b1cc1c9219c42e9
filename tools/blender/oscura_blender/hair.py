"""Hair: curves and the strands of particles, as files of strands beside the scene file, each placement in the place where it stands."""

import math
import os
import struct

import numpy as np

from . import meshes, scene_file, shaders, strand_colors, undeformed

# Radius of curves without one, metres.
USUAL_RADIUS = 0.005

# Of a strand in a file.
MOST_POINTS = 65_536

# Inputs that may vary.
VARIED = ("Color", "Base Color", "Melanin")


class Roots:
    """What strands know of the place where they grow: texture coordinates and colours by the names of layers, and which of the
    former are the usual ones; generated coordinates."""

    def __init__(self, generated, uvs=None, colors=None, active=None):
        self.generated, self.uvs, self.colors, self.active = generated, uvs or {}, colors or {}, active

    def where(self, kept):
        of_kept = lambda layers: {name: rows[kept] for name, rows in layers.items()}
        return Roots(self.generated[kept], of_kept(self.uvs), of_kept(self.colors), self.active)


class Strands:
    """Points of strands one after another, how many each has, and their radii; what is known of their roots."""

    def __init__(self, points, counts, radii, roots):
        self.points, self.counts, self.radii, self.roots = points, counts, radii, roots

    def where(self, kept):
        """Some of the strands."""
        of_kept = np.repeat(kept, self.counts)
        return Strands(self.points[of_kept], self.counts[kept], self.radii[of_kept], self.roots.where(kept))

    def lengths(self):
        """How long the way from its root to each point is."""
        steps = np.linalg.norm(np.diff(self.points, axis=0, prepend=self.points[:1]), axis=1)
        first = np.cumsum(self.counts) - self.counts
        steps[first] = 0
        way = np.cumsum(steps)
        return way - np.repeat(way[first], self.counts)

    def write(self, path, matrix, colors=None):
        """Writes a file of Cem Yuksel's HAIR models, moved by a matrix; with colours of points, if there are some."""
        matrix = np.array(matrix, np.float32)
        placed = self.points @ matrix[:3, :3].T + matrix[:3, 3]
        thickness = 2 * self.radii * abs(np.linalg.det(matrix[:3, :3])) ** (1 / 3)
        # Which arrays there are: segments, points, thicknesses, colours.
        arrays = 1 | 2 | 4 | (0 if colors is None else 16)
        head = struct.pack("<4sIII", b"HAIR", len(self.counts), len(placed), arrays)
        with open(path, "wb") as file:
            file.write(head.ljust(128, b"\0"))
            painted = [] if colors is None else [(colors, "<f4")]
            for values, kind in ((self.counts - 1, "<u2"), (placed, "<f4"), (thickness, "<f4"), *painted):
                file.write(np.ascontiguousarray(values, kind).tobytes())


def of_curves(data):
    """The strands of an evaluated Curves object's data."""
    counts = np.diff(meshes.read(data.curve_offset_data, "value", 1, np.int32).ravel())
    points = meshes.read(data.points, "position", 3, np.float32)
    radii = np.full(len(points), USUAL_RADIUS, np.float32)
    if (given := data.attributes.get("radius")) is not None and given.domain == "POINT":
        radii = meshes.read(given.data, "value", 1, np.float32).ravel()
    roots = points[np.cumsum(counts) - counts]
    low, size = roots.min(0, initial=0), np.ptp(roots, axis=0) if len(roots) else 1
    found = Roots((roots - low) / np.where(size == 0, 1, size))
    if (given := data.attributes.get("surface_uv_coordinate")) is not None and given.domain == "CURVE":
        found.uvs, found.active = {given.name: meshes.read(given.data, "vector", 2, np.float32)}, given.name
    return Strands(points, counts, radii, found).where(counts > 1)


def of_particles(obj, modifier, system, is_varied):
    """The strands of an evaluated object's particle system, in the object's own space; with what is known of their roots, if their
    colours vary."""
    settings = system.settings
    steps = 2**settings.render_step + 1 + (settings.kink_extra_steps if settings.kink == "SPIRAL" else 0)
    parents, children = len(system.particles), len(system.child_particles)
    # Cycles shows parents where there are no children, whatever the settings say.
    first = 0 if children == 0 else parents
    numbers = range(first, parents + children)
    points = np.array([system.co_hair(obj, particle_no=i, step=step) for i in numbers for step in range(steps)], np.float32)
    points = points.reshape(len(numbers), steps, 3)
    kept = _is_there(points)
    inverse = np.array(obj.matrix_world.inverted_safe(), np.float32)
    points = points.reshape(-1, 3) @ inverse[:3, :3].T + inverse[:3, 3]
    roots = Roots(undeformed.coordinates(obj.data, points[::steps]))
    if is_varied:
        _add_layers(roots, obj.data, modifier, system, numbers)
    counts = kept.sum(1, dtype=np.int32)
    strands = Strands(points[kept.ravel()], counts, np.zeros(counts.sum(), np.float32), roots).where(counts > 1)
    strands.radii = _radii(settings, strands, steps)
    return strands


def _is_there(points):
    """Which points of strands lie before their ends. What is cut off lies in the world's origin, or where the strand ends."""
    up_to_last = lambda marks: np.logical_or.accumulate(marks[:, ::-1], axis=1)[:, ::-1]
    is_whole = up_to_last((points != 0).any(2))
    goes_on = (points[:, 1:] != points[:, :-1]).any(2) & is_whole[:, 1:]
    return np.concatenate([is_whole[:, :1], up_to_last(goes_on)], 1)


def _add_layers(roots, mesh, modifier, system, numbers):
    """What layers of a mesh have where particles grow."""
    of = lambda i: {"particle": system.particles[min(i, len(system.particles) - 1)], "particle_no": i}
    for k, layer in enumerate(mesh.uv_layers):
        roots.uvs[layer.name] = np.array([system.uv_on_emitter(modifier, **of(i), uv_no=k) for i in numbers]).reshape(-1, 2)
        if layer.active_render:
            roots.active = layer.name
    corners = (color for color in mesh.color_attributes if color.domain == "CORNER" and color.data_type == "BYTE_COLOR")
    for k, layer in enumerate(corners):
        rows = np.array([system.mcol_on_emitter(modifier, **of(i), vcol_no=k) for i in numbers]).reshape(-1, 3)
        roots.colors[layer.name] = np.concatenate([rows, np.ones((len(rows), 1))], 1)


def _radii(settings, strands, steps):
    """Radii from root to tip by the way along each strand; only those of all steps are closed at the tip."""
    root, tip = (0.5 * settings.radius_scale * r for r in (settings.root_radius, settings.tip_radius))
    way, tips = strands.lengths(), np.cumsum(strands.counts) - 1
    left = np.clip(1 - way / np.repeat(way[tips], strands.counts), 0, 1)
    power = 1 + settings.shape if settings.shape < 0 else 1 / max(1 - settings.shape, 1e-6)
    radii = left**power * (root - tip) + tip
    if settings.use_close_tip:
        radii[tips[strands.counts == steps]] = 0
    return radii.astype(np.float32)


def entries(found, folder, name, report):
    """The tables of all strands and of their materials; the strands go to the folder."""
    tables, materials = [], {}
    for number, (place, strands, matrix, material, traits) in enumerate(found.hair):
        is_short = strands.counts <= MOST_POINTS
        if not is_short.all():
            report.warn(place, f"{(~is_short).sum()} strands of more than {MOST_POINTS} points are left out")
            strands = strands.where(is_short)
        if not len(strands.counts):
            continue
        key = material.name if material is not None else ""
        if key not in materials:
            materials[key] = _material(material, report)
        settings, paint = materials[key]
        file = f"{name}.{number}.hair"
        strands.write(os.path.join(folder, file), scene_file.Y_UP @ matrix, None if paint is None else np.clip(paint(strands, matrix), 0, 1))
        tables.append(("[[curves]]", {"name": place, "file": file, "basis": "catmull-rom", "material": f"{key} (strands)", **traits}))
    named = [(f"[materials.{scene_file.value(f'{key} (strands)')}]", settings) for key, (settings, _) in materials.items()]
    return named + tables


def _shader(material):
    """The shader of a material of strands, and what reads it; twice None where nothing does."""
    node = shaders.output(material.node_tree) if material is not None and material.use_nodes and material.node_tree else None
    read = {"ShaderNodeBsdfHairPrincipled": _fibre, "ShaderNodeBsdfPrincipled": _surface, "ShaderNodeBsdfDiffuse": _diffuse}
    return (node, read[node.bl_idname]) if node is not None and node.bl_idname in read else (None, None)


def _is_varied(material):
    """Do colours of strands differ?"""
    node, _ = _shader(material)
    return node is not None and any(socket.name in VARIED and shaders.constant(socket) is None for socket in node.inputs)


def _material(material, report):
    """The settings of the material of strands, and what gives the colours of their points that these are multiplied with; None
    where all are alike."""
    grey = {"type": "pbr", "base_color": [0.8, 0.8, 0.8], "roughness": 0.5}
    if material is None or not material.use_nodes or material.node_tree is None:
        return (grey if material is None else {**grey, "base_color": list(material.diffuse_color[:3])}), None
    node, read = _shader(material)
    if node is None:
        node = shaders.output(material.node_tree)
        what = "without a shader" if node is None else f"by {node.bl_label}"
        report.warn(material.name, f"strands {what} are grey")
        return grey, None
    given = _Inputs(node, material, report)
    return read(given), given.paint


class _Inputs:
    """The inputs of a node: constants, and a colour that may vary."""

    def __init__(self, node, material, report):
        self.node, self.material, self.report = node, material, report
        self.paint = None  # colours by strands and the matrix of their object

    @property
    def name(self):
        return self.material.name

    def __call__(self, key, otherwise):
        if key not in self.node.inputs:
            return otherwise
        found = shaders.constant(self.node.inputs[key])
        if found is None:
            self.report.warn(self.name, f"{key} of strands varies and is taken as {otherwise}")
            return otherwise
        return list(found) if isinstance(found, tuple) else found

    def color(self, key):
        """A constant colour, or white where points have colours of their own."""
        found = shaders.constant(self.node.inputs[key])
        if found is not None:
            return list(found)
        self.paint = lambda strands, matrix: self.evaluated(key, strands, matrix)
        return [1.0, 1.0, 1.0]

    def evaluated(self, key, strands, matrix):
        return strand_colors.evaluate(self.material, self.node, key, strands, matrix)


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
        return {**settings, **_pigment(given, settings["radial_roughness"])}
    return {**settings, "color": given.color("Color")}


def _pigment(given, radial):
    """The colour of a fibre by its pigment, which may differ by chance from strand to strand."""
    redness, tint, chance = given("Melanin Redness", 1.0), given("Tint", [1.0] * 3), given("Random Color", 0.0)
    amount = shaders.constant(given.node.inputs["Melanin"])
    if amount is not None and chance <= 0:
        if min(tint) >= 1:
            return {"melanin": amount, "melanin_redness": redness}
        return {"color": strand_colors.of_pigment([amount], redness, tint, radial)[0].tolist()}

    def paint(strands, matrix):
        melanin = given.evaluated("Melanin", strands, matrix)[:, 0] if amount is None else np.full(len(strands.points), amount)
        factors = 1 + 2 * (strand_colors.random(len(strands.counts)) - 0.5) * min(chance, 1.0)
        melanin = np.clip(melanin * np.repeat(factors, strands.counts), 0, 1)
        return strand_colors.of_pigment(melanin, redness, tint, radial)

    given.paint = paint
    return {"color": [1.0, 1.0, 1.0]}


def _surface(given):
    return {
        "type": "pbr",
        "base_color": given.color("Base Color"),
        "roughness": given("Roughness", 0.5),
        "metallic": given("Metallic", 0.0),
    }


def _diffuse(given):
    return {"type": "lambert", "color": given.color("Color")}


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
            found.strands[key] = of_particles(obj, modifier, system, _is_varied(_original(material)))
        place = f"{obj.original.name}/{system.name}"
        found.hair.append((place, found.strands[key], instance.matrix_world.copy(), _original(material), traits))


def add_curves(found, obj, instance, traits):
    """Adds a Curves object."""
    slots = obj.material_slots
    material = slots[0].material if slots else None
    found.hair.append((obj.original.name, of_curves(obj.data), instance.matrix_world.copy(), _original(material), traits))


def _original(material):
    return None if material is None else material.original
