"""Node trees that ask from where they are seen. What depends on the camera's place alone is rewritten by places; what differs
with the direction is taken as its mean, with a warning."""

from functools import partial

from mathutils import Matrix

from . import shaders, trees

# Nodes whose outputs differ with the direction, and the outputs that do.
DIRECTED = {
    "ShaderNodeFresnel": ("Factor", "Fac"),
    "ShaderNodeLayerWeight": ("Fresnel", "Facing"),
    "ShaderNodeNewGeometry": ("Incoming",),
    "ShaderNodeTexCoord": ("Reflection",),
}
WEIGHTS = ("ShaderNodeFresnel", "ShaderNodeLayerWeight")
OF_CAMERA = ("ShaderNodeCameraData", "ShaderNodeTexCoord")

# From the space of a camera object, in which z is behind, to that of shaders.
AHEAD = Matrix.Diagonal((1, 1, -1, 1))

STEPS = 64

# Rows of a table: evenly spaced cosines from 0 to 1.
ROWS = 64


def rewrite_cameras(material, eye, window):
    """Camera and window coordinates, depths, distances, and vectors in the space of the camera become what follows from the place
    of the camera; `window` is what `camera.window` gives."""
    if eye is None:
        return
    made = {**_BY_EYE, **({"Window": partial(_on_window, window)} if window is not None else {})}
    for tree, node in list(trees.nodes_with_trees(material.node_tree, OF_CAMERA)):
        wanted = [out for out in node.outputs if out.is_linked and out.name in made]
        if not wanted:
            continue
        place = tree.nodes.new("ShaderNodeTexCoord")
        place.object = eye
        # Seen from the camera z is ahead, in its own space behind; its scale doesn't count.
        x, y, z = (column.length for column in eye.matrix_world.to_3x3().col)
        turned = _vector(tree, "MULTIPLY", place.outputs["Object"], (x, y, -z))
        for out in wanted:
            _put(tree, out, made[out.name](tree, turned))
    for tree, node in list(trees.nodes_with_trees(material.node_tree, ("ShaderNodeVectorTransform",))):
        if (node.convert_from == "CAMERA") != (node.convert_to == "CAMERA") and node.outputs[0].is_linked:
            _transform(tree, node, AHEAD @ eye.matrix_world.normalized().inverted())


def _put(tree, out, other):
    for link in list(out.links):
        tree.links.new(other, link.to_socket)


def _on_window(window, tree, place):
    """Window coordinates: 0 to 1 over the picture."""
    if window.is_perspective:
        depth = tree.nodes.new("ShaderNodeCombineXYZ")
        for target in depth.inputs:
            tree.links.new(_part(tree, place, 2), target)
        divided = _vector(tree, "DIVIDE", place)
        tree.links.new(depth.outputs[0], divided.node.inputs[1])
        place = divided
    scaled = _vector(tree, "MULTIPLY", place, (*window.scale, 0.0))
    return _vector(tree, "ADD", scaled, (*window.middle, 0.0))


def _transform(tree, node, to_camera):
    """Puts what a Vector Transform to or from the space of the camera gives in its place: by way of the world."""
    is_point, is_from = node.vector_type == "POINT", node.convert_from == "CAMERA"
    own = tree.nodes.new("ShaderNodeVectorTransform")
    own.vector_type = node.vector_type
    own.convert_from, own.convert_to = ("WORLD", node.convert_to) if is_from else (node.convert_from, "WORLD")
    entry = shaders.source(node.inputs[0]) or trees.constant_node(tree, tuple(node.inputs[0].default_value))
    if is_from:
        tree.links.new(_by_matrix(tree, entry, to_camera.inverted(), is_point), own.inputs[0])
        _put(tree, node.outputs[0], own.outputs[0])
        return
    tree.links.new(entry, own.inputs[0])
    found = _by_matrix(tree, own.outputs[0], to_camera, is_point)
    _put(tree, node.outputs[0], _vector(tree, "NORMALIZE", found) if node.vector_type == "NORMAL" else found)


def _by_matrix(tree, vector, matrix, is_point):
    """A matrix times a vector, or a place."""
    made = tree.nodes.new("ShaderNodeCombineXYZ")
    for row, target in zip(matrix, made.inputs):
        tree.links.new(_vector(tree, "DOT_PRODUCT", vector, row[:3]), target)
    return _vector(tree, "ADD", made.outputs[0], tuple(matrix.translation)) if is_point else made.outputs[0]


def simplify(material, report):
    """Makes Layer Weights of the cosine between view and normal, and lets weights go by the surface's own normal."""
    if material.node_tree is None:
        return
    for tree, node in list(trees.nodes_with_trees(material.node_tree, ("ShaderNodeVectorMath",))):
        if node.operation == "DOT_PRODUCT" and _are_view_and_normal(node):
            _put_cosine(tree, node.outputs["Value"])
    for tree, node in list(trees.nodes_with_trees(material.node_tree, WEIGHTS)):
        links = list(node.inputs["Normal"].links)
        for link in links:
            tree.links.remove(link)
        if links and any(out.is_linked for out in node.outputs):
            report.warn(material.name, f"{node.bl_label} has a normal of its own: it goes by that of the surface")


def _are_view_and_normal(node):
    sources = [shaders.source(entry) for entry in node.inputs[:2]]
    names = {source.name for source in sources if source is not None and source.node.bl_idname == "ShaderNodeNewGeometry"}
    return names == {"Incoming", "Normal"}


def _put_cosine(tree, output):
    """The cosine by a Layer Weight in the place of an output."""
    weight, rest = tree.nodes.new("ShaderNodeLayerWeight"), tree.nodes.new("ShaderNodeMath")
    weight.inputs["Blend"].default_value = 0.5
    rest.operation, rest.inputs[0].default_value = "SUBTRACT", 1.0
    for link in list(output.links):
        tree.links.new(rest.outputs[0], link.to_socket)
    tree.links.new(weight.outputs["Facing"], rest.inputs[1])


def _vector(tree, operation, first, second=None):
    node = tree.nodes.new("ShaderNodeVectorMath")
    node.operation = operation
    tree.links.new(first, node.inputs[0])
    if second is not None:
        node.inputs[1].default_value = second
    return node.outputs["Value"] if operation in ("LENGTH", "DOT_PRODUCT") else node.outputs["Vector"]


def _part(tree, vector, index):
    node = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(vector, node.inputs[0])
    return node.outputs[index]


_BY_EYE = {
    "View Vector": lambda tree, place: _vector(tree, "NORMALIZE", place),
    "View Z Depth": lambda tree, place: _part(tree, place, 2),
    "View Distance": lambda tree, place: _vector(tree, "LENGTH", place),
    "Camera": lambda tree, place: place,
}


def take_means(material, shader, report, mixed=()):
    """Puts means in the place of what differs with the direction, where it reaches the shader; inputs that are mixed by the angle of
    view get what can be told by it later."""
    reached, meant = set(), set()
    for socket in shader.inputs:
        trees.upstream(socket, reached)
        if socket.name not in mixed:
            trees.upstream(socket, meant)
    groups = {node.node_tree for node in reached if getattr(node, "node_tree", None)}
    names = set()
    for tree, node in list(trees.nodes_with_trees(material.node_tree, DIRECTED)):
        if tree == material.node_tree and node not in reached or tree != material.node_tree and not groups:
            continue
        for out in node.outputs:
            if out.is_linked and out.name in DIRECTED[node.bl_idname]:
                _take_mean(tree, node, out, bool(mixed))
                # Of groups it is not known which inputs see what.
                if node in meant if tree == material.node_tree else any(getattr(n, "node_tree", None) for n in meant):
                    names.add(node.bl_label)
    if names:
        report.warn(material.name, f"{' and '.join(sorted(names))} differ with the direction of view: their means are taken")


def _take_mean(tree, node, out, is_mixed):
    if out.name in ("Incoming", "Reflection"):
        # As it is seen head on.
        for link in list(out.links):
            tree.links.new(node.outputs["Normal"], link.to_socket)
        return
    middle = mean(node, out.name)
    made = trees.replace(tree, out, middle)
    if is_mixed and is_known(node):
        made.node[shaders.BY_COSINE] = [*rows(node, out.name), middle]


def mean(node, output):
    """The mean of what a node gives, over all directions by their cosines."""
    return sum(weight(node, output, ((i + 0.5) / STEPS) ** 0.5) for i in range(STEPS)) / STEPS


def weight(node, output, cosine):
    """What a Fresnel or Layer Weight node gives at a cosine."""
    if node.bl_idname == "ShaderNodeFresnel":
        ior = shaders.constant(node.inputs["IOR"])
        return fresnel(cosine, 1.45 if ior is None else max(ior, 1e-5))
    blend = shaders.constant(node.inputs["Blend"])
    blend = 0.5 if blend is None else min(max(blend, 0.0), 1 - 1e-5)
    if output == "Fresnel":
        return fresnel(cosine, 1 / max(1 - blend, 1e-5))
    return 1 - cosine ** (2 * blend if blend < 0.5 else 0.5 / (1 - blend))


def rows(node, output):
    """What a node gives by the cosine."""
    return [weight(node, output, i / (ROWS - 1)) for i in range(ROWS)]


def is_known(node):
    """Is it a weight by the surface's own normal and a constant?"""
    if node.bl_idname not in WEIGHTS or node.inputs["Normal"].is_linked:
        return False
    return shaders.constant(node.inputs["IOR" if node.bl_idname == "ShaderNodeFresnel" else "Blend"]) is not None


def fresnel(cosine, ior):
    """Share of light that a smooth dielectric reflects."""
    g = ior * ior - 1 + cosine * cosine
    if g <= 0:
        return 1.0
    g **= 0.5
    a = (g - cosine) / (g + cosine)
    b = (cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1)
    return 0.5 * a * a * (1 + b * b)


def index_of(share):
    """The index of refraction of a smooth dielectric that reflects this share of light that comes evenly from all sides."""
    low, high = 1.0, 40.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        found = sum(fresnel(((i + 0.5) / STEPS) ** 0.5, middle) for i in range(STEPS)) / STEPS
        low, high = (middle, high) if found < share else (low, middle)
    return 0.5 * (low + high)
