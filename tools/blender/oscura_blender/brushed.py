"""The direction in which surfaces are brushed: Cycles' own runs around the vertical axis of the mesh, by what its Tangent node says
around another one or along texture coordinates. glTF takes the tangents of the mesh for it."""

import math

import numpy as np

from . import shaders

# Components of a place that a direction around each axis follows: (-a, b), and where they belong.
AROUND = {"X": (2, 1, 1, 2), "Y": (2, 0, 0, 2), "Z": (1, 0, 0, 1)}


class Brushed:
    """Which materials of a mesh are brushed around which axis, and the middle and size of the mesh."""

    def __init__(self, axes, mesh):
        self.axes = axes
        self.middle = np.array(mesh.texspace_location, np.float64)
        self.size = np.maximum(np.array(mesh.texspace_size, np.float64), 1e-9)

    def tangents(self, name, positions, normals):
        """Tangents of the places of a material, in Blender's axes."""
        first, second, to_first, to_second = AROUND[self.axes[name]]
        places = (positions - self.middle) / (2 * self.size)
        around = np.zeros_like(places)
        around[:, to_first], around[:, to_second] = -places[:, first], places[:, second]
        around -= (around * normals).sum(1, keepdims=True) * normals
        length = np.linalg.norm(around, axis=1, keepdims=True)
        # At the axis itself any direction will do.
        other = np.cross(normals, [[1.0, 0.0, 0.0]]) + 1e-6
        return np.where(length > 1e-9, around / np.maximum(length, 1e-9), other / np.linalg.norm(other, axis=1, keepdims=True))


def read(holders, report):
    """By the name of the mesh object, what is brushed in it."""
    found = {}
    for holder in holders:
        axes = {m.name: axis for m in holder.data.materials if (axis := _axis(m, report)) is not None}
        if axes:
            found[holder.name] = Brushed(axes, holder.data)
    return found


def _axis(material, report):
    node = shaders.principled(material)
    if node is None or shaders.constant(node.inputs["Anisotropic"]) in (0.0, None):
        return None
    source = shaders.source(node.inputs["Tangent"])
    if source is not None and source.node.bl_idname != "ShaderNodeTangent":
        report.warn(material.name, "the direction in which it is brushed (Tangent) is not carried over: it runs around the vertical axis")
        source = None
    if source is not None and source.node.direction_type == "UV_MAP":
        return None
    if node.inputs["Normal"].is_linked:
        report.warn(material.name, "is brushed along its texture coordinates, as its normals are, not around an axis")
        return None
    return source.node.axis if source is not None else "Z"


def rotation(node):
    """By how much the direction is turned, radians."""
    turned = shaders.constant(node.inputs["Anisotropic Rotation"]) if "Anisotropic Rotation" in node.inputs else None
    return 2 * math.pi * (turned or 0.0)


def add(glb, by_name, found, names):
    """Adds tangents to the primitives of what is brushed; `names` are the materials' by number."""
    for holder, mesh in by_name.items():
        brushed = found.get(holder)
        for primitive in glb.json["meshes"][mesh]["primitives"] if brushed is not None else []:
            name = names[primitive["material"]] if "material" in primitive else None
            if name not in brushed.axes or "NORMAL" not in primitive["attributes"]:
                continue
            # glTF's y is Blender's z, its z is Blender's -y.
            to_blender = lambda rows: rows[:, [0, 2, 1]] * (1, -1, 1)
            positions, normals = (to_blender(_floats(glb, primitive["attributes"][key])) for key in ("POSITION", "NORMAL"))
            made = brushed.tangents(name, positions, normals)
            rows = np.concatenate([made[:, [0, 2, 1]] * (1, 1, -1), np.ones((len(made), 1))], 1)
            primitive["attributes"]["TANGENT"] = glb.add_accessor(rows.tolist())


def _floats(glb, number):
    accessor = glb.json["accessors"][number]
    view = glb.json["bufferViews"][accessor["bufferView"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    data = glb.binary[start : start + 12 * accessor["count"]]
    return np.frombuffer(bytes(data), "<f4").reshape(-1, 3).astype(np.float64)
