"""Adaptive subdivision: Cycles subdivides until faces have a given size in the picture. Here the modifier gets as many levels, the same for the
whole object."""

import math

import numpy as np
from mathutils import Vector

from . import meshes

# Limits of an object.
MAX_FACES, MAX_LEVELS = 300_000, 10

# The edge whose length counts: the quantile of all lengths.
QUANTILE = 0.75


def set_levels(scene, report):
    """Sets the levels of all modifiers with adaptive subdivision."""
    if scene.render.engine != "CYCLES":
        return
    for obj in scene.objects:
        modifier = obj.modifiers[-1] if obj.type == "MESH" and obj.modifiers else None
        if modifier is None or modifier.type != "SUBSURF" or not modifier.show_render or not _is_adaptive(obj, modifier, scene):
            continue
        wanted = _levels(obj, _edges_per_metre(obj, modifier, scene))
        most = math.floor(math.log(max(MAX_FACES / max(len(obj.data.polygons), 1), 1), 4))
        levels = modifier.render_levels = min(wanted, most, MAX_LEVELS)
        tell = report.warn if wanted > levels else report.note
        tell(obj.name, f"adaptive subdivision is replaced by {levels} uniform levels ({wanted} in Cycles where the object is nearest)")


def _is_adaptive(obj, modifier, scene):
    if hasattr(modifier, "use_adaptive_subdivision"):  # since Blender 5.0
        return modifier.use_adaptive_subdivision
    return obj.cycles.use_adaptive_subdivision and scene.cycles.feature_set == "EXPERIMENTAL"


def _edges_per_metre(obj, modifier, scene):
    """Where the object is nearest to the camera."""
    if getattr(modifier, "adaptive_space", "PIXEL") == "OBJECT":
        return 1 / max(modifier.adaptive_object_edge_length, 1e-6)
    size = getattr(modifier, "adaptive_pixel_size", None)
    pixels = scene.cycles.dicing_rate * (obj.cycles.dicing_rate if size is None else size)
    render, camera = scene.render, scene.camera
    longer = max(render.resolution_x, render.resolution_y) * render.resolution_percentage / 100
    if camera is None or camera.type != "CAMERA":
        return 0.0
    if camera.data.type == "ORTHO":
        return longer / camera.data.ortho_scale / pixels
    corners = [obj.matrix_world @ Vector(corner) for corner in obj.bound_box]
    points = [*corners, sum(corners, Vector()) / len(corners)]
    distance = max(min((point - camera.matrix_world.translation).length for point in points), camera.data.clip_start)
    return longer / (2 * math.tan(camera.data.angle / 2) * distance) / pixels


def _levels(obj, edges_per_metre):
    """How often edges must be halved."""
    mesh = obj.data
    if len(mesh.edges) == 0 or edges_per_metre == 0:
        return 0
    positions = meshes.positions(mesh) @ np.array(obj.matrix_world.to_3x3(), np.float32).T
    ends = meshes.edges(mesh)
    length = np.quantile(np.linalg.norm(positions[ends[:, 0]] - positions[ends[:, 1]], axis=1), QUANTILE)
    return max(math.ceil(math.log2(max(float(length) * edges_per_metre, 1e-9))), 0)
