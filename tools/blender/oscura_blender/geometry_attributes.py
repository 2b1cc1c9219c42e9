"""Attributes of vertices for the Geometry node: pointiness and a random number per island, as Cycles computes them."""

import numpy as np

from . import meshes
from .object_info import MASK, hashed


def pointiness(mesh):
    """How far the edges of each vertex are from its normal, 0 to 1 (0.5 where it is flat), blurred over its neighbors. Vertices at one place are
    one."""
    positions, normals = meshes.positions(mesh), meshes.vertex_normals(mesh)
    _, first, merged = np.unique(positions, axis=0, return_index=True, return_inverse=True)
    merged, places = merged.ravel(), positions[first].astype(np.float64)
    edges = np.unique(np.sort(merged[meshes.edges(mesh)], axis=1), axis=0)
    mean_normals = _unit(_sums(normals, merged, len(places)))
    directions = _unit(places[edges[:, 1]] - places[edges[:, 0]])
    ends = np.concatenate([edges[:, 0], edges[:, 1]])
    counts = np.bincount(ends, minlength=len(places))
    means = _sums(np.concatenate([directions, -directions]), ends, len(places)) / np.maximum(counts, 1)[:, None]
    angles = np.where(counts > 0, np.arccos(np.clip((mean_normals * means).sum(1), -1, 1)) / np.pi, 0.0)
    beside = np.bincount(ends, angles[np.concatenate([edges[:, 1], edges[:, 0]])], minlength=len(places))
    return ((angles + beside) / (counts + 1))[merged, None].astype(np.float32)


def _sums(rows, places, count):
    """The sums of rows of three by place."""
    return np.stack([np.bincount(places, column, minlength=count) for column in rows.T], 1)


def _unit(vectors):
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(lengths > 0, lengths, 1)


def random_per_island(mesh):
    """A random number for each vertex, the same in each connected part: the hash of a root of the part, which depends on the order of edges."""
    parents, ranks = list(range(len(mesh.vertices))), [0] * len(mesh.vertices)

    def root(vertex):
        while parents[vertex] != vertex:
            parents[vertex] = vertex = parents[parents[vertex]]
        return vertex

    for a, b in meshes.edges(mesh).tolist():
        a, b = root(a), root(b)
        if a == b:
            continue
        if ranks[a] < ranks[b]:
            a, b = b, a
        parents[b] = a
        ranks[a] += ranks[a] == ranks[b]
    roots = np.array([root(vertex) for vertex in range(len(parents))], np.int64)
    return (hashed(roots, 1) / MASK)[:, None].astype(np.float32)


# By name in scene files.
COMPUTED = {"pointiness": pointiness, "random_per_island": random_per_island}
