"""Meshes as binary PLY: triangles with their materials by number, normals, texture coordinates and named attributes, in the axes of Blender."""

import numpy as np

from . import brushed, undeformed
from .meshes import positions

# Numbers of an attribute by its type, and the key of its values.
TYPES = {
    "FLOAT": ("value", 1),
    "INT": ("value", 1),
    "INT8": ("value", 1),
    "BOOLEAN": ("value", 1),
    "FLOAT2": ("vector", 2),
    "FLOAT_VECTOR": ("vector", 3),
    "FLOAT_COLOR": ("color", 4),
    "BYTE_COLOR": ("color", 4),
    "QUATERNION": ("value", 4),
}

# Odd numbers by which the bits of a corner's columns are mixed to one.
MIX = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F)

GENERATED = "generated"


class Corners:
    """Values of the corners of faces; those of vertices are spread."""

    def __init__(self, mesh):
        self.mesh = mesh
        self.vertices = _read(mesh.loops, "vertex_index", 1, np.int32).ravel()

    def of(self, domain, values):
        """Values of a domain by corner."""
        if domain == "POINT":
            return values[self.vertices]
        if domain == "FACE":
            counts = _read(self.mesh.polygons, "loop_total", 1, np.int32).ravel()
            return np.repeat(values, counts, axis=0)
        if domain == "EDGE":
            return values[_read(self.mesh.loops, "edge_index", 1, np.int32).ravel()]
        return values


class MeshFile:
    """A mesh with the attributes of some names, as far as it has them, as vertices whose corners agree."""

    def __init__(self, mesh, names, axes=(), has_maps=False):
        """`axes` are those around which faces are brushed, by slot; `has_maps` says that normals are mapped along texture coordinates."""
        mesh.calc_loop_triangles()
        corners = Corners(mesh)
        self.mesh, self.vertices = mesh, corners.vertices
        self.triangles = _read(mesh.loop_triangles, "loops", 3, np.int32)
        polygons = _read(mesh.loop_triangles, "polygon_index", 1, np.int32).ravel()
        self.last = max(len(mesh.materials) - 1, 0)
        self.materials = np.clip(_read(mesh.polygons, "material_index", 1, np.int32).ravel(), 0, self.last)[polygons]
        tangents = brushed.tangents(mesh, axes, corners.vertices)
        if tangents is None and has_maps and not mesh.uv_layers:
            tangents = brushed.on_sphere(mesh, self.triangles, corners.vertices)
        columns, self.labels = _columns(mesh, corners, names, tangents)
        self.properties = [name for names_of, _ in columns for name in names_of]
        self.first = None  # the first corner of each vertex of the file, where corners of a vertex may differ
        if columns:
            self.values = np.concatenate([values for _, values in columns], 1).astype(np.float32)
            self.first, welded = _welded(self.vertices, self.values)
            self.triangles = welded[self.triangles]
        else:
            self.triangles = self.vertices[self.triangles]

    def write(self, path):
        """Writes the mesh."""
        values = None if self.first is None else self.values[self.first]
        self._write(path, self.properties, values, self.labels)

    def write_shape(self, path, places):
        """Writes the same vertices and faces where the mesh has its vertices at other places: what `mesh_keys` name."""
        now = positions(self.mesh.vertices)
        self.mesh.vertices.foreach_set("co", np.ascontiguousarray(places, np.float32).ravel())
        self.mesh.update()
        has_normals = "nx" in self.properties
        normals = _read(self.mesh.corner_normals, "vector", 3, np.float32)[self.first] if has_normals else None
        self._write(path, ["nx", "ny", "nz"] if has_normals else [], normals, [])
        self.mesh.vertices.foreach_set("co", now.ravel())
        self.mesh.update()

    def _write(self, path, properties, values, labels):
        rows = positions(self.mesh.vertices)
        if self.first is not None:
            rows = rows[self.vertices[self.first]]
        if values is not None:
            rows = np.concatenate([rows, values], 1)
        head = ["ply", "format binary_little_endian 1.0"]
        head += [f"comment oscura attribute {index} {width} {name}" for index, width, name in labels]
        head += [f"element vertex {len(rows)}", *(f"property float {name}" for name in ("x", "y", "z", *properties))]
        head += [f"element face {len(self.triangles)}", "property list uchar int vertex_indices"]
        kind = [("count", "u1"), ("corners", "<i4", 3)]
        if self.last > 0:
            head.append("property ushort material_index")
            kind.append(("material", "<u2"))
        faces = np.empty(len(self.triangles), kind)
        faces["count"], faces["corners"] = 3, self.triangles
        if self.last > 0:
            faces["material"] = self.materials
        with open(path, "wb") as file:
            file.write("\n".join([*head, "end_header\n"]).encode())
            file.write(np.ascontiguousarray(rows, "<f4").tobytes())
            file.write(faces.tobytes())


def _columns(mesh, corners, names, tangents):
    """What corners have beside their positions: names of properties with their values, and the lines that name attributes."""
    columns, labels = [], []
    normals = _normals(mesh, corners) if tangents is None else _read(mesh.corner_normals, "vector", 3, np.float32)
    if normals is not None:
        columns.append((("nx", "ny", "nz"), normals))
    layer = next((layer for layer in mesh.uv_layers if layer.active_render), None)
    if layer is not None:
        columns.append((("s", "t"), _read(layer.uv, "vector", 2, np.float32)))
    brushed_along = [("tangent", 4, tangents)] if tangents is not None else []
    for name, width, values in [*_attributes(mesh, corners, names), *brushed_along]:
        index = len(labels)
        labels.append((index, width, name))
        columns.append((tuple(f"a{index}_{k}" for k in range(width)), values))
    return columns, labels


def _normals(mesh, corners):
    """Normals of corners; None where all faces are flat."""
    if mesh.normals_domain == "FACE":
        return None
    if mesh.normals_domain == "POINT":
        return _read(mesh.vertex_normals, "vector", 3, np.float32)[corners.vertices]
    return _read(mesh.corner_normals, "vector", 3, np.float32)


def _attributes(mesh, corners, names):
    """The attributes of these names: name, numbers, values by corner."""
    for name in sorted(names):
        found = mesh.attributes.get(undeformed.ATTRIBUTE if name == GENERATED else name)
        if found is not None and found.data_type in TYPES and len(found.data):
            key, width = TYPES[found.data_type]
            kind = {"INT": np.int32, "INT8": np.int32, "BOOLEAN": bool}.get(found.data_type, np.float32)
            yield name, width, corners.of(found.domain, _read(found.data, key, width, kind).astype(np.float32))
        elif name == GENERATED and not mesh.use_auto_texspace:
            yield name, 3, undeformed.coordinates(mesh, positions(mesh.vertices))[corners.vertices]


def _welded(vertices, values):
    """Corners of one vertex with the same values are one: the first corner of each, and which of them each corner is."""
    bits = np.ascontiguousarray(values).view(np.uint32)
    mixed = vertices.astype(np.uint64) * np.uint64(MIX[0])
    for column in bits.T:
        mixed = (mixed ^ column) * np.uint64(MIX[1])
        mixed ^= mixed >> np.uint64(29)
    _, first, welded = np.unique(mixed, return_index=True, return_inverse=True)
    return first, welded.ravel()


def _read(owner, key, width, kind):
    values = np.empty(width * len(owner), kind)
    owner.foreach_get(key, values)
    return values.reshape(-1, width)
