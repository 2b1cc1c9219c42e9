"""The view of a scene as a table: what Blender makes of the nodes of a lattice of
colours. The file is binary: src/color/view/table.rs says how."""

import contextlib
import os
import struct
import tempfile

import bpy
import numpy

# Nodes along an edge of the lattice, and of the curve before it.
NODES = 65
KNOTS = 1025

# What the curves span besides 0, in scene-linear values: from 14 stops below middle grey to 12.5 above, where AgX ends.
DARKEST, BRIGHTEST = 0.18 * 2.0**-14, 0.18 * 2.0**12.5

# Pixels a row of the pictures that Blender encodes.
ROW = 1024


def write(scene, folder, name, with_light):
    """Writes the table beside the scene file and gives the file's name. With light: exposure and white balance are part of it."""
    with viewed(scene, with_light) as copy, tempfile.TemporaryDirectory() as scratch:
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
def viewed(scene, with_light):
    """A copy of the scene that encodes 16-bit pictures for displays of sRGB."""
    copy = scene.copy()
    try:
        if not with_light:
            copy.view_settings.exposure = 0.0
            if hasattr(copy.view_settings, "use_white_balance"):
                copy.view_settings.use_white_balance = False
        # A configuration of colours of the user's own may call it otherwise; then it stays what it is.
        with contextlib.suppress(TypeError):
            copy.display_settings.display_device = "sRGB"
        copy.render.dither_intensity = 0.0
        files = copy.render.image_settings
        if hasattr(files, "media_type"):
            files.media_type = "IMAGE"
        files.file_format, files.color_mode, files.color_depth = "PNG", "RGB", "16"
        files.color_management, files.compression = "FOLLOW_SCENE", 0
        yield copy
    finally:
        bpy.data.scenes.remove(copy)


def _curve(scene, picture):
    """Ascending values, and to which of 0 to 1 they go: half by stops, half as greys are shown, so that the nodes are dense
    where the view changes much, and there are some where only one of the channels does."""
    stops = numpy.exp2(numpy.linspace(numpy.log2(DARKEST), numpy.log2(BRIGHTEST), KNOTS - 1))
    knots = numpy.concatenate([[0.0], stops])
    grey = encoded(scene, numpy.repeat(knots[:, None], 3, axis=1), picture)[:, 1].astype(float)
    grey = numpy.maximum.accumulate(grey)
    evenly = numpy.linspace(0.0, 1.0, KNOTS)
    span = grey[-1] - grey[0]
    values = 0.5 * evenly + 0.5 * (grey - grey[0]) / span if span > 0.01 else evenly
    return knots, values


def encoded(scene, colors, picture):
    """What displays show of linear colours, in 0 to 1."""
    rows = -(-len(colors) // ROW)
    pixels = numpy.ones((rows * ROW, 4), numpy.float32)
    pixels[: len(colors), :3] = colors
    made = bpy.data.images.new("oscura view", ROW, rows, alpha=False, float_buffer=True)
    read = None
    try:
        made.pixels.foreach_set(pixels.ravel())
        made.save_render(picture, scene=scene)
        read = bpy.data.images.load(picture)
        read.colorspace_settings.name = "Non-Color"
        read.pixels.foreach_get(pixels.reshape(-1))
    finally:
        bpy.data.images.remove(made)
        if read is not None:
            bpy.data.images.remove(read)
    return pixels[: len(colors), :3]
