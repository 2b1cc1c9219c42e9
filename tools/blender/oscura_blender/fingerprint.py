"""Hashes of meshes and node trees for the cache."""

import os

import bpy

from . import cycles, image_files, meshes

# Properties of nodes that don't affect what they compute, or that are hashed otherwise.
SKIPPED = {
    "rna_type", "name", "label", "location", "location_absolute", "width", "width_hidden", "height", "dimensions", "select",
    "hide", "color", "use_custom_color", "show_options", "show_preview", "show_texture", "color_tag", "parent", "inputs",
    "outputs", "internal_links", "warning_propagation", "node_tree", "image_user", "texture_mapping", "color_mapping",
    "bl_icon", "bl_width_default", "bl_width_min", "bl_width_max", "bl_height_default", "bl_height_min", "bl_height_max",
}  # fmt: skip


def add_mesh(digest, mesh):
    """Adds a mesh with all its attributes, sorted by name, since baking adds some."""
    digest.update(meshes.face_sizes(mesh).tobytes() + b"normals")
    digest.update(meshes.corner_normals(mesh).tobytes())
    for attribute in sorted(mesh.attributes, key=lambda attribute: attribute.name):
        digest.update(f"|{attribute.name}|{attribute.domain}|{attribute.data_type}|".encode())
        values = meshes.attribute_values(attribute)
        digest.update(repr([str(item.value) for item in attribute.data]).encode() if values is None else values.tobytes())
    layers = [(layer.name, layer.active_render, layer.active) for layer in mesh.uv_layers]
    colors = mesh.color_attributes
    digest.update(repr((layers, colors.render_color_index, colors.active_color_index)).encode())


def add_tree(digest, tree, _parents=()):
    """Adds a node tree with its groups, images and objects."""
    if tree in _parents:
        return
    for node in tree.nodes:
        digest.update(f"|{node.name}|{node.bl_idname}|".encode())
        _add_properties(digest, node)
        # Nodes that hold a value have it as the default of their output.
        sockets = [s for s in (*node.inputs, *node.outputs) if hasattr(s, "default_value") and (s.is_output or not s.is_linked)]
        digest.update(repr([(s.identifier, _plain(s.default_value)) for s in sockets]).encode())
        if getattr(node, "node_tree", None):
            add_tree(digest, node.node_tree, (*_parents, tree))
        if hasattr(node, "image_user"):
            user = node.image_user
            frame = bpy.context.scene.frame_current if node.image and node.image.source in ("SEQUENCE", "MOVIE") else 0
            digest.update(repr((user.frame_offset, user.frame_start, user.use_cyclic, frame)).encode())
    for link in tree.links:
        ends = (link.from_node.name, link.from_socket.identifier, link.to_node.name, link.to_socket.identifier)
        digest.update(repr((*ends, link.is_muted)).encode())


def _add_properties(digest, owner):
    """Adds the properties of a node, and of its color ramp or curves."""
    for prop in owner.bl_rna.properties:
        key = prop.identifier
        if key in SKIPPED:
            continue
        value = getattr(owner, key)
        digest.update(f"{key}=".encode())
        if prop.type == "COLLECTION":
            for item in value:
                _add_properties(digest, item)
        elif prop.type != "POINTER" or value is None:
            digest.update(repr(_plain(value)).encode())
        elif isinstance(value, bpy.types.Image):
            _add_image(digest, value)
        elif isinstance(value, bpy.types.Object):
            digest.update(repr([tuple(row) for row in value.matrix_world]).encode())
        elif isinstance(value, bpy.types.ID):
            digest.update(value.name_full.encode())
        else:
            _add_properties(digest, value)


def _plain(value):
    if isinstance(value, (str, int, float, bool, set, type(None))):
        return value
    try:
        return [_plain(part) for part in value]
    except TypeError:
        return str(value)


def _add_image(digest, image):
    digest.update(repr((image.source, image.colorspace_settings.name, image.alpha_mode)).encode())
    if image.is_dirty or image.source == "GENERATED":
        digest.update(repr(tuple(image.size)).encode() + cycles.pixels_of(image).tobytes())
        return
    if image.packed_file:
        digest.update(image.packed_file.data)
        return
    path = image_files.path_of(image)
    digest.update(path.encode())
    if os.path.isfile(path):
        found = os.stat(path)
        digest.update(repr((found.st_size, found.st_mtime_ns)).encode())
