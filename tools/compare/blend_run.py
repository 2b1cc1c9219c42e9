"""Shared by comparisons of Blender scenes: rendering by Cycles and by oscura, and differences of the pictures."""

import os
import sys
from pathlib import Path

import bpy
import numpy as np

HERE = Path(__file__).resolve().parent
PROGRAM = os.environ.get("OSCURA", str(HERE.parent.parent / "target/release/oscura"))
SAMPLES = int(os.environ.get("SAMPLES", "128"))
BLOCK = 16
PLATE = 0.3


def make(folder, build, frames=None):
    """Saves a scene and renders it by Cycles without what biases it, twice; with frames, each of them."""
    name = build.__name__
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    scene.view_settings.view_transform = "Standard"
    cycles = scene.cycles
    cycles.device, cycles.samples = "CPU", SAMPLES
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0
    cycles.pixel_filter_type = "BOX"
    cycles.filter_width = 1
    for kind in ("max", "diffuse", "glossy", "transmission", "transparent_max", "volume"):
        setattr(cycles, f"{kind}_bounces", 32)
    # Some write pictures beside the scene.
    build(folder) if build.__code__.co_argcount else build()
    image = scene.render.image_settings
    image.file_format, image.color_depth = "OPEN_EXR", "32"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"{name}.blend"))
    for seed in (1, 2):
        cycles.seed = seed
        for frame in frames or (None,):
            if frame is not None:
                scene.frame_set(frame)
            number = "" if frame is None else f".{frame:04}"
            scene.render.filepath = str(folder / f"{name}.ref.{seed}{number}.exr")
            bpy.ops.render.render(write_still=True)


def read(path):
    """The pixels of a picture with their alpha."""
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    # Blender reads no picture with layers besides.
    pixels = np.array(image.pixels[:], np.float64).reshape(height, width, -1)[::-1] if width else _read_layered(path)
    bpy.data.images.remove(image)
    return pixels


def _read_layered(path):
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.parts[0].channels
        return np.stack([channels[name].pixels for name in "RGBA"], -1).astype(np.float64)


def environment():
    """The variables of the program: it exports by this Python."""
    return {**os.environ, "OSCURA_BLENDER": os.environ.get("OSCURA_BLENDER", sys.executable)}


def blocks(values):
    height, width = (n // BLOCK * BLOCK for n in values.shape[:2])
    return values[:height, :width].reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3).mean((1, 3))


def measure(ours, theirs):
    """Ratio of the means, and the RMS of the blocks' relative difference without noise."""
    a, b = ((blocks(x[0]) + blocks(x[1])) / 2 for x in (ours, theirs))
    scale = b + 0.05 * b.mean()
    noise = sum((((blocks(x[0]) - blocks(x[1])) / 2 / scale) ** 2).mean() for x in (ours, theirs))
    square = (((a - b) / scale) ** 2).mean()
    return a.mean() / b.mean(), np.sqrt(max(square - noise, 0)), np.sqrt(noise)


def show(path, ours, theirs):
    from PIL import Image

    a, b = ((x[0] + x[1]) / 2 for x in (ours, theirs))
    code = lambda x: np.clip(x, 0, 1) ** (1 / 2.2)
    difference = np.clip(0.5 + 2 * (a - b) / (b + 0.1 * b.mean()), 0, 1)
    row = np.concatenate([code(a), code(b), difference], 1)
    Image.fromarray((255 * row).astype(np.uint8)).save(path)


def flat(ours, theirs):
    """The colours of pictures: laid over grey if Cycles' film is transparent. Ours have alpha always."""
    is_clear = any((picture[..., 3] < 1).any() for picture in theirs)
    colors = lambda p: p[..., :3] + (PLATE * (1 - p[..., 3:]) if is_clear else 0)
    return [[colors(picture) for picture in pictures] for pictures in (ours, theirs)]


def row(name, path, ours, theirs):
    """Prints how much two renders each of ours and theirs differ, as a row of a table, and shows them."""
    ours, theirs = flat(ours, theirs)
    ratio, rms, noise = measure(ours, theirs)
    show(path, ours, theirs)
    print(f"| {name} | {ratio:.4f} | {100 * rms:.2f} % | {100 * noise:.2f} % |", flush=True)
