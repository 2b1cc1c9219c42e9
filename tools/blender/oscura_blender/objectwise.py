"""What node trees ask about the object that they are on: its place, colour, numbers, attributes, its particle. Objects that
answer differently get materials of their own, in which the answers stand."""

import bpy

from . import trees

# Nodes that may ask what only the export knows. (The renderer knows places, colours, and numbers.)
ASKING = ("ShaderNodeAttribute", "ShaderNodeParticleInfo", "ShaderNodeUVMap", "ShaderNodeTexCoord")

AMBIENT = "ShaderNodeAmbientOcclusion"


class Questions:
    """Which materials ask something, of a view layer's objects."""

    def __init__(self, layer):
        self.layer = layer
        self._asking = {}

    def is_asked(self, material):
        """Does a material's tree ask about the object? Most don't, and are looked at once."""
        if material.name not in self._asking:
            tree = material.node_tree if material.use_nodes else None
            nodes = [node for _, node in trees.nodes_with_trees(tree, ASKING)] if tree is not None else []
            self._asking[material.name] = any(map(_asks, nodes)) or tree is not None and _looks_around(tree)
        return self._asking[material.name]


def answers(instance, obj, parent, materials, layer):
    """What the object answers, as a tuple that can be compared: by material, node and output; empty if nothing is asked."""
    found = []
    for material in materials:
        for _, node in trees.nodes_with_trees(material.node_tree, ASKING):
            told = _told(node, instance, obj, parent, layer)
            found += [(material.name, _mark(node), *entry) for entry in told]
        if _looks_around(material.node_tree):
            found.append((material.name, "", "place", tuple(tuple(row) for row in instance.matrix_world)))
    return tuple(found)


def info(instance, obj):
    """What an object answers to the node Object Info, by the keys of scene files."""
    color = [float(c) for c in obj.original.color]
    return {"color": color, "index": obj.original.pass_index, "random": _random_of(instance, obj.original)}


def settle(mesh, told):
    """Gives a mesh materials in which the answers stand."""
    if not told:
        return
    names = {name for name, _, what, _ in told if what != "place"}
    for i, material in enumerate(mesh.materials):
        if material is None or material.name not in names:
            continue
        own = trees.copied(material)
        answers_of = {(node, output): value for name, node, output, value in told if name == material.name}
        for tree, node in list(trees.nodes_with_trees(own.node_tree, ASKING)):
            for output in node.outputs:
                value = answers_of.get((_mark(node), output.identifier))
                if value is not None:
                    trees.replace(tree, output, value)
        mesh.materials[i] = own


def _mark(node):
    """What a node asks: nodes that ask the same get the same answers."""
    asked = (getattr(node, key, "") for key in ("attribute_type", "attribute_name", "from_instancer"))
    return (node.bl_idname, *asked)


def _asks(node):
    """Does a node ask about the object?"""
    is_special = node.bl_idname == "ShaderNodeParticleInfo" or getattr(node, "from_instancer", False)
    is_special = is_special or getattr(node, "attribute_type", "GEOMETRY") != "GEOMETRY"
    return is_special and any(out.is_linked for out in node.outputs)


def _looks_around(tree):
    """Does a tree ask how much of what is around an object other ones hide?"""
    nodes = (node for _, node in trees.nodes_with_trees(tree, (AMBIENT,)))
    return any(not node.only_local and any(out.is_linked for out in node.outputs) for node in nodes)


def _told(node, instance, obj, parent, layer):
    """What a node gives on an object, by the identifier of its outputs that are used."""
    linked = [out for out in node.outputs if out.is_linked]
    tell = {
        "ShaderNodeParticleInfo": _of_particle,
        "ShaderNodeAttribute": _of_attribute,
        "ShaderNodeUVMap": _of_instancer,
        "ShaderNodeTexCoord": _of_instancer,
    }[node.bl_idname]
    values = tell(node, instance, obj, parent, layer) if linked else {}
    return [(out.identifier, values[out.identifier]) for out in linked if out.identifier in values]


def _of_particle(_node, instance, _obj, _parent, _layer):
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


MASK = 0xFFFFFFFF

# The number of levels of instances that are not there.
UNUSED = 0x7FFFFFFF


def _random_of(instance, original):
    """The number of chance that Cycles gives an object: instances have theirs, others one of their names."""
    if instance.is_instance:
        return (instance.random_id & MASK) / MASK
    number = 0
    for byte in original.name.encode():
        number = (number * 37 + (byte if byte < 128 else byte - 256)) & MASK
    return hashed(number) / MASK


def hashed(number):
    """The hash of two words, a number (or each of an array) and 0 (Jenkins' lookup3)."""
    turned = lambda x, k: ((x << k) | (x >> (32 - k))) & MASK
    a = b = c = (0xDEADBEEF + (2 << 2) + 13) & MASK
    a = (a + number) & MASK
    for k in (14, 11, 25, 16, 4, 14, 24):
        # c, a and b take turns.
        c = ((c ^ b) - turned(b, k)) & MASK
        a, b, c = b, c, a
    return b


def _of_attribute(node, instance, obj, parent, layer):
    if node.attribute_type == "GEOMETRY":
        return {}
    places = [obj.original, obj.original.data]
    if node.attribute_type == "VIEW_LAYER":
        places = [layer, bpy.context.scene, bpy.context.scene.world]
    elif node.attribute_type == "INSTANCER" and parent is not None:
        system = instance.particle_system
        places = [parent.original, *([system.settings] if system is not None else []), *places]
        own = _of_instances(parent, list(instance.persistent_id), node.attribute_name)
        if own is not None:
            return _as_outputs(own)
    for owner in filter(None, places):
        value = _property(owner, node.attribute_name)
        if value is not None:
            return _as_outputs(value)
    return _as_outputs((0.0, 0.0, 0.0, 0.0))


def _of_instances(parent, numbers, name):
    """An attribute of instances that geometry nodes have made (Blender 4.5 and newer tell it)."""
    # Both are to be held while their attributes are read.
    geometry = parent.evaluated_geometry() if hasattr(parent, "evaluated_geometry") else None
    points = geometry.instances_pointcloud() if geometry is not None else None
    attribute = points.attributes.get(name) if points is not None else None
    # That of what is the outermost; unused numbers are the largest.
    number = next((number for number in reversed(numbers) if number != UNUSED), -1)
    if attribute is None or attribute.domain not in ("POINT", "INSTANCE") or not 0 <= number < len(attribute.data):
        return None
    element = attribute.data[number]
    key = next((key for key in ("color", "vector", "value") if hasattr(element, key)), None)
    return _as_color(getattr(element, key)) if key else None


def _property(owner, name):
    """A property of the user's, else one of Blender's by its path; None without it."""
    value = owner.get(name) if hasattr(owner, "get") else None
    if value is None:
        try:
            value = owner.path_resolve(name)
        except (ValueError, AttributeError):
            return None
    return _as_color(value)


def _as_color(value):
    if isinstance(value, (bool, int, float)):
        return (float(value),) * 3 + (1.0,)
    try:
        parts = [float(part) for part in value]
    except (TypeError, ValueError):
        return None
    return tuple((*parts, 0.0, 0.0, 0.0)[:3]) + (parts[3] if len(parts) > 3 else 1.0,) if parts else None


def _as_outputs(color):
    return {"Color": color[:3], "Vector": color[:3], "Fac": sum(color[:3]) / 3, "Alpha": color[3]}


def _of_instancer(node, instance, _obj, _parent, _layer):
    if not node.from_instancer or not instance.is_instance:
        return {}
    orco, uv = tuple(instance.orco), (*instance.uv, 0.0)
    # Cycles takes the middle of what makes the instances as 0.
    return {"Generated": tuple(0.5 * o + 0.5 for o in orco), "UV": uv}
