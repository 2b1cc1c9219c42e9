"""Adaptive subdivision: Cycles subdivides an object until its faces are as small in the picture as asked for. Here its modifier gets as many
levels, the same all over the object."""

import math

import numpy as np
from mathutils import Vector

from . import meshes

# Faces that an object has at most, and levels.
MOST_FACES, MOST_LEVELS = 300_000, 10

# Of all edges this share is no longer than the one that decides.
SHARE = 0.75


def settle(scene, report):
    """Gives the modifiers of all adaptive objects their levels."""
    if scene.render.engine != "CYCLES":
        return
    for obj in scene.objects:
        modifier = obj.modifiers[-1] if obj.type == "MESH" and obj.modifiers else None
        if modifier is None or modifier.type != "SUBSURF" or not modifier.show_render or not _is_adaptive(obj, modifier, scene):
            continue
        wanted = _levels(obj, _density(obj, modifier, scene))
        most = math.floor(math.log(max(MOST_FACES / max(len(obj.data.polygons), 1), 1), 4))
        modifier.render_levels = min(wanted, most, MOST_LEVELS)
        tell = report.warn if wanted > modifier.render_levels else report.note
        tell(obj.name, f"is subdivided {modifier.render_levels} times all over, in place of adaptive subdivision ({wanted} times at most)")


def _is_adaptive(obj, modifier, scene):
    # Blender 5 and newer, or older ones.
    if hasattr(modifier, "use_adaptive_subdivision"):
        return modifier.use_adaptive_subdivision
    return obj.cycles.use_adaptive_subdivision and scene.cycles.feature_set == "EXPERIMENTAL"


def _density(obj, modifier, scene):
    """How many edges a metre shall have, where the object is nearest to the camera."""
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
    places = [*corners, sum(corners, Vector()) / len(corners)]
    near = max(min((place - camera.matrix_world.translation).length for place in places), camera.data.clip_start)
    return longer / (2 * math.tan(camera.data.angle / 2) * near) / pixels


def _levels(obj, density):
    """How often edges are halved until that many are in a metre."""
    mesh, count = obj.data, len(obj.data.edges)
    if count == 0 or density == 0:
        return 0
    placed = meshes.positions(mesh) @ np.array(obj.matrix_world.to_3x3(), np.float32).T
    ends = meshes.edges(mesh)
    length = np.quantile(np.linalg.norm(placed[ends[:, 0]] - placed[ends[:, 1]], axis=1), SHARE)
    return max(math.ceil(math.log2(max(float(length) * density, 1e-9))), 0)
