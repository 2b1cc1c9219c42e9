"""Base colours that are a colour attribute of the mesh: glTF has them as colours of vertices, no picture is needed."""

from . import shaders, trees

# Which nodes stand for what the exporter writes.
MARK = "oscura vertex colours"


def settle(holders):
    """Marks the nodes whose colours reach the model with the vertices. A mesh has one layer of colours, which all its materials
    are multiplied with: on all meshes of a material all others have to have the same."""
    layers = {}
    for holder in holders:
        for material in holder.data.materials:
            layers.setdefault(material, set()).add(_layer(holder.data, material))
    pending = True
    while pending:
        pending = False
        for materials in (set(holder.data.materials) for holder in holders):
            if len(set().union(*map(layers.get, materials))) > 1:
                pending |= any(None not in layers[material] for material in materials)
                for material in materials:
                    layers[material].add(None)
    for material, of_material in layers.items():
        if None not in of_material:
            _color_of(material).node[MARK] = True


def is_carried(source):
    """Is this the output of a node whose colours reach the model?"""
    return source.name == "Color" and MARK in source.node


def _color_of(material):
    """The output that is the base colour of a material whose base colours are glTF's; None for others."""
    node = shaders.principled(material)
    if node is None or "translucency" in trees.SETTINGS.get(material.name, {}):
        return None
    if shaders.constant(node.inputs["Subsurface Weight"]) != 0:
        return None
    source = shaders.source(node.inputs["Base Color"])
    is_plain = source is not None and source.name == "Color" and not source.node.mute
    return source if is_plain and source.node.id_data == material.node_tree else None


def _layer(mesh, material):
    """The name of a mesh's attribute that is a material's base colour; None where there is none."""
    source, name = _color_of(material), None
    if source is None:
        return None
    if source.node.bl_idname == "ShaderNodeVertexColor":
        name = source.node.layer_name
    elif source.node.bl_idname == "ShaderNodeAttribute" and source.node.attribute_type == "GEOMETRY":
        name = source.node.attribute_name or None
    colors = mesh.color_attributes
    if name == "" and colors.render_color_index >= 0:
        name = colors[colors.render_color_index].name
    return name if name and name in colors else None
