"""Walks through node trees, and constants in the place of what nodes give."""

import bpy

from . import report


def nodes_with_trees(tree, kinds, _inside=()):
    """All nodes of these kinds in a tree and its groups, each with its tree."""
    if tree in _inside:
        return
    for node in tree.nodes:
        if node.bl_idname in kinds:
            yield tree, node
        elif getattr(node, "node_tree", None):
            yield from nodes_with_trees(node.node_tree, kinds, (*_inside, tree))


def has(tree, kinds):
    """Is there a node of these kinds that feeds something?"""
    return any(any(out.is_linked for out in node.outputs) for _, node in nodes_with_trees(tree, kinds))


def own_groups(tree):
    """Gives a tree groups of its own, that changes reach no other material."""
    for node in tree.nodes:
        if getattr(node, "node_tree", None):
            node.node_tree = node.node_tree.copy()
            own_groups(node.node_tree)


def copied(material):
    """A material like another, with groups of its own; messages call it by the other's name."""
    own = material.copy()
    report.ALIASES[own.name] = report.ALIASES.get(material.name, material.name)
    own_groups(own.node_tree)
    return own


def own(holder, material):
    """A mesh's material that no other mesh has: in the place of one that others have, a copy."""
    if material.users < 2:
        return material
    made, slots = copied(material), holder.data.materials
    for i, other in enumerate(slots):
        if other == material:
            slots[i] = made
    return made


def replace(tree, socket, value):
    """Puts a number, or three or four, in the place of an output; gives the new one."""
    targets = [link.to_socket for link in socket.links]
    if not targets:
        return None
    made = constant_node(tree, value, socket.type == "RGBA")
    for target in targets:
        tree.links.new(made, target)
    return made


def feed_attribute(tree, targets, name, output):
    """Feeds inputs by an attribute of the mesh."""
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = "GEOMETRY", name
    for target in targets:
        tree.links.new(node.outputs[output], target)


def constant_node(tree, value, is_color=False):
    """The output of a new node with a value."""
    if isinstance(value, (int, float)):
        node = tree.nodes.new("ShaderNodeValue")
        node.outputs[0].default_value = value
        return node.outputs[0]
    values = tuple(value)
    if is_color:
        node = tree.nodes.new("ShaderNodeRGB")
        node.outputs[0].default_value = (*values[:3], 1.0)
        return node.outputs[0]
    node = tree.nodes.new("ShaderNodeCombineXYZ")
    for target, part in zip(node.inputs, values):
        target.default_value = part
    return node.outputs[0]


def of_materials(holders):
    """The materials of these objects, each once."""
    return list({m.name: m for holder in holders for m in holder.data.materials if isinstance(m, bpy.types.Material)}.values())
