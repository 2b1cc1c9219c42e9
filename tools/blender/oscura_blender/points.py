"""Point clouds: meshes of small spheres, which have the attributes of their points."""

import bmesh
import numpy as np

from . import meshes

# Of all spheres of a cloud together: the more there are the fewer each has.
MOST_FACES = 1_000_000

# Subdivisions of an icosahedron, from the finest; each takes a quarter of the faces of the one before.
LEVELS = (4, 3, 2, 1)
FACES = (1280, 320, 80, 20)

# What is in the shape already.
SHAPE = ("position", "radius")


def count_of_faces(cloud):
    """How many faces the mesh of a point cloud has."""
    return len(cloud.points) * FACES[_fineness(cloud)]


def _fineness(cloud):
    """Which of the spheres a cloud has."""
    fitting = (k for k, faces in enumerate(FACES) if len(cloud.points) * faces <= MOST_FACES)
    return next(fitting, len(FACES) - 1)


def as_mesh(cloud):
    """A mesh of an evaluated point cloud."""
    count = len(cloud.points)
    corners, faces = _sphere(LEVELS[_fineness(cloud)])
    radii = np.empty(count, np.float32)
    cloud.points.foreach_get("radius", radii)
    places = meshes.positions(cloud)[:, None] + radii[:, None, None] * corners
    triangles = faces + len(corners) * np.arange(count)[:, None, None]
    mesh = meshes.of_triangles(cloud.name, places.reshape(-1, 3), triangles.reshape(-1, 3))
    for attribute in cloud.attributes:
        _repeat(attribute, mesh, len(corners))
    for material in cloud.materials:
        mesh.materials.append(material and material.original)
    return mesh


def _sphere(level):
    """The corners and triangles of a sphere that covers as much of a picture as one of radius 1 does, on average over all views."""
    made = bmesh.new()
    bmesh.ops.create_icosphere(made, subdivisions=level, radius=1.0)
    # What a convex body covers is a quarter of its surface, on average (Cauchy).
    area = sum(face.calc_area() for face in made.faces)
    scale = np.sqrt(4 * np.pi / area)
    corners = np.array([scale * np.array(vertex.co) for vertex in made.verts], np.float32)
    faces = np.array([[vertex.index for vertex in face.verts] for face in made.faces], np.int64)
    made.free()
    return corners, faces


def _repeat(attribute, mesh, corners):
    """Gives all corners of a point's sphere what the point has."""
    if attribute.name in SHAPE or attribute.name.startswith(".") or attribute.data_type not in meshes.ATTRIBUTES:
        return
    key, size, kind = meshes.ATTRIBUTES[attribute.data_type]
    values = meshes.read(attribute.data, key, size, kind)
    own = mesh.attributes.new(attribute.name, attribute.data_type, "POINT")
    own.data.foreach_set(key, np.repeat(values, corners, axis=0).ravel())
