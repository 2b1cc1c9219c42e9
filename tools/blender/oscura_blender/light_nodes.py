"""Node trees of lights. Those that are one Emission, times a profile (IES), are read; for others Cycles renders illuminated surfaces, with the tree
and with a plain Emission. The quotient becomes an image of an area light, a profile of a point or spot light, or a color of a sun."""

import math
import os
from contextlib import contextmanager
from dataclasses import dataclass

import bmesh
import bpy
import numpy as np

from . import cycles, final_render, ies_profiles
from .node_links import as_triple, constant, linked, output_node

# Resolution: the longer side of an area light, and azimuths and polar angles of other lights.
SIZE, AZIMUTHS, POLAR_ANGLES = 256, 512, 256

# Quotients that differ by no more, relative to the maximum, are the same.
TOLERANCE = 5e-3


@dataclass
class Emission:
    """The emission of a light, or of one of several lights with which it is exported: a factor on the strength, a color, and an image of an
    area light, a file of a profile, or the node of one; `suffix` is added to the light's name."""

    strength: float
    color: list
    image: str | None = None
    profile: str | None = None
    node: object = None
    suffix: str = ""


def read(tree):
    """The emission of a tree that is one Emission, or none; None of others."""
    end = output_node(tree)
    source = linked(end.inputs["Surface"]) if end is not None else None
    if source is None:
        return Emission(0.0, [1.0] * 3)
    node = source.node
    if node.bl_idname != "ShaderNodeEmission" or node.mute:
        return None
    color, strength, profile = constant(node.inputs["Color"]), constant(node.inputs["Strength"]), None
    if strength is None:
        strength, profile = _profile_factor(node.inputs["Strength"])
    return None if color is None or strength is None else Emission(strength, as_triple(color), node=profile)


def _profile_factor(socket):
    """A factor and the node of a profile whose product an input is; twice None for others."""
    source = linked(socket)
    node = source.node if source is not None else None
    if node is None or node.mute:
        return None, None
    if node.bl_idname == "ShaderNodeTexIES":
        return (constant(node.inputs["Strength"]), node) if linked(node.inputs["Vector"]) is None else (None, None)
    if node.bl_idname == "ShaderNodeMath" and node.operation in ("MULTIPLY", "DIVIDE") and not node.use_clamp:
        first, second = node.inputs[0], node.inputs[1]
        for varying, other in ((first, second), (second, first)):
            factor, (strength, profile) = constant(other), _profile_factor(varying)
            if factor is None or strength is None or (node.operation == "DIVIDE" and (varying != first or factor == 0)):
                continue
            return strength * factor if node.operation == "MULTIPLY" else strength / factor, profile
    return None, None


def render(light, name, obj, distance, folder, report):
    """The emissions of a light by renders of Cycles; files go to the folder. The distance is that of illuminated objects, in metres."""
    file = bpy.path.clean_name(name)
    with _illumination(light) as quotient_at:
        quotient = quotient_at(distance)
        lit = quotient.min(2) >= 0
        peak = max(float(quotient.max()), 1e-30)
        is_uniform = lit.any() and np.ptp(quotient[lit], axis=0).max() <= TOLERANCE * peak
        farther = quotient_at(2 * distance) if light.type in ("POINT", "SPOT") else quotient
    if not lit.any():
        report.warn(obj, "the node tree of this light is not supported")
        return [Emission(1.0, [1.0] * 3)]
    if np.abs(farther - quotient)[lit].max(initial=0) > TOLERANCE * peak:
        message = f"the brightness is right at a distance of {distance:.3g} m, and falls off with the square of the distance"
        report.warn(obj, f"the node tree of this light is not fully supported: {message}")
    quotient = np.maximum(quotient, 0.0)
    if is_uniform or light.type == "SUN":
        if not is_uniform:
            report.warn(obj, "the node tree of this light is not supported: its mean color is used")
        return [_normalized(quotient[lit].mean(0))]
    if light.type == "AREA":
        cycles.save(quotient, os.path.join(folder, f"{file}.exr"))
        return [Emission(1.0, [1.0] * 3, image=f"{file}.exr")]
    return _profiles(quotient, _max_angle(light), file, folder)


def _normalized(color, **more):
    """A color with a maximum of 1, and its strength."""
    peak = float(max(color))
    return Emission(peak, [float(c) / max(peak, 1e-30) for c in color], **more)


def _profiles(quotient, max_angle, file, folder):
    """A light with a profile for each channel, or one if all channels have the same."""
    peak = quotient.max((0, 1))
    relative = quotient / np.maximum(peak, 1e-30)
    is_gray = np.abs(relative - relative.mean(2, keepdims=True)).max() <= TOLERANCE
    emissions = []
    for suffix, channels in {"": (0, 1, 2)}.items() if is_gray else {" red": (0,), " green": (1,), " blue": (2,)}.items():
        values = quotient[..., list(channels)].max(2)
        if values.max() <= 0:
            continue
        profile = f"{file}{suffix.replace(' ', '_')}.ies"
        ies_profiles.write(values / values.max(), max_angle, os.path.join(folder, profile))
        color = [peak[c] if c in channels else 0.0 for c in range(3)]
        emissions.append(_normalized(color, profile=profile, suffix=suffix))
    return emissions


@contextmanager
def _illumination(light):
    """A function of a distance: the irradiance there with the light's node tree, divided by that with a plain Emission; rows from the bottom, and -1
    where the latter is 0."""
    own = light.copy()
    own.energy, own.color, own.use_shadow = 1000.0, (1, 1, 1), True
    for key, value in (("exposure", 0.0), ("use_temperature", False), ("normalize", True)):  # since Blender 4.5
        if hasattr(own, key):
            setattr(own, key, value)
    scene = final_render.new_scene("oscura lamp")
    try:
        cycles.add_object(scene, own, visible_camera=light.type == "AREA")
        sphere = _set_up(scene, own)
        tree = own.node_tree
        surface, plain = output_node(tree).inputs["Surface"], tree.nodes.new("ShaderNodeEmission")
        original = linked(surface)

        def quotient_at(distance):
            if sphere is not None:
                sphere.scale = (distance,) * 3
            pictures = []
            for source in (original, plain.outputs[0]):
                tree.links.new(source, surface)
                pictures.append(cycles.render(scene))
            whole, reference = pictures
            return np.where(reference > 1e-6 * reference.max(), whole / np.maximum(reference, 1e-30), -1.0)

        yield quotient_at
    finally:
        objects = list(scene.collection.objects)
        bpy.data.scenes.remove(scene)
        bpy.data.batch_remove([obj.data for obj in objects] + objects)


def _set_up(scene, light):
    """A camera in front of an area light, one above a plane in sunlight, or one inside a sphere around another light; returns the sphere."""
    if light.type == "AREA":
        light.spread = math.pi
        size = light.size, (light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size)
        light.shape, light.size, light.size_y = "RECTANGLE", *size
        cycles.add_orthographic_camera(scene, max(size), location=(0, 0, -max(size)), rotation_euler=(0, math.pi, 0))
        cycles.set_up(scene, [max(round(SIZE * s / max(size)), 1) for s in size], 4)
        return None
    if light.type == "SUN":
        plane = bpy.data.meshes.new("oscura plane")
        plane.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
        cycles.add_object(scene, plane, location=(0, 0, -1))
        cycles.add_orthographic_camera(scene, 1.0)
        cycles.set_up(scene, (8, 8), 4)
        return None
    light.shadow_soft_size = 0.0
    # The centers of pixels are azimuths from the x axis on.
    cycles.add_panoramic_camera(scene, math.pi / AZIMUTHS, _max_angle(light) - math.pi / 2)
    cycles.set_up(scene, (AZIMUTHS, POLAR_ANGLES), 4)
    mesh, sphere = bpy.data.meshes.new("oscura sphere"), bmesh.new()
    bmesh.ops.create_icosphere(sphere, subdivisions=5, radius=1.0)
    sphere.to_mesh(mesh)
    sphere.free()
    return cycles.add_object(scene, mesh)


def _max_angle(light):
    """The largest angle from the axis at which a light shines, in radians."""
    return light.spot_size / 2 if light.type == "SPOT" else math.pi
