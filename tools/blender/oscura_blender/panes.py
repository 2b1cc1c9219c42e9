"""Glass as Cycles has it: refracted light keeps its radiance, and a mesh without an inside (the pane of a window, the surface of
water) is a sheet that bends light by the sides of its normals, with nothing behind."""

import numpy as np

from . import shaders, skins, trees

# How much of a normal may point up or down in a pane that stands, and how far normals may differ.
UPRIGHT, STRAIGHT = 0.5, 1e-3


def settle(holders, found, report):
    """Says of all glass that it is that of Cycles, and which of it are sheets."""
    slots = [(holder, slot) for holder in holders for slot, m in enumerate(holder.data.materials) if _is_glass(m)]
    is_sheet = {at: _is_open(at[0].data) and not _has_volume(_of(at)) for at in slots}
    bodies = {_of(at) for at in slots if not is_sheet[at]}
    sheets = {}
    for at in slots:
        material = _of(at)
        if is_sheet[at]:
            tell_of_upright(*at, found, report)
            if material not in sheets:
                sheets[material] = trees.copied(material) if material in bodies else material
            at[0].data.materials[at[1]] = sheets[material]
    for material in bodies:
        trees.settle(material, keeps_radiance=True)
    for material in sheets.values():
        trees.settle(material, volume=False, keeps_radiance=True)


def tell_of_upright(holder, slot, found, report):
    """Tells that a sheet of glass that stands moves what is seen through it."""
    if _stands(holder, slot, found):
        message = "a single upright sheet of glass bends light as if a solid began there, as in Cycles"
        material = holder.data.materials[slot].name
        report.note(material, f"{message}; with a thickness (a Solidify modifier) or --glass panes light passes it straight")


def _of(at):
    holder, slot = at
    return holder.data.materials[slot]


def _is_glass(material):
    """Does light pass it, unless what it was made of says already how?"""
    node = shaders.principled(material)
    is_opaque = node is None or shaders.constant(node.inputs["Transmission Weight"]) == 0
    return not is_opaque and "volume" not in trees.SETTINGS.get(material.name, {})


def _has_volume(material):
    return shaders.source(shaders.end(material.node_tree).inputs["Volume"]) is not None


def _is_open(mesh):
    """Are there edges with a face on one side only?"""
    return bool((skins.sides_of_edges(mesh) == 1).any())


def _stands(holder, slot, found):
    """Are the faces of a slot parts of one upright plane, wherever the mesh is placed?"""
    mesh = holder.data
    count = len(mesh.polygons)
    slots, normals, centers = np.empty(count, np.int32), np.empty(3 * count, np.float32), np.empty(3 * count, np.float32)
    for key, values in (("material_index", slots), ("normal", normals), ("center", centers)):
        mesh.polygons.foreach_get(key, values)
    used = slots == slot
    normals, centers = normals.reshape(-1, 3)[used], centers.reshape(-1, 3)[used]
    if not len(normals):
        return False
    axis = normals[0]
    heights = (centers - centers[0]) @ axis
    size = float(np.ptp(centers, 0).max())
    if np.abs(np.abs(normals @ axis) - 1).max() > STRAIGHT or np.abs(heights).max() > STRAIGHT * size:
        return False
    turned = [np.linalg.inv(np.array(matrix.to_3x3())).T @ axis for _, matrix in found.placements[holder.name] if matrix.determinant()]
    return bool(turned) and all(abs(up[2]) < UPRIGHT * np.linalg.norm(up) for up in turned)
