"""Meshes as binary PLY: triangles with their materials by number, normals, texture coordinates and named attributes, in the
axes of Blender; and the places of copies."""

from itertools import chain

import numpy as np

from . import brushed, meshes, undeformed
from .scene_file import Y_UP

# Odd numbers by which the bits of a corner's columns are mixed to one.
MIX = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F)

GENERATED = "generated"
NORMAL = ("nx", "ny", "nz")

# Properties of the places of copies, and those that nodes ask for.
PLACE = ("x", "y", "z", *(f"m{row}{column}" for row in range(3) for column in range(3)))
INFO = ("red", "green", "blue", "alpha", "index", "random")


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
        rows = np.concatenate([column.values if self.first is None else column.of(self.first, self.vertices) for column in columns], 1)
        kind = [("count", "u1"), ("corners", "<i4", 3)] + ([("material", "<u2")] if self.last > 0 else [])
        faces = np.empty(len(self.triangles), kind)
        faces["count"], faces["corners"] = 3, self.triangles
        if self.last > 0:
            faces["material"] = self.materials
        remarks = [f"comment oscura attribute {index} {width} {name}" for index, width, name in labels]
        _write_ply(path, [name for column in columns for name in column.names], rows, remarks, faces)


def _write_ply(path, names, rows, remarks=(), faces=None):
    """Writes vertices, rows of numbers of these names, and faces, if there are some."""
    head = ["ply", "format binary_little_endian 1.0", *remarks, f"element vertex {len(rows)}", *(f"property float {name}" for name in names)]
    if faces is not None:
        head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        head += ["property ushort material_index"] if "material" in faces.dtype.names else []
    with open(path, "wb") as file:
        file.write("\n".join([*head, "end_header\n"]).encode())
        file.write(np.ascontiguousarray(rows, "<f4").data)
        if faces is not None:
            file.write(faces.view("u1").data)


def write_places(path, copies):
    """Writes the matrices of copies, and what nodes know of each."""
    flat = chain.from_iterable(chain.from_iterable(matrix for matrix, _ in copies))
    matrices = np.array(Y_UP) @ np.fromiter(flat, np.float64, 16 * len(copies)).reshape(-1, 4, 4)
    columns, names = [matrices[:, :3, 3], matrices[:, :3, :3].reshape(-1, 9)], PLACE
    if copies[0][1]:
        columns.append(np.array([[*info["color"], info["index"], info["random"]] for _, info in copies]))
        names += INFO
    _write_ply(path, names, np.concatenate(columns, 1))


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
        if found is not None and found.data_type in meshes.ATTRIBUTES and len(found.data):
            values = meshes.read(found.data, *meshes.ATTRIBUTES[found.data_type]).astype(np.float32)
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
