"""Interiors whose light comes through glass, off mirrors or water: error over CPU time, oscura beside Cycles.

    python interiors.py FOLDER [SCENE...]        with a Python that has bpy, numpy and Pillow

Makes FOLDER/X.blend (`blend_interiors.py`), exports it once, and renders it by both at 4, 16, 64 and 256 samples without clamps,
filters and left-out caustics, plain and denoised. The reference is oscura's picture of `REFERENCE` samples (2048): in one of Cycles
too few paths find a small sun behind glass; `blend.py` compares the means. Prints the error, RMS of the relative difference
without its largest thousandth, and the CPU seconds; writes FOLDER/X.png: both at 16 samples, plain and denoised.
"""

import os
import resource
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np

from blend_interiors import INTERIORS
from blend_run import PROGRAM, environment, read

LADDER = [int(n) for n in os.environ.get("LADDER", "4 16 64 256").split()]
REFERENCE = int(os.environ.get("REFERENCE", "2048"))


def save(folder, build):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    scene.view_settings.view_transform = "Standard"
    cycles = scene.cycles
    cycles.device, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", False, False
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1
    for kind in ("max", "diffuse", "glossy", "transmission", "transparent_max", "volume"):
        setattr(cycles, f"{kind}_bounces", 32)
    build()
    image = scene.render.image_settings
    image.file_format, image.color_depth = "OPEN_EXR", "32"
    path = folder / f"{build.__name__}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    subprocess.run([PROGRAM, "export", str(path), "-o", str(folder / build.__name__)], env=environment(), check=True)


def ours(folder, name, samples, denoised, seed=1):
    """The picture and its CPU seconds."""
    path = folder / f"{name}.oscura.{samples}.{seed}{'.denoised' * denoised}.exr"
    command = [PROGRAM, "render", str(folder / name / "scene.toml"), "-o", str(path), "--unbiased", "--float", "--quiet"]
    command += ["--spp", str(samples), "--seed", str(seed), "--threads", "2", *["--denoise"] * denoised]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return read(path)[..., :3], after.ru_utime - before.ru_utime


def theirs(folder, name, samples, denoised):
    bpy.ops.wm.open_mainfile(filepath=str(folder / f"{name}.blend"))
    scene = bpy.context.scene
    cycles = scene.cycles
    cycles.samples, cycles.use_denoising = samples, denoised
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    scene.render.filepath = str(folder / f"{name}.cycles.{samples}{'.denoised' * denoised}.exr")
    before = os.times().user
    bpy.ops.render.render(write_still=True)
    return read(scene.render.filepath)[..., :3], os.times().user - before


def error(picture, reference):
    squares = (picture - reference) ** 2 / (reference**2 + 0.01 * (reference**2).mean())
    by_pixel = np.sort(squares.mean(-1).ravel())
    return np.sqrt(by_pixel[: -max(by_pixel.size // 1000, 1)].mean())


def main():
    from PIL import Image

    folder = Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    print("| scene | renderer | " + " | ".join(f"{n} samples | denoised" for n in LADDER) + " | mean at the last |")
    print("|---|---|" + "---:|---:|" * len(LADDER) + "---:|")
    for build in INTERIORS:
        name = build.__name__
        if sys.argv[2:] and name not in sys.argv[2:]:
            continue
        if not (folder / name / "scene.toml").exists():
            save(folder, build)
        reference, _ = ours(folder, name, REFERENCE, False, 77)
        shown = []
        for renderer in (ours, theirs):
            row = []
            for samples in LADDER:
                for denoised in (False, True):
                    picture, seconds = renderer(folder, name, samples, denoised)
                    row.append(f"{100 * error(picture, reference):.1f} % {seconds:.1f} s")
                    if samples == 16:
                        shown.append(np.clip(picture, 0, 1) ** (1 / 2.2))
                    if not denoised:
                        mean = picture.mean() / reference.mean()
            print(f"| {name} | {'oscura' if renderer is ours else 'Cycles'} | {' | '.join(row)} | {mean:.3f} |", flush=True)
        if shown:
            Image.fromarray((255 * np.concatenate(shown, 1)).astype(np.uint8)).save(folder / f"{name}.png")


if __name__ == "__main__":
    main()
