"""Nodes that read properties of the object, particle or instancer that they are on. Those that oscura has no values for (Attribute of objects and
instancers, Particle Info, coordinates of the instancer) are replaced by constants: objects with different values get copies of the mesh and
the material."""

import bpy

from . import node_trees

# Nodes that may read such properties.
NODES = ("ShaderNodeAttribute", "ShaderNodeParticleInfo", "ShaderNodeUVMap", "ShaderNodeTexCoord")

MASK = 0xFFFFFFFF

# `persistent_id` of levels of instances that don't exist.
UNUSED_ID = 0x7FFFFFFF


def is_used(material):
    """Does a material read properties of the object?"""
    tree = node_trees.tree_of(material)
    return tree is not None and any(_reads_object(node) for _, node in node_trees.find_nodes(tree, NODES))


def _reads_object(node):
    reads = node.bl_idname == "ShaderNodeParticleInfo" or getattr(node, "from_instancer", False)
    return (reads or getattr(node, "attribute_type", "GEOMETRY") != "GEOMETRY") and node_trees.is_linked(node)


def values(instance, parent, materials, layer):
    """The values of materials' nodes on an instance: tuples of material, node, output and value."""
    found = []
    for material in materials:
        for _, node in node_trees.find_nodes(material.node_tree, NODES):
            linked = [out.identifier for out in node.outputs if out.is_linked]
            outputs = _outputs(node, instance, parent, layer) if linked else {}
            found += [(material.name, _key(node), name, outputs[name]) for name in linked if name in outputs]
    return tuple(found)


def apply(mesh, found):
    """Replaces materials of a mesh by copies with values."""
    names = {name for name, _, _, _ in found}
    for slot, material in enumerate(mesh.materials):
        if material is None or material.name not in names:
            continue
        copy = node_trees.copy_material(material)
        constants = {(node, output): value for name, node, output, value in found if name == material.name}
        for tree, node in list(node_trees.find_nodes(copy.node_tree, NODES)):
            for output in node.outputs:
                value = constants.get((_key(node), output.identifier))
                if value is not None:
                    node_trees.replace_output(tree, output, value)
        mesh.materials[slot] = copy


def _key(node):
    """A key that is the same for nodes with the same values."""
    return (node.bl_idname, *(getattr(node, key, "") for key in ("attribute_type", "attribute_name", "from_instancer")))


def info(instance):
    """The values of the Object Info node on an instance."""
    original = instance.object.original
    return {"color": [float(c) for c in original.color], "index": original.pass_index, "random": _random(instance, original)}


def _random(instance, original):
    """Cycles' random value: of instances by their ID, of others by a hash of the name."""
    if instance.is_instance:
        return (instance.random_id & MASK) / MASK
    number = 0
    for byte in original.name.encode():
        number = (number * 37 + (byte if byte < 128 else byte - 256)) & MASK
    return hashed(number) / MASK


def hashed(number, words=2):
    """Jenkins' hash lookup3 of one or two words, a number (or an array of them) and 0."""
    rotated = lambda x, k: ((x << k) | (x >> (32 - k))) & MASK
    a = b = c = (0xDEADBEEF + (words << 2) + 13) & MASK
    a = (a + number) & MASK
    for k in (14, 11, 25, 16, 4, 14, 24):
        # The roles of c, a and b rotate.
        c = ((c ^ b) - rotated(b, k)) & MASK
        a, b, c = b, c, a
    return b


def _outputs(node, instance, parent, layer):
    """The values of a node's outputs, by identifier."""
    if node.bl_idname == "ShaderNodeParticleInfo":
        return _particle_info(instance)
    if node.bl_idname == "ShaderNodeAttribute":
        return _attribute(node, instance, parent, layer)
    if not node.from_instancer or not instance.is_instance:
        return {}
    # In Cycles generated coordinates of instancers are relative to their center.
    return {"Generated": tuple(0.5 * x + 0.5 for x in instance.orco), "UV": (*instance.uv, 0.0)}


def _particle_info(instance):
    system = instance.particle_system
    if system is None:
        return {"Index": 0.0, "Random": 0.0, "Age": 0.0, "Lifetime": 0.0, "Size": 0.0}
    number = instance.persistent_id[0]
    found = {"Index": float(number), "Random": hashed(number) / MASK}
    if number < len(system.particles):
        particle = system.particles[number]
        frame = bpy.context.scene.frame_current_final
        found |= {"Age": frame - particle.birth_time, "Lifetime": particle.lifetime, "Size": particle.size}
        found |= {"Location": tuple(particle.location), "Velocity": tuple(particle.velocity)}
        found["Angular Velocity"] = tuple(particle.angular_velocity)
    return found


def _attribute(node, instance, parent, layer):
    if node.attribute_type == "GEOMETRY":
        return {}
    original = instance.object.original
    owners = [original, original.data]
    if node.attribute_type == "VIEW_LAYER":
        owners = [layer, bpy.context.scene, bpy.context.scene.world]
    elif node.attribute_type == "INSTANCER" and parent is not None:
        system = instance.particle_system
        owners = [parent.original, *([system.settings] if system is not None else []), *owners]
        value = _of_instance(parent, list(instance.persistent_id), node.attribute_name)
        if value is not None:
            return _attribute_outputs(value)
    for owner in filter(None, owners):
        value = _property(owner, node.attribute_name)
        if value is not None:
            return _attribute_outputs(value)
    return _attribute_outputs((0.0, 0.0, 0.0, 0.0))


def _of_instance(parent, ids, name):
    """An attribute of an instance by geometry nodes (since Blender 4.5)."""
    # Both must be referenced while their attributes are read.
    geometry = parent.evaluated_geometry() if hasattr(parent, "evaluated_geometry") else None
    points = geometry.instances_pointcloud() if geometry is not None else None
    attribute = points.attributes.get(name) if points is not None else None
    # The ID of the outermost level.
    number = next((number for number in reversed(ids) if number != UNUSED_ID), -1)
    if attribute is None or attribute.domain not in ("POINT", "INSTANCE") or not 0 <= number < len(attribute.data):
        return None
    element = attribute.data[number]
    key = next((key for key in ("color", "vector", "value") if hasattr(element, key)), None)
    return _as_color(getattr(element, key)) if key else None


def _property(owner, name):
    """A custom property, or one of Blender's by its path; None without it."""
    value = owner.get(name)
    if value is None:
        try:
            value = owner.path_resolve(name)
        except (ValueError, AttributeError):
            return None
    return _as_color(value)


def _as_color(value):
    """A value as RGBA; None for what is no number."""
    if isinstance(value, (bool, int, float)):
        return (float(value),) * 3 + (1.0,)
    try:
        parts = [float(part) for part in value]
    except (TypeError, ValueError):
        return None
    return tuple((*parts, 0.0, 0.0, 0.0)[:3]) + (parts[3] if len(parts) > 3 else 1.0,) if parts else None


def _attribute_outputs(color):
    return {"Color": color[:3], "Vector": color[:3], "Fac": sum(color[:3]) / 3, "Alpha": color[3]}
