"""Searching and editing node trees."""

from . import report


def find_nodes(tree, types, _parents=()):
    """All nodes of some types (`bl_idname`) in a tree and its groups, each with its tree."""
    if tree in _parents:
        return
    for node in tree.nodes:
        if node.bl_idname in types:
            yield tree, node
        elif getattr(node, "node_tree", None):
            yield from find_nodes(node.node_tree, types, (*_parents, tree))


def is_linked(node):
    return any(out.is_linked for out in node.outputs)


def has_linked(tree, types):
    """Is there a node of some types with a linked output?"""
    return any(is_linked(node) for _, node in find_nodes(tree, types))


def tree_of(owner):
    """The node tree of a material, light or world; None without nodes."""
    return owner.node_tree if owner.use_nodes else None


def copy_groups(tree):
    """Makes the groups of a tree single-user, so that changes don't affect other trees."""
    for node in tree.nodes:
        if getattr(node, "node_tree", None):
            node.node_tree = node.node_tree.copy()
            copy_groups(node.node_tree)


def copy_material(material):
    """A copy of a material and its groups, called by the original's name in messages."""
    copy = material.copy()
    report.ALIASES[copy.name] = report.ALIASES.get(material.name, material.name)
    copy_groups(copy.node_tree)
    return copy


def replace_output(tree, output, value):
    """Replaces an output by a constant (a number, or three or four) in all its links."""
    targets = [link.to_socket for link in output.links]
    constant = _constant(tree, value, output.type == "RGBA") if targets else None
    for target in targets:
        tree.links.new(constant, target)


def link_attribute(tree, targets, name, output):
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = "GEOMETRY", name
    for target in targets:
        tree.links.new(node.outputs[output], target)


def link_operation(tree, node_type, operation, *values):
    """The output of a new Math or Vector Math node. Values are constants, outputs, or inputs whose value is used."""
    node = tree.nodes.new(node_type)
    node.operation = operation
    for target, value in zip(node.inputs, values):
        if isinstance(value, (float, tuple)):
            target.default_value = value
        elif value.is_output:
            tree.links.new(value, target)
        else:
            link_input(tree, value, target)
    return node.outputs[0]


def link_input(tree, socket, target):
    """Gives an input the link or the value of another one."""
    if socket.is_linked and not socket.links[0].is_muted:
        tree.links.new(socket.links[0].from_socket, target)
        return
    value = socket.default_value
    target.default_value = (value,) * 3 + (1,) if isinstance(value, float) and target.type == "RGBA" else value


def _constant(tree, value, is_color):
    """The output of a new node with a value."""
    if isinstance(value, (int, float)):
        node = tree.nodes.new("ShaderNodeValue")
        node.outputs[0].default_value = value
    elif is_color:
        node = tree.nodes.new("ShaderNodeRGB")
        node.outputs[0].default_value = (*value[:3], 1.0)
    else:
        node = tree.nodes.new("ShaderNodeCombineXYZ")
        for target, part in zip(node.inputs, value):
            target.default_value = part
    return node.outputs[0]
