"""The objects of a final render's dependency graph, with instances of collections, geometry nodes and particles."""

import re

import bmesh
import bpy
import numpy as np
from mathutils import Matrix

from . import (
    final_render, generated_coordinates, hair, mesh_normals, meshes, node_trees, object_info, point_clouds, volumes,
)  # fmt: skip
from .report import listed
from .state import MeshEntry, Placement

# Kinds of rays to which an object is visible, by Blender's properties.
VISIBILITY = {
    "visible_camera": "camera",
    "visible_diffuse": "diffuse",
    "visible_glossy": "glossy",
    "visible_transmission": "transmission",
    "visible_volume_scatter": "volume",
    "visible_shadow": "shadow",
}

# Curves, texts and metaballs have their faces as instances of this type as well.
MESH_TYPES = ("MESH", "POINTCLOUD")

UNSUPPORTED = {"GPENCIL": "Grease Pencil", "GREASEPENCIL": "Grease Pencil"}

# UV maps that are added to a mesh at most: Blender allows one more, which baking needs.
MAX_UV_MAPS = 7

# Limit of the faces of copies of meshes for materials that read properties of objects.
MAX_COPIED_FACES = 4_000_000


def collect(export, depsgraph):
    export.depsgraph = depsgraph
    _Collector(export).collect()
    scene = export.scene
    # The active camera is the first: it may be of any type, and of another scene.
    others = (obj for obj in scene.objects if obj.type == "CAMERA" and obj != scene.camera)
    export.cameras = [obj for obj in (scene.camera, *others) if obj is not None and obj.name != final_render.PLACEHOLDER_CAMERA]


def key(instance):
    """Identifies an object or instance at all frames."""
    if not instance.is_instance:
        return (instance.object.original.name,)
    return (instance.object.original.name, instance.parent.original.name, *instance.persistent_id)


def light_group(owner):
    """The light group of an object or world in characters of scene files; empty for none."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", owner.lightgroup)[:64]


def visibility(traits):
    """Entries of the scene file by traits of an object."""
    entries = {name: True for name in ("holdout", "shadow_catcher") if f"is_{name}" in traits}
    if any(name in traits for name in VISIBILITY):
        entries["visible_to"] = [kind for name, kind in VISIBILITY.items() if name not in traits]
    return entries


class _Collector:
    def __init__(self, export):
        self.export, self.layer, self.report = export, export.layer, export.report
        self.volume_files = volumes.VolumeFiles(export)
        self.hair = hair.Collector(export)
        self.shared = {}  # of the instances of an object by another: traits, key of the mesh, materials that read objects, name
        self.readers = {}  # does a material read properties of objects?
        self.copied_faces = 0

    def collect(self):
        unsupported = {}
        for instance in self.export.depsgraph.object_instances:
            obj, original = instance.object, instance.object.original
            if _is_instanced_on_parent(instance):
                continue
            is_shown = instance.is_instance or not original.hide_render
            if self.layer.use_strand and instance.show_particles and is_shown and obj.particle_systems:
                self.hair.add_particles(instance, visibility(self._traits(obj, instance.parent)))
            if not instance.show_self or not is_shown:
                continue
            if obj.type == "LIGHT":
                self.export.lights.append((original, instance.matrix_world.copy(), key(instance)))
            elif obj.type == "CURVES" and self.layer.use_strand:
                self.hair.add_curves(instance, visibility(self._traits(obj, instance.parent)))
            elif obj.type == "VOLUME" and self.layer.use_volumes:
                self._add_volume(instance)
            elif obj.type in UNSUPPORTED:
                unsupported.setdefault(UNSUPPORTED[obj.type], []).append(original.name)
            elif any(map(_is_smoke, original.modifiers)):
                # Cycles shows the smoke in place of the mesh.
                message = "smoke of fluid domains is left out: show it as a volume object (.vdb files of its cache)"
                self.report.warn(original.name, message)
            elif obj.type in MESH_TYPES and self.layer.use_solid:
                self._add_mesh(instance)
        for kind, names in unsupported.items():
            self.report.warn("", f"{kind} is not supported, and left out: {listed(names)}")

    def _add_mesh(self, instance):
        export, obj = self.export, instance.object
        parent = instance.parent if instance.is_instance else None
        shared = obj.original, parent and parent.original, obj.data.as_pointer()
        if shared not in self.shared:
            traits = self._traits(obj, parent)
            mesh_key = (shared[2], *traits.items(), *_object_materials(obj).items(), export.links.key(_owner(obj, parent)))
            self.shared[shared] = traits, mesh_key, list(filter(self._reads_object, self._materials(obj))), _name(obj, parent)
        traits, mesh_key, readers, name = self.shared[shared]
        values = object_info.values(instance, parent, readers, self.layer) if readers else ()
        if values and (mesh_key, values) not in export.meshes and self._is_too_large(obj):
            values = next((known[1] for known in export.meshes if known[0] == mesh_key), values)
        if (mesh_key, values) not in export.meshes:
            export.meshes[mesh_key, values] = self._new_entry(instance, traits, values)
        entry = export.meshes[mesh_key, values]
        if entry is not None:
            entry.placements.append(Placement(name, instance.matrix_world.copy(), key(instance), object_info.info(instance)))
            export.links.add(name, _owner(obj, parent))

    def _new_entry(self, instance, traits, values):
        """The mesh of an evaluated object; None if it has no faces."""
        mesh = self._new_mesh(instance)
        if mesh is None:
            return None
        object_info.apply(mesh, values)
        return self._new_object(mesh, traits)

    def _new_object(self, mesh, traits):
        owner = bpy.data.objects.new(f"oscura {len(self.export.meshes)}", mesh)
        # Shape keys are applied. They would move the vertices again, or fail after modifiers that add some.
        owner.shape_key_clear()
        return MeshEntry(owner, traits)

    def _new_mesh(self, instance):
        obj = instance.object
        if obj.type == "POINTCLOUD":
            mesh = point_clouds.to_mesh(obj.data)
        elif obj.data.is_editmode:
            # The file was saved in Edit Mode. As in Cycles, modifiers that are off there have no effect: with all layers, they would have.
            obj.original.update_from_editmode()
            mesh = bpy.data.meshes.new_from_object(obj, preserve_all_data_layers=False, depsgraph=self.export.depsgraph)
            if instance.is_instance and len(mesh.polygons) != len(obj.data.polygons):
                mesh = _copy_of_edited(obj.data)
        else:
            # Meshes of instances by geometry nodes belong to no object: they can't be got by `new_from_object`.
            mesh = obj.data.copy()
        mesh.name = obj.original.data.name if obj.original.data else obj.original.name
        if not mesh.polygons:
            return None
        for slot, name in _object_materials(obj).items():
            if slot < len(mesh.materials):
                mesh.materials[slot] = bpy.data.materials[name] if name else None
        if self.layer.material_override is not None:
            mesh.materials.clear()
            mesh.materials.append(self.layer.material_override)
            mesh.polygons.foreach_set("material_index", [0] * len(mesh.polygons))
        for slot, material in enumerate(mesh.materials):
            # Evaluated materials end with the graph.
            mesh.materials[slot] = material.original if material is not None else None
        generated_coordinates.add_undeformed(mesh, obj)
        _add_missing_uv_maps(mesh)
        _remove_unused_materials(mesh)
        mesh_normals.match_cycles(mesh)
        return mesh

    def _is_too_large(self, obj):
        """Would one more copy of a mesh exceed the limit?"""
        count = len(obj.data.polygons) if obj.type == "MESH" else point_clouds.face_count(obj.data)
        if self.copied_faces + count > MAX_COPIED_FACES:
            self.report.warn(obj.original.name, "has too many instances with different values in materials: some get the values of others")
            return True
        self.copied_faces += count
        return False

    def _add_volume(self, instance):
        export, obj, matrix = self.export, instance.object, instance.matrix_world.copy()
        parent = instance.parent if instance.is_instance else None
        name = _name(obj, parent)
        made = volumes.box(self.volume_files, obj, matrix, name, self.report)
        if made is None:
            return
        mesh, medium = made
        export.media[mesh.materials[0]] = medium
        entry = self._new_object(mesh, self._traits(obj, parent))
        export.meshes[entry.object.name] = entry
        # The box is in world space. Its key is that of nothing else, so that it doesn't move.
        entry.placements.append(Placement(name, Matrix.Identity(4), ("volume", entry.object.name), object_info.info(instance)))
        export.links.add(name, _owner(obj, parent))
        export.volumes[key(instance)] = name

    def _reads_object(self, material):
        if material.name not in self.readers:
            self.readers[material.name] = object_info.is_used(material)
        return self.readers[material.name]

    def _materials(self, obj):
        """The materials of an object and of its mesh."""
        if self.layer.material_override is not None:
            return [self.layer.material_override]
        materials = [slot.material for slot in obj.material_slots] + list(obj.data.materials)
        return list({material.name: material for material in materials if material is not None}.values())

    def _traits(self, obj, parent):
        """Visibility to rays where it is off, holdout, shadow catcher and light group, of an instance combined with those of its parent, to
        which the collections of view layers refer."""
        both = [of.original for of in (obj, parent) if of is not None]
        traits = {name: False for name in VISIBILITY if not all(getattr(of, name) for of in both)}
        marks = {name for name in ("is_holdout", "is_shadow_catcher") if any(getattr(of, name) for of in both)}
        if both[-1].holdout_get(view_layer=self.layer):
            marks.add("is_holdout")
        elif both[-1].indirect_only_get(view_layer=self.layer):
            traits = {name: False for name in VISIBILITY if name == "visible_camera" or name in traits}
        traits.update({name: True for name in sorted(marks)})
        group = next(filter(None, map(light_group, both)), None)
        return {**traits, "light_group": group} if group else traits


def _is_instanced_on_parent(instance):
    """Is an object instanced on its parent's vertices or faces? A final render shows only the instances."""
    parent = instance.object.original.parent
    return not instance.is_instance and parent is not None and parent.instance_type in ("VERTS", "FACES")


def _copy_of_edited(mesh):
    """A copy of the mesh of an instance by geometry nodes of an object in Edit Mode, of which plain copies have no corners."""
    edited = bmesh.new()
    edited.from_mesh(mesh)
    copy = bpy.data.meshes.new(mesh.name)
    edited.to_mesh(copy)
    edited.free()
    for material in mesh.materials:
        copy.materials.append(material)
    return copy


def _is_smoke(modifier):
    return modifier.show_render and modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN" and modifier.domain_settings.domain_type == "GAS"


def _name(obj, parent):
    """The name of an object, or of an instance by another object."""
    is_own = parent is None or parent.original == obj.original
    return obj.original.name if is_own else f"{parent.original.name}/{obj.original.name}"


def _owner(obj, parent):
    """The object that collections of light linking contain: of instances the parent."""
    return (obj if parent is None else parent).original


def _object_materials(obj):
    """Materials of slots that are linked to the object instead of its mesh: names by slot."""
    slots = enumerate(obj.material_slots)
    return {i: slot.material.name if slot.material else None for i, slot in slots if slot.link == "OBJECT"}


def _add_missing_uv_maps(mesh):
    """Adds UV maps that materials name and the mesh lacks: they are 0 in Cycles, while oscura would take the default one."""
    trees = (material.node_tree for material in mesh.materials if material is not None and material.node_tree is not None)
    nodes = (node for tree in trees for _, node in node_trees.find_nodes(tree, ("ShaderNodeUVMap",)))
    missing = {node.uv_map for node in nodes if node.uv_map and not node.from_instancer} - set(mesh.attributes.keys())
    for name in sorted(missing)[: max(MAX_UV_MAPS - len(mesh.uv_layers), 0)]:
        mesh.uv_layers.new(name=name, do_init=False)


def _remove_unused_materials(mesh):
    """Materials of no face may be those of strands."""
    counts = np.bincount(meshes.material_indices(mesh), minlength=len(mesh.materials))
    for slot in range(len(mesh.materials)):
        if counts[slot] == 0:
            mesh.materials[slot] = None
