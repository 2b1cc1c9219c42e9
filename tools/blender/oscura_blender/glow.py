"""What Cycles bakes of the light that materials emit: scenes for it, and the numbers in the pictures."""

from contextlib import contextmanager

import bpy
import numpy as np

from . import context


@contextmanager
def stage(*objects):
    """Opens a scene to bake in, which holds objects: the first is the one that operators work on."""
    scene = context.new_scene("oscura bake")
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", 1
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    try:
        with context.opened(scene):
            for obj in objects:
                scene.collection.objects.link(obj)
            context.choose(objects[0], scene)
            yield scene
    finally:
        bpy.data.scenes.remove(scene)


def picture(width, height):
    """A picture of numbers."""
    image = bpy.data.images.new("oscura numbers", width, height, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    return image


def save(pixels, path):
    """Writes numbers (rows from below, columns, channels) to a picture."""
    height, width, channels = pixels.shape
    image, full = picture(width, height), np.ones((height, width, 4), np.float32)
    full[..., :channels] = pixels
    image.pixels.foreach_set(full.ravel())
    image.filepath_raw, image.file_format = path, "OPEN_EXR"
    image.save()
    bpy.data.images.remove(image)


def light(tree, end):
    """A light in place of the surface of a tree that is thrown away afterwards: its color is black so far."""
    made = tree.nodes.new("ShaderNodeEmission")
    made.inputs["Color"].default_value = (0, 0, 0, 1)
    tree.links.new(made.outputs[0], end.inputs["Surface"])
    return made


def baked(width, height, trees, **options):
    """The numbers (rows, columns, 4) of a picture into which the materials of trees shine."""
    image = picture(width, height)
    for tree in trees:
        target = tree.nodes.new("ShaderNodeTexImage")
        target.image = image
        for node in tree.nodes:
            node.select = node == target
        tree.nodes.active = target
    bpy.ops.object.bake(type="EMIT", target="IMAGE_TEXTURES", use_clear=True, **options)
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)
