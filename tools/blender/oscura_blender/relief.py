"""Displacement: heights, or vectors where it isn't along the mesh's normals, are evaluated by Cycles at the vertices of a mesh, which is
how Cycles displaces, and move them. Where it is meant as both, normals stay those of the mesh before it is displaced, of flat faces those
of their vertices, and bumps are a node of the surface's graph."""

import bpy
import numpy as np

from . import glow, meshes, shaders, trees, undeformed

HEIGHTS = "oscura heights"


def bumps(material):
    """The Displacement node of a material whose displacement is meant as bumps, alone or beside; None for others."""
    node = _node(material)
    is_bump = node is not None and material.displacement_method != "DISPLACEMENT" and node.bl_idname == "ShaderNodeDisplacement"
    return node if is_bump else None


def object_scale(material, node):
    """Exponent of the object's scale in the heights of bumps: one for object space, and one where Cycles takes the slopes there."""
    return float(node.space == "OBJECT") + float(material.displacement_method == "BOTH")


def displace(holders, found, report):
    """Moves the vertices of all meshes with materials that displace them."""
    for holder in holders:
        if is_displaced(holder):
            _displace(holder, found.placements[holder.name][0].matrix, report)


def is_displaced(holder):
    """Has it a material that moves its vertices?"""
    return any(material is not None and _displaces(material) for material in holder.data.materials)


def _node(material):
    end = shaders.end(material.node_tree) if material.node_tree is not None else None
    source = shaders.source(end.inputs["Displacement"]) if end is not None else None
    return source.node if source is not None and not source.node.mute else None


def _displaces(material):
    return material.displacement_method != "BUMP" and _node(material) is not None


def _displace(holder, matrix, report):
    mesh = holder.data
    bake = lambda feed: _baked(holder, matrix, feed)
    offsets = np.zeros((len(mesh.vertices), 3), np.float32)
    along_normals = {_is_along_normals(material) for material in mesh.materials if material is not None and _displaces(material)}
    if True in along_normals:
        heights = bake(_heights)
        offsets += (heights[:, 0] - heights[:, 1])[:, None] * meshes.vertex_normals(mesh)
    if False in along_normals:
        if matrix.determinant() == 0.0:
            report.warn(holder.name, "has no extent in some direction: its displacement by vectors is left out")
        else:
            to_object = np.array(matrix.to_3x3().inverted())
            offsets += (bake(_vectors(1.0)) - bake(_vectors(-1.0))) @ to_object.T
    _move(mesh, offsets)


def _baked(holder, matrix, feed):
    """Three numbers for each vertex: the light of its materials after `feed` linked nodes to an emission."""
    mesh = holder.data
    layer = mesh.color_attributes.new(HEIGHTS, "FLOAT_COLOR", "POINT")
    active = mesh.color_attributes.active_color_index
    mesh.color_attributes.active_color = layer
    holder.matrix_world = matrix
    shown = list(mesh.materials)
    shining = {material: _shining(material, matrix, feed) for material in shown if material is not None}
    for slot, material in enumerate(shown):
        mesh.materials[slot] = shining.get(material)
    try:
        with glow.stage(holder):
            bpy.ops.object.bake(type="EMIT", target="VERTEX_COLORS")
        found = np.empty(len(mesh.vertices) * 4, np.float32)
        mesh.color_attributes[HEIGHTS].data.foreach_get("color", found)
    finally:
        for slot, material in enumerate(shown):
            mesh.materials[slot] = material
        for material in shining.values():
            bpy.data.materials.remove(material)
        holder.matrix_world.identity()
        mesh.color_attributes.remove(mesh.color_attributes[HEIGHTS])
        mesh.color_attributes.active_color_index = min(active, len(mesh.color_attributes) - 1)
    return np.nan_to_num(found.reshape(-1, 4)[:, :3])


def _shining(material, matrix, feed):
    """A copy of a material that shines with what displaces it."""
    own = trees.copied(material)
    light = glow.light(own.node_tree, shaders.end(own.node_tree))
    if _displaces(own):
        feed(own, light, matrix)
    return own


def _move(mesh, offsets):
    """Moves vertices. Normals follow, but those of what has bumps beside; generated coordinates stay."""
    kept, places = _kept_normals(mesh), meshes.positions(mesh)
    undeformed.keep(mesh, places)
    mesh.vertices.foreach_set("co", (places + offsets).astype(np.float32).ravel())
    if mesh.has_custom_normals:
        mesh.attributes.remove(mesh.attributes["custom_normal"])
    mesh.update()
    if kept.any():
        mesh.normals_split_custom_set(kept)


def _kept_normals(mesh):
    """The normals of corners that stay as they are; 0 for others."""
    stays = np.array([material is not None and material.displacement_method == "BOTH" for material in mesh.materials])
    # Cycles takes them at vertices, as if all faces were smooth, where all are flat.
    is_flat = mesh.normals_domain == "FACE"
    normals = meshes.vertex_normals(mesh)[meshes.corner_vertices(mesh)] if is_flat else meshes.corner_normals(mesh)
    return normals * np.repeat(stays[meshes.material_slots(mesh)], meshes.face_sizes(mesh))[:, None]


def _is_along_normals(material):
    """Does it move vertices along the normals of the mesh?"""
    node = _node(material)
    return node.bl_idname == "ShaderNodeDisplacement" and shaders.source(node.inputs["Normal"]) is None


def _heights(material, light, matrix):
    """Feeds (Height - Midlevel) * Scale as its positive and its negative part: light has no sign."""
    tree, node = material.node_tree, _node(material)
    if not _is_along_normals(material):
        return
    size = abs(matrix.to_3x3().determinant()) ** (1 / 3) if node.space == "WORLD" else 1.0
    above = _math(tree, "SUBTRACT", node.inputs["Height"], node.inputs["Midlevel"])
    local = _math(tree, "DIVIDE", _math(tree, "MULTIPLY", above, node.inputs["Scale"]), max(size, 1e-9))
    both = tree.nodes.new("ShaderNodeCombineXYZ")
    for part, sign in zip(both.inputs, (1.0, -1.0)):
        tree.links.new(_math(tree, "MAXIMUM", _math(tree, "MULTIPLY", local, sign), 0.0), part)
    tree.links.new(both.outputs[0], light.inputs["Color"])


def _vectors(sign):
    """Feeds the positive or the negative part of the vector in world space that displaces."""

    def feed(material, light, _):
        tree = material.node_tree
        if _is_along_normals(material):
            return
        scaled, part = tree.nodes.new("ShaderNodeVectorMath"), tree.nodes.new("ShaderNodeVectorMath")
        scaled.operation, part.operation = "MULTIPLY", "MAXIMUM"
        tree.links.new(shaders.source(shaders.end(tree).inputs["Displacement"]), scaled.inputs[0])
        scaled.inputs[1].default_value = (sign, sign, sign)
        tree.links.new(scaled.outputs[0], part.inputs[0])
        part.inputs[1].default_value = (0.0, 0.0, 0.0)
        tree.links.new(part.outputs[0], light.inputs["Color"])

    return feed


def _math(tree, operation, *given):
    """The output of a node of inputs of others, outputs and numbers."""
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    for target, value in zip(node.inputs, given):
        if isinstance(value, float):
            target.default_value = value
        elif value.is_output:
            tree.links.new(value, target)
        else:
            shaders.feed(tree, value, target)
    return node.outputs[0]
