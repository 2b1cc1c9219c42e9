"""Flicker of denoised frames: what is left of the errors of frames, compared between neighbours.

    python tools/compare/flicker.py OUT [SCENE...]

Frames are rendered noisy, denoised one by one (`--denoise-alone`) and with their neighbours (`--frames A-B --denoise`), each with a
seed of its own. Two measures: the mean squared change, between neighbouring frames, of the error, over R^2 + 0.01 (what moves in the reference
is no flicker; the product with two references of other seeds leaves their noise out); and the same of pixels read where motion vectors say that
their surface was in the frame before, without the reference. FLIP between a frame and its reference says that nothing was bought by blur. Needs
`pip install numpy OpenEXR`. `OSCURA` names another binary; `SPP` (8), `REFERENCE` (64, of each), `WIDTH` (160), `FRAMES` (1-5)."""

import json
import os
import sys

import numpy as np
from convergence import ROOT, channels, read, run

SPP = os.environ.get("SPP", "8")
REFERENCE = os.environ.get("REFERENCE", "64")
WIDTH = os.environ.get("WIDTH", "160")
FIRST, LAST = (int(n) for n in os.environ.get("FRAMES", "1-5").split("-"))
# Scenes whose camera moves by this between frames.
SCENES = {
    "glass and metal": ("scenes/cornell-spheres.toml", [0.004, 0.002, 0.0]),
    "rings": ("scenes/rings.toml", [0.05, 0.02, 0.0]),
    "many lamps": ("scenes/many-lights.toml", [0.06, 0.0, 0.0]),
    "room with a window": ("scenes/window.toml", [0.015, 0.0, 0.01]),
    "random spheres": ("scenes/thesis/final-scene.toml", [0.05, 0.0, 0.0]),
}
WAYS = {"noisy": ["--no-denoise"], "alone": ["--denoise", "--denoise-alone"], "neighbours": ["--denoise"]}


def moving(out, name):
    """The scene with a camera that moves."""
    scene, step = SCENES[name]
    path = os.path.join(out, name.replace(" ", "-") + ".toml")
    with open(os.path.join(ROOT, scene)) as file:
        text = file.read().replace("[camera]\n", f"[camera]\nmotion = {{ translate = {step} }}\n", 1)
    for folder in ("meshes", "textures", "curves"):
        text = text.replace(f'"../{folder}/', f'"{folder}/').replace(f'"{folder}/', f'"{ROOT}/scenes/{folder}/')
    with open(path, "w") as file:
        file.write(text)
    return path


def sequence(scene, pattern, spp, *how):
    """Renders the frames that aren't there."""
    if not os.path.exists(pattern.replace("##", f"{LAST:02d}")):
        fixed = ["--width", WIDTH, "--float", "--path-reuse", "off", "--animate-seed", "--allow-external", "--quiet"]
        run("render", scene, "--frames", f"{FIRST}-{LAST}", "-o", pattern, "--spp", spp, *fixed, *how)


def reprojected(frame, before, motion):
    """Frame `before` where its surfaces are in `frame`, and which pixels have a place there."""
    height, width = frame.shape[:2]
    y, x = np.mgrid[:height, :width]
    u, v = x + motion[0], y - motion[1]
    i, j = np.rint(u).astype(int), np.rint(v).astype(int)
    inside = (i >= 0) & (j >= 0) & (i < width) & (j < height)
    return before[np.clip(j, 0, height - 1), np.clip(i, 0, width - 1)], inside


def flicker(frames, references, motions):
    of_errors, of_surfaces = [], []
    means = [0.5 * (first + second) for first, second in references]
    for k in range(1, len(frames)):
        scale = means[k] ** 2 + 0.01
        first, second = ((frames[k] - references[k][i]) - (frames[k - 1] - references[k - 1][i]) for i in (0, 1))
        of_errors.append((first * second / scale).mean())
        before, inside = reprojected(frames[k], frames[k - 1], motions[k])
        of_surfaces.append((((frames[k] - before) ** 2) / scale)[inside].mean())
    return np.mean(of_errors), np.mean(of_surfaces)


def main(out, names):
    os.makedirs(out, exist_ok=True)
    print("| Scene | change of the error: noisy, alone, neighbours | over alone | reprojected: noisy, alone, neighbours | FLIP: alone, neighbours |")
    print("|---|---|---:|---|---|")
    for name in names or SCENES:
        scene, stem = moving(out, name), os.path.join(out, name.replace(" ", "-"))
        for seed in ("1000", "2000"):
            sequence(scene, f"{stem}-{seed}.##.exr", REFERENCE, "--seed", seed, "--aov", "motion")
        at = lambda way, k: f"{stem}-{way}.{k:02d}.exr"
        numbers = range(FIRST, LAST + 1)
        references = [[read(at(seed, k)) for seed in ("1000", "2000")] for k in numbers]
        planes = [channels(at("1000", k)) for k in numbers]
        motions = [[of["Vector.X"], of["Vector.Y"]] for of in planes]
        found, flips = {}, {}
        for way, how in WAYS.items():
            sequence(scene, f"{stem}-{way}.##.exr", SPP, *how)
            found[way] = flicker([read(at(way, k)) for k in numbers], references, motions)
            flip = lambda k: json.loads(run("compare", at(way, k), at("1000", k), "--json")[0])["flip"]
            flips[way] = np.mean([flip(k) for k in numbers])
        cells = [", ".join(f"{found[way][0]:.3g}" for way in WAYS), f"{found['neighbours'][0] / found['alone'][0]:.2f}"]
        cells.append(", ".join(f"{value:.3g}" for value in (found[way][1] for way in WAYS)))
        print(f"| {name} | {' | '.join(cells)} | {flips['alone']:.4f}, {flips['neighbours']:.4f} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
