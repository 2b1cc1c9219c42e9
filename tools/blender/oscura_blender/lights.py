"""Lights and portals."""

import math
import os
import shutil

import bpy
import numpy as np
from mathutils import Matrix

from . import ies_profiles, light_nodes, node_trees, scene_file
from .objects import VISIBILITY, light_group

# Cycles' watts of a lumen of a profile, and those of scene files.
CYCLES_LUMENS_PER_WATT, LUMENS_PER_WATT = 177.83, 683.0

# The largest cosine between axes of area lights that are not skewed.
MAX_SKEW = 1e-4

ALL_RAYS = {"diffuse", "glossy", "transmission", "volume"}


def tables(export):
    made = []
    for number, (obj, matrix, key) in enumerate(export.lights):
        light = obj.data
        if scene_file.is_singular(matrix):
            if light.type != "POINT":
                export.report.warn(obj.name, "this light is left out, since its scale is 0")
                continue
            matrix = Matrix.Translation(matrix.translation)
        if light.type == "AREA" and light.cycles.is_portal:
            size = [max(s, 1e-9) for s in _area_size(light)]
            made.append(("[[portals]]", {"name": obj.name, "size": size, **scene_file.placement(matrix, None, None)}))
            continue
        entries = _Writer(export, obj, matrix, f"light {number}: {obj.name}").entries()
        if entries:
            place = _placement(export, obj, matrix, key)
            made += [("[[lights]]", {**entry, **place}) for entry in entries]
    return made


def _placement(export, obj, matrix, key):
    unskewed = lambda matrix: _unskewed(matrix, export.report, obj.name) if obj.data.type == "AREA" else matrix
    moves = export.moves
    matrices = moves.matrices_of(key) if moves is not None else None
    return scene_file.placement(unskewed(matrix), moves and moves.frames, matrices and [unskewed(then) for then in matrices])


class _Writer:
    """The tables of a light: several where its node tree emits a profile for each channel."""

    def __init__(self, export, obj, matrix, name):
        self.export, self.obj, self.light, self.scale = export, obj, obj.data, matrix.to_scale()
        self.name = name  # of its files

    def warn(self, message):
        self.export.report.warn(self.obj.name, message)

    def new_file(self, suffix):
        """A file of the light: its name, and its path."""
        file = f"{bpy.path.clean_name(self.name)}{suffix}"
        return file, os.path.join(self.export.folder, file)

    def entries(self):
        """Entries without the place; none for lights without power or area."""
        if self.light.type == "AREA" and 0 in _area_size(self.light):
            return []
        found = []
        for emission in self._emissions():
            energy = self.light.energy * emission.strength * self.export.exposure
            if energy == 0 or not any(emission.color):
                continue
            if energy < 0 or min(emission.color) < 0:
                self.warn("this light is left out, since its strength is negative")
                continue
            kind, values = self._shape(energy, emission)
            found.append({"name": self.obj.name + emission.suffix, "color": emission.color, **self._common(), kind: values})
        return found

    def _emissions(self):
        """The emissions of the node tree times strength and color of the light, with colors of a maximum of 1."""
        light = self.light
        factor = 2.0 ** getattr(light, "exposure", 0.0)  # since Blender 4.5, as the temperature
        color = list(light.color)
        if getattr(light, "use_temperature", False):
            color = [c * t for c, t in zip(color, light.temperature_color)]
        emissions = [light_nodes.Emission(1.0, [1.0] * 3)]
        if node_trees.tree_of(light) is not None:
            emission = light_nodes.read(light.node_tree)
            emissions = [emission] if emission is not None else self._rendered()
        for emission in emissions:
            tinted = [c * t for c, t in zip(color, emission.color)]
            peak = max(max(tinted), 1e-30)
            emission.strength, emission.color = factor * emission.strength * peak, [c / peak for c in tinted]
        return emissions

    def _rendered(self):
        """Emissions of a node tree by rendering; the distance is the median of that to all objects."""
        boxes, distance = self.export.boxes, 1.0
        if len(boxes):
            offsets = boxes.mean(1) - np.array(self.obj.matrix_world.translation)
            distance = max(float(np.median(np.linalg.norm(offsets, axis=1))), 0.01)
        return light_nodes.render(self.light, self.name, self.obj.name, distance, self.export.folder, self.export.report)

    def _common(self):
        entries = {}
        if group := light_group(self.obj):
            entries["group"] = group
        if self.light.type != "SUN":
            entries.update({"visible_to_camera": bool(self.obj.visible_camera), "obstacle": False})
        visible_to = [kind for key, kind in VISIBILITY.items() if key == "visible_shadow" or getattr(self.obj, key)]
        if not ALL_RAYS <= set(visible_to):
            entries["visible_to"] = visible_to
        entries.update(self.export.links.tables(self.obj))
        if not self.light.use_shadow:
            entries["shadow_link"] = {"include": []}
        return entries

    def _shape(self, energy, emission):
        """The key of the light's type, and its values."""
        light = self.light
        values = {"SUN": self._sun, "AREA": self._area}.get(light.type, self._sphere)(energy)
        if light.type == "SPOT" and self._stretch(values, emission):
            return "spot", values
        if emission.image is not None:
            values["image"] = emission.image
        if emission.profile is not None:
            values.update({"ies": emission.profile, "intensity": values.pop("power") / (4 * math.pi)})
        elif emission.node is not None and (file := self._profile(emission.node)) is not None:
            del values["power"]
            strength = energy * self._area_factor(self._sphere_area()) * LUMENS_PER_WATT / CYCLES_LUMENS_PER_WATT
            values.update({"ies": file, "strength": strength, "clockwise": True, "turn": 90})
        return light.type.lower(), values

    def _sun(self, energy):
        return {"angle": math.degrees(min(self.light.angle, math.pi)), "irradiance": energy}

    def _sphere(self, energy):
        light, values = self.light, {}
        if light.type == "SPOT":
            half_angle = ies_profiles.SpotCone(light, self.scale).mean_half_angle()
            values.update({"angle": math.degrees(2 * half_angle), "blend": light.spot_blend})
        values["radius"] = light.shadow_soft_size
        if getattr(light, "use_soft_falloff", False) and light.shadow_soft_size > 0:
            values["soft_falloff"] = True
        return {**values, "power": energy * self._area_factor(self._sphere_area())}

    def _area(self, energy):
        light, size = self.light, _area_size(self.light)
        is_round = light.shape in ("DISK", "ELLIPSE")
        area = size[0] * size[1] * abs(self.scale.x * self.scale.y) * (math.pi / 4 if is_round else 1)
        values = {"size": list(size)}
        if is_round:
            values["shape"] = "ellipse"
        spread = math.degrees(light.spread)
        if spread < 179.9:
            values["spread"] = max(spread, 0.1)
        return {**values, "power": energy * self._area_factor(area)}

    def _stretch(self, values, emission):
        """Gives a spot light whose cone is not round a profile; returns whether it has one."""
        cone = ies_profiles.SpotCone(self.light, self.scale)
        if cone.is_unchanged() or (cone.is_round() and cone.blend == 0):
            return False
        if emission.node is not None or emission.profile is not None:
            self.warn("the cone of this light has its mean angle: its scale can't be combined with its node tree")
            return False
        file, path = self.new_file("_cone.ies")
        cone.write(path)
        power = values.pop("power")
        angle = math.degrees(2 * cone.max_half_angle())
        values.update({"angle": angle, "blend": 0.0, "ies": file, "intensity": power / (4 * math.pi)})
        return True

    def _profile(self, node):
        """The file of a profile; None where there is none, or where it can't be used."""
        if self.light.type not in ("POINT", "SPOT"):
            self.warn("profiles (IES) are supported for point and spot lights only: this light emits evenly")
            return None
        file, path = self.new_file(".ies")
        if node.mode == "INTERNAL":
            if node.ies is None:
                return None
            with open(path, "w", encoding="utf-8", newline="\n") as stream:
                stream.write(node.ies.as_string())
            return file
        original = bpy.path.abspath(node.filepath, library=node.id_data.library)
        try:
            shutil.copyfile(original, path)
        except OSError as error:
            self.warn(f"the profile (IES) of this light can't be read: {original}: {error.strerror}")
            return None
        return file

    def _sphere_area(self):
        return 4 * math.pi * self.light.shadow_soft_size**2

    def _area_factor(self, area):
        """The area where the strength is that of each square metre."""
        return 1 if getattr(self.light, "normalize", True) or area == 0 else area  # since Blender 4.5


def _area_size(light):
    """Width and height of an area light. It emits nothing with a size of 0."""
    return light.size, (light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size)


def _unskewed(matrix, report, name):
    """The matrix of an area light without the skew of a scaled parent: lengths, the plane of the axes and the emitting side stay."""
    u, v, w = (matrix.col[k].to_3d() for k in range(3))
    lengths = [max(axis.length, 1e-12) for axis in (u, v, w)]
    first, second, third = (axis / length for axis, length in zip((u, v, w), lengths))
    if max(abs(first.dot(second)), abs(first.dot(third)), abs(second.dot(third))) < MAX_SKEW:
        return matrix
    report.warn(name, "this light is skewed by the scale of its parent: it is replaced by a rectangle")
    middle, across = (first + second).normalized(), (first - second).normalized()
    first, second = (middle + across).normalized(), (middle - across).normalized()
    normal = first.cross(second)
    axes = (first, second, normal if normal.dot(third) >= 0 else -normal)
    made = Matrix([axis * length for axis, length in zip(axes, lengths)]).transposed().to_4x4()
    made.translation = matrix.translation
    return made
