"""Generated texture coordinates: they are those of the mesh before shape keys, modifiers that deform it, and displacement. Only
final renders of Blender itself know that mesh: it is evaluated once more, and its vertices become an attribute."""

import bpy
import numpy as np

from . import context, meshes, trees

ATTRIBUTE = "oscura generated"

# Modifiers that only move vertices, or that simulate: all others work on the copy, too.
DEFORMING = (
    "ARMATURE", "CAST", "CLOTH", "COLLISION", "CORRECTIVE_SMOOTH", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LAPLACIANSMOOTH",
    "LATTICE", "MESH_CACHE", "MESH_DEFORM", "PARTICLE_SYSTEM", "SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "SOFT_BODY", "SURFACE",
    "SURFACE_DEFORM", "WARP", "WAVE", "FLUID", "DYNAMIC_PAINT",
)  # fmt: skip

COORDINATES = "ShaderNodeTexCoord"

# Textures that look up generated coordinates where nothing is linked.
TEXTURES = (
    "ShaderNodeTexNoise", "ShaderNodeTexVoronoi", "ShaderNodeTexWave", "ShaderNodeTexMagic", "ShaderNodeTexChecker",
    "ShaderNodeTexBrick", "ShaderNodeTexGradient", "ShaderNodeTexGabor", "ShaderNodeTexMusgrave",
)  # fmt: skip


def evaluate(objects):
    """The generated coordinates of vertices of evaluated meshes, by the names of objects, of those that have another shape than
    their meshes and whose materials look such coordinates up."""
    shown = (obj for obj in objects if obj.type == "MESH" and not obj.hide_viewport)
    changed = [obj for obj in shown if (obj.modifiers or obj.data.shape_keys) and _is_asked(obj)]
    if not changed:
        return {}
    scene = context.new_scene("oscura coordinates")
    copies = {obj.name: _copy(obj, scene) for obj in changed}
    try:
        with context.opened(scene):
            scene.view_layers[0].update()
            graph = bpy.context.evaluated_depsgraph_get()
            places = {name: meshes.positions(copy.evaluated_get(graph).data.vertices) for name, copy in copies.items()}
            return {name: coordinates(bpy.data.objects[name].data, of) for name, of in places.items()}
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.batch_remove([copy.data for copy in copies.values()] + list(copies.values()))


def _is_asked(obj):
    return any(slot.material is not None and _asks(slot.material) for slot in obj.material_slots)


def _copy(obj, scene):
    """An object like another that nothing deforms."""
    keys, mesh = obj.data.shape_keys, obj.data.copy()
    made = obj.copy()
    made.data = mesh
    made.shape_key_clear()
    if keys is not None:
        mesh.vertices.foreach_set("co", meshes.positions(keys.reference_key.data).ravel())
        mesh.update()
    for modifier in list(made.modifiers):
        if modifier.type in DEFORMING:
            made.modifiers.remove(modifier)
    made.hide_viewport = False
    scene.collection.objects.link(made)
    return made


def settle(mesh, coordinates):
    """Gives an evaluated mesh its coordinates, if there are some and they are those of its vertices."""
    if coordinates is not None and len(coordinates) == len(mesh.vertices):
        _set(mesh, coordinates)


def use(holders, changed):
    """Lets materials look the attribute up, on all their meshes, if one has it or is among those that are still to be changed."""
    materials = [material for material in trees.of_materials(holders) if _asks(material)]
    asking = [holder for holder in holders if any(m in materials for m in holder.data.materials)]
    if not any(ATTRIBUTE in holder.data.attributes or holder in changed for holder in asking):
        return
    for holder in asking:
        if ATTRIBUTE not in holder.data.attributes:
            _set(holder.data, coordinates(holder.data, meshes.positions(holder.data.vertices)))
    for material in materials:
        look_up(material.node_tree)


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
            is_idle = node.inputs["Vector"].is_linked or not any(out.is_linked for out in node.outputs)
            targets = [] if is_idle else [node.inputs["Vector"]]
        if targets:
            yield inner, targets


def coordinates(mesh, places):
    """Generated coordinates of places in the space of a mesh."""
    middle, size = (np.array(value, np.float32) for value in (mesh.texspace_location, mesh.texspace_size))
    return (places - middle) / (2 * np.where(size == 0, 1, size)) + 0.5


def _set(mesh, values):
    mesh.attributes.new(ATTRIBUTE, "FLOAT_VECTOR", "POINT").data.foreach_set("vector", values.astype(np.float32).ravel())
