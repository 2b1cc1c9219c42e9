"""Meshes from arrays of numbers, and the other way round. Arrays are read by attributes, which Blender copies at once: the properties of the same
values that elements have (`loops`, `edges`, `loop_triangles`) are read one by one, a hundred times as long."""

import ctypes

import bpy
import numpy as np


# What the values of attributes are called, how many numbers each has, and of what type they are.
ATTRIBUTES = {
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "INT8": ("value", 1, np.int32),
    "BOOLEAN": ("value", 1, bool),
    "INT16_2D": ("value", 2, np.int32),
    "INT32_2D": ("value", 2, np.int32),
    "FLOAT2": ("vector", 2, np.float32),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
    "QUATERNION": ("value", 4, np.float32),
}


def read(owner, key, width, kind):
    """A property of all elements of a collection: a row of `width` numbers each."""
    values = np.empty(width * len(owner), kind)
    owner.foreach_get(key, values)
    return values.reshape(-1, width)


def positions(mesh):
    """Positions of vertices."""
    return _attribute(mesh, "position", "vector", 3, np.float32)


def corner_vertices(mesh):
    """The vertex of each corner of a face."""
    return _attribute(mesh, ".corner_vert", "value", 1, np.int32).ravel()


def corner_edges(mesh):
    """The edge after each corner of a face."""
    return _attribute(mesh, ".corner_edge", "value", 1, np.int32).ravel()


def edges(mesh):
    """The two vertices of each edge."""
    return _attribute(mesh, ".edge_verts", "value", 2, np.int32)


def corner_normals(mesh):
    """Shading normals of corners."""
    return read(mesh.corner_normals, "vector", 3, np.float32)


def set_custom_normals(mesh, normals):
    """Gives the corners of a mesh with custom normals others."""
    given = mesh.attributes.get("custom_normal")
    if given is not None and given.data_type == "FLOAT_VECTOR":
        given.data.foreach_set("vector", normals.ravel())
        mesh.update()
    else:
        mesh.normals_split_custom_set(normals)


def vertex_normals(mesh):
    """Shading normals of vertices, where all faces are smooth."""
    return read(mesh.vertex_normals, "vector", 3, np.float32)


def face_normals(mesh):
    """Normals of faces."""
    return read(mesh.polygon_normals, "vector", 3, np.float32)


def face_sizes(mesh):
    """How many corners each face has."""
    return np.diff(read(mesh.polygons, "loop_start", 1, np.int32).ravel(), append=np.int32(len(mesh.loops)))


def material_slots(mesh):
    """The number of each face's material, from 0; without materials 0."""
    if "material_index" not in mesh.attributes:
        return np.zeros(len(mesh.polygons), np.int32)
    slots = _attribute(mesh, "material_index", "value", 1, np.int32).ravel()
    return np.clip(slots, 0, max(len(mesh.materials) - 1, 0))


def triangles(mesh):
    """The faces in triangles: their corners by number, and the face of each."""
    mesh.calc_loop_triangles()
    faces = read(mesh.loop_triangle_polygons, "value", 1, np.int32).ravel()
    return _corners_of_triangles(mesh.loop_triangles), faces


def _corners_of_triangles(found):
    """Their array itself where it is one, without gaps."""
    count, size = len(found), 3 * ctypes.sizeof(ctypes.c_int32)
    if count > 1 and all(found[k].as_pointer() == found[0].as_pointer() + k * size for k in (1, count - 1)):
        array = (ctypes.c_int32 * (3 * count)).from_address(found[0].as_pointer())
        return np.array(array, np.int32).reshape(-1, 3)
    return read(found, "loops", 3, np.int32)


def _attribute(mesh, name, key, width, kind):
    return read(mesh.attributes[name].data, key, width, kind) if name in mesh.attributes else np.empty((0, width), kind)


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
