"""Window panes of one sheet. Cycles bends light at them as if the room were filled with glass, which shifts what lies behind; here
such a filling would brighten it as well, by the square of the index. So upright flat sheets without a back become thin panes,
which light passes straight; level ones are the surfaces of liquids and stay."""

import numpy as np

from . import shaders, trees

# How much of a normal may point up or down in a pane that stands, and how far normals may differ.
UPRIGHT, STRAIGHT = 0.5, 1e-3


def settle(holders, found, report):
    """Makes thin panes of the sheets of glass among the faces of all meshes."""
    for holder in holders:
        for slot, material in enumerate(holder.data.materials):
            if _is_glass(material) and _stands(holder, slot, found):
                _make_pane(holder, slot, material, report)


def _is_glass(material):
    node = shaders.principled(material)
    if node is None or shaders.constant(node.inputs["Transmission Weight"]) == 0:
        return False
    end = shaders.end(material.node_tree)
    return "volume" not in trees.SETTINGS.get(material.name, {}) and shaders.source(end.inputs["Volume"]) is None


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


def _make_pane(holder, slot, material, report):
    own = trees.copied(material)
    holder.data.materials[slot] = own
    trees.settle(own, volume=False)
    socket = shaders.principled(own).inputs["Base Color"]
    if (color := shaders.constant(socket)) is not None:
        # Blender's glass has the root of its colour at each surface.
        for link in list(socket.links):
            own.node_tree.links.remove(link)
        socket.default_value = (*(max(c, 0.0) ** 0.5 for c in color), 1.0)
    message = "single upright sheets of glass are thin panes: they don't bend light, as they do in Cycles"
    report.note(material.name, f"{message}; with a thickness (a Solidify modifier) both show them alike")
