"""Generated texture coordinates: they are those of the mesh before shape keys, modifiers that deform it, and displacement. The
graph of a final render knows where vertices were there: their coordinates become an attribute."""

import numpy as np

from . import trees

ATTRIBUTE = "oscura generated"

COORDINATES = "ShaderNodeTexCoord"

# Textures that look up generated coordinates where nothing is linked.
TEXTURES = (
    "ShaderNodeTexNoise", "ShaderNodeTexVoronoi", "ShaderNodeTexWave", "ShaderNodeTexMagic", "ShaderNodeTexChecker",
    "ShaderNodeTexBrick", "ShaderNodeTexGradient", "ShaderNodeTexGabor", "ShaderNodeTexMusgrave",
)  # fmt: skip


def settle(mesh, obj):
    """Gives a mesh of an evaluated object the generated coordinates that it had before it was deformed, if its materials ask for them."""
    if obj.type != "MESH" or not (obj.original.modifiers or getattr(obj.original.data, "shape_keys", None)):
        return
    materials = [slot.material for slot in obj.material_slots] + list(mesh.materials)
    if any(material is not None and _asks(material.original) for material in materials):
        places = np.empty(3 * len(obj.data.vertices), np.float32)
        obj.data.vertices.foreach_get("undeformed_co", places)
        _set(mesh, coordinates(obj.data, places.reshape(-1, 3)))


def keep(mesh, places):
    """Keeps the generated coordinates of vertices at places that are about to be moved, unless the mesh has some."""
    if ATTRIBUTE not in mesh.attributes:
        _set(mesh, coordinates(mesh, places))


def look_up(tree):
    """Puts the attribute in the place of generated coordinates in a tree and its groups."""
    for inner, targets in list(_lookups(tree)):
        trees.feed_attribute(inner, targets, ATTRIBUTE, "Vector")


def _asks(material):
    """Are generated coordinates looked up?"""
    return material.use_nodes and material.node_tree is not None and any(True for _ in _lookups(material.node_tree))


def _lookups(tree):
    """The inputs to which generated coordinates go, by nodes of a tree and its groups, each with its tree."""
    for inner, node in trees.nodes_with_trees(tree, (COORDINATES, *TEXTURES)):
        if node.bl_idname == COORDINATES:
            # Those of another object are not of this mesh.
            targets = [] if node.from_instancer else [link.to_socket for link in node.outputs["Generated"].links]
        else:
            # Noise of one dimension has none: a lookup by name fails on sockets that are not available.
            vector = next((socket for socket in node.inputs if socket.name == "Vector" and not socket.is_unavailable), None)
            is_idle = vector is None or vector.is_linked or not any(out.is_linked for out in node.outputs)
            targets = [] if is_idle else [vector]
        if targets:
            yield inner, targets


def coordinates(mesh, places):
    """Generated coordinates of places in the space of a mesh."""
    middle, size = (np.array(value, np.float32) for value in (mesh.texspace_location, mesh.texspace_size))
    return (places - middle) / (2 * np.where(size == 0, 1, size)) + 0.5


def _set(mesh, values):
    mesh.attributes.new(ATTRIBUTE, "FLOAT_VECTOR", "POINT").data.foreach_set("vector", values.astype(np.float32).ravel())
