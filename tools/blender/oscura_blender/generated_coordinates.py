"""Generated texture coordinates: those of the mesh before shape keys and deforming modifiers. Where these move vertices, an
attribute holds the coordinates."""

import numpy as np

from . import meshes, node_trees

ATTRIBUTE = "oscura generated"

TEXTURE_COORDINATE = "ShaderNodeTexCoord"

# Textures that use generated coordinates where their vector has no link.
TEXTURES = (
    "ShaderNodeTexNoise", "ShaderNodeTexVoronoi", "ShaderNodeTexWave", "ShaderNodeTexMagic", "ShaderNodeTexChecker",
    "ShaderNodeTexBrick", "ShaderNodeTexGradient", "ShaderNodeTexGabor",
)  # fmt: skip


def add_undeformed(mesh, obj):
    """Adds the coordinates of an evaluated object's undeformed mesh if a material uses them."""
    if obj.type != "MESH" or not (obj.original.modifiers or getattr(obj.original.data, "shape_keys", None)):
        return
    materials = [slot.material for slot in obj.material_slots] + list(mesh.materials)
    trees = (node_trees.tree_of(material.original) for material in materials if material is not None)
    if any(tree is not None and any(True for _ in _users(tree)) for tree in trees):
        undeformed = meshes.read(obj.data.vertices, "undeformed_co", 3, np.float32)
        _add(mesh, coordinates(obj.data, undeformed))


def use_attribute(tree):
    """Replaces generated coordinates in a tree and its groups by the attribute."""
    for inner, targets in list(_users(tree)):
        node_trees.link_attribute(inner, targets, ATTRIBUTE, "Vector")


def _users(tree):
    """The inputs that get generated coordinates in a tree and its groups, each list with its tree."""
    for inner, node in node_trees.find_nodes(tree, (TEXTURE_COORDINATE, *TEXTURES)):
        if node.bl_idname == TEXTURE_COORDINATE:
            targets = [] if node.from_instancer else [link.to_socket for link in node.outputs["Generated"].links]
        else:
            # One-dimensional noise has none, and sockets that are unavailable can't be found by name.
            vector = next((socket for socket in node.inputs if socket.name == "Vector" and not socket.is_unavailable), None)
            is_used = vector is not None and not vector.is_linked and node_trees.is_linked(node)
            targets = [vector] if is_used else []
        if targets:
            yield inner, targets


def coordinates(mesh, positions):
    """The generated coordinates of positions in the space of a mesh."""
    center, size = (np.array(value, np.float32) for value in (mesh.texspace_location, mesh.texspace_size))
    return (positions - center) / (2 * np.where(size == 0, 1, size)) + 0.5


def _add(mesh, values):
    meshes.add_attribute(mesh, ATTRIBUTE, "FLOAT_VECTOR", "POINT", values)
