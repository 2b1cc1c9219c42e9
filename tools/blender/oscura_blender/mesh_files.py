"""Meshes as binary PLY files (triangles, material indices, normals, texture coordinates, named attributes) in Blender's coordinate system, and
the transforms of instances."""

from itertools import chain

import numpy as np

from . import generated_coordinates, geometry_attributes, meshes, tangents
from .scene_file import Y_UP

# Odd factors of the hash of corners.
HASH = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F)

GENERATED = "generated"
NORMAL = ("nx", "ny", "nz")

# Properties of instances: position and matrix, and values for the Object Info node.
TRANSFORM = ("x", "y", "z", *(f"m{row}{column}" for row in range(3) for column in range(3)))
OBJECT_INFO = ("red", "green", "blue", "alpha", "index", "random")


class Column:
    """Values of vertices or of face corners, a row for each, and the names of their PLY properties."""

    def __init__(self, names, values, is_of_vertices):
        self.names, self.values, self.is_of_vertices = names, values, is_of_vertices

    def at(self, corners, vertices):
        return self.values[vertices[corners] if self.is_of_vertices else corners]


class MeshFile:
    """A mesh with those of some attributes that it has. Corners of a vertex with the same values are one vertex of the file."""

    def __init__(self, mesh, attributes, axes=(), has_normal_maps=False):
        """`axes` are those of anisotropic reflection, by material slot."""
        self.mesh, self.vertices = mesh, meshes.corner_vertices(mesh)
        self.triangles, faces = meshes.triangles(mesh)
        self.materials = meshes.material_indices(mesh)[faces] if len(mesh.materials) > 1 else None
        directions = tangents.radial(mesh, axes, self.vertices)
        if directions is None and has_normal_maps and not mesh.uv_layers:
            directions = tangents.spherical(mesh, self.triangles, self.vertices)
        self.columns, self.labels = _columns(mesh, attributes, directions)
        self.corners = None  # the first corner of each vertex of the file, where vertices are split
        of_corners = [column.values for column in self.columns if not column.is_of_vertices]
        corner_to_vertex = self.vertices
        if of_corners:
            values = np.concatenate(of_corners, 1, dtype=np.float32)
            self.corners, corner_to_vertex = _merge_corners(self.vertices, values, len(mesh.vertices))
        self.triangles = corner_to_vertex[self.triangles]

    def write(self, path):
        self._write(path, self.columns, self.labels)

    def write_shape(self, path, positions):
        """Writes the mesh with its vertices at other positions, for `mesh_keys`: without attributes, and with the same faces."""
        now = meshes.positions(self.mesh)
        self._move(np.ascontiguousarray(positions, np.float32))
        normals = [_normals(self.mesh, column.is_of_vertices) for column in self.columns if column.names == NORMAL]
        self._write(path, normals, [])
        self._move(now)

    def _move(self, positions):
        self.mesh.vertices.foreach_set("co", positions.ravel())
        self.mesh.update()

    def _write(self, path, columns, labels):
        columns = [Column(("x", "y", "z"), meshes.positions(self.mesh), True), *columns]
        values = [column.values if self.corners is None else column.at(self.corners, self.vertices) for column in columns]
        has_materials = self.materials is not None
        faces = np.empty(len(self.triangles), [("count", "u1"), ("corners", "<i4", 3)] + [("material", "<u2")] * has_materials)
        faces["count"], faces["corners"] = 3, self.triangles
        if has_materials:
            faces["material"] = self.materials
        comments = [f"comment oscura attribute {index} {width} {name}" for index, width, name in labels]
        _write_ply(path, [name for column in columns for name in column.names], np.concatenate(values, 1), comments, faces)


def _write_ply(path, names, rows, comments=(), faces=None):
    """Writes vertices, rows of properties of these names, and faces, if any."""
    head = ["ply", "format binary_little_endian 1.0", *comments, f"element vertex {len(rows)}", *(f"property float {name}" for name in names)]
    if faces is not None:
        head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        head += ["property ushort material_index"] if "material" in faces.dtype.names else []
    with open(path, "wb") as file:
        file.write("\n".join([*head, "end_header\n"]).encode())
        file.write(np.ascontiguousarray(rows, "<f4").data)
        if faces is not None:
            file.write(faces.view("u1").data)


def write_instances(path, instances):
    """Writes instances: pairs of a matrix and the values for the Object Info node, which are empty if no node uses them."""
    flat = chain.from_iterable(chain.from_iterable(matrix for matrix, _ in instances))
    matrices = np.array(Y_UP) @ np.fromiter(flat, np.float64, 16 * len(instances)).reshape(-1, 4, 4)
    columns, names = [matrices[:, :3, 3], matrices[:, :3, :3].reshape(-1, 9)], TRANSFORM
    if instances[0][1]:
        columns.append(np.array([[*info["color"], info["index"], info["random"]] for _, info in instances]))
        names += OBJECT_INFO
    _write_ply(path, names, np.concatenate(columns, 1))


def _columns(mesh, attributes, directions):
    """The columns besides positions, and the labels of attributes: their index, width and name."""
    columns, labels = [], []
    if directions is not None or mesh.normals_domain != "FACE":
        columns.append(_normals(mesh, directions is None and mesh.normals_domain == "POINT"))
    layer = next((layer for layer in mesh.uv_layers if layer.active_render), None)
    if layer is not None:
        columns.append(Column(("s", "t"), meshes.read(layer.uv, "vector", 2, np.float32), False))
    named = list(_attributes(mesh, attributes))
    if directions is not None:
        named.append(("tangent", directions, False))
    for index, (name, values, is_of_vertices) in enumerate(named):
        labels.append((index, values.shape[1], name))
        columns.append(Column(tuple(f"a{index}_{k}" for k in range(values.shape[1])), values, is_of_vertices))
    return columns, labels


def _normals(mesh, is_of_vertices):
    return Column(NORMAL, meshes.vertex_normals(mesh) if is_of_vertices else meshes.corner_normals(mesh), is_of_vertices)


def _attributes(mesh, names):
    """The attributes of these names that a mesh has: name, values, and whether they are those of vertices or of corners."""
    for name in sorted(names):
        if name in geometry_attributes.COMPUTED:
            yield name, geometry_attributes.COMPUTED[name](mesh), True
            continue
        attribute = mesh.attributes.get(generated_coordinates.ATTRIBUTE if name == GENERATED else name)
        values = meshes.attribute_values(attribute) if attribute is not None and len(attribute.data) else None
        if values is not None:
            yield name, _on_corners(mesh, attribute.domain, values.astype(np.float32)), attribute.domain == "POINT"
        elif name == GENERATED and not mesh.use_auto_texspace:
            yield name, generated_coordinates.coordinates(mesh, meshes.positions(mesh)), True


def _on_corners(mesh, domain, values):
    """Values of faces and edges by corner; others as they are."""
    if domain == "FACE":
        return np.repeat(values, meshes.face_sizes(mesh), axis=0)
    return values[meshes.corner_edges(mesh)] if domain == "EDGE" else values


def _merge_corners(vertices, values, count):
    """Merges corners of a vertex with the same values: the first corner of each merged vertex, and the merged vertex of each corner. Most corners
    agree with a representative of their vertex, so that only the others are sorted, by a hash."""
    bits = np.ascontiguousarray(values).view(np.uint32)
    representatives = np.full(count, -1, np.int32)
    representatives[vertices] = np.arange(len(vertices), dtype=np.int32)
    differs, representative = np.zeros(len(vertices), bool), representatives[vertices]
    for column in bits.T:
        differs |= column != column[representative]
    del representative
    used = representatives >= 0
    number = np.cumsum(used, dtype=np.int32) - 1
    merged = number[vertices]
    others = np.flatnonzero(differs)
    hashes = vertices[others].astype(np.uint64) * np.uint64(HASH[0])
    for column in bits[others].T:
        hashes = (hashes ^ column) * np.uint64(HASH[1])
        hashes ^= hashes >> np.uint64(29)
    _, first, among = np.unique(hashes, return_index=True, return_inverse=True)
    merged[others] = used.sum() + among.ravel()
    return np.concatenate([representatives[used], others[first]]), merged
