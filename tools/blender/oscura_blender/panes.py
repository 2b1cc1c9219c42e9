"""Glass as Cycles has it: refracted light keeps its radiance, and a mesh without an inside (the pane of a window, the surface of
water) is a sheet that bends light by the sides of its normals, with nothing behind."""

import numpy as np

from . import meshes

# How much of a normal may point up or down in a pane that stands, and how far normals may differ.
UPRIGHT, STRAIGHT = 0.5, 1e-3


def tell_of_upright(holder, slot, found, report):
    """Tells that a sheet of glass that stands moves what is seen through it."""
    if _stands(holder, slot, found):
        message = "a single upright sheet of glass bends light as if a solid began there, as in Cycles"
        material = holder.data.materials[slot].name
        report.note(material, f"{message}; with a thickness (a Solidify modifier) light passes it straight")


def _stands(holder, slot, found):
    """Are the faces of a slot parts of one upright plane, wherever the mesh is placed?"""
    mesh = holder.data
    used = meshes.material_slots(mesh) == slot
    if not used.any():
        return False
    normals = meshes.face_normals(mesh)[used]
    centers = meshes.read(mesh.polygons, "center", 3, np.float32)[used]
    axis = normals[0]
    heights = (centers - centers[0]) @ axis
    size = float(np.ptp(centers, 0).max())
    if np.abs(np.abs(normals @ axis) - 1).max() > STRAIGHT or np.abs(heights).max() > STRAIGHT * size:
        return False
    turned = [np.linalg.inv(np.array(matrix.to_3x3())).T @ axis for _, matrix, *_ in found.placements[holder.name] if matrix.determinant()]
    return bool(turned) and all(abs(up[2]) < UPRIGHT * np.linalg.norm(up) for up in turned)
