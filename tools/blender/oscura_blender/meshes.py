"""Meshes from arrays of numbers, and the other way round."""

import bpy
import numpy as np


def positions(points):
    """Where vertices, or points that are like them, are: a row each."""
    found = np.empty(3 * len(points), np.float32)
    points.foreach_get("co", found)
    return found.reshape(-1, 3)


def of_triangles(name, places, triangles):
    """A mesh with vertices at places (rows of three), by the numbers of triangles' corners (rows of three)."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(places))
    mesh.vertices.foreach_set("co", places.astype(np.float32).ravel())
    mesh.loops.add(triangles.size)
    mesh.loops.foreach_set("vertex_index", triangles.ravel().astype(np.int32))
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", 3 * np.arange(len(triangles), dtype=np.int32))
    mesh.update(calc_edges=True)
    return mesh
