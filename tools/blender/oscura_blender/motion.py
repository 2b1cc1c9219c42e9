"""Motion blur: the scene is evaluated at frames while the shutter is open; objects that move or deform get motion keys."""

import bpy
import numpy as np

from . import final_render, meshes, objects, scene_file

# Times (of 0 to 1) of the picture's frame in the interval in which the shutter is open.
POSITIONS = {"start": 0.0, "centre": 0.5, "end": 1.0}

# Keys of the interval: Cycles' default, unless an object has more steps, of which there are at most so many.
KEYS, MAX_STEPS = 3, 5


class Shutter:
    """The time for which the shutter is open in frames, its position, and whether motion vectors are wanted."""

    def __init__(self, scene, layer, options):
        render = scene.render
        frames = render.motion_blur_shutter if render.use_motion_blur else 0.0
        frames = frames if options.shutter is None else options.shutter
        self.frames = min(max(frames, 0.0), 1000.0)
        position = {"START": "start", "CENTER": "centre", "END": "end"}[getattr(render, "motion_blur_position", "CENTER")]
        self.position = options.shutter_position or position
        self.has_vectors = bool(options.vectors) or layer.use_pass_vector

    def is_needed(self):
        return self.frames > 0 or self.has_vectors

    def open_at(self, keys):
        """Frames relative to the picture's while it is open."""
        begin = -POSITIONS[self.position] * self.frames
        return {begin + self.frames * k / (keys - 1) for k in range(keys)} if self.frames > 0 else set()


class Moves:
    """Moving objects: their transforms and shapes at frames relative to the picture's."""

    def __init__(self, frames):
        self.frames = frames
        self.matrices = {}  # of instances, cameras and lights by key
        self.shapes = {}  # positions of vertices, by mesh object
        self.volumes = {}  # matrices of volume objects while the shutter is open, by key

    def shapes_of(self, entry, report):
        """The positions of a mesh's vertices at all frames, if it deforms; those of meshes that the export has changed are lost."""
        shapes, mesh = self.shapes.get(entry.object.name), entry.object.data
        if shapes is None:
            return None
        now, count = shapes[self.frames.index(0.0)], len(mesh.vertices)
        if any(len(shape) != count for shape in shapes) or not np.array_equal(now, meshes.positions(mesh)):
            report.warn(entry.placements[0].key[0], "deformation motion blur is left out, since the topology changes or its material displaces it")
            return None
        return shapes

    def matrices_of(self, key):
        """The matrices of a moving object; None for others, and for a scale of 0 at some frame."""
        matrices = self.matrices.get(key, ())
        return matrices if matrices and not any(map(scene_file.is_singular, matrices)) else None

    def remove_still(self):
        """Removes objects that don't move, or that don't exist at all frames."""
        count = len(self.frames)
        self.matrices = {key: found for key, found in self.matrices.items() if len(found) == count and _moves(found)}
        self.shapes = {
            name: found
            for name, found in self.shapes.items()
            if len(found) == count and any(not np.array_equal(shape, found[0]) for shape in found)
        }
        self.volumes = {key: found for key, found in self.volumes.items() if _moves(found)}


def record(export):
    """Evaluates all frames of a final render's graph, and the picture's frame again; None without motion."""
    shutter = Shutter(export.scene, export.layer, export.options)
    if not shutter.is_needed():
        return None
    scene, now, keys = export.scene, export.scene.frame_current_final, _key_count(export)
    open_at = shutter.open_at(keys)
    moves = Moves(sorted({0.0, *open_at, *((-1.0, 1.0) if shutter.has_vectors else ())}))
    names = {entry.placements[0].key: entry.object.name for entry in export.mesh_entries() if entry.placements}
    for frame in moves.frames:
        final_render.set_frame(scene, now + frame)
        _record_frame(export, names, moves, frame in open_at)
    final_render.set_frame(scene, now)
    moves.remove_still()
    return moves


def _key_count(export):
    """The keys of the object with the most motion steps."""
    names = {placement.key[0] for entry in export.mesh_entries() for placement in entry.placements}
    settings = (bpy.data.objects[name].cycles for name in names if name in bpy.data.objects)
    steps = max((s.motion_steps for s in settings if s.use_motion_blur), default=1)
    return max(KEYS, 2 ** min(steps, MAX_STEPS) + 1)


def _record_frame(export, names, moves, is_open):
    for instance in export.depsgraph.object_instances:
        obj = instance.object
        key, has_blur = objects.key(instance), obj.original.cycles.use_motion_blur
        if obj.type == "LIGHT" or obj.type in objects.MESH_TYPES and has_blur:
            moves.matrices.setdefault(key, []).append(instance.matrix_world.copy())
        if is_open and obj.type == "VOLUME" and has_blur:
            moves.volumes.setdefault(key, []).append(instance.matrix_world.copy())
        if key in names and obj.type == "MESH" and _may_deform(obj.original):
            moves.shapes.setdefault(names[key], []).append(meshes.positions(obj.data))
    for obj in export.cameras:
        matrix = obj.evaluated_get(export.depsgraph).matrix_world.normalized()
        moves.matrices.setdefault(("camera", obj.name), []).append(matrix)


def _may_deform(obj):
    if not (obj.cycles.use_motion_blur and obj.cycles.use_deform_motion):
        return False
    return bool(obj.modifiers) or getattr(obj.data, "shape_keys", None) is not None or obj.data.animation_data is not None


def _moves(matrices):
    return any(
        abs(x - y) > 1e-7 * max(1.0, abs(y)) for matrix in matrices for row, first in zip(matrix, matrices[0]) for x, y in zip(row, first)
    )


def warn_of_volumes(export):
    for key in sorted(export.moves.volumes, key=str) if export.moves is not None else ():
        if key in export.volumes:
            export.report.warn(export.volumes[key], "motion blur is left out, since volume objects don't support it")
