"""Materials as tables of the scene file."""

from . import bakes, closures, displacement, media, node_trees
from .node_links import SHADER_TO_RGB, constant, follow, is_number, output_node
from .node_types import Unsupported

# Tables of faces without a material, and of materials without a surface.
DEFAULT = {"type": "nodes", "surface": "surface", "nodes": {"surface": {"type": "principled_bsdf", "multiscatter": 1.0}}}
BLACK = {"type": "lambert", "color": [0.0, 0.0, 0.0]}
TRANSPARENT = {"type": "nodes", "surface": "surface", "nodes": {"surface": {"type": "transparent_bsdf"}}}

# Inputs that transmit light into an object, by type of shader; None for shaders that always do.
REFRACTIVE = {"principled_bsdf": ("transmission_weight",), "glass_bsdf": None, "refraction_bsdf": None}
TRANSMISSIVE = {**REFRACTIVE, "principled_bsdf": ("transmission_weight", "subsurface_weight"), "subsurface_scattering": None}


class Material:
    """A material: its table, and what it needs of meshes."""

    def __init__(self, graph, surface=None, medium=None, fixed=None):
        self.nodes, self.surface, self.medium = graph.nodes, surface, medium
        self.fixed = fixed  # the table of a material without a surface
        self.tangent_axis, self.bumps, self.displacement = graph.tangent_axis or "", graph.bumps, graph.displacement
        self.attributes, self.reads_object = graph.attributes, graph.reads_object
        nodes = graph.nodes.values()
        self.is_transmissive = any(_has_input(node, TRANSMISSIVE) for node in nodes)
        self.is_refractive = any(_has_input(node, REFRACTIVE) for node in nodes)
        self.has_normal_maps = any(node["type"] == "normal_map" and node["space"] == "tangent" for node in nodes)
        self.has_subsurface = fixed is None and any(closures.has_subsurface(node) for node in nodes)

    def table(self, is_solid):
        """The table on meshes that enclose a volume, or on others."""
        if self.fixed is not None:
            return self.fixed
        entries = {"type": "nodes", "surface": self.surface, "up": "z"}
        if self.bumps is not None:
            entries["bumps"] = self.bumps
        if self.displacement is not None:
            entries["displacement"] = self.displacement
        if self.is_transmissive and is_solid:
            entries["volume"] = True
            if self.medium is not None:
                entries["medium"] = self.medium
        return {**entries, "nodes": self.nodes}


def _has_input(node, table):
    if node["type"] not in table:
        return False
    inputs = table[node["type"]]
    return inputs is None or any(node.get(name, 0.0) != 0.0 for name in inputs)


class Materials:
    def __init__(self, export):
        self.export = export
        self._known = {}  # None for materials that are baked, which differ from mesh to mesh

    def on(self, entry, material):
        """A material on a mesh."""
        if material not in self._known:
            requests = bakes.BakeRequests()
            read = self._read(material, requests)
            self._known[material] = None if requests.reasons else read
            for message in () if requests.reasons else requests.warnings:
                self.export.report.warn(material.name, message)
        return self._known[material] or self._read(material, bakes.Baker(self.export, entry, material))

    def _read(self, material, baker):
        graph = closures.SurfaceGraph(self.export.exposure, self.export.images, baker)
        if material in self.export.media:
            return Material(graph, fixed=self.export.media[material] or TRANSPARENT)
        tree = node_trees.tree_of(material)
        if tree is None:
            return Material(graph, graph.new({"type": "diffuse_bsdf", "color": list(material.diffuse_color)[:3]}))
        end = output_node(tree)
        if end is None:
            return Material(graph, fixed=BLACK)
        displacement.read(graph, material)
        if node_trees.has_linked(tree, (SHADER_TO_RGB,)):
            baker.warn("Shader to RGB is ignored, as in Cycles: inputs that it is linked to have their own values")
        medium, is_lost = None, False
        try:
            volume = media.read(end.inputs["Volume"], self.export)
            medium = None if volume.is_empty() else volume.entries()
            graph.reads_object |= volume.reads_object
        except Unsupported as reason:
            is_lost = True
            baker.warn(f"its volume is left out, since it can't be evaluated: {reason}")
        source = follow(end.inputs["Surface"])
        is_invisible = medium is not None and _is_invisible(source)
        surface = None if is_invisible else graph.shader(source)
        if surface is not None:
            return Material(graph, surface, medium)
        if medium is not None:
            return Material(graph, fixed={"type": "medium", **medium})
        return Material(graph, fixed=TRANSPARENT if is_lost else BLACK)


def _is_invisible(source):
    """Is a surface a white Transparent shader, which does nothing besides bounding a volume?"""
    if source.node is None or source.node.bl_idname != "ShaderNodeBsdfTransparent":
        return False
    color = constant(source.node.inputs["Color"], source.groups)
    return color is not None and is_number(color, 1.0)
