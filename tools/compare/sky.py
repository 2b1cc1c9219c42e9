"""The clear sky against Mitsuba 3's `sunsky` emitter, which evaluates the same model by data of its own.

    python sky.py FOLDER

A camera without a lens looks up into the sky, without its sun. Mitsuba's emitter is asked for the radiance in the direction of each pixel. Units
differ by one factor, which is that of all skies; what remains are the shares of the three channels and the
shape. The table gives the factor by channel, over its mean, and by how much pixels differ from it.
"""

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

import common

common.find_llvm()
import mitsuba as mi  # noqa: E402

mi.set_variant("llvm_ad_rgb")

SIZE = 64
VFOV = 120.0
# Elevation of the sun, turbidity, albedo of the ground.
SKIES = [(10, 2, 0.2), (30, 3, 0.2), (60, 3, 0.2), (30, 6, 0.2), (30, 3, 0.8), (80, 10, 0.0)]


def ours(folder, elevation, turbidity, albedo):
    scene = folder / "sky.toml"
    scene.write_text(
        f"""[camera]
look_from = [0, 0, 0]
look_at = [0, 1, 0]
view_up = [0, 0, -1]
vfov = {VFOV}
width = {SIZE}
height = {SIZE}
[environment]
sky = {{ sun_elevation = {elevation}, turbidity = {turbidity}, ground_albedo = {albedo}, sun = false }}
[materials]
a = {{ type = "lambert" }}
[[objects]]
sphere = {{ center = [0, -9, 0], radius = 1 }}
material = "a"
"""
    )
    program = os.environ.get("OSCURA", str(common.PROJECT / "target/release/oscura"))
    picture = folder / "sky.exr"
    command = [program, "render", str(scene), "-o", str(picture), "--quiet", *common.PLAIN, "--spp", "64"]
    subprocess.run(command, check=True)
    return common.read(picture)


def theirs(elevation, turbidity, albedo):
    height = math.radians(elevation)
    # Mitsuba's sky has z up; azimuth 0 of ours is -z, here y.
    sun = [0.0, math.cos(height), math.sin(height)]
    sky = mi.load_dict(
        {
            "type": "sunsky",
            "sun_direction": sun,
            "turbidity": float(turbidity),
            "albedo": {"type": "rgb", "value": [float(albedo)] * 3},
            "sun_scale": 0.0,
        }
    )
    at = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    reach = math.tan(math.radians(VFOV / 2))
    right, down = np.meshgrid(at * reach, at * reach)
    # Up is the view; the picture's right is x, its top -z of ours: y here.
    directions = np.stack([right, -down, np.ones_like(right)], -1)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    si = mi.SurfaceInteraction3f()
    si.wi = -mi.Vector3f(*directions.reshape(-1, 3).T.astype(np.float32))
    return np.array(sky.eval(si)).T.reshape(SIZE, SIZE, 3)


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    print("| Sun | Turbidity | Albedo | Factor | R G B over it | RMS of the rest | 99 % of pixels within |")
    print("|---:|---:|---:|---:|---|---:|---:|")
    for elevation, turbidity, albedo in SKIES:
        a, b = ours(folder, elevation, turbidity, albedo), theirs(elevation, turbidity, albedo)
        ratio = a / b
        by_channel = ratio.mean((0, 1))
        rest = ratio / by_channel - 1
        print(
            f"| {elevation} | {turbidity} | {albedo} | {by_channel.mean():.4f} | "
            f"{common.by_channel(by_channel / by_channel.mean(), 4)} | {100 * np.sqrt((rest**2).mean()):.2f} % | "
            f"{100 * np.quantile(abs(rest), 0.99):.2f} % |"
        )


if __name__ == "__main__":
    main()
