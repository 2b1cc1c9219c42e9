"""Node trees of worlds as graphs that oscura evaluates in each direction: their points are those of the unit sphere."""

from . import node_graph, shaders
from .node_graph import Unsupported, as_triple, feed

BLACK = [0.0, 0.0, 0.0]

# What coordinates and places of a world are, by the names of outputs: shares of the direction. A world is seen from within.
DIRECTIONS = {
    "ShaderNodeTexCoord": {"Generated": 1.0, "Object": 1.0, "Normal": -1.0, "Reflection": -1.0, "UV": 0.0},
    "ShaderNodeNewGeometry": {"Position": 1.0, "Normal": -1.0, "True Normal": -1.0, "Incoming": -1.0},
}

# Nodes that ask about a surface or the camera.
OF_SURFACES = {
    "ShaderNodeBump", "ShaderNodeNormalMap", "ShaderNodeTangent", "ShaderNodeObjectInfo", "ShaderNodeCameraData", "ShaderNodeWireframe",
    "ShaderNodeVectorTransform", "ShaderNodeLightPath", "ShaderNodeUVMap", "ShaderNodeAttribute", "ShaderNodeVertexColor",
}  # fmt: skip


class NoBaker:
    """Where nothing can be baked: worlds have no surface."""

    def image(self, found, reason):
        raise Unsupported(reason)

    def warn(self, message):
        raise Unsupported(message)


class WorldGraph(node_graph.Graph):
    """The graph of the radiance of a world. `sky` gives the file of the picture of a sky node."""

    def __init__(self, images, sky):
        super().__init__(images=images, baker=NoBaker())
        self._sky = sky

    def radiance(self, found):
        """The light of what feeds the surface of a world: a number, a triple, or the output of a node."""
        node = found.node
        if node is None or found.output.type != "SHADER":
            return self.value(found)
        kind, groups = node.bl_idname, found.groups
        if kind in ("ShaderNodeBackground", "ShaderNodeEmission"):
            color, strength = (self.value(feed(node.inputs[key], groups), to) for key, to in (("Color", "RGBA"), ("Strength", "VALUE")))
            return self.product(color, strength)
        if kind == "ShaderNodeAddShader":
            return self.sum(*(self.radiance(feed(socket, groups)) for socket in node.inputs))
        if kind == "ShaderNodeMixShader":
            factor, (first, second) = self.value(feed(node.inputs[0], groups), "VALUE"), node.inputs[1:3]
            if isinstance(factor, str):
                a, b = (as_triple(self.radiance(feed(socket, groups))) for socket in (first, second))
                return f"{self.made({'type': 'mix', 'data_type': 'vector', 'factor': factor, 'a': a, 'b': b})}.result"
            factor = min(max(factor, 0.0), 1.0)
            parts = [self.product(self.radiance(feed(part, groups)), share) for part, share in ((first, 1 - factor), (second, factor)) if share > 0]
            return self.sum(*parts, *[0.0] * (2 - len(parts)))
        return 0.0  # surfaces and volumes shine not

    def value(self, found, to="RGBA"):
        if found.node is not None and found.node.bl_idname in DIRECTIONS:
            share = DIRECTIONS[found.node.bl_idname].get(found.output.name)
            if share is None or getattr(found.node, "object", None) is not None:
                raise Unsupported(f"{found.output.name} of {found.node.bl_label}")
            return self._direction(share)
        return super().value(found, to)

    def _write(self, node, groups):
        kind = node.bl_idname
        if kind in OF_SURFACES or getattr(node, "projection", "FLAT") == "BOX":
            raise Unsupported(node.bl_label)
        if kind != "ShaderNodeTexSky":
            return super()._write(node, groups)
        file = self._sky(node)
        entries = {"type": "environment_texture", "file": file, "color_space": "linear"}
        self.put(entries, "vector", node.inputs[0], groups)
        self._add(node, groups, entries)

    def _output(self, node, socket):
        return "color" if node.bl_idname == "ShaderNodeTexSky" else super()._output(node, socket)

    def coordinates(self, output):
        return self._direction(0.0 if output == "uv" else 1.0)

    def _direction(self, share):
        if share == 0.0:
            return BLACK
        if "direction" not in self.nodes:
            self.nodes["direction"] = {"type": "geometry"}
        if share == 1.0:
            return "direction.position"
        if "back" not in self.nodes:
            self.nodes["back"] = {"type": "vector_math", "operation": "scale", "a": "direction.position", "scale": share}
        return "back.vector"


def read(world, images, sky):
    """The radiance of a world, an even colour or the entries of a texture.

    Raises `Unsupported` where oscura can't evaluate something of it."""
    end = shaders.end(world.node_tree)
    if end is None:
        return BLACK
    graph = WorldGraph(images, sky)
    radiance = graph.radiance(feed(end.inputs["Surface"]))
    if not isinstance(radiance, str):
        return [max(c, 0.0) for c in as_triple(radiance)]
    needed = _needed(graph.nodes, radiance)
    return {"type": "nodes", "up": "z", "result": radiance, "nodes": {name: graph.nodes[name] for name in graph.nodes if name in needed}}


def _needed(nodes, result):
    """The names of the nodes that a result needs."""
    found, pending = set(), [result]
    while pending:
        name = pending.pop().rpartition(".")[0]
        if name in nodes and name not in found:
            found.add(name)
            pending += [value for value in nodes[name].values() if isinstance(value, str) and "." in value]
    return found
