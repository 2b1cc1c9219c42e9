"""Displacement: heights, or vectors where it isn't along the mesh's normals, are evaluated by Cycles at the vertices of a mesh, which is
how Cycles displaces, and move them. Where it is meant as both, normals stay those of the mesh before it is displaced, of flat faces those
of their vertices, and bumps are a node of the surface's graph."""

import bpy
import numpy as np

from . import glow, meshes, shaders, undeformed
from .context import choose, opened

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
    wanted = [holder for holder in holders if is_displaced(holder)]
    if not wanted:
        return
    bake_scene = glow.new_scene()
    try:
        with opened(bake_scene):
            for holder in wanted:
                _displace(holder, found.placements[holder.name][0][1], bake_scene, report)
    finally:
        bpy.data.scenes.remove(bake_scene)


def is_displaced(holder):
    """Has it a material that moves its vertices?"""
    return any(material is not None and _displaces(material) for material in holder.data.materials)


def _node(material):
    end = shaders.end(material.node_tree) if material.node_tree is not None else None
    source = shaders.source(end.inputs["Displacement"]) if end is not None else None
    return source.node if source is not None and not source.node.mute else None


def _displaces(material):
    return material.displacement_method != "BUMP" and _node(material) is not None


def _displace(holder, matrix, bake_scene, report):
    mesh = holder.data
    bake = lambda feed: _baked(holder, matrix, bake_scene, feed)
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


def _baked(holder, matrix, bake_scene, feed):
    """Three numbers for each vertex: the light of its materials after `feed` linked nodes to an emission."""
    mesh = holder.data
    layer = mesh.color_attributes.new(HEIGHTS, "FLOAT_COLOR", "POINT")
    active = mesh.color_attributes.active_color_index
    mesh.color_attributes.active_color = layer
    holder.matrix_world = matrix
    bake_scene.collection.objects.link(holder)
    undo = [_shine(material, matrix, feed) for material in dict.fromkeys(mesh.materials) if material is not None]
    try:
        choose(holder, bake_scene)
        bpy.ops.object.bake(type="EMIT", target="VERTEX_COLORS")
        found = np.empty(len(mesh.vertices) * 4, np.float32)
        mesh.color_attributes[HEIGHTS].data.foreach_get("color", found)
    finally:
        for restore in undo:
            restore()
        bake_scene.collection.objects.unlink(holder)
        holder.matrix_world.identity()
        mesh.color_attributes.remove(mesh.color_attributes[HEIGHTS])
        mesh.color_attributes.active_color_index = min(active, len(mesh.color_attributes) - 1)
    return np.nan_to_num(found.reshape(-1, 4)[:, :3])


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


def _shine(material, matrix, feed):
    """Lets a material shine with what displaces it; gives what undoes it."""
    tree = material.node_tree
    end = shaders.end(tree)
    before = shaders.source(end.inputs["Surface"])
    glow = tree.nodes.new("ShaderNodeEmission")
    glow.inputs["Color"].default_value = (0, 0, 0, 1)
    made = [glow]
    if _displaces(material):
        made += feed(material, glow, matrix)
    tree.links.new(glow.outputs[0], end.inputs["Surface"])

    def restore():
        for other in made:
            tree.nodes.remove(other)
        if before is not None:
            tree.links.new(before, end.inputs["Surface"])

    return restore


def _is_along_normals(material):
    """Does it move vertices along the normals of the mesh?"""
    node = _node(material)
    return node.bl_idname == "ShaderNodeDisplacement" and shaders.source(node.inputs["Normal"]) is None


def _heights(material, glow, matrix):
    """Feeds (Height - Midlevel) * Scale as its positive and its negative part: light has no sign."""
    tree, node = material.node_tree, _node(material)
    if not _is_along_normals(material):
        return []
    size = abs(matrix.to_3x3().determinant()) ** (1 / 3) if node.space == "WORLD" else 1.0
    math = lambda operation: _math(tree, operation)
    above, scaled, local, below = math("SUBTRACT"), math("MULTIPLY"), math("DIVIDE"), math("MULTIPLY")
    _join(tree, node.inputs["Height"], above.inputs[0])
    _join(tree, node.inputs["Midlevel"], above.inputs[1])
    tree.links.new(above.outputs[0], scaled.inputs[0])
    _join(tree, node.inputs["Scale"], scaled.inputs[1])
    tree.links.new(scaled.outputs[0], local.inputs[0])
    local.inputs[1].default_value = max(size, 1e-9)
    tree.links.new(local.outputs[0], below.inputs[0])
    below.inputs[1].default_value = -1.0
    parts = [math("MAXIMUM"), math("MAXIMUM")]
    both = tree.nodes.new("ShaderNodeCombineXYZ")
    for k, (part, source) in enumerate(zip(parts, (local, below))):
        tree.links.new(source.outputs[0], part.inputs[0])
        part.inputs[1].default_value = 0.0
        tree.links.new(part.outputs[0], both.inputs[k])
    tree.links.new(both.outputs[0], glow.inputs["Color"])
    return [above, scaled, local, below, *parts, both]


def _vectors(sign):
    """Feeds the positive or the negative part of the vector in world space that displaces."""

    def feed(material, glow, _):
        tree = material.node_tree
        if _is_along_normals(material):
            return []
        scaled, part = tree.nodes.new("ShaderNodeVectorMath"), tree.nodes.new("ShaderNodeVectorMath")
        scaled.operation, part.operation = "MULTIPLY", "MAXIMUM"
        tree.links.new(shaders.source(shaders.end(tree).inputs["Displacement"]), scaled.inputs[0])
        scaled.inputs[1].default_value = (sign, sign, sign)
        tree.links.new(scaled.outputs[0], part.inputs[0])
        part.inputs[1].default_value = (0.0, 0.0, 0.0)
        tree.links.new(part.outputs[0], glow.inputs["Color"])
        return [scaled, part]

    return feed


def _math(tree, operation):
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    return node


def _join(tree, socket, target):
    source = shaders.source(socket)
    if source is not None:
        tree.links.new(source, target)
    else:
        target.default_value = socket.default_value
