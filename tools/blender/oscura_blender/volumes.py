"""Volume objects: their grids go to .vdb files beside the scene file, and a box without a surface around each that its medium fills.

Grids come from the evaluated object: files (of the frame's number, packed or not), modifiers and geometry nodes alike."""

import itertools
import os

import bpy
import numpy as np
from mathutils import Vector

from . import grids, scene_file
from .scene_file import Y_UP

# Kinds of grids that are read.
NUMBERS = ("FLOAT", "DOUBLE")

# Voxels between a grid's box and that of the medium: values fall to nothing there.
AROUND = 2

# Corners of a box and its faces, seen from outside.
CORNERS = list(itertools.product((0, 1), repeat=3))
FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]

# What is written of a file whose values are distances to a surface.
LEVEL_SET = b"class\x06\0\0\0string\x09\0\0\0level set"


def unpack():
    """Gives volumes that are packed in the file, which Blender does not read by itself, files in Blender's own temporary folder."""
    for number, data in enumerate(bpy.data.volumes):
        if data.packed_file is None or os.path.isfile(bpy.path.abspath(data.filepath, library=data.library)):
            continue
        path = os.path.join(bpy.app.tempdir, f"packed {number}.vdb")
        with open(path, "wb") as stream:
            stream.write(data.packed_file.data)
        data.filepath = path


class Store:
    """The files of volumes in a folder: one of each object's data."""

    def __init__(self, folder, name):
        self.folder, self.name = folder, name
        self.files = {}  # by what the data is

    def file(self, data, place, report):
        """The name of the file of an evaluated object's grids; None where there is none."""
        key = data.as_pointer()
        if key not in self.files:
            self.files[key] = self._written(data, place, report)
        return self.files[key]

    def _written(self, data, place, report):
        loaded = data.grids.load()
        if not loaded or data.grids.error_message:
            where = data.grids.frame_filepath or data.filepath
            report.warn(place, f"this volume is left out: its file {where} can't be read: {data.grids.error_message or 'no grids'}")
            return None
        file = f"{self.name}.{len(self.files)}.vdb"
        path = os.path.join(self.folder, file)
        if not data.grids.save(filepath=path):
            report.warn(place, "this volume is left out: Blender can't write its grids")
            return None
        with open(path, "rb") as stream:
            holds_distances = LEVEL_SET in stream.read()
        if holds_distances and len(data.grids) == 1:
            report.warn(place, "this volume is left out: it has a level set, which holds distances and no densities")
            return None
        return file


def add(store, obj, instance, name, report):
    """A mesh around an evaluated volume, in the world, where an instance has it, with a material for its medium, and the table of that;
    None where there is nothing."""
    data, matrix = obj.data, instance.matrix_world.copy()
    material = next((slot.material for slot in obj.material_slots if slot.material is not None), None)
    if material is None:
        report.warn(name, "this volume is left out: it has no material")
        return None
    file = store.file(data, name, report)
    if file is None:
        return None
    kinds = {grid.name: grid.data_type for grid in data.grids}
    medium = grids.read(material.original, [grid for grid, kind in kinds.items() if kind in NUMBERS], report)
    entries = medium.entries(name, _density_scale(data, matrix), report)
    for grid in sorted(medium.asked):
        if kinds.get(grid, "FLOAT") not in NUMBERS:
            report.warn(name, f"its grid '{grid}' holds no numbers but {kinds[grid]}, and is left out")
    if entries is None:
        return None
    made = bpy.data.materials.new(f"{material.name} ({name})")
    where = {}
    if "grid_name" in entries:
        where = {"grid": file, "up": "z", "transform": scene_file.placed(Y_UP @ matrix @ Y_UP.inverted())}
    corners = _corners(obj, data, AROUND if where else 0)
    mesh = bpy.data.meshes.new(name)
    is_mirrored = matrix.determinant() < 0
    mesh.from_pydata([matrix @ Vector(corner) for corner in corners], [], [face[::-1] if is_mirrored else face for face in FACES])
    mesh.materials.append(made)
    return mesh, {"type": "medium", **where, **entries}


def _density_scale(data, matrix):
    """What densities are taken times: of volumes in the object's space as much is in the way of light whatever the object's size."""
    if data.render.space != "OBJECT":
        return 1.0
    return 1 / max((matrix.to_3x3() @ Vector((1, 1, 1)).normalized()).length, 1e-30)


def _corners(obj, data, voxels):
    """The corners of a volume's box, so many voxels wider, in the object's space."""
    bounds = np.array(obj.bound_box)
    low, high = bounds.min(0), bounds.max(0)
    around = np.zeros(3)
    for grid in (grid for grid in data.grids if grid.data_type in NUMBERS):
        along = np.abs(np.array(grid.matrix_object)[:3, :3])
        around = np.maximum(around, voxels * along.sum(1))
    low, high = low - around, high + around
    return [[(low, high)[k][axis] for axis, k in enumerate(corner)] for corner in CORNERS]
