"""Nodes that oscura can't evaluate (ambient occlusion, bevel, scripts, ...): Cycles bakes what they give to pictures of floats, on texture
coordinates made for it, and image nodes stand in their place. Of inputs that may not vary over a surface the mean is taken."""

import os

import bpy
import numpy as np

from . import cache, fingerprint, glow, shaders, trees

UV = "oscura bake"

# Texels along the edge of a picture; of one of nodes that look around, which is smooth; and of one whose mean is wanted.
EDGE, EDGE_OF_LOOKING, EDGE_OF_MEANS = 1024, 512, 128

# Samples of nodes that look around, of as many rays each as the node says.
SAMPLES = 8
LOOKING = ("ShaderNodeAmbientOcclusion", "ShaderNodeBevel", "ShaderNodeRaycast")

# Meshes of more faces keep their trees unbaked: laying out coordinates takes minutes for them.
MOST_FACES = 400_000

# Vectors are stored as shares of this, around a half: light has no sign.
VECTOR_RANGE = 16.0

# Share of texels that may be brighter than the brightest colour.
BRIGHTEST = 0.999


class BakeRequests:
    """Notes what of a material has to be baked."""

    def __init__(self):
        self.reasons = []  # the nodes and inputs
        self.warnings = []  # about the rest

    def image(self, found, reason):
        self.reasons.append(reason)

    def mean(self, found, reason, default):
        self.reasons.append(reason)
        return default

    def brightest(self, found, reason):
        self.reasons.append(reason)
        return [1.0, 1.0, 1.0]

    def warn(self, message):
        self.warnings.append(message)


class Baker:
    """Bakes what nodes of a material give on a mesh."""

    def __init__(self, holder, material, told):
        self.holder, self.material = holder, material
        self.found, self.store, self.options, self.report = told
        looks = trees.has(material.node_tree, LOOKING) if material.node_tree is not None else False
        edge = EDGE_OF_LOOKING if looks else EDGE
        self.edge = min(edge, self.options.bake or edge)
        self.is_bakable = len(holder.data.polygons) <= MOST_FACES

    def warn(self, message):
        self.report.warn(self.material.name, message)

    def image(self, found, reason):
        """The file of a picture of an output, and whether it holds vectors; None where nothing can be baked."""
        if not self.is_bakable:
            self.report.warn(self.material.name, f"{reason} is left out: {self.holder.data.name} has too many faces to bake it")
            return None
        self.report.note(self.material.name, f"{reason} is baked, since oscura doesn't evaluate it")
        pixels, file = self._pixels(found, self.edge), f"{self.options.name}.baked{len(self.found.bakes)}.exr"
        self.found.bakes.append(file)
        glow.save(pixels, os.path.join(self.options.folder, file))
        return file, found.output.type == "VECTOR"

    def mean(self, found, reason, default):
        """The mean of an output over the mesh, as a number or three."""
        texels = self._texels(found)
        if not len(texels):
            return default
        mean = [float(c) for c in texels.mean(0)]
        self.report.warn(self.material.name, f"{reason} varies over the surface: its mean is taken")
        return mean if isinstance(default, list) else shaders.as_type(tuple(mean), False)

    def brightest(self, found, reason):
        """The brightest colour of an output, by channel."""
        texels = self._texels(found)
        return np.clip(np.quantile(texels, BRIGHTEST, axis=0), 1e-3, 1.0).tolist() if len(texels) else [1.0, 1.0, 1.0]

    def _texels(self, found):
        if not self.is_bakable:
            return np.zeros((0, 3))
        pixels = self._pixels(found, min(EDGE_OF_MEANS, self.edge)).reshape(-1, 4).astype(np.float64)
        colors = pixels[pixels[:, 3] > 0][:, :3]
        return (colors - 0.5) * VECTOR_RANGE if found.output.type == "VECTOR" else colors

    def _pixels(self, found, edge):
        """The texels (edge, edge, 4) of an output; alpha is 0 where no face lies."""
        lay_out(self.holder)
        own = trees.copied(self.material)
        try:
            light, output = _lift(own.node_tree, found), found.output
            if output.type == "VECTOR":
                light = _coded(own.node_tree, light, found.node.bl_idname == "ShaderNodeBevel")
            looks = any(node.bl_idname in LOOKING for _, node in trees.nodes_with_trees(own.node_tree, LOOKING))
            return self._baked(own, light, edge, looks)
        finally:
            bpy.data.materials.remove(own)

    def _baked(self, own, light, edge, looks):
        mesh, idle = self.holder.data.copy(), bpy.data.materials.new("oscura idle")
        idle.use_nodes = True
        shown = bpy.data.objects.new("oscura baked", mesh)
        for slot, other in enumerate(self.holder.data.materials):
            mesh.materials[slot] = own if other == self.material else idle
        shown.matrix_world = self.found.placements[self.holder.name][0].matrix
        around = self._surroundings() if looks else []

        def make():
            with glow.stage(shown, *around) as scene:
                scene.cycles.samples = SAMPLES if looks else 1
                shining, dark = own.node_tree, idle.node_tree
                shining.links.new(light, glow.light(shining, shaders.end(shining)).inputs["Color"])
                glow.light(dark, shaders.end(dark))
                pixels = glow.baked(edge, edge, [shining, dark], margin=8, uv_layer=UV)
            return np.nan_to_num(pixels, posinf=0).astype(np.float16)

        try:
            return self.store.kept(self._key(own, light, edge, shown, around), make)
        finally:
            for obj in around:
                bpy.data.objects.remove(obj)
            bpy.data.meshes.remove(mesh)
            bpy.data.materials.remove(idle)

    def _key(self, own, light, edge, shown, around):
        digest = cache.digest()
        digest.update(repr(("bake", edge, light.node.name, light.identifier, [tuple(row) for row in shown.matrix_world])).encode())
        for obj in (shown, *around):
            digest.update(repr([tuple(row) for row in obj.matrix_world]).encode())
            fingerprint.add_mesh(digest, obj.data)
        fingerprint.add_tree(digest, own.node_tree)
        return digest

    def _surroundings(self):
        """Everything else at its places."""
        made = []
        for other in self.found.objects.values():
            for number, place in enumerate(self.found.placements[other.name] if other is not None else []):
                if other != self.holder or number > 0:
                    obj = bpy.data.objects.new("oscura neighbour", other.data)
                    obj.matrix_world = place.matrix
                    made.append(obj)
        return made


def lay_out(holder):
    """Gives a mesh texture coordinates that use no point of a picture twice; what is there goes on looking up its own."""
    layers = holder.data.uv_layers
    if UV in layers:
        return
    rendered = next((layer.name for layer in layers if layer.active_render), None)
    layers.new(name=UV)
    layers.active = layers[UV]
    with glow.stage(holder):
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.reveal()
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.uv.smart_project(angle_limit=1.15, island_margin=0.004)
        bpy.ops.object.mode_set(mode="OBJECT")
    if rendered is not None:
        layers[rendered].active_render = True


def _lift(tree, found):
    """The socket of a copy of a tree at its top level that gives what an output within groups does."""
    trees_of, node = [tree], None
    for group in found.groups:
        trees_of.append(trees_of[-1].nodes[group.name].node_tree)
    node = trees_of[-1].nodes[found.node.name]
    socket = next(s for s in node.outputs if s.identifier == found.output.identifier)
    kind = {"RGBA": "NodeSocketColor", "VECTOR": "NodeSocketVector"}.get(socket.type, "NodeSocketFloat")
    for inner, outer, group in reversed(list(zip(trees_of[1:], trees_of, found.groups))):
        made = inner.interface.new_socket("oscura", in_out="OUTPUT", socket_type=kind)
        end = next(n for n in inner.nodes if n.bl_idname == "NodeGroupOutput" and n.is_active_output)
        inner.links.new(socket, next(s for s in end.inputs if s.identifier == made.identifier))
        socket = next(s for s in outer.nodes[group.name].outputs if s.identifier == made.identifier)
    return socket


def _coded(tree, socket, is_normal):
    """A vector as light; a normal in the space of the object."""
    if is_normal:
        turn = tree.nodes.new("ShaderNodeVectorTransform")
        turn.vector_type, turn.convert_from, turn.convert_to = "NORMAL", "WORLD", "OBJECT"
        tree.links.new(socket, turn.inputs[0])
        socket = turn.outputs[0]
    coded = tree.nodes.new("ShaderNodeVectorMath")
    coded.operation = "MULTIPLY_ADD"
    coded.inputs[1].default_value, coded.inputs[2].default_value = (1 / VECTOR_RANGE,) * 3, (0.5,) * 3
    tree.links.new(socket, coded.inputs[0])
    return coded.outputs[0]
