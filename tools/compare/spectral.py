"""Coloured media by wavelength against Mitsuba 3's `scalar_spectral`: a ball without a surface, in a uniform sky or under a lamp.

    python spectral.py FOLDER

Both give coefficients the smooth spectra of Jakob and Hanika 2019 in the same way, light is daylight, and the observer is that of
1931.
"""

import os
import sys
from pathlib import Path

import common
import mitsuba as mi
import numpy as np

mi.set_variant("scalar_spectral")

SIZE, DEPTH, SEEDS = 64, 64, (1, 2, 3, 4)
SAMPLES = int(os.environ.get("SAMPLES", "1024"))
DENSITY = (0.4, 1.5, 4.0)
# Name: uniform sky, lamp, albedo, anisotropy.
SCENES = {
    "white furnace": (1.0, 0.0, (1.0, 1.0, 1.0), 0.4),
    "lamp": (0.0, 20.0, (0.95, 0.7, 0.3), 0.3),
    "sky": (1.0, 0.0, (0.6, 0.9, 0.4), 0.0),
}


def ours(name, folder):
    sky, lamp, albedo, g = SCENES[name]
    text = f"""
[camera]
look_from = [0, 0, 5]
look_at = [0, 0, 0]
type = "orthographic"
view_height = 1.8
[environment]
background = {sky}
[materials.inside]
type = "medium"
density = {list(DENSITY)}
color = {list(albedo)}
anisotropy = {g}
[[objects]]
sphere = {{ center = [0, 0, 0], radius = 1 }}
material = "inside"
"""
    if lamp:
        text += f"""
[materials.lamp]
type = "emissive"
radiance = {lamp}
two_sided = true
[[objects]]
quad = {{ corner = [-1, 2, -1], u = [2, 0, 0], v = [0, 0, 2] }}
material = "lamp"
"""
    path = folder / f"{name.replace(' ', '-')}.toml"
    path.write_text(text)
    options = ["--width", str(SIZE), "--height", str(SIZE), "--depth", str(DEPTH), "--spectral"]
    return common.render(path, folder, options, SAMPLES, SEEDS)


def theirs(name):
    sky, lamp, albedo, g = SCENES[name]
    most = 2 * max(DENSITY)
    # Spectra of reflectances are read only up to 1: half of the largest, as oscura has it for coefficients.
    inside = {
        "type": "homogeneous",
        "scale": most,
        "sigma_t": {"type": "rgb", "value": [s / most for s in DENSITY]},
        "albedo": {"type": "rgb", "value": list(albedo)},
        "phase": {"type": "hg", "g": g},
    }
    turn = mi.ScalarTransform4f
    scene = {
        "type": "scene",
        "integrator": {"type": "volpathmis", "max_depth": DEPTH, "rr_depth": 1000},
        "sensor": {
            "type": "orthographic",
            "to_world": turn().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0]) @ turn().scale([0.9, 0.9, 1]),
            "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}},
        },
        "ball": {"type": "sphere", "bsdf": {"type": "null"}, "interior": inside},
    }
    if sky:
        scene["sky"] = {"type": "constant", "radiance": {"type": "rgb", "value": sky}}
    if lamp:
        scene["lamp"] = {
            "type": "rectangle",
            "to_world": turn().translate([0, 2, 0]) @ turn().rotate([1, 0, 0], 90),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": lamp}},
            "bsdf": {"type": "diffuse", "reflectance": 0},
        }
    return mi.load_dict(scene)


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    print("| Scene | Ours / Mitsuba R G B | Standard error | Largest z | Blocks beyond 3 sigma | |")
    print("|---|---|---|---:|---:|---|")
    for name in SCENES:
        a, scene = ours(name, folder), theirs(name)
        b = common.Picture.of([np.array(mi.render(scene, spp=SAMPLES, seed=seed))[..., :3] for seed in SEEDS])
        found = common.compare(a, b)
        z = found.z[np.argmax(abs(found.z))]
        print(
            f"| {name} | {common.by_channel(found.ratio, 4)} | {common.by_channel(found.sigma, 4)} | {z:+.1f} | "
            f"{100 * found.beyond_3:.2f} % | {'agrees' if found.holds() else 'differs'} |",
            flush=True,
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
