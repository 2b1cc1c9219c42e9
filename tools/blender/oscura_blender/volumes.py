"""Volume objects: .vdb files of the evaluated grids (of files, sequences, modifiers, geometry nodes), and a box with a medium and without a
surface around each."""

import itertools
import os

import bpy
import numpy as np
from mathutils import Vector

from . import grids, scene_file
from .scene_file import Y_UP

# Types of grids that oscura reads.
SCALAR = ("FLOAT", "DOUBLE")

# Voxels by which the box of a medium is larger than its grids, so that interpolation reaches 0.
MARGIN = 2

# Corners of a box, and its faces with outward normals.
CORNERS = list(itertools.product((0, 1), repeat=3))
FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]

# A level set in a file: its metadata "class".
LEVEL_SET = b"class\x06\0\0\0string\x09\0\0\0level set"


def unpack():
    """Writes packed volumes, which Blender does not read, to Blender's temporary folder."""
    for number, data in enumerate(bpy.data.volumes):
        if data.packed_file is None or os.path.isfile(bpy.path.abspath(data.filepath, library=data.library)):
            continue
        path = os.path.join(bpy.app.tempdir, f"packed {number}.vdb")
        with open(path, "wb") as stream:
            stream.write(data.packed_file.data)
        data.filepath = path


class VolumeFiles:
    """The .vdb files of an export, one for each object's data."""

    def __init__(self, export):
        self.export = export
        self._files = {}

    def file(self, data, obj):
        """The file of evaluated data; None for what is left out."""
        key = data.as_pointer()
        if key not in self._files:
            self._files[key] = self._write(data, f"{self.export.name}.{len(self._files)}.vdb", obj)
        return self._files[key]

    def _write(self, data, file, obj):
        warn = lambda reason: self.export.report.warn(obj, f"this volume is left out: {reason}")
        path = os.path.join(self.export.folder, file)
        if not data.grids.load() or data.grids.error_message:
            where = data.grids.frame_filepath or data.filepath
            return warn(f"its file {where} can't be read: {data.grids.error_message or 'no grids'}")
        if not data.grids.save(filepath=path):
            return warn("Blender can't write its grids")
        with open(path, "rb") as stream:
            has_level_set = LEVEL_SET in stream.read()
        if has_level_set and len(data.grids) == 1:
            return warn("it has a level set, which holds distances and no densities")
        return file


def box(files, obj, matrix, name, report):
    """The mesh of an evaluated volume, in the world, with a new material, and the table of that; None for what is left out."""
    data = obj.data
    material = next((slot.material for slot in obj.material_slots if slot.material is not None), None)
    if material is None:
        report.warn(name, "this volume is left out: it has no material")
        return None
    file = files.file(data, name)
    if file is None:
        return None
    types = {grid.name: grid.data_type for grid in data.grids}
    medium = grids.read(material.original, [grid for grid, kind in types.items() if kind in SCALAR], report)
    entries = medium.entries(name, _density_scale(data, matrix), report)
    for grid in sorted(medium.used):
        if types.get(grid, "FLOAT") not in SCALAR:
            report.warn(name, f"its grid '{grid}' is left out, since it has the type {types[grid]}")
    if entries is None:
        return None
    has_grid = "grid_name" in entries
    mesh = bpy.data.meshes.new(name)
    corners = [matrix @ Vector(corner) for corner in _corners(obj, data, MARGIN if has_grid else 0)]
    is_mirrored = matrix.determinant() < 0
    mesh.from_pydata(corners, [], [face[::-1] if is_mirrored else face for face in FACES])
    mesh.materials.append(bpy.data.materials.new(f"{material.name} ({name})"))
    where = {"grid": file, "up": "z", "transform": scene_file.transform(Y_UP @ matrix @ Y_UP.inverted())} if has_grid else {}
    return mesh, {"type": "medium", **where, **entries}


def _density_scale(data, matrix):
    """The factor on densities: with the space Object the optical thickness doesn't depend on the object's scale."""
    if data.render.space != "OBJECT":
        return 1.0
    return 1 / max((matrix.to_3x3() @ Vector((1, 1, 1)).normalized()).length, 1e-30)


def _corners(obj, data, margin):
    """The corners of a volume's bounding box with a margin of voxels, in object space."""
    bounds = np.array(obj.bound_box)
    widening = np.zeros(3)
    for grid in (grid for grid in data.grids if grid.data_type in SCALAR):
        widening = np.maximum(widening, margin * np.abs(np.array(grid.matrix_object)[:3, :3]).sum(1))
    low, high = bounds.min(0) - widening, bounds.max(0) + widening
    return [[(low, high)[k][axis] for axis, k in enumerate(corner)] for corner in CORNERS]
