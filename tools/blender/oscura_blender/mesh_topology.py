"""Whether meshes are closed: holes are filled for subsurface scattering, and planar glass sheets get a note."""

import bmesh
import numpy as np

from . import meshes

# Holes are filled up to this share of the surface area.
MAX_HOLES = 0.2

# Upright sheets: the largest vertical component of their normal, and deviations from a plane.
UPRIGHT, PLANAR = 0.5, 1e-3


def faces_of_edges(mesh, slot=None):
    """The number of faces at each edge, all or those of a material slot."""
    edges = meshes.corner_edges(mesh)
    if slot is not None:
        edges = edges[np.repeat(meshes.material_indices(mesh) == slot, meshes.face_sizes(mesh))]
    return np.bincount(edges, minlength=1)


def fill_holes(mesh, slot, report):
    """Fills small holes (characters are open at the neck and the eyes) with the material beside them, if the faces of a slot are not closed."""
    if np.isin(faces_of_edges(mesh, slot), (0, 2)).all():
        return
    work = bmesh.new()
    work.from_mesh(mesh)
    area = sum(face.calc_area() for face in work.faces)
    filled = bmesh.ops.holes_fill(work, edges=[edge for edge in work.edges if edge.is_boundary], sides=0)["faces"]
    if 0 < sum(face.calc_area() for face in filled) <= MAX_HOLES * area:
        for face in filled:
            beside = [other for edge in face.edges for other in edge.link_faces if other != face]
            face.material_index = beside[0].material_index if beside else 0
        work.to_mesh(mesh)
        report.note(mesh.name, f"{len(filled)} holes are filled, since subsurface scattering needs a closed mesh")
    work.free()


def note_upright_sheet(entry, slot, report):
    """Cycles refracts light at a single sheet of glass as at the surface of a solid, which displaces the view through a window."""
    mesh = entry.object.data
    if _is_upright_sheet(mesh, slot, [placement.matrix for placement in entry.placements]):
        message = "a single sheet of glass refracts light as the surface of a solid, as in Cycles; a Solidify modifier makes it a pane"
        report.note(mesh.materials[slot].name, message)


def _is_upright_sheet(mesh, slot, matrices):
    """Are the faces of a slot in one plane, which is upright for all matrices?"""
    used = meshes.material_indices(mesh) == slot
    if not used.any():
        return False
    normals = meshes.face_normals(mesh)[used]
    centers = meshes.read(mesh.polygons, "center", 3, np.float32)[used]
    normal = normals[0]
    heights = (centers - centers[0]) @ normal
    size = float(np.ptp(centers, 0).max())
    if np.abs(np.abs(normals @ normal) - 1).max() > PLANAR or np.abs(heights).max() > PLANAR * size:
        return False
    placed = [np.linalg.inv(np.array(matrix.to_3x3())).T @ normal for matrix in matrices if matrix.determinant()]
    return bool(placed) and all(abs(n[2]) < UPRIGHT * np.linalg.norm(n) for n in placed)
