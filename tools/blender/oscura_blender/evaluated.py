"""Meshes as files of their own, and their materials as graphs of nodes in the scene file."""

import os

from . import bakes, geometry, media, mesh_files, node_graph, panes, relief, report as reports, scene_file, shaders, skins, trees
from .scene_file import Y_UP

# Tables of the materials of faces without one, and of what has no surface.
DEFAULT = {"type": "nodes", "surface": "surface", "nodes": {"surface": {"type": "principled_bsdf", "multiscatter": 1.0}}}
BLACK = {"type": "lambert", "color": [0.0, 0.0, 0.0]}
NOTHING = {"type": "nodes", "surface": "surface", "nodes": {"surface": {"type": "transparent_bsdf"}}}

# So many copies of a mesh that stand still are a file of places, not a table each.
LEAST_COPIES = 16

# Inputs that let light into a solid, by the type of their shader; others always do.
REFRACTING = {"principled_bsdf": ("transmission_weight",), "glass_bsdf": None, "refraction_bsdf": None}
PASSING = {**REFRACTING, "principled_bsdf": ("transmission_weight", "subsurface_weight"), "subsurface_scattering": None}


class Material:
    """A material as a table, and what it asks of meshes."""

    def __init__(self, graph, surface=None, medium=None, whole=None):
        self.nodes, self.surface, self.medium = graph.nodes, surface, medium
        self.whole = whole  # the table of what has no surface
        self.brushed, self.bumps = graph.brushed or "", graph.bumps
        self.attributes, self.asks_object = graph.attributes, graph.asks_object
        self.lets_light_in = any(_passes(node, PASSING) for node in graph.nodes.values())
        self.refracts = any(_passes(node, REFRACTING) for node in graph.nodes.values())
        self.maps_normals = any(node["type"] == "normal_map" and node["space"] == "tangent" for node in graph.nodes.values())
        self.scatters_within = any(node_graph.scatters_within(node) for node in graph.nodes.values())

    def table(self, is_solid):
        if self.whole is not None:
            return self.whole
        entries = {"type": "nodes", "surface": self.surface, "up": "z"}
        if self.bumps is not None:
            entries["bumps"] = self.bumps
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
        self.meshes = self.places = 0  # files of meshes, and of places of copies
        self._tables = {}  # by material and whether it fills solids

    def add(self, material, is_solid, name):
        """The name of a material's table; None is Blender's default. A name means one material: others are called otherwise."""
        key = (material, is_solid)
        if key not in self._tables:
            self._tables[key] = DEFAULT if material is None else material.table(is_solid)
        table = self._tables[key]
        while self.materials.get(name, table) is not table:
            name += " "
        self.materials[name] = table
        return name

    def tables(self):
        named = [(f"[materials.{scene_file.value(name)}]", entries) for name, entries in sorted(self.materials.items())]
        return named + [("[[objects]]", entries) for entries in self.objects]


class Materials:
    """The materials of an export as graphs."""

    def __init__(self, images, told):
        self.images, self.told = images, told
        self.found, self.store, self.options, self.report = told
        self._known = {}

    def on(self, holder, material):
        """A material on a mesh: those of which something is baked are others on each."""
        if material not in self._known:
            requests = bakes.BakeRequests()
            self._known[material] = self._read(material, requests)
            if requests.reasons:
                self._known[material] = None
            else:
                for message in requests.warnings:
                    self.report.warn(material.name, message)
        return self._known[material] or self._read(material, bakes.Baker(holder, material, self.told))

    def _read(self, material, baker):
        graph, exposure = node_graph.Graph(self.found.exposure, self.images, baker), self.found.exposure
        if material in self.found.media:
            return Material(graph, whole=self.found.media[material] or NOTHING)
        if material.node_tree is None or not material.use_nodes:
            return Material(graph, graph.made({"type": "diffuse_bsdf", "color": list(material.diffuse_color)[:3]}))
        end = shaders.end(material.node_tree)
        if end is None:
            return Material(graph, whole=BLACK)
        self._add_bumps(graph, material)
        if any(node.outputs[0].is_linked for _, node in trees.nodes_with_trees(material.node_tree, (node_graph.SHADER_TO_RGB,))):
            baker.warn("Shader to RGB is left out, as Cycles does: inputs that it is linked to have their own values")
        medium, is_lost = None, False
        try:
            filling = media.read(end.inputs["Volume"], exposure)
            medium = None if filling.is_nothing() else filling.entries()
            graph.asks_object |= filling.asks_object
        except media.Varying as varying:
            is_lost = True
            baker.warn(f"its volume can't be evaluated ({varying}) and is left out")
        surface = graph.shader(node_graph.feed(end.inputs["Surface"]))
        if surface is None and (medium is not None or is_lost):
            return Material(graph, whole=NOTHING if medium is None else {"type": "medium", **medium})
        return Material(graph, whole=BLACK) if surface is None else Material(graph, surface, medium)

    @staticmethod
    def _add_bumps(graph, material):
        """Displacement that is meant as bumps."""
        node = relief.bumps(material)
        if node is not None:
            height, scale = (graph.value(node_graph.feed(node.inputs[name]), "VALUE") for name in ("Height", "Scale"))
            graph.relief = height, scale, relief.object_scale(material, node)


def take(found, moves, told, images):
    """Writes all that was collected."""
    _, _, options, report = told
    made, known = Evaluated(options.folder, options.name), Materials(images, told)
    holders = [holder for holder in found.objects.values() if holder is not None]
    relief.displace(holders, found, report)
    for holder in holders:
        _write(made, holder, known, (found, moves), report)
    return made


def _write(made, holder, known, told, report):
    """Writes a mesh, and adds its materials and placements."""
    mesh, (found, moves) = holder.data, told
    shown = [known.on(holder, material) if material is not None else None for material in mesh.materials]
    for slot, entry in enumerate(shown):
        if entry is not None and entry.whole is None and entry.scatters_within:
            skins.close(holder, slot, report)
    shapes = moves.shapes_of(holder, found.placements[holder.name][0].mark[0], report) if moves is not None else None
    is_solid = not bool((skins.sides_of_edges(mesh) == 1).any())
    listed, attributes, asks_object = [], set(), False
    for slot, (material, entry) in enumerate(zip(mesh.materials, shown) if shown else [(None, None)]):
        is_filled = entry is not None and entry.lets_light_in and (is_solid or entry.medium is not None)
        if entry is not None and entry.refracts and not is_filled:
            panes.tell_of_upright(holder, slot, found, report)
        name = reports.ALIASES.get(material.name, material.name) if material is not None else "default"
        listed.append(made.add(entry, is_filled, name))
        if entry is not None:
            attributes |= entry.attributes
            asks_object |= entry.asks_object
    file = f"{made.name}.mesh{made.meshes}.ply"
    made.meshes += 1
    axes = [entry.brushed if entry is not None else "" for entry in shown]
    has_maps = any(entry is not None and entry.maps_normals for entry in shown)
    written = mesh_files.MeshFile(mesh, attributes, axes, has_maps)
    written.write(os.path.join(made.folder, file))
    keys = _shapes(made, written, file, (moves, shapes)) if shapes is not None else []
    extras = found.extras.get(holder.name, {})
    traits, group = geometry.traits_of(extras), extras.get("light_group")
    shared = {"mesh": file, "materials": listed, **traits, **({"mesh_keys": keys} if keys else {}), **({"light_group": group} if group else {})}
    still = {}  # matrices and infos by name
    for name, matrix, mark, info in found.placements[holder.name]:
        if _is_nothing(matrix):
            continue
        info, motion = info if asks_object else {}, _motion(mark, moves)
        if motion is None:
            still.setdefault(name, []).append((matrix, info))
        else:
            made.objects.append({"name": name, **shared, "motion": motion, **info, **found.links.shining.get(name, {})})
    for name, copies in still.items():
        entries = {"name": name, **shared, **found.links.shining.get(name, {})}
        if len(copies) >= LEAST_COPIES:
            file = f"{made.name}.places{made.places}.ply"
            made.places += 1
            mesh_files.write_places(os.path.join(made.folder, file), copies)
            made.objects.append({**entries, "instances": file})
        else:
            made.objects += ({**entries, "transform": scene_file.placed(Y_UP @ matrix), **info} for matrix, info in copies)


def _is_nothing(matrix):
    """Does a matrix leave a line or a point of an object? A scale of 0 along one axis leaves something flat."""
    x, y, z = matrix.to_3x3().col
    return all(a.cross(b).length < 1e-30 for a, b in ((x, y), (y, z), (z, x)))


def _motion(mark, moves):
    """The motion of an object; None of one that stands still."""
    matrices = moves.of(mark) if moves is not None else None
    if matrices is None:
        return None
    return {"keys": [{"frame": frame, "transform": scene_file.placed(Y_UP @ then)} for frame, then in zip(moves.offsets, matrices)]}


def _shapes(made, written, file, told):
    """Writes the shapes of a mesh that deforms; gives its `mesh_keys`."""
    (moves, shapes), keys = told, []
    for number, (frame, shape) in enumerate(zip(moves.offsets, shapes)):
        name = file if frame == 0.0 else file.replace(".ply", f".{number}.ply")
        if frame != 0.0:
            written.write_shape(os.path.join(made.folder, name), shape)
        keys.append({"frame": frame, "mesh": name})
    return keys
