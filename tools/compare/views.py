"""Views, looks, curves and gamma of Blender's scenes: what displays show of random colours, by Blender and by the table that
the exporter writes. Run by a Python that has bpy, numpy and OpenEXR: views.py OUT."""

import os
import subprocess
import sys

import bpy
import numpy
import OpenEXR

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "blender"))
from oscura_blender import report, settings, view_table  # noqa: E402

OSCURA = os.environ.get("OSCURA", os.path.join(HERE, "..", "..", "target", "release", "oscura"))
SIDE = 160

# View, look, and what else is set.
CASES = [
    ("Standard", "None", {}),
    ("Standard", "None", {"gamma": 1.5}),
    ("Standard", "None", {"curves": True, "exposure": 0.5}),
    ("Khronos PBR Neutral", "None", {}),
    ("AgX", "None", {}),
    *(("AgX", f"AgX - {look}", {}) for look in ("Punchy", "Greyscale", "Very High Contrast", "Medium High Contrast", "Very Low Contrast")),
    ("AgX", "AgX - High Contrast", {"curves": True, "exposure": -1.0, "gamma": 1.2}),
    ("AgX", "None", {"tint": 40.0}),
    ("Filmic", "None", {}),
    ("Filmic", "Very High Contrast", {}),
    ("Filmic", "Low Contrast", {"exposure": 1.0}),
    ("Filmic Log", "None", {}),
    ("Raw", "None", {}),
    ("ACES 1.3", "None", {}),
    ("ACES 2.0", "None", {}),
]


def colors():
    """Pure and mixed hues over fourteen stops, some of them greys."""
    dice = numpy.random.default_rng(7)
    hues = dice.random((SIDE, SIDE, 3)) ** 1.5
    hues[: SIDE // 8] = dice.integers(0, 2, (SIDE // 8, SIDE, 3))
    hues[SIDE // 8 : SIDE // 4] = 1.0
    return (hues * numpy.exp2(dice.uniform(-9, 5, (SIDE, SIDE, 1)))).astype(numpy.float32)


def scene_of(view, look, more):
    """A scene with a view transform, or `None` where this Blender lacks it."""
    scene = bpy.data.scenes.new("viewed")
    shown = scene.view_settings
    try:
        shown.view_transform = view
        shown.look = look
    except TypeError:
        return None
    shown.gamma, shown.exposure = more.get("gamma", 1.0), more.get("exposure", 0.0)
    if more.get("curves"):
        shown.use_curve_mapping = True
        shown.curve_mapping.initialize()
        shown.curve_mapping.curves[3].points.new(0.4, 0.25)
        shown.curve_mapping.curves[0].points.new(0.5, 0.6)
        shown.curve_mapping.update()
    if "tint" in more:
        if not hasattr(shown, "use_white_balance"):
            return None
        shown.use_white_balance, shown.white_balance_temperature, shown.white_balance_tint = True, 4000.0, more["tint"]
    return scene


def read(path):
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    pixels = numpy.empty(SIDE * SIDE * 4, numpy.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(SIDE, SIDE, 4)[::-1, :, :3]


def main(out):
    out = os.path.abspath(out)
    os.makedirs(out, exist_ok=True)
    given = colors()
    picture = os.path.join(out, "colors.exr")
    OpenEXR.File({}, {"RGB": given}).write(picture)
    print("| view | look | more | oscura's | largest difference | 99 % below | RMS |\n|---|---|---|---|---:|---:|---:|")
    for number, (view, look, more) in enumerate(CASES):
        scene = scene_of(view, look, more)
        if scene is None:
            print(f"| {view} | {look} | | not in this Blender | | | |")
            continue
        entries = settings.view(scene, out, f"{number}", report.Report())
        chosen = entries["view"] if entries["view"] in settings.VIEWS.values() else os.path.join(out, entries["view"])
        options = ["--view", chosen, "--exposure", str(entries.get("exposure", 0.0))]
        ours = os.path.join(out, f"{number}.oscura.png")
        subprocess.run([OSCURA, "convert", picture, "-o", ours, "--deep", *options], check=True, stdout=subprocess.DEVNULL)
        with view_table.viewed(scene, True) as copy:
            shown = view_table.encoded(copy, given[::-1].reshape(-1, 3), os.path.join(out, f"{number}.blender.png"))
        theirs = shown.reshape(SIDE, SIDE, 3)[::-1]
        error = numpy.abs(read(ours) - theirs).max(axis=-1)
        name = "a table" if chosen.endswith((".csp", ".view")) else chosen
        figures = f"{error.max():.4f} | {numpy.quantile(error, 0.99):.4f} | {numpy.sqrt((error**2).mean()):.5f}"
        print(f"| {view} | {look} | {', '.join(f'{k} {v}' for k, v in more.items())} | {name} | {figures} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
