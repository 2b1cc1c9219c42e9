"""Meshes as arrays. Attributes are read, not the equivalent properties of elements (`loops`, `edges`, `loop_triangles`), which Blender copies
one by one, a hundred times slower."""

import ctypes

import bpy
import numpy as np

# Types of attributes: the name of their values, the numbers of each, and their type.
ATTRIBUTE_TYPES = {
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


def read(collection, key, width, dtype):
    """A property of all elements of a collection, shape (elements, width)."""
    values = np.empty(width * len(collection), dtype)
    collection.foreach_get(key, values)
    return values.reshape(-1, width)


def attribute_values(attribute):
    """The values of an attribute, shape (elements, width); None for types that aren't numbers."""
    kind = ATTRIBUTE_TYPES.get(attribute.data_type)
    return read(attribute.data, *kind) if kind else None


def add_attribute(mesh, name, data_type, domain, values):
    """Adds an attribute with values."""
    key, _, dtype = ATTRIBUTE_TYPES[data_type]
    mesh.attributes.new(name, data_type, domain).data.foreach_set(key, np.asarray(values, dtype).ravel())


def positions(mesh):
    return _read(mesh, "position", "vector", 3, np.float32)


def corner_vertices(mesh):
    """The vertex of each face corner."""
    return _read(mesh, ".corner_vert", "value", 1, np.int32).ravel()


def corner_edges(mesh):
    """The edge that follows each face corner."""
    return _read(mesh, ".corner_edge", "value", 1, np.int32).ravel()


def edges(mesh):
    """The two vertices of each edge."""
    return _read(mesh, ".edge_verts", "value", 2, np.int32)


def _read(mesh, name, key, width, dtype):
    return read(mesh.attributes[name].data, key, width, dtype) if name in mesh.attributes else np.empty((0, width), dtype)


def flags(mesh, name, size):
    """A boolean attribute; false without it."""
    return read(mesh.attributes[name].data, "value", 1, bool).ravel() if name in mesh.attributes else np.zeros(size, bool)


def corner_normals(mesh):
    """Shading normals of face corners."""
    return read(mesh.corner_normals, "vector", 3, np.float32)


def vertex_normals(mesh):
    """Normals of vertices, as if all faces were smooth."""
    return read(mesh.vertex_normals, "vector", 3, np.float32)


def face_normals(mesh):
    return read(mesh.polygon_normals, "vector", 3, np.float32)


def face_sizes(mesh):
    """The number of corners of each face."""
    return np.diff(read(mesh.polygons, "loop_start", 1, np.int32).ravel(), append=np.int32(len(mesh.loops)))


def material_indices(mesh):
    """The material slot of each face."""
    slots = _read(mesh, "material_index", "value", 1, np.int32).ravel()
    if not len(slots):
        return np.zeros(len(mesh.polygons), np.int32)
    return np.clip(slots, 0, max(len(mesh.materials) - 1, 0))


def triangles(mesh):
    """The triangulated faces: the corners of each triangle (by index), and its face."""
    mesh.calc_loop_triangles()
    faces = read(mesh.loop_triangle_polygons, "value", 1, np.int32).ravel()
    return _triangle_corners(mesh.loop_triangles), faces


def _triangle_corners(found):
    """`foreach_get` of `loops` is slow: the array is copied where the triangles lie one after another in memory."""
    count, size = len(found), 3 * ctypes.sizeof(ctypes.c_int32)
    if count > 1 and all(found[k].as_pointer() == found[0].as_pointer() + k * size for k in (1, count - 1)):
        array = (ctypes.c_int32 * (3 * count)).from_address(found[0].as_pointer())
        return np.array(array, np.int32).reshape(-1, 3)
    return read(found, "loops", 3, np.int32)


def from_triangles(name, vertices, triangles):
    """A mesh by the positions of vertices and by triangles of vertex indices, rows of three each."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    mesh.loops.add(triangles.size)
    mesh.loops.foreach_set("vertex_index", triangles.ravel().astype(np.int32))
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", 3 * np.arange(len(triangles), dtype=np.int32))
    mesh.update(calc_edges=True)
    return mesh
