"""What moves while the shutter is open: the scene is looked at some moments of that time, and what stands elsewhere or has
another shape gets motion keys, in which the picture has its moment."""

import bpy
import numpy as np

from . import context, geometry, meshes, scene_file

POSITIONS = {"START": "start", "CENTER": "centre", "END": "end"}

# Moments of the time that the shutter is open: Cycles' own number, unless an object asks for more.
KEYS = 3

# Steps of motion that objects may ask for.
MOST_STEPS = 5


class Shutter:
    """How long it is open, frames; when, as scene files have it; and whether motion vectors are wanted."""

    def __init__(self, frames, position, has_vectors):
        self.frames, self.position, self.has_vectors = frames, position, has_vectors

    def offsets(self, keys):
        """Moments to look at, frames from the picture's own on."""
        return sorted({0.0, *self.open_at(keys), *((-1.0, 1.0) if self.has_vectors else ())})

    def open_at(self, keys):
        """Moments at which it is open."""
        begin = {"start": 0.0, "centre": -0.5, "end": -1.0}[self.position] * self.frames
        return {begin + self.frames * k / (keys - 1) for k in range(keys)} if self.frames > 0 else set()


def shutter(scene, options, layer):
    """The shutter of a scene, where the program's options don't say another; None where nothing is to be known of motion."""
    render = scene.render
    frames = render.motion_blur_shutter if render.use_motion_blur else 0.0
    frames = frames if options.shutter is None else options.shutter
    position = options.shutter_position or POSITIONS[getattr(render, "motion_blur_position", "CENTER")]
    has_vectors = bool(options.vectors) or layer.use_pass_vector
    found = Shutter(min(max(frames, 0.0), 1000.0), position, has_vectors)
    return found if found.frames > 0 or has_vectors else None


class Moves:
    """Where things are at moments; what stands still is not among them."""

    def __init__(self, offsets):
        self.offsets = offsets  # frames from the picture's on
        self.matrices = {}  # by what tells placements, cameras and lights apart
        self.shapes = {}  # positions of vertices by the name of the mesh object
        self.volumes = {}  # matrices of volume objects while the shutter is open, by the same marks

    def shapes_of(self, holder, name, report):
        """The places of the vertices of a mesh at all moments, if it deforms; those that were changed on the way are lost."""
        shapes = self.shapes.get(holder.name)
        if shapes is None:
            return None
        now, count = shapes[self.offsets.index(0.0)], len(holder.data.vertices)
        if any(len(shape) != count for shape in shapes) or not np.array_equal(now, meshes.positions(holder.data)):
            report.warn(name, "its change of shape is not blurred: its faces change, or its material moves them")
            return None
        return shapes

    def of(self, mark):
        """The matrices of something that moves; None for others, and for what has no extent at some moment."""
        found = self.matrices.get(mark, ())
        return found if found and not any(map(scene_file.is_flat, found)) else None

    def drop_the_still(self):
        """Forgets what doesn't move, and what is not there all the time."""
        count = len(self.offsets)
        self.matrices = {
            mark: found
            for mark, found in self.matrices.items()
            if len(found) == count and any(_differs(matrix, found[0]) for matrix in found)
        }
        self.shapes = {
            name: found
            for name, found in self.shapes.items()
            if len(found) == count and any(not np.array_equal(shape, found[0]) for shape in found)
        }
        self.volumes = {mark: found for mark, found in self.volumes.items() if any(_differs(matrix, found[0]) for matrix in found)}


def record(scene, graph, found, shutter):
    """Looks at all moments of a render's graph, and goes back to the picture's own."""
    now = scene.frame_current_final
    keys = _keys(found)
    offsets, open_at = shutter.offsets(keys), shutter.open_at(keys)
    moves = Moves(offsets)
    first = {places[0].mark: name for name, places in found.placements.items() if places}
    for offset in offsets:
        context.go(scene, now + offset)
        _look(scene, graph, first, moves, offset in open_at)
    context.go(scene, now)
    moves.drop_the_still()
    return moves


def _keys(found):
    """How many moments the most exacting object asks for."""
    names = {place.mark[0] for places in found.placements.values() for place in places}
    settings = (getattr(bpy.data.objects[name], "cycles", None) for name in names if name in bpy.data.objects)
    steps = max((s.motion_steps for s in settings if s is not None and s.use_motion_blur), default=1)
    return max(KEYS, 2 ** min(steps, MOST_STEPS) + 1)


def _look(scene, graph, first, moves, is_open):
    """Notes where everything is at this moment, at which the shutter is open or not."""
    for instance in graph.object_instances:
        obj = instance.object
        mark = geometry.mark(instance)
        if obj.type == "LIGHT" or obj.type in geometry.MESHES and _is_blurred(obj.original):
            moves.matrices.setdefault(mark, []).append(instance.matrix_world.copy())
        if is_open and obj.type == "VOLUME" and _is_blurred(obj.original):
            moves.volumes.setdefault(mark, []).append(instance.matrix_world.copy())
        if mark in first and obj.type == "MESH" and _may_deform(obj.original):
            moves.shapes.setdefault(first[mark], []).append(meshes.positions(obj.data))
    for obj in scene.objects:
        if obj.type == "CAMERA":
            placed = obj.evaluated_get(graph).matrix_world.normalized()
            moves.matrices.setdefault(("camera", obj.name), []).append(placed)


def _is_blurred(obj):
    return getattr(getattr(obj, "cycles", None), "use_motion_blur", True)


def _may_deform(obj):
    settings = getattr(obj, "cycles", None)
    if settings is not None and not (settings.use_motion_blur and settings.use_deform_motion):
        return False
    return bool(obj.modifiers) or getattr(obj.data, "shape_keys", None) is not None or obj.data.animation_data is not None


def _differs(a, b):
    return any(abs(x - y) > 1e-7 * max(1.0, abs(y)) for p, q in zip(a, b) for x, y in zip(p, q))


def tell_of_volumes(found, moves, report):
    """Tells of volume objects that move: their grids stand in the world."""
    for mark in sorted(moves.volumes, key=str):
        if mark in found.volumes:
            report.warn(found.volumes[mark], "this volume moves while the shutter is open: it stands still, since volumes are not blurred")
