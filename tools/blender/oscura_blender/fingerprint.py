"""Hashes of meshes and of node trees, by all that results can depend on."""

import os

import bpy
import numpy as np

from . import meshes

# What nodes look like, and what the hash of a tree has in another way.
LOOKS = {
    "rna_type", "name", "label", "location", "location_absolute", "width", "width_hidden", "height", "dimensions", "select",
    "hide", "color", "use_custom_color", "show_options", "show_preview", "show_texture", "color_tag", "parent", "inputs",
    "outputs", "internal_links", "warning_propagation", "node_tree", "image_user", "texture_mapping", "color_mapping",
    "bl_icon", "bl_width_default", "bl_width_min", "bl_width_max", "bl_height_default", "bl_height_min", "bl_height_max",
}  # fmt: skip


def add_mesh(digest, mesh):
    """Adds the shape of a mesh with all its attributes."""
    digest.update(meshes.face_sizes(mesh).tobytes() + b"normals")
    digest.update(meshes.corner_normals(mesh).tobytes())
    # Their order follows from what was baked on the way.
    for attribute in sorted(mesh.attributes, key=lambda attribute: attribute.name):
        digest.update(f"|{attribute.name}|{attribute.domain}|{attribute.data_type}|".encode())
        kind = meshes.ATTRIBUTES.get(attribute.data_type)
        digest.update(meshes.read(attribute.data, *kind).tobytes() if kind else repr([str(item.value) for item in attribute.data]).encode())
    marks = [(layer.name, layer.active_render, layer.active) for layer in mesh.uv_layers]
    colors = mesh.color_attributes
    digest.update(repr((marks, colors.render_color_index, colors.active_color_index)).encode())


def add_tree(digest, tree, _inside=()):
    """Adds a node tree with the groups, pictures and objects that it uses."""
    if tree in _inside:
        return
    for node in tree.nodes:
        digest.update(f"|{node.name}|{node.bl_idname}|".encode())
        add_properties(digest, node)
        for socket in node.inputs:
            if not socket.is_linked and hasattr(socket, "default_value"):
                digest.update(repr((socket.identifier, _plain(socket.default_value))).encode())
        for socket in node.outputs:
            # Nodes of a colour or a number have it there.
            if hasattr(socket, "default_value"):
                digest.update(repr(_plain(socket.default_value)).encode())
        if getattr(node, "node_tree", None):
            add_tree(digest, node.node_tree, (*_inside, tree))
        if hasattr(node, "image_user"):
            user = node.image_user
            moment = bpy.context.scene.frame_current if node.image and node.image.source in ("SEQUENCE", "MOVIE") else 0
            digest.update(repr((user.frame_offset, user.frame_start, user.use_cyclic, moment)).encode())
    for link in tree.links:
        ends = (link.from_node.name, link.from_socket.identifier, link.to_node.name, link.to_socket.identifier)
        digest.update(repr((*ends, link.is_muted)).encode())


def add_properties(digest, thing):
    """Adds what a node or a part of one says, but for its looks."""
    for known in thing.bl_rna.properties:
        key = known.identifier
        if key in LOOKS:
            continue
        value = getattr(thing, key)
        digest.update(f"{key}=".encode())
        if known.type == "COLLECTION":
            for item in value:
                add_properties(digest, item)
        elif known.type != "POINTER" or value is None:
            digest.update(repr(_plain(value)).encode())
        elif isinstance(value, bpy.types.Image):
            _add_image(digest, value)
        elif isinstance(value, bpy.types.Object):
            digest.update(repr([tuple(row) for row in value.matrix_world]).encode())
        elif isinstance(value, bpy.types.ID):
            digest.update(value.name_full.encode())
        else:
            # Ramps and curves.
            add_properties(digest, value)


def _plain(value):
    return value if isinstance(value, (str, int, float, bool, set, type(None))) else _listed(value)


def _listed(value):
    try:
        return [_plain(part) for part in value]
    except TypeError:
        return str(value)


def _add_image(digest, image):
    looked_up = (image.source, image.colorspace_settings.name, image.alpha_mode)
    digest.update(repr(looked_up).encode())
    if image.is_dirty or image.source == "GENERATED":
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        digest.update(repr(tuple(image.size)).encode() + pixels.tobytes())
        return
    if image.packed_file:
        digest.update(image.packed_file.data)
        return
    path = bpy.path.abspath(image.filepath_raw, library=image.library)
    digest.update(path.encode())
    if os.path.isfile(path):
        found = os.stat(path)
        digest.update(repr((found.st_size, found.st_mtime_ns)).encode())
