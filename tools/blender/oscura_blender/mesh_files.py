"""Meshes as binary PLY: triangles with their materials by number, normals, texture coordinates and named attributes, in the axes of Blender."""

import numpy as np

from . import brushed, meshes, undeformed

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
NORMAL = ("nx", "ny", "nz")


class Column:
    """Values of a mesh, a row of them for each vertex or for each corner of a face, and the names of their properties."""

    def __init__(self, names, values, is_of_vertices):
        self.names, self.values, self.is_of_vertices = names, values, is_of_vertices

    def of(self, corners, vertices):
        """Values of these corners."""
        return self.values[vertices[corners] if self.is_of_vertices else corners]


class MeshFile:
    """A mesh with the attributes of some names, as far as it has them, as vertices whose corners agree."""

    def __init__(self, mesh, names, axes=(), has_maps=False):
        """`axes` are those around which faces are brushed, by slot; `has_maps` says that normals are mapped along texture coordinates."""
        self.mesh, self.vertices = mesh, meshes.corner_vertices(mesh)
        self.triangles, faces = meshes.triangles(mesh)
        self.last = max(len(mesh.materials) - 1, 0)
        self.materials = meshes.material_slots(mesh)[faces] if self.last > 0 else None
        del faces
        tangents = brushed.tangents(mesh, axes, self.vertices)
        if tangents is None and has_maps and not mesh.uv_layers:
            tangents = brushed.on_sphere(mesh, self.triangles, self.vertices)
        self.columns, self.labels = _columns(mesh, names, tangents)
        self.first = None  # the first corner of each vertex of the file, where corners of a vertex differ
        of_corners = [column.values for column in self.columns if not column.is_of_vertices]
        if of_corners:
            self.first, welded = _welded(self.vertices, np.concatenate(of_corners, 1, dtype=np.float32), len(mesh.vertices))
            self.triangles = welded[self.triangles]
        else:
            self.triangles = self.vertices[self.triangles]

    def write(self, path):
        """Writes the mesh."""
        self._write(path, self.columns, self.labels)

    def write_shape(self, path, places):
        """Writes the same vertices and faces where the mesh has its vertices at other places: what `mesh_keys` name."""
        now = meshes.positions(self.mesh)
        self.mesh.vertices.foreach_set("co", np.ascontiguousarray(places, np.float32).ravel())
        self.mesh.update()
        normals = [_normals(self.mesh, column.is_of_vertices) for column in self.columns if column.names == NORMAL]
        self._write(path, normals, [])
        self.mesh.vertices.foreach_set("co", now.ravel())
        self.mesh.update()

    def _write(self, path, columns, labels):
        columns = [Column(("x", "y", "z"), meshes.positions(self.mesh), True), *columns]
        read = [column.values if self.first is None else column.of(self.first, self.vertices) for column in columns]
        rows = np.concatenate(read, 1)
        properties = [name for column in columns for name in column.names]
        head = ["ply", "format binary_little_endian 1.0"]
        head += [f"comment oscura attribute {index} {width} {name}" for index, width, name in labels]
        head += [f"element vertex {len(rows)}", *(f"property float {name}" for name in properties)]
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
            file.write(np.ascontiguousarray(rows, "<f4").data)
            file.write(faces.view("u1").data)


def _columns(mesh, names, tangents):
    """What vertices and corners have beside their positions, and the lines that name attributes."""
    columns, labels = [], []
    if tangents is not None or mesh.normals_domain != "FACE":
        columns.append(_normals(mesh, tangents is None and mesh.normals_domain == "POINT"))
    layer = next((layer for layer in mesh.uv_layers if layer.active_render), None)
    if layer is not None:
        columns.append(Column(("s", "t"), meshes.read(layer.uv, "vector", 2, np.float32), False))
    brushed_along = [("tangent", tangents, False)] if tangents is not None else []
    for name, values, is_of_vertices in [*_attributes(mesh, names), *brushed_along]:
        index, width = len(labels), values.shape[1]
        labels.append((index, width, name))
        columns.append(Column(tuple(f"a{index}_{k}" for k in range(width)), values, is_of_vertices))
    return columns, labels


def _normals(mesh, is_of_vertices):
    return Column(NORMAL, meshes.vertex_normals(mesh) if is_of_vertices else meshes.corner_normals(mesh), is_of_vertices)


def _attributes(mesh, names):
    """The attributes of these names: name, values, and whether they are those of vertices; others are spread to corners."""
    for name in sorted(names):
        found = mesh.attributes.get(undeformed.ATTRIBUTE if name == GENERATED else name)
        if found is not None and found.data_type in TYPES and len(found.data):
            key, width = TYPES[found.data_type]
            kind = {"INT": np.int32, "INT8": np.int32, "BOOLEAN": bool}.get(found.data_type, np.float32)
            values = meshes.read(found.data, key, width, kind).astype(np.float32)
            yield name, _on_corners(mesh, found.domain, values), found.domain == "POINT"
        elif name == GENERATED and not mesh.use_auto_texspace:
            yield name, undeformed.coordinates(mesh, meshes.positions(mesh)), True


def _on_corners(mesh, domain, values):
    """Values of faces and edges by corner."""
    if domain == "FACE":
        return np.repeat(values, meshes.face_sizes(mesh), axis=0)
    return values[meshes.corner_edges(mesh)] if domain == "EDGE" else values


def _welded(vertices, values, count):
    """Corners of one vertex with the same values are one: the first corner of each, and which of them each corner is. Most agree with one
    corner of their vertex, and the others alone are sorted."""
    bits = np.ascontiguousarray(values).view(np.uint32)
    some = np.full(count, -1, np.int32)
    some[vertices] = np.arange(len(vertices), dtype=np.int32)
    differs, representative = np.zeros(len(vertices), bool), some[vertices]
    for column in bits.T:
        differs |= column != column[representative]
    del representative
    used = some >= 0
    number = np.cumsum(used, dtype=np.int32) - 1
    welded = number[vertices]
    others = np.flatnonzero(differs)
    mixed = vertices[others].astype(np.uint64) * np.uint64(MIX[0])
    for column in bits[others].T:
        mixed = (mixed ^ column) * np.uint64(MIX[1])
        mixed ^= mixed >> np.uint64(29)
    _, first, among = np.unique(mixed, return_index=True, return_inverse=True)
    welded[others] = used.sum() + among.ravel()
    return np.concatenate([some[used], others[first]]), welded
