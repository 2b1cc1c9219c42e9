"""Meshes that were exported before: Blender's exporter gets a triangle of each material in their place, and the file what it
wrote the last time."""

import json

import bpy
import numpy as np

from . import cache, fingerprint

# Meshes of fewer corners are exported sooner than looked up.
FEWEST_CORNERS = 10_000

# What of an accessor depends on the values.
OF_VALUES = ("componentType", "count", "type", "min", "max", "normalized")


class KeptMeshes:
    """Which of the meshes to export are known, by the names of their objects."""

    def __init__(self, store):
        self.store = store
        self.keys = {}  # of those that are exported, and then kept
        self.known = {}  # what is kept of the others

    def replace(self, holders):
        """Puts triangles in the place of the meshes that are known."""
        if self.store.folder is None:
            return
        for holder in holders:
            if len(holder.data.loops) < FEWEST_CORNERS:
                continue
            key = _key(holder.data)
            kept = self.store.get(key)
            if kept is None:
                self.keys[holder.name] = key
            else:
                self.known[holder.name] = kept
                holder.data = _stand_in(holder.data)

    def exchange(self, glb, by_name):
        """Keeps what Blender's exporter wrote of meshes, and puts in what it wrote the last time; `by_name` has the numbers
        of meshes by the names of their objects."""
        taken = {}
        for name, mesh in by_name.items():
            primitives = glb.json["meshes"][mesh]["primitives"]
            if name in self.known:
                _put_in(glb, primitives, self.known[name], taken)
            elif name in self.keys:
                kept = _taken_out(glb, primitives)
                if kept is not None:
                    self.store.put(self.keys[name], kept)


def _key(mesh):
    """The hash of a mesh and of its materials, which decide what of it is exported."""
    digest = cache.digest()
    fingerprint.add_mesh(digest, mesh)
    for material in mesh.materials:
        fingerprint.add_tree(digest, material.node_tree)
        digest.update(b"|")
    return digest.hexdigest()


def _stand_in(mesh):
    """A mesh of the same materials and layers with one triangle of each material."""
    indices = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("material_index", indices)
    used = np.unique(indices)
    triangles = np.arange(3 * len(used)).reshape(-1, 3)
    corners = [((0, 0, 0), (1, 0, 0), (0, 1, 0))[k % 3] for k in range(3 * len(used))]
    made = bpy.data.meshes.new("oscura stand-in")
    made.from_pydata(corners, [], triangles.tolist())
    made.polygons.foreach_set("material_index", used)
    for material in mesh.materials:
        made.materials.append(material)
    for layer in mesh.uv_layers:
        made.uv_layers.new(name=layer.name)
        made.uv_layers[layer.name].active_render = layer.active_render
    for color in mesh.color_attributes:
        made.color_attributes.new(color.name, color.data_type, color.domain)
    if len(mesh.color_attributes):
        made.color_attributes.render_color_index = mesh.color_attributes.render_color_index
        made.color_attributes.active_color_index = mesh.color_attributes.active_color_index
    for key in mesh.keys():
        made[key] = mesh[key]
    name = mesh.name
    mesh.name = "oscura replaced"
    made.name = name
    return made


def _slots(primitive):
    """What a primitive has accessors for, with their numbers."""
    return {**primitive["attributes"], "indices": primitive["indices"]}


def _set(primitive, slot, number):
    """Gives a primitive another accessor."""
    (primitive if slot == "indices" else primitive["attributes"])[slot] = number


def _taken_out(glb, primitives):
    """The accessors of primitives as arrays; None for what Blender's exporter doesn't write of such meshes."""
    kept, rows = {}, []
    for primitive in primitives:
        if "targets" in primitive or "indices" not in primitive or primitive.get("mode", 4) != 4:
            return None
        row = {}
        for slot, number in _slots(primitive).items():
            accessor = glb.json["accessors"][number]
            view = glb.json["bufferViews"][accessor["bufferView"]]
            if "sparse" in accessor or "byteStride" in view or accessor.get("byteOffset", 0):
                return None
            row[slot] = {key: accessor[key] for key in OF_VALUES if key in accessor}
            start = view.get("byteOffset", 0)
            kept[f"{len(rows)} {slot}"] = np.frombuffer(glb.binary[start : start + view["byteLength"]], np.uint8)
        rows.append(row)
    return {"rows": np.array(json.dumps(rows)), **kept}


def _put_in(glb, primitives, kept, taken):
    """Gives the accessors of primitives the values that were kept; those that other values have taken, as
    stand-ins of equal numbers share theirs, are copied."""
    rows = json.loads(str(kept["rows"]))
    if [set(row) for row in rows] != [set(_slots(primitive)) for primitive in primitives]:
        raise ValueError("a mesh that was kept does not fit its materials: run once with --no-cache and report this")
    for k, (row, primitive) in enumerate(zip(rows, primitives)):
        for slot, number in _slots(primitive).items():
            accessor, values = glb.json["accessors"][number], kept[f"{k} {slot}"].tobytes()
            if taken.get(accessor["bufferView"]) == (row[slot], values):
                continue
            if accessor["bufferView"] in taken:
                accessor, view = dict(accessor), dict(glb.json["bufferViews"][accessor["bufferView"]])
                accessor["bufferView"] = len(glb.json["bufferViews"])
                glb.json["bufferViews"].append(view)
                _set(primitive, slot, len(glb.json["accessors"]))
                glb.json["accessors"].append(accessor)
            taken[accessor["bufferView"]] = row[slot], values
            view = glb.json["bufferViews"][accessor["bufferView"]]
            accessor.update(row[slot])
            view["byteOffset"], view["byteLength"] = glb.add(values)
