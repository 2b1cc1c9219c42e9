"""The Cornell box by numbers, against Mitsuba 3 and Cycles.

    python cornell.py mitsuba|cycles|oscura FOLDER [SAMPLES]   # FOLDER/NAME.K.exr, independent parts of so many samples
    python cornell.py table FOLDER [REFERENCE.ref.exr REFERENCE.var.exr]

All three read assets/cornell-box.gltf, SIZE x SIZE pixels (from the environment; 512), one-pixel box filter, up to 100
bounces, no clamping. The table takes Mitsuba's picture from the two files, if they are given, instead of from its parts in
FOLDER; they may be larger by a whole factor.
"""

import base64
import json
import os
import sys
from pathlib import Path

import numpy as np

import common

SIZE = int(os.environ.get("SIZE", "512"))
DEPTH = 100
PARTS = {"mitsuba": 4, "cycles": 4, "oscura": 2}
SAMPLES = {"mitsuba": 512, "cycles": 256, "oscura": 1024}
ASSET = common.PROJECT / "assets/cornell-box.gltf"

# Name, and columns and rows [from, to) in a picture of 512 x 512 pixels.
PARTS_OF_THE_BOX = [
    ("tall box, side towards the red wall", (144, 154), (240, 420)),
    ("short box, side towards the green wall", (381, 391), (350, 460)),
    ("tall box, front", (165, 245), (230, 410)),
    ("short box, front", (255, 370), (350, 460)),
    ("short box, top", (285, 375), (332, 340)),
    ("the light", (220, 290), (68, 78)),
    ("ceiling in front of the light", (215, 295), (52, 60)),
    ("ceiling behind the light", (225, 285), (85, 97)),
    ("ceiling beside it, towards the red wall", (196, 206), (62, 80)),
    ("ceiling beside it, towards the green wall", (306, 316), (62, 80)),
    ("back wall, corner at the top left", (112, 132), (113, 133)),
    ("back wall, corner at the bottom right", (380, 400), (375, 395)),
    ("floor, foot of the tall box", (160, 240), (442, 448)),
    ("floor, penumbra of the short box", (400, 440), (455, 485)),
    ("left wall, shadow of the tall box", (70, 105), (330, 390)),
]

# Lines through penumbras: name, columns, rows, and along which of the two the light grows or fades.
PENUMBRAS = [
    ("floor, short box towards the green wall", (410, 484), (476, 484), "x"),
    ("floor, short box towards the viewer's left", (216, 300), (482, 486), "x"),
    ("left wall, upper edge of the tall box", (78, 82), (230, 410), "y"),
]


def asset():
    """(gltf, buffer) of the box."""
    gltf = json.loads(ASSET.read_text())
    return gltf, base64.b64decode(gltf["buffers"][0]["uri"].split(",", 1)[1])


def read_accessor(gltf, data, index):
    accessor = gltf["accessors"][index]
    view = gltf["bufferViews"][accessor["bufferView"]]
    kind, width = {5126: (np.float32, 3), 5123: (np.uint16, 1)}[accessor["componentType"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    return np.frombuffer(data, kind, accessor["count"] * width, start).reshape(-1, width)


def mitsuba_scene(mi):
    gltf, data = asset()
    camera = next(n for n in gltf["nodes"] if "camera" in n)
    origin = np.array(camera["translation"])
    fov = np.degrees(gltf["cameras"][0]["perspective"]["yfov"])
    view = mi.ScalarTransform4f().look_at(origin.tolist(), (origin + [0, 0, 1]).tolist(), [0, 1, 0])
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "component_format": "float32"}
    sensor = {"type": "perspective", "fov": fov, "fov_axis": "y", "to_world": view, "near_clip": 1e-3, "film": film}
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": DEPTH + 1}, "sensor": sensor}
    rgb = lambda color: {"type": "rgb", "value": [float(c) for c in color[:3]]}
    for node in gltf["nodes"]:
        if "mesh" not in node:
            continue
        primitive = gltf["meshes"][node["mesh"]]["primitives"][0]
        material = gltf["materials"][primitive["material"]]
        vertices = read_accessor(gltf, data, primitive["attributes"]["POSITION"])
        faces = read_accessor(gltf, data, primitive["indices"]).reshape(-1, 3)
        color = material["pbrMetallicRoughness"]["baseColorFactor"]
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(
            {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(color)}}
        )
        strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength")
        if strength:
            radiance = np.array(material["emissiveFactor"]) * strength
            properties["emitter"] = mi.load_dict({"type": "area", "radiance": rgb(radiance)})
        mesh = mi.Mesh(node["name"], len(vertices), len(faces), props=properties)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = np.ravel(vertices)
        parameters["faces"] = np.ravel(faces.astype(np.uint32))
        parameters.update()
        scene[node["name"].replace(" ", "_")] = mesh
    return mi.load_dict(scene)


def mitsuba(samples, write):
    common.find_llvm()
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    scene = mitsuba_scene(mi)
    for part in range(PARTS["mitsuba"]):
        # A few launches each, so that memory stays small.
        launches = max(samples // 64, 1)
        seeds = range(part * launches, (part + 1) * launches)
        pictures = [np.array(mi.render(scene, spp=samples // launches, seed=s))[..., :3] for s in seeds]
        write(part, np.mean(pictures, 0, dtype=np.float64))


def one_sided(material):
    """Emission from the front alone, which Blender's importer doesn't set up."""
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    color, strength = inputs["Emission Color"].default_value[:], inputs["Emission Strength"].default_value
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    output, emission = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeEmission")
    geometry, scale = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeMath")
    scale.operation = "MULTIPLY_ADD"
    scale.inputs[1].default_value, scale.inputs[2].default_value = -strength, strength
    emission.inputs["Color"].default_value = color
    links.new(geometry.outputs["Backfacing"], scale.inputs[0])
    links.new(scale.outputs[0], emission.inputs["Strength"])
    links.new(emission.outputs[0], output.inputs["Surface"])
    material.cycles.emission_sampling = "FRONT"


def cycles(samples, folder):
    import bpy
    import addon_utils  # found only once bpy is there

    bpy.ops.wm.read_factory_settings(use_empty=True)
    for name in ("cycles", "io_scene_gltf2"):
        addon_utils.enable(name)
    bpy.ops.import_scene.gltf(filepath=str(ASSET))
    scene = bpy.context.scene
    scene.camera = next(o for o in bpy.data.objects if o.type == "CAMERA")
    scene.world = bpy.data.worlds.new("black")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes.clear()
    one_sided(bpy.data.materials["light"])
    for thing in bpy.data.objects:
        if thing.type == "MESH":
            thing.cycles.shadow_terminator_geometry_offset = thing.cycles.shadow_terminator_offset = 0
    settings, output = scene.cycles, scene.render
    output.engine, settings.device = "CYCLES", "CPU"
    output.resolution_x = output.resolution_y = SIZE
    output.use_compositing = output.use_sequencer = False
    settings.pixel_filter_type, settings.filter_width = "BOX", 1.0
    settings.sample_clamp_direct = settings.sample_clamp_indirect = settings.blur_glossy = 0
    settings.use_denoising = settings.use_adaptive_sampling = False
    settings.max_bounces = settings.diffuse_bounces = DEPTH
    settings.samples = samples
    output.image_settings.file_format, output.image_settings.color_depth = "OPEN_EXR", "32"
    for part in range(PARTS["cycles"]):
        settings.seed = part
        output.filepath = str(Path(folder) / f"cycles.{part}.exr")
        bpy.ops.render.render(write_still=True)


def write_exr(path, picture):
    import mitsuba as mi

    mi.Bitmap(np.ascontiguousarray(picture, np.float32)).write(str(path))


def render(name, folder, samples):
    folder.mkdir(parents=True, exist_ok=True)
    if name == "mitsuba":
        mitsuba(samples, lambda part, picture: write_exr(folder / f"mitsuba.{part}.exr", picture))
    elif name == "cycles":
        cycles(samples, folder)
    else:
        size = ["--width", str(SIZE), "--height", str(SIZE), "--depth", str(DEPTH)]
        common.render(ASSET, folder, size, samples)
        for part in range(PARTS["oscura"]):
            (folder / f"{ASSET.stem}.{part + 1}.exr").replace(folder / f"oscura.{part}.exr")


def pixels(interval):
    """A range of columns or rows of this picture."""
    return slice(*(n * SIZE // 512 for n in interval))


def given_reference(mean, variance):
    """A reference from its two files, brought to the size of the other pictures by averaging blocks."""
    mean, variance = common.read(mean), common.read(variance)
    k = len(mean) // SIZE
    shrunk = lambda values: values.reshape(SIZE, k, SIZE, k, 3).mean((1, 3))
    return common.Picture(shrunk(mean), shrunk(variance) / k**2)


def load(folder, name):
    return common.Picture.of([common.read(folder / f"{name}.{part}.exr") for part in range(PARTS[name])])


def width(mean, line):
    """Pixels, of 512 a row, between a tenth and nine tenths of the way from dark to light along a line through a penumbra."""
    _, columns, rows, axis = line
    profile = mean[pixels(rows), pixels(columns)].mean(-1).mean(0 if axis == "x" else 1)
    profile = np.convolve(profile, np.ones(3) / 3, "valid")
    if profile[0] > profile[-1]:
        profile = profile[::-1]
    dark, light = profile[:4].mean(), profile[-4:].mean()

    def crossing(share):
        level = dark + share * (light - dark)
        after = int(np.argmax(profile >= level))
        return after - (profile[after] - level) / (profile[after] - profile[after - 1])

    return (crossing(0.9) - crossing(0.1)) * 512 / SIZE


def widths(picture, line):
    """The width and its standard error, by drawing the noise of the picture again."""
    random = np.random.default_rng(1)
    deviation = np.sqrt(picture.variance)
    draws = [width(picture.mean + deviation * random.standard_normal(picture.mean.shape), line) for _ in range(50)]
    return width(picture.mean, line), np.std(draws)


def table(folder, given):
    ours = load(folder, "oscura")
    others = {"Mitsuba": given_reference(*given) if given else load(folder, "mitsuba")}
    if (folder / "cycles.0.exr").exists():
        others["Cycles"] = load(folder, "cycles")
    print("| Ours over | R G B | Standard error | Blocks beyond 3 sigma | |\n|---|---|---|---:|---|")
    for name, other in others.items():
        a = common.compare(ours, other)
        cells = [name, common.by_channel(a.ratio, 5), common.by_channel(a.sigma, 5), f"{100 * a.beyond_3:.2f} %"]
        print(f"| {' | '.join(cells)} | {'agrees' if a.holds() else 'differs'} |")
        common.difference_picture(folder / f"difference-{name.lower()}.png", ours, other)
    print(f"\n| Part | Radiance R G B | {' | '.join(f'Ours / {n}, standard error' for n in others)} |")
    print("|---|---|" + "---|" * len(others))
    for part, columns, rows in PARTS_OF_THE_BOX:
        mask = np.zeros((SIZE, SIZE), bool)
        mask[pixels(rows), pixels(columns)] = True
        cells = [part, common.by_channel(ours.mean[mask].mean(0), 4)]
        for other in others.values():
            a = common.compare(ours, other, mask)
            cells.append(f"{common.by_channel(a.ratio, 4)}, {max(a.sigma):.4f}")
        print(f"| {' | '.join(cells)} |")
    print(f"\n| Width of the penumbra, pixels | Ours | {' | '.join(others)} |\n|---|---|" + "---|" * len(others))
    for line in PENUMBRAS:
        found = [widths(picture, line) for picture in (ours, *others.values())]
        print(f"| {line[0]} | {' | '.join(f'{w:.2f} +- {s:.2f}' for w, s in found)} |")


def main():
    what, folder, *rest = sys.argv[1:]
    if what == "table":
        table(Path(folder), rest)
    else:
        render(what, Path(folder), int(rest[0]) if rest else SAMPLES[what])


if __name__ == "__main__":
    main()
