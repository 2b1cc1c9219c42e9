"""Inputs of shaders that node trees feed, but that are the same everywhere: all are evaluated at once by Cycles, and become
constants."""

import bpy
import numpy as np

from . import flat, shaders
from .context import opened

# Edge of the part of the picture that each material has, pixels.
EDGE = 4


def fold(materials, make_scene, shader_of):
    """Makes constants of what is the same everywhere, in materials of one Principled shader each."""
    wanted = {material: names for material in materials if (names := _names(shader_of(material)))}
    if not wanted:
        return
    # As many as a mesh may have.
    batch = list(wanted)[:4096]
    scene = make_scene()
    try:
        with opened(scene):
            _fold(batch, wanted, scene, shader_of)
    finally:
        bpy.data.scenes.remove(scene)
    if len(batch) < len(wanted):
        fold([material for material in materials if material not in batch], make_scene, shader_of)


def _names(shader):
    """The inputs of a shader that are alike everywhere and no constants yet."""
    if shader is None:
        return []
    return [s.name for s in shader.inputs if s.is_linked and s.type != "VECTOR" and s.enabled and _is_even(s)]


def _is_even(socket):
    source = shaders.source(socket)
    if source is None:
        return not socket.is_linked
    node = source.node
    if node.mute:
        return False
    if getattr(node, "node_tree", None):
        within = all(n.bl_idname in _IN_GROUPS for n in node.node_tree.nodes)
        return within and all(_is_even(entry) for entry in node.inputs)
    return node.bl_idname in flat.PURE and all(_is_even(entry) for entry in node.inputs if entry.enabled)


_IN_GROUPS = flat.PURE | {"NodeGroupInput", "NodeGroupOutput", "NodeReroute", "NodeFrame"}


def _fold(materials, wanted, scene, shader_of):
    plate, columns = board(materials)
    scene.collection.objects.link(plate)
    layer = scene.view_layers[0]
    layer.update()
    layer.objects.active = plate
    plate.select_set(True, view_layer=layer)
    for name in dict.fromkeys(name for material in materials for name in wanted[material]):
        users = [material for material in materials if name in wanted[material]]
        values = _evaluate(name, materials, users, columns, shader_of)
        for material in users:
            socket = shader_of(material).inputs[name]
            tree = material.node_tree
            tree.links.remove(socket.links[0])
            value = values[materials.index(material)]
            socket.default_value = tuple(value) if socket.type == "RGBA" else float(value[:3].mean())
    bpy.data.meshes.remove(plate.data)


def board(materials):
    """A mesh with a square for each material, side by side on its texture coordinates; and how many are in a row."""
    columns = int(np.ceil(len(materials) ** 0.5))
    corners, uvs = [], []
    for i in range(len(materials)):
        x, y = i % columns, i // columns
        square = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)]
        corners += [(*corner, 0.0) for corner in square]
        uvs += [(u / columns, v / columns) for u, v in square]
    mesh = bpy.data.meshes.new("oscura board")
    mesh.from_pydata(corners, [], [tuple(range(4 * i, 4 * i + 4)) for i in range(len(materials))])
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", np.ravel(uvs))
    for material in materials:
        mesh.materials.append(material)
    mesh.polygons.foreach_set("material_index", list(range(len(materials))))
    return bpy.data.objects.new("oscura board", mesh), columns


def _evaluate(name, materials, users, columns, shader_of):
    """The values of an input, a row for each material."""
    edge = EDGE * columns
    image = bpy.data.images.new("oscura board", edge, edge, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    undo = [_aim(material, shader_of(material), name if material in users else None, image) for material in materials]
    bpy.ops.object.bake(type="EMIT", target="IMAGE_TEXTURES", margin=0, use_clear=True)
    for restore in undo:
        restore()
    pixels = np.empty(edge * edge * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    cells = pixels.reshape(columns, EDGE, columns, EDGE, 4)[:, EDGE // 2, :, EDGE // 2]
    return cells.reshape(-1, 4)


def _aim(material, shader, name, image):
    """Lets a material shine with an input into a picture; gives what undoes it."""
    tree = material.node_tree
    target, glow = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeEmission")
    target.image = image
    for node in tree.nodes:
        node.select = node == target
    tree.nodes.active = target
    source = shaders.source(shader.inputs[name]) if name else None
    if source is not None:
        tree.links.new(source, glow.inputs["Color"])
    end = shaders.end(tree)
    tree.links.new(glow.outputs[0], end.inputs["Surface"])

    def restore():
        tree.nodes.remove(target)
        tree.nodes.remove(glow)
        tree.links.new(shader.outputs[0], end.inputs["Surface"])

    return restore


def feed(tree, socket, target):
    """Gives an input what another one has."""
    source = shaders.source(socket)
    if source is not None:
        tree.links.new(source, target)
        return
    value = socket.default_value
    is_color = target.type == "RGBA"
    target.default_value = (value,) * 3 + (1,) if isinstance(value, float) and is_color else value
