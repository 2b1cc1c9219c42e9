"""Lights: everything about them is in the file of settings; the model only has empty nodes where they stand."""

import math
import os
import shutil

import bpy

from . import shaders
from .geometry import VISIBILITY, light_group


# Watts of Cycles that a lumen of a profile is, and ours.
LUMENS_PER_WATT, OUR_LUMENS_PER_WATT = 177.83, 683.0


def entries(obj, name, light, exposure, links, folder, report):
    """The entries of [[lights]] for a light at the node `name`, times the film's exposure; None for what shines not. Profiles
    go to the folder."""
    if light.type == "AREA" and light.cycles.is_portal:
        return None
    strength, color, profile = _strength(light, obj.name, report)
    energy = light.energy * strength * exposure
    if energy == 0 or not any(color):
        return None
    if energy < 0 or min(color) < 0:
        report.warn(obj.name, "light that takes light away is not supported: it is left out")
        return None
    found = {"name": obj.name, "color": color}
    if group := light_group(obj):
        found["group"] = group
    if light.type != "SUN":
        found.update({"visible_to_camera": bool(obj.visible_camera), "obstacle": False})
    seen_by = [kind for key, kind in VISIBILITY.items() if key == "visible_shadow" or getattr(obj, key, True)]
    if not {"diffuse", "glossy", "transmission", "volume"} <= set(seen_by):
        found["visible_to"] = seen_by
    scale = obj.matrix_world.to_scale()
    shape = {"POINT": _point, "SPOT": _spot, "SUN": _sun, "AREA": _area}[light.type]
    kind, values = shape(light, energy, scale)
    if profile is not None and (file := _profile(profile, name, light, folder, obj.name, report)):
        del values["power"]
        strength = energy * _area_factor(light, _ball(light)) * OUR_LUMENS_PER_WATT / LUMENS_PER_WATT
        values.update({"ies": file, "strength": strength, "clockwise": True, "turn": 90})
    found.update(links.entries(obj))
    if not light.use_shadow:
        found["shadow_link"] = {"include": []}
    found[kind] = {"node": name, **values}
    return found


def portal(obj, name, light):
    """The entries of [[portals]] for an area light at the node `name` that is one; round ones become rectangles around them."""
    if light.type != "AREA" or not light.cycles.is_portal:
        return None
    size = light.size, (light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size)
    return {"name": obj.name, "node": name, "size": [max(s, 1e-9) for s in size]}


def _point(light, energy, _scale):
    return "point", {"radius": light.shadow_soft_size, "power": energy * _area_factor(light, _ball(light))}


def _spot(light, energy, _scale):
    angle = {"angle": math.degrees(light.spot_size), "blend": light.spot_blend}
    power = energy * _area_factor(light, _ball(light))
    return "spot", {**angle, "radius": light.shadow_soft_size, "power": power}


def _sun(light, energy, _scale):
    return "sun", {"angle": math.degrees(min(light.angle, math.pi)), "irradiance": energy}


def _area(light, energy, scale):
    size = light.size, (light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size)
    is_round = light.shape in ("DISK", "ELLIPSE")
    area = size[0] * size[1] * abs(scale.x * scale.y) * (math.pi / 4 if is_round else 1)
    values = {"size": [max(s, 1e-9) for s in size]}
    if is_round:
        values["shape"] = "ellipse"
    spread = math.degrees(light.spread)
    if spread < 179.9:
        values["spread"] = max(spread, 0.1)
    return "area", {**values, "power": energy * _area_factor(light, area)}


def _profile(node, name, light, folder, place, report):
    """The file of a light's profile beside the model; None where there is none, or where it can't be used."""
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


def _strength(light, name, report):
    """Factor on the light's energy, its colour, and the node of its profile, if it has one."""
    profile = None
    factor = 2.0 ** getattr(light, "exposure", 0.0)
    color = list(light.color)
    if getattr(light, "use_temperature", False):
        color = [c * t for c, t in zip(color, light.temperature_color)]
    if light.use_nodes and light.node_tree:
        emission = shaders.emission_of_light(light.node_tree)
        if emission is None:
            report.warn(name, "the node tree of this light is not carried over")
        else:
            strength, tint, profile = emission
            factor *= strength
            color = [c * t for c, t in zip(color, tint)]
    # The colour carries no strength.
    peak = max(max(color), 1e-30)
    return factor * peak, [c / peak for c in color], profile
