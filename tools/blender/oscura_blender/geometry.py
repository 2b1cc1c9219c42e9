"""What Cycles would render, from Blender's dependency graph: objects with their modifiers, and instances of collections,
of geometry nodes and of particles."""

import re
from collections import namedtuple

import bpy
import numpy as np
from mathutils import Matrix

from . import context, hair, meshes, objectwise, points, trees, undeformed, volumes
from .links import Links
from .report import listed

# Kinds of rays that see an object.
VISIBILITY = {
    "visible_camera": "camera",
    "visible_diffuse": "diffuse",
    "visible_glossy": "glossy",
    "visible_transmission": "transmission",
    "visible_volume_scatter": "volume",
    "visible_shadow": "shadow",
}
# What has faces, or gets some.
MESHES = ("MESH", "POINTCLOUD")

# What is seen in Blender and has no counterpart here.
LOST = {
    "GPENCIL": "Grease Pencil",
    "GREASEPENCIL": "Grease Pencil",
}


# Of texture coordinates that a mesh gets: Blender has one more, which is left for baking.
MOST_LAYERS = 7

# More faces than this are not made for the sake of materials alone.
MOST_FACES = 4_000_000


# Of a mesh: the name of an object, its matrix, what tells it from all others at all times, and what it answers to nodes that ask about objects.
Placement = namedtuple("Placement", ("name", "matrix", "mark", "info"))


class Collected:
    """What there is to render. Meshes are owned by new objects at the origin; all else by the scene."""

    def __init__(self):
        self.graph = None  # what all is taken from
        self.objects = {}  # mesh objects by what they were made of
        self.placements = {}  # lists by the name of the mesh object
        self.extras = {}  # by the name of the mesh object: what its nodes say about rays and pictures
        self.lights = []  # (object, matrix, mark)
        self.cameras = []  # objects
        self.exposure = 1.0  # the film's factor on all light
        self.hair = []  # of strands: name, strands, matrix, material, entries for rays and pictures
        self.strands = {}  # of particles, by object and system
        self.media = {}  # tables of materials that are volumes alone
        self.bakes = []  # files of pictures that were baked
        self.volumes = {}  # names of volume objects by what tells them from all else
        self.links = None  # what lights are linked to
        self.kinds = {}  # of instances: what those of one mesh have in common that an object makes of another
        self.questions = None  # that materials ask about objects
        self.faces = 0  # of meshes that were made for the sake of materials

    def is_crowded(self, obj, report):
        """Would one more copy of an object's mesh be too much?"""
        count = len(obj.data.polygons) if obj.type == "MESH" else points.count_of_faces(obj.data)
        if self.faces + count > MOST_FACES:
            report.warn(obj.original.name, "has too many copies: some get materials that are meant for others")
            return True
        self.faces += count
        return False


def collect(scene, layer, graph, store, report):
    """Collects everything; grids of volumes go to their store."""
    found = Collected()
    found.graph = graph
    found.questions = objectwise.Questions(layer)
    found.links = Links(bpy.data.objects)
    lost = {}
    for instance in graph.object_instances:
        obj = instance.object
        original = obj.original
        if _is_replaced(instance):
            continue
        traits = lambda: traits_of(_extras(found, obj, instance.parent))
        if layer.use_strand and instance.show_particles and (instance.is_instance or not original.hide_render):
            hair.add_particles(found, obj, instance, traits())
        if not instance.show_self or (not instance.is_instance and original.hide_render):
            continue
        if obj.type == "LIGHT":
            found.lights.append((original, instance.matrix_world.copy(), mark(instance)))
        elif obj.type == "CURVES" and layer.use_strand:
            hair.add_curves(found, obj, instance, traits())
        elif obj.type == "VOLUME" and layer.use_volumes:
            _add_volume(found, obj, instance, store, report)
        elif obj.type in LOST:
            lost.setdefault(LOST[obj.type], []).append(original.name)
        elif obj.type in MESHES and layer.use_solid:
            # Curves, texts and metaballs come once more, with their faces, as instances of themselves.
            _add_mesh(found, obj, instance, report)
        if not instance.is_instance:
            _tell_of_the_rest(original, report)
    for what, names in lost.items():
        report.warn("", f"left out, since {what} can't be rendered: {listed(names)}")
    found.cameras = [obj for obj in scene.objects if obj.type == "CAMERA" and obj.name != context.NO_CAMERA]
    if scene.camera in found.cameras:
        found.cameras.remove(scene.camera)
        found.cameras.insert(0, scene.camera)
    return found


def _is_replaced(instance):
    """An object that its parent puts on vertices or faces: a final render shows these instances alone."""
    parent = instance.object.original.parent
    return not instance.is_instance and parent is not None and parent.instance_type in ("VERTS", "FACES")


def mark(instance):
    """What tells something that is shown from all else, at all times."""
    if not instance.is_instance:
        return (instance.object.original.name,)
    return (instance.object.original.name, instance.parent.original.name, *instance.persistent_id)


def _add_mesh(found, obj, instance, report):
    parent = instance.parent if instance.is_instance else None
    maker = obj.original, parent and parent.original, obj.data.as_pointer()
    if maker not in found.kinds:
        # What all copies have in common that an object makes of another.
        extras = _extras(found, obj, parent)
        key = (maker[2], *extras.items(), *_own_materials(obj).items(), found.links.key(_linked(obj, parent)))
        asking = [material for material in _materials(found, obj) if found.questions.is_asked(material)]
        found.kinds[maker] = extras, key, asking, _name(obj, parent)
    extras, key, asking, name = found.kinds[maker]
    told = objectwise.answers(instance, obj, parent, asking, found.questions.layer) if asking else ()
    if told and (key, told) not in found.objects and found.is_crowded(obj, report):
        told = next((known[1] for known in found.objects if known[0] == key), told)
    key = (key, told)
    if key not in found.objects:
        found.objects[key] = _holder(found, obj)
        if found.objects[key] is not None:
            objectwise.settle(found.objects[key].data, told)
            if extras:
                found.extras[found.objects[key].name] = extras
    holder = found.objects[key]
    if holder is None:
        return
    found.placements[holder.name].append(Placement(name, instance.matrix_world.copy(), mark(instance), objectwise.info(instance, obj)))
    found.links.place(name, _linked(obj, parent))


def _add_volume(found, obj, instance, store, report):
    parent = instance.parent if instance.is_instance else None
    name = _name(obj, parent)
    made = volumes.add(store, obj, instance, name, report)
    if made is None:
        return
    mesh, medium = made
    found.media[mesh.materials[0]] = medium
    holder = bpy.data.objects.new(f"oscura {len(found.objects)}", mesh)
    found.objects[holder.name] = holder
    if extras := _extras(found, obj, parent):
        found.extras[holder.name] = extras
    # It stands in the world and is marked as nothing else, so that nothing moves it.
    found.placements[holder.name] = [Placement(name, Matrix.Identity(4), ("volume", holder.name), objectwise.info(instance, obj))]
    found.links.place(name, _linked(obj, parent))
    found.volumes[mark(instance)] = name


def _name(obj, parent):
    """What an object is called, or an instance of it that is made by another."""
    is_own = parent is None or parent.original == obj.original
    return obj.original.name if is_own else f"{parent.original.name}/{obj.original.name}"


def _linked(obj, parent):
    """The object that collections of links hold: of an instance, what makes it."""
    return (obj if parent is None else parent).original


def _materials(found, obj):
    """The materials that an object shows."""
    if found.questions.layer.material_override is not None:
        return [found.questions.layer.material_override]
    own = [slot.material for slot in obj.material_slots if slot.material is not None]
    of_data = [material for material in getattr(obj.data, "materials", []) if material is not None]
    return list({material.name: material for material in (*own, *of_data)}.values())


def _extras(found, obj, parent):
    """What differs from objects that all rays see: of an instance, together with what makes it. Collections of the view layer hold
    the latter."""
    both, layer = [of.original for of in (obj, parent) if of is not None], found.questions.layer
    extras = {key: False for key in VISIBILITY if not all(getattr(of, key, True) for of in both)}
    marks = {key for key in ("is_holdout", "is_shadow_catcher") if any(getattr(of, key, False) for of in both)}
    if both[-1].holdout_get(view_layer=layer):
        marks.add("is_holdout")
    elif both[-1].indirect_only_get(view_layer=layer):
        extras = {key: False for key in VISIBILITY if key == "visible_camera" or key in extras}
    extras.update({key: True for key in sorted(marks)})
    group = next(filter(None, map(light_group, both)), None)
    return {**extras, "light_group": group} if group else extras


def traits_of(extras):
    """The same as scene files have it."""
    traits = {key: True for key in ("holdout", "shadow_catcher") if f"is_{key}" in extras}
    if any(key in extras for key in VISIBILITY):
        traits["visible_to"] = [kind for key, kind in VISIBILITY.items() if key not in extras]
    return traits


def light_group(of):
    """The group of lights of an object or a world, with _ for what names of groups here can't have; empty for none."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", getattr(of, "lightgroup", ""))[:64]


def _own_materials(obj):
    """Materials that an object has in place of those of its mesh: names by number."""
    slots = enumerate(obj.material_slots)
    return {i: slot.material.name if slot.material else None for i, slot in slots if slot.link == "OBJECT"}


def _holder(found, obj):
    """A new object with the evaluated mesh; None where that has no faces."""
    # The data of instances made by nodes is that of no object: only a copy has it.
    if obj.type == "POINTCLOUD":
        mesh = points.as_mesh(obj.data)
    elif obj.data.is_editmode:
        # What was being edited when the file was saved.
        obj.original.update_from_editmode()
        mesh = bpy.data.meshes.new_from_object(obj, preserve_all_data_layers=True, depsgraph=found.graph)
    else:
        mesh = obj.data.copy()
    mesh.name = obj.original.data.name if obj.original.data else obj.original.name
    if not mesh.polygons:
        return None
    for i, name in _own_materials(obj).items():
        if i < len(mesh.materials):
            mesh.materials[i] = bpy.data.materials[name] if name else None
    if found.questions.layer.material_override is not None:
        mesh.materials.clear()
        mesh.materials.append(found.questions.layer.material_override)
        mesh.polygons.foreach_set("material_index", [0] * len(mesh.polygons))
    for i, material in enumerate(mesh.materials):
        # Those of the graph go with it.
        mesh.materials[i] = material.original if material is not None else None
    undeformed.settle(mesh, obj)
    _add_missing_coordinates(mesh)
    _leave_out_unused(mesh)
    _settle_normals(mesh)
    holder = bpy.data.objects.new(f"oscura {len(found.objects)}", mesh)
    # The mesh has its shape. Keys would give it another once more, or none where modifiers have made other vertices.
    holder.shape_key_clear()
    found.placements[holder.name] = []
    return holder


def _add_missing_coordinates(mesh):
    """Cycles looks at the origin of texture coordinates that a mesh doesn't have, oscura at the first ones."""
    trees_of = (material.node_tree for material in mesh.materials if material is not None and material.node_tree is not None)
    nodes = (node for tree in trees_of for _, node in trees.nodes_with_trees(tree, ("ShaderNodeUVMap",)))
    missing = {node.uv_map for node in nodes if node.uv_map and not node.from_instancer} - set(mesh.attributes.keys())
    for name in sorted(missing)[: max(MOST_LAYERS - len(mesh.uv_layers), 0)]:
        mesh.uv_layers.new(name=name, do_init=False)


def _leave_out_unused(mesh):
    """Materials of slots without faces are those of strands, or of nothing."""
    counts = np.bincount(meshes.material_slots(mesh), minlength=len(mesh.materials))
    for slot in range(len(mesh.materials)):
        if counts[slot] == 0:
            mesh.materials[slot] = None


def _settle_normals(mesh):
    """Gives corners the normals that Cycles shades them by, which has one for each vertex, once sharp edges are split."""
    if mesh.has_custom_normals:
        last, normals = _last_corners(mesh), meshes.corner_normals(mesh)
        if not np.allclose(normals, normals[last], atol=1e-3):
            meshes.set_custom_normals(mesh, normals[last])
    else:
        _round_beside_flat(mesh)


def _last_corners(mesh):
    """For each corner the last of those that share a vertex with it and are joined to it by edges that aren't sharp: its normal counts for all."""
    edges, vertices, sizes = meshes.corner_edges(mesh), meshes.corner_vertices(mesh), meshes.face_sizes(mesh)
    last, following = np.arange(len(edges)), np.arange(1, len(edges) + 1)
    ends = np.cumsum(sizes)
    following[ends - 1] = ends - sizes
    sharp = _values(mesh, "sharp_edge", len(mesh.edges))
    sharp[edges[np.repeat(_values(mesh, "sharp_face", len(sizes)), sizes)]] = True
    # Corners with the same edge, one after the other; the two ends of each edge belong together.
    order = np.argsort(edges, kind="stable")
    first, second = order[:-1], order[1:]
    joined = (edges[first] == edges[second]) & ~sharp[edges[first]]
    first, second = first[joined], second[joined]
    is_same_way = vertices[first] == vertices[second]
    pairs = [(first, np.where(is_same_way, second, following[second])), (following[first], np.where(is_same_way, following[second], second))]
    while True:
        before = last.copy()
        for a, b in pairs:
            larger = np.maximum(last[a], last[b])
            np.maximum.at(last, a, larger)
            np.maximum.at(last, b, larger)
        if np.array_equal(before, last):
            return last


def _round_beside_flat(mesh):
    """Smooth faces beside flat ones: without sharp edges Cycles shades them by the normals of vertices, to which flat faces add."""
    flat, sharp = (_values(mesh, name, size) for name, size in (("sharp_face", len(mesh.polygons)), ("sharp_edge", len(mesh.edges))))
    if mesh.has_custom_normals or sharp.any() or flat.all() or not flat.any():
        return
    of_vertices, of_faces = meshes.vertex_normals(mesh), meshes.face_normals(mesh)
    faces = np.repeat(np.arange(len(mesh.polygons)), meshes.face_sizes(mesh))
    normals = np.where(flat[faces, None], of_faces[faces], of_vertices[meshes.corner_vertices(mesh)])
    mesh.normals_split_custom_set(normals)


def _values(mesh, name, size):
    """A boolean attribute; all false without it."""
    found = np.zeros(size, bool)
    if name in mesh.attributes:
        mesh.attributes[name].data.foreach_get("value", found)
    return found


def _tell_of_the_rest(obj, report):
    if obj.type in ("LIGHT", "CAMERA"):
        return
    if any(m.type == "FLUID" and m.fluid_type == "DOMAIN" and m.domain_settings.domain_type == "GAS" for m in obj.modifiers):
        report.warn(obj.name, "smoke of fluid domains is left out: show it as a volume object (.vdb files of its cache)")
