"""Passes beside Cycles': a scene of Blender with two lamps, a glass sphere, one of metal, plastic and a panel that shines, rendered by both
with all passes they have in common. Mean of each pass over Cycles', with its standard error, and the share of blocks of 8 x 8 pixels
that differ by more than 3 of their standard deviations (chance: 0.3 %), estimated from two seeds of either.

    python passes.py FOLDER        with a Python that has bpy, numpy and OpenEXR

`OSCURA` names another binary, `SAMPLES` the samples of each of the two pictures of either (256 by default). Says so and succeeds where
modules are missing."""

import os
import subprocess
import sys
from pathlib import Path

try:
    import bpy
    import numpy as np
    import OpenEXR
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(0)

import common

HERE = Path(__file__).resolve().parent
PROGRAM = os.environ.get("OSCURA", str(HERE.parent.parent / "target/release/oscura"))
SAMPLES = int(os.environ.get("SAMPLES", "256"))
SIZE = (160, 120)
FAR = 1e9


def material(name, **values):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    for key, value in values.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return made


def glass():
    made = bpy.data.materials.new("glass")
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    shader = nodes.new("ShaderNodeBsdfGlass")
    shader.inputs["Roughness"].default_value, shader.inputs["IOR"].default_value = 0.0, 1.5
    links.new(shader.outputs[0], nodes["Material Output"].inputs["Surface"])
    return made


def put(of, **place):
    of(**place)
    return bpy.context.object


def build():
    ball = bpy.ops.mesh.primitive_uv_sphere_add
    put(bpy.ops.mesh.primitive_plane_add, size=20).data.materials.append(material("floor", Base_Color=(0.5, 0.4, 0.3, 1), Roughness=1.0, Specular_IOR_Level=0.0))
    for name, x, of in [
        ("glass", -1.2, glass()),
        ("plastic", 0.0, material("plastic", Base_Color=(0.1, 0.3, 0.6, 1), Roughness=0.3)),
        ("metal", 1.2, material("metal", Base_Color=(0.9, 0.6, 0.3, 1), Metallic=1.0, Roughness=0.25)),
    ]:
        thing = put(ball, segments=64, ring_count=32, radius=0.5, location=(x, 0, 0.5))
        bpy.ops.object.shade_smooth()
        thing.name = name
        thing.data.materials.append(of)
    panel = put(bpy.ops.mesh.primitive_plane_add, size=1, location=(0, 2, 1), rotation=(np.pi / 2, 0, 0))
    panel.data.materials.append(material("panel", Base_Color=(0, 0, 0, 1), Specular_IOR_Level=0.0, Emission_Color=(1, 0.5, 0.2, 1), Emission_Strength=2.0))
    for kind, place, energy, size in [("AREA", (-2, -2, 3), 120, 1.0), ("POINT", (2.5, -1, 2), 60, 0.2)]:
        lamp = put(bpy.ops.object.light_add, type=kind, location=place)
        lamp.data.energy = energy
        setattr(lamp.data, "size" if kind == "AREA" else "shadow_soft_size", size)
        lamp.rotation_euler = (0.7, 0, -0.8) if kind == "AREA" else (0, 0, 0)
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (0.1, 0.15, 0.2, 1)
    bpy.context.scene.world = world
    camera = put(bpy.ops.object.camera_add, location=(0, -5, 1.6), rotation=(1.35, 0, 0))
    bpy.context.scene.camera = camera


def by_cycles(folder):
    """Saves the scene, and renders it twice."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", SAMPLES, False, False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0
    cycles.pixel_filter_type = "BOX"
    cycles.filter_width = 1
    for kind in ("max", "diffuse", "glossy", "transmission", "transparent_max"):
        setattr(cycles, f"{kind}_bounces", 32)
    build()
    layer = scene.view_layers[0]
    layer.name = "ViewLayer"
    for kind in ("z", "position", "normal", "emit", "environment", *(f"{a}_{b}" for a in ("diffuse", "glossy", "transmission") for b in ("direct", "indirect", "color"))):
        setattr(layer, f"use_pass_{kind}", True)
    image = scene.render.image_settings
    if hasattr(image, "media_type"):  # Blender 5 and later
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth = "OPEN_EXR_MULTILAYER", "32"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "passes.blend"))
    for seed in (1, 2):
        cycles.seed = seed
        scene.render.filepath = str(folder / f"cycles.{seed}.exr")
        bpy.ops.render.render(write_still=True)


# Names of passes since Blender 5, in parts of their own.
NEW = {f"{full} {way}": f"{short}{mark}" for full, short in (("Diffuse", "Diff"), ("Glossy", "Gloss"), ("Transmission", "Trans"))
       for way, mark in (("Direct", "Dir"), ("Indirect", "Ind"), ("Color", "Col"))} | {"Emission": "Emit", "Environment": "Env"}  # fmt: skip


def planes(path):
    found = {}
    for part in OpenEXR.File(str(path), separate_channels=True).parts:
        for name, channel in part.channels.items():
            layer, _, letter = name.removeprefix("ViewLayer.").rpartition(".")
            found[f"{NEW.get(layer, layer)}.{letter}" if layer else letter] = np.asarray(channel.pixels, np.float64)
    return found


def triple(found, layer, letters="RGB"):
    return np.stack([found[f"{layer}.{letter}"] for letter in letters], -1)


def passes_of_cycles(found):
    """Cycles' passes in oscura's names and conventions: light with its colour; y up."""
    passes = {"Combined": triple(found, "Combined"), "Emit": triple(found, "Emit"), "Env": triple(found, "Env")}
    for kind in ("Diff", "Gloss", "Trans"):
        color = triple(found, f"{kind}Col")
        passes[f"{kind}Col"] = color
        for way in ("Dir", "Ind"):
            passes[f"{kind}{way}"] = triple(found, f"{kind}{way}") * color
    up = lambda v: np.stack([v[..., 0], v[..., 2], -v[..., 1]], -1)
    passes["N"] = up(triple(found, "Normal", "XYZ"))
    passes["P"] = up(triple(found, "Position", "XYZ"))
    passes["Z"] = np.repeat(found["Depth.Z"][..., None], 3, 2)
    return passes


def passes_of_ours(found):
    passes = {name: triple(found, name) for name in ("Combined", "Emit", "Env")}
    passes |= {f"{a}{b}": triple(found, f"{a}{b}") for a in ("Diff", "Gloss", "Trans") for b in ("Dir", "Ind", "Col")}
    passes |= {name: triple(found, name, "XYZ") for name in ("N", "P")}
    passes["Z"] = np.repeat(found["Depth.Z"][..., None], 3, 2)
    return passes


def is_smooth(depth):
    """Surfaces, except at depth discontinuities."""
    wide = np.pad(depth, 1, mode="edge")
    near = np.stack([wide[y : y + depth.shape[0], x : x + depth.shape[1]] for y in range(3) for x in range(3)])
    return (near.max(0) < FAR) & (near.max(0) - near.min(0) < 0.3)


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "cycles.2.exr").exists():
        by_cycles(folder)
    plain = ["--microfacet", "single", "--terminator", "off", "--filter", "box", "--float", "--path-reuse", "off", "--quiet"]
    size = ["--width", str(SIZE[0]), "--height", str(SIZE[1]), "--blender", sys.executable, "--exr-layout", "layers"]
    for seed in (1, 2):
        command = [PROGRAM, "render", folder / "passes.blend", "-o", folder / f"ours.{seed}.exr", "--aov", "all", "--spp", str(SAMPLES), "--seed", str(seed)]
        subprocess.run([str(word) for word in [*command, *plain, *size]], check=True)
    ours = [passes_of_ours(planes(folder / f"ours.{seed}.exr")) for seed in (1, 2)]
    theirs = [passes_of_cycles(planes(folder / f"cycles.{seed}.exr")) for seed in (1, 2)]
    # Backgrounds have no place, and at edges ours is a mean, Cycles' the place of one sample.
    solid = np.all([is_smooth(passes["Z"][..., 0]) for passes in (*ours, *theirs)], 0)
    print("| Pass | ours / Cycles R G B | standard error | blocks beyond 3 sigma | largest difference of a block |\n|---|---|---|---:|---:|")
    for name in ours[0]:
        a, b = (common.Picture.of([passes[name] for passes in of]) for of in (ours, theirs))
        if name in ("N", "P", "Z"):
            print(f"| {name} | | | | {abs(a.mean - b.mean)[solid].max():.2g} (pixels) |")
        elif not a.mean.any() and not b.mean.any():
            print(f"| {name} | both black | | | 0 |")
        else:
            found = common.compare(a, b)
            largest = abs(common.block_means(a.mean) - common.block_means(b.mean)).max()
            ratio, sigma = (common.by_channel(values, 4) for values in (found.ratio, found.sigma))
            print(f"| {name} | {ratio} | {sigma} | {100 * found.beyond_3:.1f} % | {largest:.2g} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
