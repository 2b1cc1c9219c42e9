"""The cost of features that no path reaches.

    python unused_features.py FOLDER [NAME...]

The Cornell box, whose surfaces are all Lambertian, with a speck behind its back wall where no path can come. Callgrind
counts the instructions of rendering with a speck of each material, against those with a Lambertian one. Counts at two
numbers of samples are subtracted, which takes loading, building and writing out.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

import common
from sheet import quad, write_png, write_sheet

ASSET = common.PROJECT / "assets/cornell-box.gltf"
SPECK = quad([0.27, 0.27, 0.6], [0, 0.001, 0], [0.001, 0, 0])
SAMPLES = (2, 10)
SIZE = 64

# Materials of scene files.
PLAIN = {
    "a picture": 'type = "lambert", color = "picture"',
    "marble": 'type = "lambert", color = "marble"',
    "Oren-Nayar": 'type = "oren-nayar"',
    "metal": 'type = "metal", name = "gold", roughness = 0.3',
    "clear glass": 'type = "dielectric"',
    "rough glass": 'type = "dielectric", roughness = 0.3',
    "absorbing glass": 'type = "pbr", transmission = 1.0, volume = true, attenuation_color = [0.5, 0.9, 0.9], '
    "attenuation_distance = 0.1, roughness = 0.0",
    "dispersive glass": 'type = "pbr", transmission = 1.0, volume = true, dispersion = 1.0, roughness = 0.0',
    "coat and sheen": 'type = "pbr", clearcoat = 1.0, sheen_color = 1.0, sheen_roughness = 0.4',
    "thin film": 'type = "pbr", metallic = 1.0, iridescence = 1.0',
    "diffuse transmission": 'type = "pbr", diffuse_transmission = 0.5',
}
# Materials of glTF files; all but the last Lambertian.
LAMBERT = {
    "pbrMetallicRoughness": {"metallicFactor": 0.0},
    "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}},
}
BASE_PICTURE = {**LAMBERT, "pbrMetallicRoughness": {"metallicFactor": 0.0, "baseColorTexture": {"index": 0}}}
BOTH_PICTURES = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}}
TEXTURED = {
    "Lambert, of a glTF file": LAMBERT,
    "a normal map": {**LAMBERT, "normalTexture": {"index": 0}},
    "alpha, blended": {**BASE_PICTURE, "alphaMode": "BLEND"},
    "alpha, masked": {**BASE_PICTURE, "alphaMode": "MASK"},
    "metallic and rough by pictures": {"pbrMetallicRoughness": BOTH_PICTURES},
}


def write_scene(path, subject, material):
    mesh = Path(os.path.relpath(ASSET, path.parent)).as_posix()
    lines = [f'camera = {{ from = "{mesh}" }}', "[environment]", "background = 0", "[textures]"]
    lines += ['picture = { type = "image", file = "picture.png" }', 'marble = { type = "marble" }', "[materials]"]
    lines += [f"speck = {{ {material} }}"] if material else []
    lines += ["[[objects]]", f'mesh = "{mesh}"', "[[objects]]", *subject]
    path.write_text("\n".join(lines) + "\n")


def instructions(scene, samples):
    program = os.environ.get("OSCURA", str(common.PROJECT / "target/release/oscura"))
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", program, "render", str(scene)]
    command += ["-o", str(scene.with_suffix(".exr")), "--width", str(SIZE), "--height", str(SIZE), "--threads", "1"]
    command += ["--spp", str(samples), "--path-reuse", "off", "--quiet", "--reproducible"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return int(re.search(r"Collected : (\d+)", done.stderr).group(1))


def rendering(scene):
    few, many = (instructions(scene, samples) for samples in SAMPLES)
    return (many - few) / (SAMPLES[1] - SAMPLES[0]) / SIZE**2


def scenes(folder):
    """(name, scene file) of each feature; a Lambertian speck, as a quad or as triangles, precedes the specks compared with
    it."""
    texels = np.random.default_rng(3).integers(0, 256, (32, 32, 4), np.uint8)
    write_png(folder / "picture.png", texels)
    flat = [f"quad = {{ corner = {SPECK['corner']}, u = {SPECK['u']}, v = {SPECK['v']} }}", 'material = "speck"']
    for name, material in {"Lambert": 'type = "lambert"', **PLAIN}.items():
        path = folder / f"{name.replace(' ', '-').replace(',', '')}.toml"
        write_scene(path, flat, material)
        yield name, path
    for name, material in TEXTURED.items():
        path = folder / f"{name.replace(' ', '-').replace(',', '')}.toml"
        write_sheet(path.with_suffix(".gltf"), SPECK, material, ["picture.png"])
        write_scene(path, [f'mesh = "{path.stem}.gltf"'], None)
        yield name, path


def main():
    folder, names = Path(sys.argv[1]).resolve(), sys.argv[2:]
    folder.mkdir(parents=True, exist_ok=True)
    print("| The speck has | Instructions a sample | More than with Lambert |\n|---|---:|---:|")
    base, worst = None, 0.0
    for name, scene in scenes(folder):
        if names and not name.startswith(("Lambert", *names)):
            continue
        count = rendering(scene)
        base = count if name.startswith("Lambert") else base
        more = count / base - 1
        worst = max(worst, more)
        print(f"| {name} | {count:,.0f} | {100 * more:+.2f} % |", flush=True)
    sys.exit(worst >= 0.02)


if __name__ == "__main__":
    main()
