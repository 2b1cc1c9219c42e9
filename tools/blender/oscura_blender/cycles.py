"""Pictures that Cycles renders or bakes during the export: worlds, light node trees, nodes without a counterpart."""

import math
import os
import tempfile
from contextlib import contextmanager

import bpy
import numpy as np

from . import final_render

# Baking.


@contextmanager
def baking_scene(obj):
    """A temporary scene with an object, which is selected and active."""
    scene = final_render.new_scene("oscura bake")
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", 1
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    try:
        with final_render.active_scene(scene):
            scene.collection.objects.link(obj)
            layer = scene.view_layers[0]
            layer.update()
            layer.objects.active = obj
            obj.select_set(True, view_layer=layer)
            yield scene
    finally:
        bpy.data.scenes.remove(scene)


def new_image(width, height):
    """A float image without a color space conversion."""
    image = bpy.data.images.new("oscura numbers", width, height, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    return image


def pixels_of(image):
    """The pixels of an image (height, width, channels), rows from the bottom."""
    width, height = image.size
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, -1)


def save(pixels, path):
    """Writes pixels (height, width, channels), rows from the bottom, to an OpenEXR file."""
    height, width, channels = pixels.shape
    image, full = new_image(width, height), np.ones((height, width, 4), np.float32)
    full[..., :channels] = pixels
    image.pixels.foreach_set(full.ravel())
    image.filepath_raw, image.file_format = path, "OPEN_EXR"
    image.save()
    bpy.data.images.remove(image)


def add_emission(tree, output_node):
    """Replaces the surface of a temporary tree by a black Emission, whose Color can be linked."""
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = (0, 0, 0, 1)
    tree.links.new(emission.outputs[0], output_node.inputs["Surface"])
    return emission


def bake_emission(width, height, trees, **options):
    """Bakes the emission of material node trees to pixels (height, width, 4)."""
    image = new_image(width, height)
    for tree in trees:
        target = tree.nodes.new("ShaderNodeTexImage")
        target.image = image
        for node in tree.nodes:
            node.select = node == target
        tree.nodes.active = target
    bpy.ops.object.bake(type="EMIT", target="IMAGE_TEXTURES", use_clear=True, **options)
    pixels = pixels_of(image)
    bpy.data.images.remove(image)
    return pixels


# Rendering.


@contextmanager
def world_scene(world):
    """A temporary scene with a world; both are removed at the end."""
    scene = final_render.new_scene("oscura still")
    try:
        world.cycles.sampling_method = "NONE"  # nothing is lit
        scene.world = world
        yield scene
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.worlds.remove(world)


def add_panoramic_camera(scene, rotation=0.0, max_latitude=math.pi / 2):
    """Adds an equirectangular camera with the orientation of environment textures, rotated about the vertical; angles in radians."""
    camera = bpy.data.cameras.new("oscura camera")
    camera.type, camera.clip_start = "PANO", 1e-4
    panorama = panorama_settings(camera)
    panorama.panorama_type = "EQUIRECTANGULAR"
    panorama.latitude_max = max_latitude
    return add_object(scene, camera, rotation_euler=(math.pi / 2, 0.0, rotation - math.pi / 2))


def panorama_settings(camera):
    """The owner of a camera's panorama properties: the camera since Blender 5.0, before that its Cycles settings."""
    return camera if hasattr(camera, "panorama_type") else camera.cycles


def add_orthographic_camera(scene, size, **properties):
    camera = bpy.data.cameras.new("oscura camera")
    camera.type, camera.ortho_scale = "ORTHO", size
    camera.clip_start, camera.clip_end = 1e-3 * size, 10 * size
    return add_object(scene, camera, **properties)


def add_object(scene, data, **properties):
    """Adds an object to a scene; a camera becomes the active one."""
    obj = bpy.data.objects.new("oscura still", data)
    for key, value in properties.items():
        setattr(obj, key, value)
    scene.collection.objects.link(obj)
    if obj.type == "CAMERA":
        scene.camera = obj
    return obj


def set_output(scene, file_format, depth):
    """The format of the pictures of a scene, RGB with so many bits."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # since Blender 5.0
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = file_format, "RGB", depth


def set_up(scene, size, samples):
    """Settings of a render of direct light to a linear picture, without clamping."""
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    render.film_transparent = False
    render.use_compositing = render.use_sequencer = False
    set_output(scene, "OPEN_EXR", "32")
    render.image_settings.exr_codec = "ZIP"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = samples, False, False
    cycles.pixel_filter_type = "BOX"
    cycles.max_bounces = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0


def render_to(scene, path):
    """Renders a scene to a file, and returns the file's bytes."""
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return np.fromfile(path, np.uint8)


def render(scene):
    """Renders a scene to pixels (height, width, 3), rows from the bottom."""
    with tempfile.TemporaryDirectory(prefix="oscura-") as folder:
        path = os.path.join(folder, "still.exr")
        render_to(scene, path)
        image = bpy.data.images.load(path)
        image.colorspace_settings.name = "Non-Color"
        pixels = pixels_of(image)
        bpy.data.images.remove(image)
    return np.nan_to_num(pixels[..., :3]).astype(float)
