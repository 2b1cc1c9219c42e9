"""View transforms as a 3D lookup table of a scene's display colors, which Blender fills. src/color/view/table.rs describes the file."""

import contextlib
import os
import struct
import tempfile

import bpy
import numpy

from . import cycles

# Entries along an edge of the table, and of the 1D table before it.
NODES = 65
KNOTS = 1025

# The range of scene-linear values besides 0: from 14 stops below middle gray to 12.5 above, where AgX ends.
DARKEST, BRIGHTEST = 0.18 * 2.0**-14, 0.18 * 2.0**12.5

# Width of the images that Blender encodes.
ROW = 1024


def write(scene, folder, name, with_exposure):
    """Writes the table, with exposure and white balance or without; returns the file's name."""
    with viewed(scene, with_exposure) as copy, tempfile.TemporaryDirectory() as scratch:
        picture = os.path.join(scratch, "view.png")
        knots, values = _curve(copy, picture)
        node = numpy.interp(numpy.linspace(0.0, 1.0, NODES), values, knots)
        blue, green, red = numpy.meshgrid(node, node, node, indexing="ij")
        shown = encoded(copy, numpy.stack([red, green, blue], axis=-1).reshape(-1, 3), picture)
    file = f"{name}.view"
    with open(os.path.join(folder, file), "wb") as stream:
        stream.write(b"OSCVIEW1" + struct.pack("<I", len(knots)))
        stream.write(numpy.stack([knots, values]).astype("<f4").tobytes())
        stream.write(struct.pack("<I", NODES) + numpy.rint(shown * 65535.0).astype("<u2").tobytes())
    return file


@contextlib.contextmanager
def viewed(scene, with_exposure):
    """A copy of the scene that encodes 16-bit images for sRGB displays."""
    copy = scene.copy()
    try:
        if not with_exposure:
            copy.view_settings.exposure = 0.0
            if hasattr(copy.view_settings, "use_white_balance"):  # since Blender 4.3
                copy.view_settings.use_white_balance = False
        # A custom OpenColorIO configuration may have no display of this name.
        with contextlib.suppress(TypeError):
            copy.display_settings.display_device = "sRGB"
        copy.render.dither_intensity = 0.0
        cycles.set_output(copy, "PNG", "16")
        copy.render.image_settings.color_management, copy.render.image_settings.compression = "FOLLOW_SCENE", 0
        yield copy
    finally:
        bpy.data.scenes.remove(copy)


def _curve(scene, picture):
    """The 1D table: ascending scene-linear values, and their positions (from 0 to 1) in the 3D table. Positions are the mean of the logarithm and of
    the display value of gray: entries are dense where the view changes fast, and there are some where only saturated colors change."""
    stops = numpy.exp2(numpy.linspace(numpy.log2(DARKEST), numpy.log2(BRIGHTEST), KNOTS - 1))
    knots = numpy.concatenate([[0.0], stops])
    gray = encoded(scene, numpy.repeat(knots[:, None], 3, axis=1), picture)[:, 1].astype(float)
    gray = numpy.maximum.accumulate(gray)
    uniform = numpy.linspace(0.0, 1.0, KNOTS)
    span = gray[-1] - gray[0]
    return knots, 0.5 * uniform + 0.5 * (gray - gray[0]) / span if span > 0.01 else uniform


def encoded(scene, colors, picture):
    """The display colors (0 to 1) of linear colors, shape (colors, 3), by way of a file."""
    rows = -(-len(colors) // ROW)
    pixels = numpy.ones((rows * ROW, 4), numpy.float32)
    pixels[: len(colors), :3] = colors
    image = bpy.data.images.new("oscura view", ROW, rows, alpha=False, float_buffer=True)
    display = None
    try:
        image.pixels.foreach_set(pixels.ravel())
        image.save_render(picture, scene=scene)
        display = bpy.data.images.load(picture)
        display.colorspace_settings.name = "Non-Color"
        display.pixels.foreach_get(pixels.reshape(-1))
    finally:
        bpy.data.images.remove(image)
        if display is not None:
            bpy.data.images.remove(display)
    return pixels[: len(colors), :3]
