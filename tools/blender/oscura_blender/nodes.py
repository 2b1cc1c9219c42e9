"""Node trees as graphs that oscura evaluates: each node of Blender becomes one of the scene file, without groups, reroutes and muted nodes.
Outputs without a counterpart are baked (`bakes.py`)."""

from . import bakes, mesh_files, node_types
from .node_links import VALUE_NODES, as_triple, constant, converted, default, follow, is_number, zero
from .node_types import Unsupported

# Inputs of the Mapping node by the properties of a texture node's own mapping.
MAPPING = {"location": "translation", "rotation": "rotation", "scale": "scale"}

# Nodes whose normal by default is that of the surface.
BUMPED = ("fresnel", "layer_weight", "ambient_occlusion")


class Graph:
    """The nodes of a tree in a scene file. Values of inputs are numbers, lists of three, or references to outputs ("node.output")."""

    def __init__(self, images=None, baker=None):
        self.nodes = {}  # entries by name
        self.attributes = set()  # names of mesh attributes that nodes read
        self.reads_object = False  # does a node read properties of the object?
        self.images = images
        self.baker = baker if baker is not None else bakes.BakeRequests()
        self._written = {}  # names by node and groups
        self._replaced = {}  # values by output and groups, of outputs that are no nodes

    def add(self, node, groups, entries):
        """Adds a node of Blender, named like it: TOML keys without quotes are ASCII."""
        base = "".join(c if c.isascii() and c.isalnum() else "_" for c in node.name.lower()).strip("_")
        base = base or node.bl_idname.removeprefix("ShaderNode").lower()
        name, number = base, 1
        while name in self.nodes:
            number += 1
            name = f"{base}_{number}"
        self.nodes[name] = entries
        self._written[(node, groups)] = name
        return name

    def new(self, entries):
        """Adds a node that Blender's tree doesn't have."""
        name = f"{entries['type']}_{len(self.nodes)}"
        self.nodes[name] = entries
        return name

    # Arithmetic of values; constants are folded.

    def folded(self, operation, fold, a, b):
        if isinstance(a, str) or isinstance(b, str):
            return self._vector_math(operation, a=a, b=b)
        pairs = zip(as_triple(a), as_triple(b), strict=True)
        return [fold(x, y) for x, y in pairs] if isinstance(a, list) or isinstance(b, list) else fold(a, b)

    def sum(self, a, b):
        return b if is_number(a, 0.0) else a if is_number(b, 0.0) else self.folded("add", lambda x, y: x + y, a, b)

    def difference(self, a, b):
        return a if is_number(b, 0.0) else self.folded("subtract", lambda x, y: x - y, a, b)

    def product(self, a, b):
        if is_number(a, 0.0) or is_number(b, 0.0):
            return 0.0
        return b if is_number(a, 1.0) else a if is_number(b, 1.0) else self.folded("multiply", lambda x, y: x * y, a, b)

    def _vector_math(self, operation, **inputs):
        return f"{self.new({'type': 'vector_math', 'operation': operation, **inputs})}.vector"

    # Inputs.

    def value(self, source, to="RGBA"):
        """The value of a source for an input of a socket type."""
        node = source.node
        if node is None:
            return 0.0 if source.value is None else converted(source.value, source.type, to)
        if node.bl_idname in VALUE_NODES:
            return converted(default(source.output), source.output.type, to)
        if node_types.is_tiled(node):
            return self._once(source, self._tiled)
        if node.bl_idname == "ShaderNodeNewGeometry" and source.output.name == "Normal" and self.bumped_normal() is not None:
            return self.bumped_normal()
        try:
            if (node, source.groups) not in self._written:
                self._write(node, source.groups)
            return f"{self._written[(node, source.groups)]}.{self._output_name(node, source.output)}"
        except Unsupported as reason:
            return self._once(source, lambda source: self._substitute(source, str(reason)))

    def uniform(self, node, socket, groups):
        """The value of an input that may not vary over a surface."""
        source = follow(socket, groups)
        if source.node is None or source.node.bl_idname in VALUE_NODES:
            return self.value(source, socket.type)
        value = constant(socket, groups)
        return self.baker.mean(source, f"{socket.name} of {node.bl_label}", default(socket)) if value is None else value

    def put(self, entries, name, socket, groups, implicit="generated"):
        """Writes an input. Without a link, a vector is a texture coordinate, and a normal that of the surface, which is the default."""
        source = follow(socket, groups)
        if source.is_default and socket.type == "VECTOR" and socket.hide_value:
            if name == "normal" and entries["type"] in BUMPED and self.bumped_normal() is not None:
                entries[name] = self.bumped_normal()
            elif name != "normal" and implicit != "position":
                entries[name] = self.coordinates(implicit)
            return
        entries[name] = self.value(source, socket.type)

    def bumped_normal(self):
        """The normal with bump mapping by displacement, which is that of the surface to other nodes; None without it."""
        return None

    def coordinates(self, output):
        """An output of a Texture Coordinate node."""
        if output == "generated":
            self.attributes.add(mesh_files.GENERATED)
        return self._shared("coordinates", "texture_coordinate", output)

    def surface(self, output):
        """An output of a Geometry node."""
        return self._shared("surface_geometry", "geometry", output)

    def _shared(self, name, kind, output):
        """An output of a node that is added once."""
        self.nodes.setdefault(name, {"type": kind})
        return f"{name}.{output}"

    # Nodes.

    def _write(self, node, groups):
        entries = node_types.entries(self, node, groups)
        if getattr(node, "texture_mapping", None) is not None and "vector" in entries:
            entries["vector"] = self._mapped(entries["vector"], node.texture_mapping)
        self.add(node, groups, entries)

    def _output_name(self, node, output):
        return node_types.output_name(node, output)

    def _mapped(self, vector, mapping):
        """A vector by a texture node's own mapping, which only old files and scripts set: it permutes axes, and then acts as a Mapping node."""
        axes = [mapping.mapping_x, mapping.mapping_y, mapping.mapping_z]
        if axes != list("XYZ"):
            parts = self.new({"type": "separate_xyz", "vector": vector})
            chosen = {out: 0.0 if axis == "NONE" else f"{parts}.{axis.lower()}" for out, axis in zip("xyz", axes)}
            vector = f"{self.new({'type': 'combine_xyz', **chosen})}.vector"
        inputs = {key: list(getattr(mapping, name)) for key, name in MAPPING.items()}
        if inputs == {"location": [0.0] * 3, "rotation": [0.0] * 3, "scale": [1.0] * 3}:
            return vector
        return f"{self.new({'type': 'mapping', 'vector_type': mapping.vector_type.lower(), 'vector': vector, **inputs})}.vector"

    # Outputs that are no nodes of the scene file.

    def _once(self, source, make):
        key = (source.node, source.groups, source.output.identifier)
        if key not in self._replaced:
            self._replaced[key] = make(source)
        return self._replaced[key]

    def _substitute(self, source, reason):
        """The value of an output that oscura doesn't have."""
        if source.node.bl_idname == "ShaderNodeLightPath":
            self.baker.warn(f"{reason} is taken as 0")
            return 0.0
        if getattr(source.node, "from_instancer", False):
            return 0.0
        baked = self.baker.image(source, reason)
        if baked is None:
            return zero(source.output) or 0.0
        file, has_vectors = baked
        color, span = self._baked(file), bakes.VECTOR_RANGE
        return self._vector_math("multiply_add", a=color, b=[span] * 3, c=[-span / 2] * 3) if has_vectors else color

    def _baked(self, file):
        """The color of a baked image."""
        self.attributes.add(bakes.UV_MAP)
        uv = f"{self.new({'type': 'uv_map', 'name': bakes.UV_MAP})}.uv"
        image = {"type": "image_texture", "file": file, "color_space": "non-color", "extension": "extend", "alpha_mode": "none"}
        return f"{self.new({**image, 'vector': uv})}.color"

    def _tiled(self, source):
        """The sum of the tiles of an image (UDIM), each of which is 0 outside its square."""
        node, inputs, total = source.node, {}, None
        self.put(inputs, "vector", node.inputs[0], source.groups, "uv")
        for number, file in self.images.tiles(node.image):
            corner = [float((number - 1001) % 10), float((number - 1001) // 10), 0.0]
            vector = self._vector_math("subtract", a=inputs["vector"], b=corner)
            tile = {"type": "image_texture", **node_types.image_settings(node, file), "extension": "clip", "projection": "flat", "vector": vector}
            value = f"{self.new(tile)}.{node_types.output_name(node, source.output)}"
            total = value if total is None else self._vector_math("add", a=total, b=value)
        return total if total is not None else zero(source.output)
