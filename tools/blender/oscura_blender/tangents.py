"""Tangents of meshes: for anisotropic reflection around an axis (Cycles' default is the local z axis), and for normal maps on meshes without
UV maps."""

import bpy
import numpy as np

from . import meshes

# By axis: the components (a, b) of a position for the tangent (-a, b), and the components of the tangent.
COMPONENTS = {"X": (2, 1, 1, 2), "Y": (2, 0, 0, 2), "Z": (1, 0, 0, 1)}


def radial(mesh, axes, vertices):
    """Tangents of corners (of these vertices) around the axes of their material slots, with the sign of the bitangent; 0 for slots without an
    axis, whose tangents are those of the UV map. None if no slot has one."""
    if not any(axes):
        return None
    slots = np.repeat(meshes.material_indices(mesh), meshes.face_sizes(mesh))
    positions, normals = meshes.positions(mesh)[vertices].astype(np.float64), meshes.corner_normals(mesh).astype(np.float64)
    tangents = np.zeros((len(mesh.loops), 4), np.float32)
    for slot, axis in enumerate(axes):
        used = slots == slot
        if axis and used.any():
            tangents[used, :3] = _around(mesh, axis, positions[used], normals[used])
            tangents[used, 3] = 1.0
    return tangents


def spherical(mesh, triangles, vertices):
    """Tangents of corners, with the sign of the bitangent, by longitude and latitude about the origin, which Cycles uses for normal maps on meshes
    without UV maps. Triangles are corner indices; vertices are those of the corners."""
    corners = triangles.ravel()
    copy = bpy.data.meshes.new("triangles")
    try:
        copy.from_pydata(meshes.positions(mesh), [], vertices[triangles])
        copy.normals_split_custom_set(meshes.corner_normals(mesh)[corners])
        coordinates = _sphere_coordinates(meshes.positions(mesh)[vertices[corners]].astype(np.float64))
        copy.uv_layers.new(name="sphere").uv.foreach_set("vector", coordinates.astype(np.float32).ravel())
        copy.calc_tangents(uvmap="sphere")
        directions, signs = (meshes.read(copy.loops, key, width, np.float32) for key, width in (("tangent", 3), ("bitangent_sign", 1)))
    finally:
        bpy.data.meshes.remove(copy)
    tangents = np.zeros((len(vertices), 4), np.float32)
    tangents[corners] = np.concatenate([directions, signs], 1)
    return tangents


def _sphere_coordinates(positions):
    """Cycles' spherical mapping: texture coordinates by longitude and latitude."""
    x, y, z = positions.T
    u = np.where((x == 0) & (y == 0), 0.0, 0.5 - np.arctan2(x, y) / (2 * np.pi))
    length = np.maximum(np.sqrt((positions**2).sum(1)), 1e-30)
    return np.stack([u, 1 - np.arccos(np.clip(z / length, -1, 1)) / np.pi], 1)


def _around(mesh, axis, positions, normals):
    """Tangents around an axis through the center of a mesh, at positions with normals."""
    center, size = np.array(mesh.texspace_location, np.float64), np.maximum(np.array(mesh.texspace_size, np.float64), 1e-9)
    first, second, to_first, to_second = COMPONENTS[axis]
    offsets = (positions - center) / (2 * size)
    tangents = np.zeros_like(offsets)
    tangents[:, to_first], tangents[:, to_second] = -offsets[:, first], offsets[:, second]
    tangents -= (tangents * normals).sum(1, keepdims=True) * normals
    length = np.linalg.norm(tangents, axis=1, keepdims=True)
    # On the axis any direction is as good.
    other = np.cross(normals, [[1.0, 0.0, 0.0]]) + 1e-6
    return np.where(length > 1e-9, tangents / np.maximum(length, 1e-9), other / np.linalg.norm(other, axis=1, keepdims=True))
