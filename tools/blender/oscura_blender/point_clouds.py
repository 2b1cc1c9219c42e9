"""Point clouds as meshes of spheres with the attributes of the points."""

import bmesh
import numpy as np

from . import meshes

# Of a whole point cloud: with more points each sphere has fewer faces.
MAX_FACES = 1_000_000

# Subdivisions of icospheres and the faces of each, the finest first.
LEVELS = {4: 1280, 3: 320, 2: 80, 1: 20}

# Attributes that the positions of the vertices contain.
SHAPE = ("position", "radius")


def face_count(cloud):
    """The number of faces of a point cloud's mesh."""
    return len(cloud.points) * LEVELS[_level(cloud)]


def _level(cloud):
    return next((level for level, faces in LEVELS.items() if len(cloud.points) * faces <= MAX_FACES), min(LEVELS))


def to_mesh(cloud):
    """The mesh of an evaluated point cloud."""
    count = len(cloud.points)
    vertices, faces = _sphere(_level(cloud))
    radii = meshes.read(cloud.points, "radius", 1, np.float32)
    positions = meshes.positions(cloud)[:, None] + radii[:, None] * vertices
    triangles = faces + len(vertices) * np.arange(count)[:, None, None]
    mesh = meshes.from_triangles(cloud.name, positions.reshape(-1, 3), triangles.reshape(-1, 3))
    for attribute in cloud.attributes:
        values = meshes.attribute_values(attribute)
        if values is not None and attribute.name not in SHAPE and not attribute.name.startswith("."):
            meshes.add_attribute(mesh, attribute.name, attribute.data_type, "POINT", np.repeat(values, len(vertices), axis=0))
    for material in cloud.materials:
        mesh.materials.append(material and material.original)
    return mesh


def _sphere(level):
    """The vertices and triangles of an icosphere whose silhouette has the area of that of the unit sphere, averaged over all directions."""
    made = bmesh.new()
    bmesh.ops.create_icosphere(made, subdivisions=level, radius=1.0)
    # The mean area of a convex body's silhouette is a quarter of its surface area (Cauchy).
    area = sum(face.calc_area() for face in made.faces)
    scale = np.sqrt(4 * np.pi / area)
    vertices = np.array([scale * np.array(vertex.co) for vertex in made.verts], np.float32)
    faces = np.array([[vertex.index for vertex in face.verts] for face in made.faces], np.int64)
    made.free()
    return vertices, faces
