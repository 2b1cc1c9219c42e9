"""Subsurface scattering of varying colours: a body of the brightest one, painted with what remains. Light crosses the paint on its
way in and on its way out, so that the paint is the root of the colour over that of the body."""

import bmesh
import bpy
import numpy as np

from . import shaders, trees

# Subsurface scattering of less weight is left to diffuse reflection.
LEAST_SUBSURFACE = 0.5

# What is noted of materials: that they are to be painted, and the colour of the body once they are.
WANTED, BODY = "oscura skin", "oscura body"

# Share of the picture that may be brighter than the body.
BRIGHTEST = 0.999

# Holes of a larger share of the surface are not closed.
LARGEST_HOLES = 0.2


def settle(holders, report):
    """Closes small holes of bodies, and notes which closed ones have a varying colour."""
    users = {}
    for holder in holders:
        for slot, material in enumerate(holder.data.materials):
            if _scatters(material):
                users.setdefault(material, []).append((holder, slot))
    for material, places in users.items():
        are_closed = [close(holder, slot, report) for holder, slot in places]
        if all(are_closed) and shaders.constant(shaders.principled(material).inputs["Base Color"]) is None:
            trees.settle(material, **{WANTED: True})


def _scatters(material):
    node = shaders.principled(material)
    if node is None:
        return False
    weight = shaders.constant(node.inputs["Subsurface Weight"])
    others = [shaders.constant(node.inputs[name]) for name in ("Metallic", "Transmission Weight")]
    return weight is not None and weight >= LEAST_SUBSURFACE and others == [0.0, 0.0]


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
    edges = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("edge_index", edges)
    if slot is not None:
        slots, counts = np.empty(len(mesh.polygons), np.int32), np.empty(len(mesh.polygons), np.int32)
        mesh.polygons.foreach_get("material_index", slots)
        mesh.polygons.foreach_get("loop_total", counts)
        edges = edges[np.repeat(slots == slot, counts)]
    return np.bincount(edges, minlength=1)


def is_wanted(material, name):
    """Is an input to be a picture of paint, however it is fed?"""
    return name == "Base Color" and trees.SETTINGS.get(material.name, {}).get(WANTED, False) and not is_painted(material)


def is_painted(material):
    """Has a material its paint?"""
    return trees.SETTINGS.get(material.name, {}).get(WANTED) == "painted"


def body_of(material):
    """The colour of the body of a material that was painted, None for others; said once."""
    said = trees.SETTINGS.get(material.name, {})
    said.pop(WANTED, None)
    return said.pop(BODY, None)


def paint(material, image):
    """The picture of the paint for a picture of the colour."""
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(-1, 4)
    coded = pixels[:, :3]
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    body = np.clip(np.quantile(linear[linear.max(1) > 0] if linear.any() else linear, BRIGHTEST, axis=0), 1e-3, 1.0)
    paint_of = np.sqrt(np.minimum(linear / body, 1))
    pixels[:, :3] = np.where(paint_of <= 0.0031308, 12.92 * paint_of, 1.055 * paint_of ** (1 / 2.4) - 0.055)
    made = bpy.data.images.new(f"{image.name} paint", *image.size, alpha=True)
    made.pixels.foreach_set(pixels.ravel())
    made.update()
    made.pack()
    trees.settle(material, **{WANTED: "painted", BODY: tuple(float(b) for b in body)})
    return made
