"""Writes meshes, and the tables of their materials and instances."""

import os

from . import materials, mesh_files, mesh_topology, objects, scene_file
from .report import ALIASES
from .scene_file import Y_UP

# With as many instances that don't move, a mesh has a file of instances, not a table for each.
MIN_INSTANCES = 16


class Writer:
    def __init__(self, export):
        self.export = export
        self.materials = {}  # tables by name
        self.objects = []  # tables
        self._read = materials.Materials(export)
        self._tables = {}  # by material and whether it is on a solid

    def write_all(self):
        for entry in self.export.mesh_entries():
            self._write(entry)

    def tables(self):
        named = [(f"[materials.{scene_file.value(name)}]", entries) for name, entries in sorted(self.materials.items())]
        return named + [("[[objects]]", entries) for entries in self.objects]

    def _write(self, entry):
        mesh, report = entry.object.data, self.export.report
        shown = [self._read.on(entry, material) if material is not None else None for material in mesh.materials]
        for slot, material in enumerate(shown):
            if material is not None and material.has_subsurface:
                mesh_topology.fill_holes(mesh, slot, report)
        moves = self.export.moves
        shapes = moves.shapes_of(entry, report) if moves is not None else None
        is_solid = not (mesh_topology.faces_of_edges(mesh) == 1).any()
        names = [self._material_name(entry, slot, material, is_solid) for slot, material in enumerate(shown or [None])]
        used = [material for material in shown if material is not None]
        attributes = set().union(*(material.attributes for material in used))
        axes = [material.tangent_axis if material is not None else "" for material in shown]
        file = self.export.new_file("mesh", ".ply")
        mesh_file = mesh_files.MeshFile(mesh, attributes, axes, any(material.has_normal_maps for material in used))
        mesh_file.write(os.path.join(self.export.folder, file))
        shared = {"mesh": file, "materials": names, **objects.visibility(entry.traits)}
        if shapes is not None:
            shared["mesh_keys"] = self._write_shapes(mesh_file, file, shapes)
        if group := entry.traits.get("light_group"):
            shared["light_group"] = group
        self._add_objects(entry, shared, any(material.reads_object for material in used))

    def _material_name(self, entry, slot, material, is_solid):
        """The name of the table of a material, which is added."""
        if material is None:
            return self._add_material(None, False, "default")
        name = entry.object.data.materials[slot].name
        is_filled = material.is_transmissive and (is_solid or material.medium is not None)
        if material.is_refractive and not is_filled:
            mesh_topology.note_upright_sheet(entry, slot, self.export.report)
        return self._add_material(material, is_filled, ALIASES.get(name, name))

    def _add_material(self, material, is_filled, name):
        """Adds a table. Tables of the same name get spaces at its end."""
        key = (material, is_filled)
        if key not in self._tables:
            self._tables[key] = materials.DEFAULT if material is None else material.table(is_filled)
        table = self._tables[key]
        while self.materials.get(name, table) is not table:
            name += " "
        self.materials[name] = table
        return name

    def _write_shapes(self, mesh_file, file, shapes):
        """Writes the shapes of a deforming mesh; returns its `mesh_keys`."""
        keys = []
        for number, (frame, shape) in enumerate(zip(self.export.moves.frames, shapes)):
            name = file if frame == 0.0 else file.replace(".ply", f".{number}.ply")
            if frame != 0.0:
                mesh_file.write_shape(os.path.join(self.export.folder, name), shape)
            keys.append({"frame": frame, "mesh": name})
        return keys

    def _add_objects(self, entry, shared, reads_object):
        """Adds the tables of all instances: of moving ones, and then of the others by name."""
        links, still = self.export.links, {}
        for name, matrix, key, info in entry.placements:
            if _has_no_area(matrix):
                continue
            info, motion = info if reads_object else {}, self._motion(key)
            if motion is None:
                still.setdefault(name, []).append((matrix, info))
            else:
                self.objects.append({"name": name, **shared, "motion": motion, **info, **links.of_meshes.get(name, {})})
        for name, instances in still.items():
            entries = {"name": name, **shared, **links.of_meshes.get(name, {})}
            if len(instances) >= MIN_INSTANCES:
                file = self.export.new_file("places", ".ply")
                mesh_files.write_instances(os.path.join(self.export.folder, file), instances)
                self.objects.append({**entries, "instances": file})
            else:
                self.objects += ({**entries, "transform": scene_file.transform(Y_UP @ matrix), **info} for matrix, info in instances)

    def _motion(self, key):
        """`motion` of an instance; None if it doesn't move."""
        moves = self.export.moves
        matrices = moves.matrices_of(key) if moves is not None else None
        if matrices is None:
            return None
        return {"keys": [{"frame": frame, "transform": scene_file.transform(Y_UP @ then)} for frame, then in zip(moves.frames, matrices)]}


def _has_no_area(matrix):
    """Does a matrix scale by 0 along two axes? One alone leaves something flat."""
    x, y, z = matrix.to_3x3().col
    return all(a.cross(b).length < 1e-30 for a, b in ((x, y), (y, z), (z, x)))
