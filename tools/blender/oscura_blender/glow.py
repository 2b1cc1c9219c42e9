"""What Cycles bakes of the light that materials emit: scenes and boards for it, and the numbers in the pictures."""

from contextlib import contextmanager

import bpy
import numpy as np

from . import context


def new_scene():
    """A scene to bake in."""
    bake_scene = context.new_scene("oscura bake")
    bake_scene.render.engine = "CYCLES"
    bake_scene.cycles.device = "CPU"
    bake_scene.cycles.samples = 1
    bake_scene.cycles.use_denoising = bake_scene.cycles.use_adaptive_sampling = False
    return bake_scene


@contextmanager
def board(materials):
    """Opens a scene with a square for each material, side by side on its texture coordinates; how many are in a row."""
    scene, columns = new_scene(), int(np.ceil(len(materials) ** 0.5))
    mesh = _squares(materials, columns)
    try:
        with context.opened(scene):
            plate = bpy.data.objects.new("oscura board", mesh)
            scene.collection.objects.link(plate)
            context.choose(plate, scene)
            yield columns
    finally:
        bpy.data.meshes.remove(mesh)
        bpy.data.scenes.remove(scene)


def _squares(materials, columns):
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
    return mesh


def picture(width, height):
    """A picture of numbers."""
    image = bpy.data.images.new("oscura numbers", width, height, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    return image


def aim(tree, image):
    """Makes a picture the target of baking what has this tree; gives its node."""
    target = tree.nodes.new("ShaderNodeTexImage")
    target.image = image
    for node in tree.nodes:
        node.select = node == target
    tree.nodes.active = target
    return target


def shine(tree, end, shader, image, feed):
    """Lets a tree shine into a picture in place of its shader; `feed` has the inputs of the light. Gives what undoes it."""
    target, light = aim(tree, image), tree.nodes.new("ShaderNodeEmission")
    feed(light.inputs)
    tree.links.new(light.outputs[0], end.inputs["Surface"])

    def restore():
        tree.nodes.remove(target)
        tree.nodes.remove(light)
        tree.links.new(shader.outputs[0], end.inputs["Surface"])

    return restore


def baked(width, height, shining, margin=0, **options):
    """The numbers (rows, columns, 4) of a picture into which materials shine, each by a function of the picture as `shine` is."""
    image = picture(width, height)
    undo = [make(image) for make in shining]
    bpy.ops.object.bake(type="EMIT", target="IMAGE_TEXTURES", margin=margin, use_clear=True, **options)
    for restore in undo:
        restore()
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)
