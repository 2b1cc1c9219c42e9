"""Lights."""

import math
import os
import shutil

import bpy
import numpy as np
from mathutils import Matrix

from . import cones, lamp_trees, shaders
from .geometry import VISIBILITY, light_group


# Watts of Cycles that a lumen of a profile is, and ours.
LUMENS_PER_WATT, OUR_LUMENS_PER_WATT = 177.83, 683.0

# Cosine between edges of area lights that are taken for orthogonal.
SKEW = 1e-4


def entries(obj, placed, light, exposure, links, corners, folder, report):
    """The entries of [[lights]] for a light, without its place, times the film's exposure: none for lights without power or area, several
    where its node tree emits by pictures. `placed` are a name for its files and its matrix. Profiles and pictures go to the folder.
    `corners` are those of the boxes around all visible objects."""
    if light.type == "AREA" and (light.cycles.is_portal or 0 in _size_of_area(light)):
        return []
    found, (name, matrix) = [], placed
    for strength, color, more in _parts(obj, name, light, corners, folder, report):
        energy = light.energy * strength * exposure
        if energy == 0 or not any(color):
            continue
        if energy < 0 or min(color) < 0:
            report.warn(obj.name, "light of negative strength is not supported: it is left out")
            continue
        kind, values = _shape(obj, (name, matrix.to_scale()), light, energy, more, folder, report)
        common = {"name": obj.name + more.get("end", ""), "color": color, **_common(obj, light, links)}
        found.append({**common, kind: values})
    return found


def _common(obj, light, links):
    """Keys of all kinds of lights."""
    found = {}
    if group := light_group(obj):
        found["group"] = group
    if light.type != "SUN":
        found.update({"visible_to_camera": bool(obj.visible_camera), "obstacle": False})
    seen_by = [kind for key, kind in VISIBILITY.items() if key == "visible_shadow" or getattr(obj, key, True)]
    if not {"diffuse", "glossy", "transmission", "volume"} <= set(seen_by):
        found["visible_to"] = seen_by
    found.update(links.entries(obj))
    if not light.use_shadow:
        found["shadow_link"] = {"include": []}
    return found


def _shape(obj, placed, light, energy, more, folder, report):
    """The key of a light's shape, and its values. `placed` are a name for its files and its scale."""
    name, scale = placed
    shape = {"POINT": _point, "SPOT": _spot, "SUN": _sun, "AREA": _area}[light.type]
    kind, values = shape(light, energy, scale)
    if kind == "spot" and not (cone := cones.Cone(light, scale)).is_plain():
        values = _stretched(values, cone, name, obj.name, more, folder, report)
        if "ies" in values:
            return kind, values
    if "image" in more:
        values["image"] = more["image"]
    measured = more.get("node")
    file = more.get("profile") if measured is None else _profile(measured, name, light, folder, obj.name, report)
    if file is None:
        return kind, values
    power = values.pop("power")
    if measured is None:
        return kind, {**values, "ies": file, "intensity": power / (4 * math.pi)}
    strength = energy * _area_factor(light, _ball(light)) * OUR_LUMENS_PER_WATT / LUMENS_PER_WATT
    return kind, {**values, "ies": file, "strength": strength, "clockwise": True, "turn": 90}


def portal(obj, light):
    """The entries of [[portals]] for an area light that is one, without its place; round ones become rectangles around them."""
    if light.type != "AREA" or not light.cycles.is_portal:
        return None
    return {"name": obj.name, "size": [max(s, 1e-9) for s in _size_of_area(light)]}


def upright(matrix, light, place, report):
    """The matrix of a light: that of an area light without the skew that a scaled parent gives it. Lengths and the plane of
    its edges stay, and it shines to the side of its axis."""
    if light.type != "AREA":
        return matrix
    u, v, w = (matrix.col[k].to_3d() for k in range(3))
    lengths = [max(axis.length, 1e-12) for axis in (u, v, w)]
    first, second, ahead = (axis / length for axis, length in zip((u, v, w), lengths))
    if max(abs(first.dot(second)), abs(first.dot(ahead)), abs(second.dot(ahead))) < SKEW:
        return matrix
    report.warn(place, "is skewed by the scale of its parent: the nearest rectangle shines instead")
    # As far from one edge as from the other.
    middle, across = (first + second).normalized(), (first - second).normalized()
    first, second = (middle + across).normalized(), (middle - across).normalized()
    normal = first.cross(second)
    axes = (first, second, normal if normal.dot(ahead) >= 0 else -normal)
    made = Matrix([axis * length for axis, length in zip(axes, lengths)]).transposed().to_4x4()
    made.translation = matrix.translation
    return made


def _point(light, energy, _scale):
    return "point", {**_size(light), "power": energy * _area_factor(light, _ball(light))}


def _spot(light, energy, scale):
    angle = {"angle": math.degrees(2 * cones.Cone(light, scale).mean()), "blend": light.spot_blend}
    power = energy * _area_factor(light, _ball(light))
    return "spot", {**angle, **_size(light), "power": power}


def _stretched(values, cone, name, place, more, folder, report):
    """The values of a spot whose scale changes its cone, by a profile unless its angle says all."""
    if cone.is_round() and cone.blend == 0:
        return values
    if more.keys() & {"node", "profile", "image"}:
        report.warn(place, "this light's scale stretches its cone, and its node tree is not stretched: its mean angle is taken")
        return values
    power = values.pop("power")
    edge = {"angle": math.degrees(2 * cone.reach()), "blend": 0.0}
    return {**values, **edge, "ies": cone.write(name, folder), "intensity": power / (4 * math.pi)}


def _size(light):
    soft = getattr(light, "use_soft_falloff", False) and light.shadow_soft_size > 0
    return {"radius": light.shadow_soft_size, **({"soft_falloff": True} if soft else {})}


def _sun(light, energy, _scale):
    return "sun", {"angle": math.degrees(min(light.angle, math.pi)), "irradiance": energy}


def _size_of_area(light):
    """Width and height of an area light. With a size of 0 it emits nothing in Cycles."""
    return light.size, (light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size)


def _area(light, energy, scale):
    size = _size_of_area(light)
    is_round = light.shape in ("DISK", "ELLIPSE")
    area = size[0] * size[1] * abs(scale.x * scale.y) * (math.pi / 4 if is_round else 1)
    values = {"size": list(size)}
    if is_round:
        values["shape"] = "ellipse"
    spread = math.degrees(light.spread)
    if spread < 179.9:
        values["spread"] = max(spread, 0.1)
    return "area", {**values, "power": energy * _area_factor(light, area)}


def _profile(node, name, light, folder, place, report):
    """The file of a light's profile beside the scene file; None where there is none, or where it can't be used."""
    if light.type not in ("POINT", "SPOT"):
        report.warn(place, "profiles (IES) are carried over of points and spots only: this light shines evenly")
        return None
    file = f"{bpy.path.clean_name(name)}.ies"
    target = os.path.join(folder, file)
    if node.mode == "INTERNAL":
        if node.ies is None:
            return None
        with open(target, "w", encoding="utf-8", newline="\n") as stream:
            stream.write(node.ies.as_string())
        return file
    origin = bpy.path.abspath(node.filepath, library=node.id_data.library)
    try:
        shutil.copyfile(origin, target)
    except OSError as error:
        report.warn(place, f"the profile (IES) of this light can't be read: {origin}: {error.strerror}")
        return None
    return file


def _ball(light):
    return 4 * math.pi * light.shadow_soft_size**2


def _area_factor(light, area):
    """Where the strength is meant for each square metre (Blender 4.5 and newer)."""
    return 1 if getattr(light, "normalize", True) or area == 0 else area


def _parts(obj, name, light, corners, folder, report):
    """The parts of a light, each a light of its own: a factor on the energy, a colour, and further keys by its nodes: the node or the
    file of a profile, or a picture."""
    factor = 2.0 ** getattr(light, "exposure", 0.0)
    color = list(light.color)
    if getattr(light, "use_temperature", False):
        color = [c * t for c, t in zip(color, light.temperature_color)]
    parts = [(1.0, [1.0] * 3, {})]
    if light.use_nodes and light.node_tree:
        emission = shaders.emission_of_light(light.node_tree)
        if emission is None:
            parts = lamp_trees.take(light, name, obj.name, _distance(obj, corners), folder, report)
        else:
            strength, tint, profile = emission
            parts = [(strength, tint, {"node": profile} if profile is not None else {})]
    for strength, tint, more in parts:
        tinted = [c * t for c, t in zip(color, tint)]
        # The colour carries no strength.
        peak = max(max(tinted), 1e-30)
        yield factor * strength * peak, [c / peak for c in tinted], more


def _distance(obj, corners):
    """How far away from a light things are: the median of all, metres."""
    if not len(corners):
        return 1.0
    middles = corners.mean(1) - np.array(obj.matrix_world.translation)
    return max(float(np.median(np.linalg.norm(middles, axis=1))), 0.01)
