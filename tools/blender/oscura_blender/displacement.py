"""Displacement: Cycles bakes heights (or vectors, where they aren't along normals) at the vertices of meshes, where it displaces as well. With the
method Displacement and Bump, normals stay those of the undisplaced mesh, and the surface has bump mapping."""

import bpy
import numpy as np

from . import cycles, generated_coordinates, meshes, node_trees
from .node_links import linked, output_node

LAYER = "oscura heights"

DISPLACEMENT = "ShaderNodeDisplacement"


def bump_node(material):
    """The Displacement node of a material with bump mapping by displacement; None for others."""
    node = _node(material)
    is_bump = node is not None and material.displacement_method != "DISPLACEMENT" and node.bl_idname == DISPLACEMENT
    return node if is_bump else None


def scale_exponent(material, node):
    """The exponent of the object's scale in bump heights: one for object space, and one where Cycles computes slopes in that space."""
    return float(node.space == "OBJECT") + float(material.displacement_method == "BOTH")


def displace(entry, report):
    """Moves the vertices of a mesh with materials that displace."""
    mesh, matrix = entry.object.data, entry.placements[0].matrix
    displacing = [material for material in mesh.materials if material is not None and _displaces(material)]
    if not displacing:
        return
    offsets = np.zeros((len(mesh.vertices), 3), np.float32)
    if any(map(_is_along_normals, displacing)):
        heights = _bake(entry.object, matrix, _link_heights)
        offsets += (heights[:, 0] - heights[:, 1])[:, None] * meshes.vertex_normals(mesh)
    if not all(map(_is_along_normals, displacing)):
        if matrix.determinant() == 0.0:
            report.warn(entry.object.name, "vector displacement is left out, since the object's scale is 0")
        else:
            to_object = np.array(matrix.to_3x3().inverted())
            positive, negative = (_bake(entry.object, matrix, _vector_linker(sign)) for sign in (1.0, -1.0))
            offsets += (positive - negative) @ to_object.T
    _move(mesh, offsets)


def _node(material):
    end = output_node(material.node_tree)
    source = linked(end.inputs["Displacement"]) if end is not None else None
    return source.node if source is not None and not source.node.mute else None


def _displaces(material):
    return material.displacement_method != "BUMP" and _node(material) is not None


def _is_along_normals(material):
    node = _node(material)
    return node.bl_idname == DISPLACEMENT and linked(node.inputs["Normal"]) is None


def _bake(obj, matrix, link):
    """Three numbers for each vertex: the emission of the materials' copies in which `link` has linked the color."""
    mesh = obj.data
    layer = mesh.color_attributes.new(LAYER, "FLOAT_COLOR", "POINT")
    active = mesh.color_attributes.active_color_index
    mesh.color_attributes.active_color = layer
    obj.matrix_world = matrix
    originals = list(mesh.materials)
    copies = {material: _emitting(material, matrix, link) for material in originals if material is not None}
    for slot, material in enumerate(originals):
        mesh.materials[slot] = copies.get(material)
    try:
        with cycles.baking_scene(obj):
            bpy.ops.object.bake(type="EMIT", target="VERTEX_COLORS")
        colors = meshes.attribute_values(mesh.color_attributes[LAYER])
    finally:
        for slot, material in enumerate(originals):
            mesh.materials[slot] = material
        for material in copies.values():
            bpy.data.materials.remove(material)
        obj.matrix_world.identity()
        mesh.color_attributes.remove(mesh.color_attributes[LAYER])
        mesh.color_attributes.active_color_index = min(active, len(mesh.color_attributes) - 1)
    return np.nan_to_num(colors[:, :3])


def _emitting(material, matrix, link):
    """A copy of a material that emits its displacement."""
    copy = node_trees.copy_material(material)
    emission = cycles.add_emission(copy.node_tree, output_node(copy.node_tree))
    if _displaces(copy):
        link(copy, emission.inputs["Color"], matrix)
    return copy


def _link_heights(material, color, matrix):
    """(Height - Midlevel) * Scale as its positive and its negative part, since emission has no sign."""
    tree, node = material.node_tree, _node(material)
    if not _is_along_normals(material):
        return
    size = abs(matrix.to_3x3().determinant()) ** (1 / 3) if node.space == "WORLD" else 1.0
    math = lambda *operation: node_trees.link_operation(tree, "ShaderNodeMath", *operation)
    scaled = math("MULTIPLY", math("SUBTRACT", node.inputs["Height"], node.inputs["Midlevel"]), node.inputs["Scale"])
    height = math("DIVIDE", scaled, max(size, 1e-9))
    parts = tree.nodes.new("ShaderNodeCombineXYZ")
    for part, sign in zip(parts.inputs, (1.0, -1.0)):
        tree.links.new(math("MAXIMUM", math("MULTIPLY", height, sign), 0.0), part)
    tree.links.new(parts.outputs[0], color)


def _vector_linker(sign):
    """Links the positive or the negative part of displacement vectors, in world space."""

    def link(material, color, _matrix):
        if _is_along_normals(material):
            return
        tree = material.node_tree
        math = lambda *operation: node_trees.link_operation(tree, "ShaderNodeVectorMath", *operation)
        vector = linked(output_node(tree).inputs["Displacement"])
        tree.links.new(math("MAXIMUM", math("MULTIPLY", vector, (sign,) * 3), (0.0,) * 3), color)

    return link


def _move(mesh, offsets):
    """Moves vertices. Generated coordinates stay; normals follow, but for the method Displacement and Bump."""
    kept, positions = _kept_normals(mesh), meshes.positions(mesh)
    generated_coordinates.keep(mesh, positions)
    mesh.vertices.foreach_set("co", (positions + offsets).astype(np.float32).ravel())
    if mesh.has_custom_normals:
        mesh.attributes.remove(mesh.attributes["custom_normal"])
    mesh.update()
    if kept.any():
        mesh.normals_split_custom_set(kept)


def _kept_normals(mesh):
    """The normals of corners that stay as they are; 0 for others."""
    stays = np.array([material is not None and material.displacement_method == "BOTH" for material in mesh.materials])
    # Where all faces are flat Cycles takes the normals of vertices.
    is_flat = mesh.normals_domain == "FACE"
    normals = meshes.vertex_normals(mesh)[meshes.corner_vertices(mesh)] if is_flat else meshes.corner_normals(mesh)
    return normals * np.repeat(stays[meshes.material_indices(mesh)], meshes.face_sizes(mesh))[:, None]
