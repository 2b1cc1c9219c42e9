"""Holes of bodies that scatter light within: small ones are closed."""

import bmesh
import numpy as np

from . import meshes

# Holes of a larger share of the surface are not closed.
LARGEST_HOLES = 0.2


def close(holder, slot, report):
    """Are the faces of a slot closed, once small holes of the mesh are?"""
    return _is_closed(holder.data, slot) or _fill_holes(holder, report) and _is_closed(holder.data, slot)


def _fill_holes(holder, report):
    """Fills the holes of a mesh, as far as they are small, with the material beside them: heads are open at their neck and eyes."""
    mesh, work = holder.data, bmesh.new()
    work.from_mesh(mesh)
    area = sum(face.calc_area() for face in work.faces)
    made = bmesh.ops.holes_fill(work, edges=[edge for edge in work.edges if edge.is_boundary], sides=0)["faces"]
    is_small = 0 < sum(face.calc_area() for face in made) <= LARGEST_HOLES * area
    if is_small:
        for face in made:
            beside = [other for edge in face.edges for other in edge.link_faces if other != face]
            face.material_index = beside[0].material_index if beside else 0
        work.to_mesh(mesh)
        report.note(mesh.name, f"has {len(made)} holes, which are closed: light scatters within bodies")
    work.free()
    return is_small


def _is_closed(mesh, slot):
    """Has each edge of the faces of a slot two of them?"""
    return bool(np.isin(sides_of_edges(mesh, slot), (0, 2)).all())


def sides_of_edges(mesh, slot=None):
    """How many faces each edge has, all or those of a slot."""
    edges = meshes.corner_edges(mesh)
    if slot is not None:
        edges = edges[np.repeat(meshes.material_slots(mesh) == slot, meshes.face_sizes(mesh))]
    return np.bincount(edges, minlength=1)
