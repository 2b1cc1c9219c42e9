"""Displacement: heights are evaluated by Cycles at the vertices of a mesh, which is how Cycles displaces, and move them; what is
meant as bumps becomes a Bump node. Where it is meant as both, bumps are those of the mesh before it is displaced, and so are its
smooth normals."""

import bpy
import numpy as np

from . import glow, meshes, shaders, trees
from .context import choose, opened

HEIGHTS, OFFSETS = "oscura heights", "oscura offsets"

# Nodes whose outputs follow from where a surface lies, and those outputs.
PLACED = {
    "ShaderNodeNewGeometry": ("Position", "Normal", "True Normal", "Incoming", "Pointiness"),
    "ShaderNodeTexCoord": ("Object", "Camera", "Window", "Normal", "Reflection"),
    "ShaderNodeCameraData": ("View Vector", "View Z Depth", "View Distance"),
    "ShaderNodeAmbientOcclusion": ("Color", "AO"),
    "ShaderNodeBevel": ("Normal",),
}


def bumps(material, shader, report):
    """Takes the displacement of a material as bumps, where that is what it is set to. After that it has none."""
    node = _node(material)
    if node is not None:
        end = shaders.end(material.node_tree)
        material.node_tree.links.remove(end.inputs["Displacement"].links[0])
    if node is None or material.displacement_method == "DISPLACEMENT" or shader is None:
        return
    if node.bl_idname != "ShaderNodeDisplacement":
        if material.displacement_method == "BUMP":
            report.warn(material.name, f"bumps by {node.bl_label} are not carried over")
        return
    tree = material.node_tree
    bump = tree.nodes.new("ShaderNodeBump")
    for name, target in (("Height", "Height"), ("Scale", "Distance")):
        _join(tree, node.inputs[name], bump.inputs[target])
    bump.inputs["Strength"].default_value = 1.0
    before = shaders.source(shader.inputs["Normal"])
    if before is not None:
        tree.links.new(before, bump.inputs["Normal"])
    tree.links.new(bump.outputs[0], shader.inputs["Normal"])


def displace(holders, found, report):
    """Moves the vertices of all meshes with materials that displace them, or notes for `finish` by how much."""
    wanted = [holder for holder in holders if is_displaced(holder)]
    if not wanted:
        return
    kitchen = glow.new_scene()
    try:
        with opened(kitchen):
            for holder in wanted:
                _displace(holder, found.placements[holder.name][0][1], kitchen, report)
    finally:
        bpy.data.scenes.remove(kitchen)


def finish(holders):
    """Moves the vertices of those meshes that had to be baked before."""
    for holder in holders:
        if OFFSETS in holder.data.attributes:
            _move(holder.data)


def is_displaced(holder):
    """Has it a material that moves its vertices?"""
    return any(_displaces(material) for material in holder.data.materials)


def _node(material):
    end = shaders.end(material.node_tree) if material.node_tree is not None else None
    source = shaders.source(end.inputs["Displacement"]) if end is not None else None
    return source.node if source is not None and not source.node.mute else None


def _displaces(material):
    return material.displacement_method != "BUMP" and _node(material) is not None


def _displace(holder, matrix, kitchen, report):
    mesh = holder.data
    layer = mesh.color_attributes.new(HEIGHTS, "FLOAT_COLOR", "POINT")
    active = mesh.color_attributes.active_color_index
    mesh.color_attributes.active_color = layer
    holder.matrix_world = matrix
    kitchen.collection.objects.link(holder)
    undo = [_shine(material, matrix, report) for material in dict.fromkeys(mesh.materials)]
    try:
        choose(holder, kitchen)
        bpy.ops.object.bake(type="EMIT", target="VERTEX_COLORS")
        moved = np.empty(len(mesh.vertices) * 4, np.float32)
        mesh.color_attributes[HEIGHTS].data.foreach_get("color", moved)
    finally:
        for restore in undo:
            restore()
        kitchen.collection.objects.unlink(holder)
        holder.matrix_world.identity()
        mesh.color_attributes.remove(mesh.color_attributes[HEIGHTS])
        mesh.color_attributes.active_color_index = min(active, len(mesh.color_attributes) - 1)
    _note(mesh, np.nan_to_num(moved.reshape(-1, 4)[:, :3]))
    if not any(map(_is_both, mesh.materials)) or any(map(_asks_for_places, mesh.materials)):
        _move(mesh)


def _is_both(material):
    return material.displacement_method == "BOTH" and _node(material) is not None


def _asks_for_places(material):
    """Does the surface depend on where it lies, beside its heights?"""
    end = shaders.end(material.node_tree) if material.node_tree is not None else None
    nodes = trees.upstream(end.inputs["Surface"]) if end is not None else ()
    groups = [node.node_tree for node in nodes if getattr(node, "node_tree", None)]
    inner = [node for tree in groups for _, node in trees.nodes_with_trees(tree, PLACED)]
    return any(out.is_linked and out.name in PLACED.get(node.bl_idname, ()) for node in [*nodes, *inner] for out in node.outputs)


def _note(mesh, heights):
    """Keeps by how much vertices are to be moved: by numbers along their normals in the first channel less those in the second."""
    normals = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertex_normals.foreach_get("vector", normals)
    offsets = (heights[:, 0] - heights[:, 1])[:, None] * normals.reshape(-1, 3)
    mesh.attributes.new(OFFSETS, "FLOAT_VECTOR", "POINT").data.foreach_set("vector", offsets.ravel())


def _move(mesh):
    """Moves vertices, and lets normals follow, but smooth ones of what has bumps beside."""
    offsets, kept = np.empty(3 * len(mesh.vertices), np.float32), _kept_normals(mesh)
    mesh.attributes[OFFSETS].data.foreach_get("vector", offsets)
    mesh.attributes.remove(mesh.attributes[OFFSETS])
    mesh.vertices.foreach_set("co", meshes.positions(mesh.vertices).ravel() + offsets)
    if mesh.has_custom_normals:
        mesh.attributes.remove(mesh.attributes["custom_normal"])
    mesh.update()
    if kept.any():
        mesh.normals_split_custom_set(kept.tolist())


def _kept_normals(mesh):
    """The normals of corners that stay as they are; 0 for others."""
    count = len(mesh.polygons)
    slots, corners, flat = np.empty(count, np.int32), np.empty(count, np.int32), np.zeros(count, bool)
    mesh.polygons.foreach_get("material_index", slots)
    mesh.polygons.foreach_get("loop_total", corners)
    if "sharp_face" in mesh.attributes:
        mesh.attributes["sharp_face"].data.foreach_get("value", flat)
    stays = np.array([material.displacement_method == "BOTH" for material in mesh.materials])
    normals = np.empty(3 * len(mesh.loops), np.float32)
    mesh.corner_normals.foreach_get("vector", normals)
    return normals.reshape(-1, 3) * np.repeat(stays[np.minimum(slots, len(stays) - 1)] & ~flat, corners)[:, None]


def _shine(material, matrix, report):
    """Lets a material shine with its heights above and below; gives what undoes it."""
    tree, node = material.node_tree, _node(material)
    end = shaders.end(tree)
    before = shaders.source(end.inputs["Surface"])
    glow = tree.nodes.new("ShaderNodeEmission")
    glow.inputs["Color"].default_value = (0, 0, 0, 1)
    made = [glow]
    if node is not None and material.displacement_method != "BUMP":
        if node.bl_idname == "ShaderNodeDisplacement":
            made += _heights(tree, node, glow, matrix)
        else:
            report.warn(material.name, f"displacement by {node.bl_label} is not carried over")
    tree.links.new(glow.outputs[0], end.inputs["Surface"])

    def restore():
        for other in made:
            tree.nodes.remove(other)
        if before is not None:
            tree.links.new(before, end.inputs["Surface"])

    return restore


def _heights(tree, node, glow, matrix):
    """Feeds (Height - Midlevel) * Scale as its positive and its negative part: light has no sign."""
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
