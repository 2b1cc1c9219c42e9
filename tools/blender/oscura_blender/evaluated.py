"""What oscura evaluates itself: meshes whose materials are graphs of nodes it knows go to files of their own, with their materials in
the file of settings. What is left is baked and goes into the model."""

import os

import numpy as np

from . import geometry, media, mesh_files, node_graph, panes, report as reports, shaders, sidecar, skins
from .glb import Y_UP

# Tables of the materials of faces without one, and of what has no surface.
DEFAULT = {"type": "nodes", "surface": "surface", "nodes": {"surface": {"type": "principled_bsdf"}}}
BLACK = {"type": "lambert", "color": [0.0, 0.0, 0.0]}

# Inputs that let light into a solid, by the type of their shader; others always do.
REFRACTING = {"principled_bsdf": ("transmission_weight",), "glass_bsdf": None, "refraction_bsdf": None}
PASSING = {**REFRACTING, "principled_bsdf": ("transmission_weight", "subsurface_weight"), "subsurface_scattering": None}


class Material:
    """A material as a table, and what it asks of meshes."""

    def __init__(self, material, graph, surface, medium):
        self.material, self.nodes, self.surface, self.medium = material, graph.nodes, surface, medium
        self.attributes, self.asks_object = graph.attributes, graph.asks_object
        self.lets_light_in = any(_passes(node, PASSING) for node in graph.nodes.values())
        self.refracts = any(_passes(node, REFRACTING) for node in graph.nodes.values())
        self.scatters_within = any(node_graph.scatters_within(node) for node in graph.nodes.values())

    def table(self, is_solid):
        if self.surface is None:
            return BLACK
        entries = {"type": "nodes", "surface": self.surface, "up": "z"}
        if self.lets_light_in and is_solid:
            entries["volume"] = True
            if self.medium is not None:
                entries["medium"] = self.medium
        return {**entries, "nodes": self.nodes}


def _passes(node, passing):
    """Does a node let light into a solid, by a table of inputs?"""
    if node["type"] not in passing:
        return False
    inputs = passing[node["type"]]
    return inputs is None or any(node.get(name, 0.0) != 0.0 for name in inputs)


class Evaluated:
    """The meshes that oscura evaluates, with their materials and placements."""

    def __init__(self, folder, name):
        self.folder, self.name = folder, name
        self.materials = {}  # tables by name
        self.objects = []  # tables of objects
        self.meshes = 0  # files of meshes
        self._tables = {}  # by material and whether it fills solids

    def add(self, material, is_solid, name, others):
        """The name of a material's table, which is none of others that mean something else; None is Blender's default."""
        key = (material, is_solid)
        if key not in self._tables:
            self._tables[key] = DEFAULT if material is None else material.table(is_solid)
        table = self._tables[key]
        while name in others or self.materials.get(name, table) is not table:
            name += " "
        self.materials[name] = table
        return name

    def tables(self):
        named = [(f"[materials.{sidecar.value(name)}]", entries) for name, entries in sorted(self.materials.items())]
        return named + [("[[objects]]", entries) for entries in self.objects]


class Materials:
    """Which materials oscura evaluates."""

    def __init__(self, images, exposure):
        self.reasons = {}  # why others are not, by material
        self._images, self._exposure = images, exposure
        self._known = {}

    def get(self, material):
        """A material that is evaluated; None for others."""
        if material not in self._known:
            self._known[material] = _read(material, self._exposure, self._images, self.reasons)
        return self._known[material]


def take(found, known, moves, options, report):
    """Takes what oscura can evaluate out of what was collected."""
    made = Evaluated(options.folder, options.name)
    taken = {key: h for key, h in found.objects.items() if h is not None and _is_taken(h, known, found)}
    kept = (holder for key, holder in found.objects.items() if holder is not None and key not in taken)
    baked = {material for holder in kept for material in holder.data.materials if material is not None}
    # A name means one material: those that the model has as well are called otherwise.
    names = {material.name for material in baked}
    for key, holder in taken.items():
        del found.objects[key]
        _write(made, holder, known, names, (found, moves), report)
    for material, reason in known.reasons.items():
        if material in baked:
            report.note(material.name, f"is baked, since oscura doesn't evaluate it: {reason}")
    return made


def _read(material, exposure, images, reasons):
    """A material's graph; None where it can't be expressed."""
    try:
        if material.node_tree is None or not material.use_nodes:
            raise node_graph.Unsupported("no node tree")
        end = shaders.end(material.node_tree)
        graph = node_graph.Graph(exposure, images)
        if end is None:
            return Material(material, graph, None, None)
        if end.inputs["Displacement"].is_linked:
            raise node_graph.Unsupported("displacement")
        filling = media.read(end.inputs["Volume"])
        surface = graph.shader(node_graph.feed(end.inputs["Surface"]))
        if surface is None and not filling.is_nothing():
            raise node_graph.Unsupported("a volume without a surface")
        return Material(material, graph, surface, None if filling.is_nothing() else filling.entries(exposure))
    except node_graph.Unsupported as reason:
        reasons[material] = str(reason)
    except media.Varying as reason:
        reasons[material] = f"a volume that varies ({reason})"
    return None


def _is_taken(holder, known, found):
    """Can a mesh be written with its materials?"""
    if holder.name in found.volumes or any(known.get(m) is None for m in holder.data.materials if m is not None):
        return False
    return not any(mark[0] == "volume" for mark in found.marks[holder.name])


def _write(made, holder, known, names, told, report):
    """Writes a mesh, and adds its materials and placements."""
    mesh, (found, moves) = holder.data, told
    shown = [known.get(material) if material is not None else None for material in mesh.materials]
    for slot, entry in enumerate(shown):
        if entry is not None and entry.scatters_within:
            skins.close(holder, slot, report)
    shapes = moves.shapes_of(holder, found.marks[holder.name][0][0], report) if moves is not None else None
    is_solid = not bool((skins.sides_of_edges(mesh) == 1).any())
    listed, attributes, asks_object = [], set(), False
    for slot, (material, entry) in enumerate(zip(mesh.materials, shown) if shown else [(None, None)]):
        is_filled = entry is not None and entry.lets_light_in and (is_solid or entry.medium is not None)
        if entry is not None and entry.refracts and not is_filled:
            panes.tell_of_upright(holder, slot, found, report)
        name = reports.ALIASES.get(material.name, material.name) if material is not None else "default"
        listed.append(made.add(entry, is_filled, name, names))
        if entry is not None:
            attributes |= entry.attributes
            asks_object |= entry.asks_object
    file = f"{made.name}.mesh{made.meshes}.ply"
    made.meshes += 1
    written = mesh_files.MeshFile(mesh, attributes)
    written.write(os.path.join(made.folder, file))
    keys = _shapes(made, written, file, (moves, shapes)) if shapes is not None else []
    extras = found.extras.get(holder.name, {})
    traits, group = geometry.traits_of(extras), extras.get("light_group")
    for (name, matrix), info, mark in zip(found.placements[holder.name], found.infos[holder.name], found.marks[holder.name]):
        if abs(matrix.to_3x3().determinant()) < 1e-30:
            continue
        entries = {"name": name, "mesh": file, "materials": listed, **_place(matrix, mark, moves), **traits}
        if keys:
            entries["mesh_keys"] = keys
        if group:
            entries["light_group"] = group
        if asks_object:
            entries.update(info)
        entries.update(found.links.shining.get(name, {}))
        made.objects.append(entries)


def _place(matrix, mark, moves):
    """Where an object is: its transform, or its motion in place of one."""
    turned = lambda matrix: [{"matrix": [float(x) for row in Y_UP @ matrix for x in row]}]
    matrices = moves.of(mark) if moves is not None else None
    if matrices is None or any(abs(then.to_3x3().determinant()) < 1e-30 for then in matrices):
        return {"transform": turned(matrix)}
    return {"motion": {"keys": [{"frame": frame, "transform": turned(then)} for frame, then in zip(moves.frames(), matrices)]}}


def _shapes(made, written, file, told):
    """Writes the shapes of a mesh that deforms; gives its `mesh_keys`."""
    (moves, shapes), keys = told, []
    for number, (frame, offset, shape) in enumerate(zip(moves.frames(), moves.offsets, shapes)):
        name = file if offset == 0.0 else file.replace(".ply", f".{number}.ply")
        if offset != 0.0:
            written.write_shape(os.path.join(made.folder, name), shape)
        keys.append({"frame": frame, "mesh": name})
    return keys
