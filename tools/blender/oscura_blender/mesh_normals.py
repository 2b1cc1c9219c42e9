"""Corner normals where Cycles shades by others than Blender: Cycles has one normal for each vertex, after it splits sharp edges."""

import numpy as np

from . import meshes


def match_cycles(mesh):
    """Gives a mesh the normals by which Cycles shades it."""
    if mesh.has_custom_normals:
        last, normals = _last_corners(mesh), meshes.corner_normals(mesh)
        if not np.allclose(normals, normals[last], atol=1e-3):
            _set_custom_normals(mesh, normals[last])
        return
    flat, sharp = meshes.flags(mesh, "sharp_face", len(mesh.polygons)), meshes.flags(mesh, "sharp_edge", len(mesh.edges))
    if not sharp.any() and flat.any() and not flat.all():
        # Smooth faces beside flat ones have the normals of their vertices, which are averages over flat faces as well.
        faces = np.repeat(np.arange(len(mesh.polygons)), meshes.face_sizes(mesh))
        of_vertices = meshes.vertex_normals(mesh)[meshes.corner_vertices(mesh)]
        mesh.normals_split_custom_set(np.where(flat[faces, None], meshes.face_normals(mesh)[faces], of_vertices))


def _set_custom_normals(mesh, normals):
    attribute = mesh.attributes.get("custom_normal")
    if attribute is not None and attribute.data_type == "FLOAT_VECTOR":  # since Blender 4.5, by geometry nodes
        attribute.data.foreach_set("vector", normals.ravel())
        mesh.update()
    else:
        mesh.normals_split_custom_set(normals)


def _last_corners(mesh):
    """For each corner the last of those that share its vertex and are connected to it by edges that aren't sharp: Cycles uses its normal for
    all of them."""
    edges, vertices, sizes = meshes.corner_edges(mesh), meshes.corner_vertices(mesh), meshes.face_sizes(mesh)
    last, following = np.arange(len(edges)), np.arange(1, len(edges) + 1)
    ends = np.cumsum(sizes)
    following[ends - 1] = ends - sizes
    sharp = meshes.flags(mesh, "sharp_edge", len(mesh.edges))
    sharp[edges[np.repeat(meshes.flags(mesh, "sharp_face", len(sizes)), sizes)]] = True
    # Pairs of corners with the same edge. Those at the same vertex are connected, at either end of the edge.
    order = np.argsort(edges, kind="stable")
    first, second = order[:-1], order[1:]
    joined = (edges[first] == edges[second]) & ~sharp[edges[first]]
    first, second = first[joined], second[joined]
    is_same_way = vertices[first] == vertices[second]
    pairs = [
        (first, np.where(is_same_way, second, following[second])),
        (following[first], np.where(is_same_way, following[second], second)),
    ]
    while True:
        before = last.copy()
        for a, b in pairs:
            larger = np.maximum(last[a], last[b])
            np.maximum.at(last, a, larger)
            np.maximum.at(last, b, larger)
        if np.array_equal(before, last):
            return last
