"""Pictures that Cycles renders on the way: what a world shows, what a lamp lights."""

import math
import os
import tempfile
from contextlib import contextmanager

import bpy
import numpy as np

from . import context


@contextmanager
def around(world):
    """A scene within a world; both are removed afterwards."""
    scene = context.new_scene("oscura still")
    try:
        world.cycles.sampling_method = "NONE"  # nothing is lit
        scene.world = world
        yield scene
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.worlds.remove(world)


def look_around(scene, turn=0.0, highest=math.pi / 2):
    """A camera that sees all around, oriented as Blender's own environment pictures are, but for a turn about the vertical, and up to a
    latitude; radians."""
    camera = bpy.data.cameras.new("oscura camera")
    camera.type, camera.clip_start = "PANO", 1e-4
    # Blender 5 has it on the camera, 4 on what Cycles adds to it.
    owner = camera if hasattr(camera, "panorama_type") else camera.cycles
    owner.panorama_type = "EQUIRECTANGULAR"
    owner.latitude_max = highest
    return place(scene, camera, rotation_euler=(math.pi / 2, 0.0, turn - math.pi / 2))


def look_along(scene, size, **placed):
    """A camera of parallel rays that sees so much."""
    camera = bpy.data.cameras.new("oscura camera")
    camera.type, camera.ortho_scale = "ORTHO", size
    camera.clip_start, camera.clip_end = 1e-3 * size, 10 * size
    return place(scene, camera, **placed)


def place(scene, data, **placed):
    """An object of a scene; a camera is the scene's."""
    obj = bpy.data.objects.new("oscura still", data)
    for key, value in placed.items():
        setattr(obj, key, value)
    scene.collection.objects.link(obj)
    if obj.type == "CAMERA":
        scene.camera = obj
    return obj


def prepare(scene, size, samples):
    """Sets a scene up to render a picture of so many pixels: directly lit, linear, without what biases it."""
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    render.film_transparent = False
    render.use_compositing = render.use_sequencer = False
    image = render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGB", "32"
    image.exr_codec = "ZIP"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = samples, False, False
    cycles.pixel_filter_type = "BOX"
    cycles.max_bounces = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0


def shown(scene):
    """What a scene shows (height, width, 3), rows from below."""
    with tempfile.TemporaryDirectory(prefix="oscura-") as folder:
        scene.render.filepath = os.path.join(folder, "still.exr")
        bpy.ops.render.render(write_still=True, scene=scene.name)
        image = bpy.data.images.load(scene.render.filepath)
        image.colorspace_settings.name = "Non-Color"
        width, height = image.size
        pixels = np.empty(width * height * image.channels, np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
    return np.nan_to_num(pixels.reshape(height, width, -1)[..., :3]).astype(float)
