"""Walks through node trees, and constants in the place of what nodes give."""

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


def replace(tree, socket, value):
    """Puts a number, or three or four, in the place of an output."""
    targets = [link.to_socket for link in socket.links]
    made = _constant(tree, value, socket.type == "RGBA") if targets else None
    for target in targets:
        tree.links.new(made, target)


def feed_attribute(tree, targets, name, output):
    """Feeds inputs by an attribute of the mesh."""
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = "GEOMETRY", name
    for target in targets:
        tree.links.new(node.outputs[output], target)


def _constant(tree, value, is_color):
    """The output of a new node with a value."""
    is_number = isinstance(value, (int, float))
    node = tree.nodes.new(f"ShaderNode{'Value' if is_number else 'RGB' if is_color else 'CombineXYZ'}")
    if is_number or is_color:
        node.outputs[0].default_value = value if is_number else (*value[:3], 1.0)
    for target, part in zip(node.inputs, () if is_number else value):
        target.default_value = part
    return node.outputs[0]
