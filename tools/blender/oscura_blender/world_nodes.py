"""Node trees of worlds, evaluated for each direction as a point on the unit sphere."""

from . import nodes
from .node_links import as_triple, follow, output_node
from .node_types import Unsupported

BLACK = [0.0, 0.0, 0.0]

# Outputs that are multiples of the direction; normals point inwards.
DIRECTIONS = {
    "ShaderNodeTexCoord": {"Generated": 1.0, "Object": 1.0, "Normal": -1.0, "Reflection": -1.0, "UV": 0.0},
    "ShaderNodeNewGeometry": {"Position": 1.0, "Normal": -1.0, "True Normal": -1.0, "Incoming": -1.0},
}

# Nodes that depend on a surface or the camera.
SURFACE_NODES = {
    "ShaderNodeBump", "ShaderNodeNormalMap", "ShaderNodeTangent", "ShaderNodeObjectInfo", "ShaderNodeCameraData", "ShaderNodeWireframe",
    "ShaderNodeVectorTransform", "ShaderNodeLightPath", "ShaderNodeUVMap", "ShaderNodeAttribute", "ShaderNodeVertexColor",
}  # fmt: skip


class NoBaker:
    """Worlds have no surface to bake on."""

    def image(self, source, reason):
        raise Unsupported(reason)

    def warn(self, message):
        raise Unsupported(message)


class WorldGraph(nodes.Graph):
    """The nodes of a world's radiance. `sky_file` returns the image of a sky texture."""

    def __init__(self, images, sky_file):
        super().__init__(images, NoBaker())
        self._sky_file = sky_file

    def radiance(self, source):
        """The radiance of a source: a number, a list of three, or a reference to an output."""
        node, groups = source.node, source.groups
        if node is None or source.output.type != "SHADER":
            return self.value(source)
        if node.bl_idname in ("ShaderNodeBackground", "ShaderNodeEmission"):
            color, strength = (node.inputs[name] for name in ("Color", "Strength"))
            return self.product(self.value(follow(color, groups), "RGBA"), self.value(follow(strength, groups), "VALUE"))
        parts = lambda sockets: (self.radiance(follow(socket, groups)) for socket in sockets)
        if node.bl_idname == "ShaderNodeAddShader":
            return self.sum(*parts(node.inputs))
        if node.bl_idname == "ShaderNodeMixShader":
            factor = self.value(follow(node.inputs[0], groups), "VALUE")
            if isinstance(factor, str):
                a, b = map(as_triple, parts(node.inputs[1:3]))
                return f"{self.new({'type': 'mix', 'data_type': 'vector', 'factor': factor, 'a': a, 'b': b})}.result"
            total, factor = 0.0, min(max(factor, 0.0), 1.0)
            for socket, weight in zip(node.inputs[1:3], (1 - factor, factor)):
                if weight > 0:
                    total = self.sum(total, self.product(next(parts([socket])), weight))
            return total
        return 0.0  # other shaders don't emit

    def value(self, source, to="RGBA"):
        if source.node is not None and source.node.bl_idname in DIRECTIONS:
            factor = DIRECTIONS[source.node.bl_idname].get(source.output.name)
            if factor is None or getattr(source.node, "object", None) is not None:
                raise Unsupported(f"{source.output.name} of {source.node.bl_label}")
            return self._direction(factor)
        return super().value(source, to)

    def _write(self, node, groups):
        if node.bl_idname in SURFACE_NODES or getattr(node, "projection", "FLAT") == "BOX":
            raise Unsupported(node.bl_label)
        if node.bl_idname != "ShaderNodeTexSky":
            return super()._write(node, groups)
        entries = {"type": "environment_texture", "file": self._sky_file(node), "color_space": "linear"}
        self.put(entries, "vector", node.inputs[0], groups)
        self.add(node, groups, entries)

    def _output_name(self, node, output):
        return "color" if node.bl_idname == "ShaderNodeTexSky" else super()._output_name(node, output)

    def coordinates(self, output):
        return self._direction(0.0 if output == "uv" else 1.0)

    def _direction(self, factor):
        """The direction times 0, 1 or -1."""
        if factor == 0.0:
            return BLACK
        self.nodes.setdefault("direction", {"type": "geometry"})
        if factor == 1.0:
            return "direction.position"
        self.nodes.setdefault("back", {"type": "vector_math", "operation": "scale", "a": "direction.position", "scale": factor})
        return "back.vector"


def read(world, images, sky_file):
    """The radiance of a world: a color, or the entries of a texture. Raises `Unsupported` for what oscura can't evaluate."""
    end = output_node(world.node_tree)
    if end is None:
        return BLACK
    graph = WorldGraph(images, sky_file)
    radiance = graph.radiance(follow(end.inputs["Surface"]))
    if not isinstance(radiance, str):
        return [max(c, 0.0) for c in as_triple(radiance)]
    used = _used(graph.nodes, radiance)
    return {"type": "nodes", "up": "z", "result": radiance, "nodes": {name: graph.nodes[name] for name in graph.nodes if name in used}}


def _used(nodes, result):
    """The names of nodes that a result depends on."""
    found, pending = set(), [result]
    while pending:
        name = pending.pop().rpartition(".")[0]
        if name in nodes and name not in found:
            found.add(name)
            pending += [value for value in nodes[name].values() if isinstance(value, str) and "." in value]
    return found
