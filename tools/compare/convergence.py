"""Denoised pictures beside noisy ones as samples are added: relMSE, FLIP and the error of the means of blocks of 32 x 32 pixels, of the same
samples.

    python tools/compare/convergence.py OUT [SCENE...]

Two references of other seeds make errors unbiased by the references' own noise: the error of a picture X is the mean of
(X - A)(X - B) / (R^2 + 0.01), with R the mean of the references A and B. Needs `pip install numpy OpenEXR`. `OSCURA` names another
binary, `REFERENCE` the samples of each reference (256), `LADDER` the numbers of samples, `WIDTH` the width (160). Parts (`.part`) in OUT are
kept: another binary denoises the same samples again."""

import json
import os
import subprocess
import sys

import numpy as np
import OpenEXR

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
OSCURA = os.environ.get("OSCURA", os.path.join(ROOT, "target", "release", "oscura"))
REFERENCE = os.environ.get("REFERENCE", "256")
LADDER = os.environ.get("LADDER", "4 16 64 256 1024").split()
WIDTH = os.environ.get("WIDTH", "160")
BLOCK = 32
SCENES = {
    "Cornell box": "scenes/thesis/cornell-box.toml",
    "glass and metal": "scenes/cornell-spheres.toml",
    "textures": "scenes/thesis/world-map.toml",
    "hair": "scenes/fur.toml",
    "depth of field": "scenes/thesis/defocus-out.toml",
    "motion": "scenes/flying-balls.toml",
    "many lamps": "scenes/many-lights.toml",
    "rings": "scenes/rings.toml",
    "fog": "scenes/cornell-beam.toml",
    "room with a window": "scenes/window.toml",
    "materials": "scenes/gallery.toml",
    "random spheres": "scenes/thesis/final-scene.toml",
    "scattering solids": "scenes/wax.toml",
    "smoke": "scenes/smoke.toml",
    "caustics": "scenes/thesis/glass-light-behind.toml",
    "hills": "scenes/hills.toml",
}


def run(*arguments):
    done = subprocess.run([OSCURA, *arguments, "--quiet"], capture_output=True, text=True, cwd=ROOT)
    if done.returncode != 0:
        sys.exit(f"{' '.join(arguments)}: {done.stderr}")
    return done.stdout


def render(scene, path, samples, *more):
    if not os.path.exists(path):
        fixed = ["--width", WIDTH, "--float", "--path-reuse", "off"]
        run("render", *scene.split(), "-o", path, "--spp", samples, *fixed, *more)


def read(path):
    channels = OpenEXR.File(path, separate_channels=True).channels()
    return np.stack([channels[name].pixels for name in "RGB"], -1).astype(np.float64)


def error(picture, references):
    first, second = references
    mean = 0.5 * (first + second)
    return float(((picture - first) * (picture - second) / (mean**2 + 0.01)).mean())


def blocks(picture):
    height, width = (n // BLOCK * BLOCK for n in picture.shape[:2])
    return picture[:height, :width].reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3).mean((1, 3))


def flip(path, reference):
    return json.loads(run("compare", path, reference, "--json"))["flip"]


def figures(path, references, reference):
    """relMSE, FLIP, the error of the blocks' means, and the picture's mean over the references'."""
    picture = read(path)
    ratio = picture.mean() / np.mean(references)
    of_blocks = error(blocks(picture), [blocks(reference) for reference in references])
    return error(picture, references), flip(path, reference), of_blocks, ratio


def main(out, scenes):
    os.makedirs(out, exist_ok=True)
    print("| Scene | Samples | relMSE: noisy, denoised, ratio | FLIP | blocks' relMSE | mean over the reference's |")
    print("|---|---:|---|---|---|---|")
    for name in scenes or SCENES:
        scene = SCENES.get(name, name)
        stem = os.path.join(out, os.path.splitext(os.path.basename(scene.split()[0]))[0])
        at = lambda what: f"{stem}-{what}"
        for seed in ("77", "78"):
            render(scene, at(f"{seed}.exr"), REFERENCE, "--seed", seed)
        references = [read(at(f"{seed}.exr")) for seed in ("77", "78")]
        for samples in LADDER:
            part = at(f"{samples}.part")
            render(scene, part, samples, "--denoise")
            found = []
            for what, how in [("noisy", "--no-denoise"), ("denoised", "--denoise")]:
                run("merge", part, "-o", at(f"{samples}-{what}.exr"), how, "--float")
                found.append(figures(at(f"{samples}-{what}.exr"), references, at("77.exr")))
            noisy, denoised = found
            cells = [f"{noisy[0]:.3g}, {denoised[0]:.3g}, {denoised[0] / noisy[0]:.2f}"]
            cells += [f"{a:.3g}, {b:.3g}" for a, b in zip(noisy[1:], denoised[1:])]
            print(f"| {name} | {samples} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
