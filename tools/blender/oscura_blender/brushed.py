"""Tangents of meshes: the direction in which surfaces are brushed, Cycles' own around the vertical axis of the mesh, by what its Tangent
node says around another one or along texture coordinates; and what normal maps stand on where a mesh has no texture coordinates."""

import bpy
import numpy as np

from . import meshes

# Components of a place that a direction around each axis follows: (-a, b), and where they belong.
AROUND = {"X": (2, 1, 1, 2), "Y": (2, 0, 0, 2), "Z": (1, 0, 0, 1)}


def tangents(mesh, axes, corners):
    """Tangents of corners with their handedness, by the axes of slots; 0 where texture coordinates give them. None where all do."""
    if not any(axes):
        return None
    of_corners = np.repeat(meshes.material_slots(mesh), meshes.face_sizes(mesh))
    places, normals = meshes.positions(mesh)[corners].astype(np.float64), meshes.corner_normals(mesh).astype(np.float64)
    found = np.zeros((len(mesh.loops), 4), np.float32)
    for slot, axis in enumerate(axes):
        used = of_corners == slot
        if axis and used.any():
            found[used, :3] = _around(mesh, axis, places[used], normals[used])
            found[used, 3] = 1.0
    return found


def on_sphere(mesh, triangles, vertices):
    """Tangents of corners with their handedness along longitudes and latitudes about the mesh's origin: those that Cycles has for normal
    maps on meshes without texture coordinates. It finds them on `triangles`, of numbers of corners, whose `vertices` are given."""
    corners = triangles.ravel()
    apart = bpy.data.meshes.new("triangles")
    try:
        apart.from_pydata(meshes.positions(mesh), [], vertices[triangles])
        apart.normals_split_custom_set(meshes.corner_normals(mesh)[corners])
        coordinates = _longitudes_and_latitudes(meshes.positions(mesh)[vertices[corners]].astype(np.float64))
        apart.uv_layers.new(name="sphere").uv.foreach_set("vector", coordinates.astype(np.float32).ravel())
        apart.calc_tangents(uvmap="sphere")
        directions, signs = np.empty(3 * len(corners), np.float32), np.empty(len(corners), np.float32)
        apart.loops.foreach_get("tangent", directions)
        apart.loops.foreach_get("bitangent_sign", signs)
    finally:
        bpy.data.meshes.remove(apart)
    found = np.zeros((len(vertices), 4), np.float32)
    found[corners] = np.concatenate([directions.reshape(-1, 3), signs[:, None]], 1)
    return found


def _longitudes_and_latitudes(places):
    """Texture coordinates of places on a sphere around them, as Cycles has them."""
    x, y, z = places.T
    around = np.where((x == 0) & (y == 0), 0.0, 0.5 - np.arctan2(x, y) / (2 * np.pi))
    length = np.maximum(np.sqrt((places**2).sum(1)), 1e-30)
    return np.stack([around, 1 - np.arccos(np.clip(z / length, -1, 1)) / np.pi], 1)


def _around(mesh, axis, positions, normals):
    """Tangents of places that run around an axis through the middle of a mesh."""
    middle, size = np.array(mesh.texspace_location, np.float64), np.maximum(np.array(mesh.texspace_size, np.float64), 1e-9)
    first, second, to_first, to_second = AROUND[axis]
    places = (positions - middle) / (2 * size)
    around = np.zeros_like(places)
    around[:, to_first], around[:, to_second] = -places[:, first], places[:, second]
    around -= (around * normals).sum(1, keepdims=True) * normals
    length = np.linalg.norm(around, axis=1, keepdims=True)
    # At the axis itself any direction will do.
    other = np.cross(normals, [[1.0, 0.0, 0.0]]) + 1e-6
    return np.where(length > 1e-9, around / np.maximum(length, 1e-9), other / np.linalg.norm(other, axis=1, keepdims=True))
