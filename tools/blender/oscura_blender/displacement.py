"""Displacement: a vector in world space, by which the renderer moves the vertices of meshes, and bump mapping. With the method Displacement and Bump,
normals stay those of the undisplaced mesh."""

from .node_links import follow, is_number, output_node

DISPLACEMENT, VECTOR_DISPLACEMENT = "ShaderNodeDisplacement", "ShaderNodeVectorDisplacement"


def read(graph, material):
    """Adds a material's displacement to its graph: of vertices, or by bump mapping, or both."""
    source = follow(output_node(material.node_tree).inputs["Displacement"])
    node, method = source.node, material.displacement_method
    if node is None:
        return
    is_height = node.bl_idname == DISPLACEMENT
    if method != "DISPLACEMENT" and is_height:
        height, scale = (graph.value(follow(node.inputs[name], source.groups), "VALUE") for name in ("Height", "Scale"))
        # One for object space, and one where Cycles computes slopes in that space.
        graph.bump_mapping = height, scale, float(node.space == "OBJECT") + float(method == "BOTH")
    if method == "BUMP" and is_height:
        return
    vector = _VECTORS.get(node.bl_idname, lambda graph, source: graph.value(source, "VECTOR"))(graph, source)
    if method != "BUMP" and not is_number(vector, 0.0):
        graph.displacement = {"vector": vector, "keep_normals": method == "BOTH"}
    if method != "DISPLACEMENT" and not is_height and isinstance(vector, str):
        # Cycles takes the part along the normal.
        along = graph.new({"type": "vector_math", "operation": "dot_product", "a": vector, "b": graph.surface("normal")})
        graph.bump_mapping = f"{along}.value", 1.0, float(method == "BOTH")


def _height(graph, source):
    """A height along a normal."""
    node = source.node
    height, middle, scale = (_number(graph, node.inputs[name], source.groups) for name in ("Height", "Midlevel", "Scale"))
    offset = graph.product(graph.difference(height, middle), scale)
    if is_number(offset, 0.0):
        return offset
    linked = follow(node.inputs["Normal"], source.groups)
    normal = graph.value(linked, "VECTOR") if linked.node is not None else graph.surface("normal")
    if node.space == "WORLD":
        return graph.product(normal, offset)
    return _to_world(graph, graph.product(_to_object(graph, "normal", normal), offset))


def _vector(graph, source):
    """A vector in world, object or tangent space."""
    node = source.node
    middle, scale = (_number(graph, node.inputs[name], source.groups) for name in ("Midlevel", "Scale"))
    vector = graph.product(graph.difference(graph.value(follow(node.inputs["Vector"], source.groups), "VECTOR"), middle), scale)
    if node.space == "TANGENT":
        vector = _from_tangent_space(graph, vector)
    return vector if node.space == "WORLD" or is_number(vector, 0.0) else _to_world(graph, vector)


def _number(graph, socket, groups):
    """The value of an input that is a number; vectors and colors are converted."""
    source = follow(socket, groups)
    value = graph.value(source, "VALUE")
    if not isinstance(value, str) or source.output.type in ("VALUE", "INT", "BOOLEAN"):
        return value
    return f"{graph.new({'type': 'math', 'operation': 'add', 'a': value, 'b': 0.0})}.value"


_VECTORS = {DISPLACEMENT: _height, VECTOR_DISPLACEMENT: _vector}


def _from_tangent_space(graph, vector):
    """A vector along the tangent, the normal and the bitangent of the UV map in object space."""
    # Normal maps of these colors are the tangent and the bitangent.
    maps = ({"type": "normal_map", "space": "tangent", "color": color} for color in ([1.0, 0.5, 0.5], [0.5, 1.0, 0.5]))
    tangent, bitangent = (f"{graph.new(entries)}.normal" for entries in maps)
    parts = graph.new({"type": "separate_xyz", "vector": vector})
    total = 0.0
    for axis, part in ((tangent, "x"), (graph.surface("normal"), "y"), (bitangent, "z")):
        total = graph.sum(total, graph.product(_to_object(graph, "normal", axis), f"{parts}.{part}"))
    return total


def _to_object(graph, kind, vector):
    return _transform(graph, kind, vector, "world", "object")


def _to_world(graph, vector):
    return _transform(graph, "vector", vector, "object", "world")


def _transform(graph, kind, vector, source, target):
    return f"{graph.new({'type': 'vector_transform', 'vector_type': kind, 'convert_from': source, 'convert_to': target, 'vector': vector})}.vector"
