"""Fog and smoke against Mitsuba 3's `volpath`: the same scene in both, tested by blocks, and what it costs.

    python media.py FOLDER [NAME...]

A ball of even fog, a box of smoke (a `.vol` file, which both read), dense milk and an upright slab two mean free paths thick stand on a grey floor under a square lamp and an even
sky. Neither stops paths before 64 bounces. The cost of a picture is its variance times the CPU seconds that it took, over all
pixels and channels: the time to a given error. Mitsuba's compiler has done its work before the clock starts.
"""

import os
import resource
import struct
import sys
import time
from pathlib import Path

import numpy as np

import common

common.find_llvm()
import mitsuba as mi

SAMPLES = int(os.environ.get("SAMPLES", "256"))
SIZE = 96
DEPTH = 64
SEEDS = (1, 2, 3, 4)
# By name: the medium's shape, extinction per metre, albedo, anisotropy.
MEDIA = {
    "fog": ("ball", 0.8, (0.9, 0.9, 0.9), 0.6),
    "smoke": ("grid", 12.0, (0.7, 0.8, 0.9), 0.3),
    "milk": ("ball", 20.0, (0.99, 0.97, 0.9), 0.0),
    "slab": ("slab", 10.0, (0.98, 0.9, 0.6), 0.5),
}


def smoke():
    """Noise in a box of 1.6 metres, as z, y, x."""
    n = 48
    z, y, x = (np.indices((n, n, n)) + 0.5) / n * 2 - 1
    waves = np.sin(9 * x + 4 * np.sin(7 * y)) * np.sin(8 * y + 3 * np.sin(6 * z)) * np.sin(7 * z + 2 * np.sin(5 * x))
    inside = np.clip(1 - np.sqrt(x * x + y * y + z * z), 0, 1)
    return (np.clip(0.25 + waves, 0, 1) * inside).astype(np.float32)


def write_vol(path, values):
    """Writes Mitsuba's grid format, with the box of oscura's medium."""
    d, h, w = values.shape
    head = b"VOL\x03" + struct.pack("<5I6f", 1, w, h, d, 1, -0.8, 0.2, -0.8, 0.8, 1.8, 0.8)
    path.write_bytes(head + values.tobytes())


def ours(name, folder):
    shape, density, albedo, g = MEDIA[name]
    grid = f'grid = "{name}.vol"\n' if shape == "grid" else ""
    solid = {
        "grid": "box = { min = [-0.8, 0.2, -0.8], max = [0.8, 1.8, 0.8] }",
        "slab": "box = { min = [-1.2, 0.2, -0.1], max = [1.2, 1.8, 0.1] }",
        "ball": "sphere = { center = [0, 1, 0], radius = 0.8 }",
    }[shape]
    text = f"""
[camera]
look_from = [0, 1.4, 5]
look_at = [0, 0.9, 0]
vfov = 32
width = {SIZE}
height = {SIZE}
[environment]
background = [0.2, 0.25, 0.3]
[materials]
floor = {{ type = "lambert", color = 0.5 }}
[materials.inside]
type = "medium"
density = {density}
color = {list(albedo)}
anisotropy = {g}
{grid}
[[lights]]
area = {{ center = [1, 3, 0.5], direction = [0, -1, 0], size = [1, 1], radiance = 12 }}
[[objects]]
{solid}
material = "inside"
[[objects]]
quad = {{ corner = [-4, 0, 4], u = [8, 0, 0], v = [0, 0, -8] }}
material = "floor"
"""
    path = folder / f"{name}.toml"
    path.write_text(text)
    return path


def theirs(name, folder):
    shape, density, albedo, g = MEDIA[name]
    t = mi.ScalarTransform4f
    phase = {"type": "hg", "g": g} if g else {"type": "isotropic"}
    color = {"type": "rgb", "value": list(albedo)}
    if shape == "grid":
        to_world = t().translate([-0.8, 0.2, -0.8]).scale(1.6)
        values = mi.TensorXf(smoke()[..., None])
        sigma = {"type": "gridvolume", "grid": mi.VolumeGrid(values), "to_world": to_world}
        medium = {"type": "heterogeneous", "sigma_t": sigma, "albedo": color, "scale": density, "phase": phase}
        solid = {"type": "cube", "to_world": t().translate([0, 1, 0]).scale(0.8)}
    else:
        medium = {"type": "homogeneous", "sigma_t": density, "albedo": color, "phase": phase}
        solid = {"type": "sphere", "center": [0, 1, 0], "radius": 0.8}
        if shape == "slab":
            solid = {"type": "cube", "to_world": t().translate([0, 1, 0]).scale([1.2, 0.8, 0.1])}
    down = t().translate([1, 3, 0.5]).rotate([1, 0, 0], 90).scale(0.5)
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "max_depth": DEPTH + 1, "rr_depth": 16},
            "sensor": {
                "type": "perspective",
                "fov": 32,
                "to_world": t().look_at([0, 1.4, 5], [0, 0.9, 0], [0, 1, 0]),
                "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}},
            },
            "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.2, 0.25, 0.3]}},
            "lamp": {
                "type": "rectangle",
                "to_world": down,
                "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 12}},
                "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0}},
            },
            "solid": {**solid, "interior": medium, "bsdf": {"type": "null"}},
            "floor": {
                "type": "rectangle",
                "to_world": t().rotate([1, 0, 0], -90).scale(4),
                "bsdf": {"type": "twosided", "b": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}}},
            },
        }
    )


def processor_seconds():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def main():
    mi.set_variant("llvm_ad_rgb")
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    print("| Scene | Ours / Mitsuba R G B | Standard error | Largest z | Blocks beyond 3 sigma | | Time to equal error |")
    print("|---|---|---|---:|---:|---|---:|")
    for name in sys.argv[2:] or MEDIA:
        write_vol(folder / f"{name}.vol", smoke())
        scene = ours(name, folder)
        before = processor_seconds()
        a = common.render(scene, folder, ["--depth", str(DEPTH)], SAMPLES, SEEDS)
        our_cost = (processor_seconds() - before) * a.variance.mean()
        reference = theirs(name, folder)
        np.array(mi.render(reference, spp=4))
        before = time.process_time()
        parts = [np.array(mi.render(reference, spp=SAMPLES, seed=seed))[..., :3] for seed in SEEDS]
        b = common.Picture.of(parts)
        their_cost = (time.process_time() - before) * b.variance.mean()
        common.difference_picture(folder / f"{name}.difference.png", a, b)
        found = common.compare(a, b)
        verdict = "agrees" if found.holds() else "differs"
        z = found.z[np.argmax(abs(found.z))]
        print(
            f"| {name} | {common.by_channel(found.ratio, 4)} | {common.by_channel(found.sigma, 4)} | {z:+.1f} | "
            f"{100 * found.beyond_3:.2f} % | {verdict} | {our_cost / their_cost:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
