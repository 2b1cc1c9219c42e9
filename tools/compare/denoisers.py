"""Our denoiser against plain non-local means (`nlm.py`): relMSE and FLIP of noisy and denoised pictures against converged
ones, and times, at several numbers of samples. Paths are neither shared nor split, so that both are given the same noise.

    python tools/compare/denoisers.py OUT [SCENE...]

Non-local means need `pip install numpy OpenEXR`, and are left out without. `OSCURA` names another binary, `REFERENCE` the samples
of the references (1024 by default), `WIDTH` the width (320)."""

import json
import os
import subprocess
import sys

import nlm

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
OSCURA = os.environ.get("OSCURA", os.path.join(ROOT, "target", "release", "oscura"))
REFERENCE = os.environ.get("REFERENCE", "1024")
WIDTH = os.environ.get("WIDTH", "320")
SCENES = ["assets/cornell-box.gltf", "scenes/cornell-spheres.toml", "scenes/thesis/final-scene.toml"]
LADDER = ["4", "16", "64"]


def run(*arguments):
    return subprocess.run([OSCURA, *arguments], check=True, capture_output=True, text=True, cwd=ROOT)


def render(scene, path, samples, *more):
    """Renders; gives the seconds that denoising took, if it was asked for."""
    fixed = ["--width", WIDTH, "--float", "--quiet", "--json"]
    report = json.loads(run("render", scene, "-o", path, "--spp", samples, *fixed, *more).stdout)
    return report["denoise_s"]


def errors(path, reference):
    found = json.loads(run("compare", path, reference, "--json").stdout)
    return found["rel_mse"], found["flip"]


def by_means(noisy, path, reference):
    """Errors of the noisy picture after non-local means."""
    if nlm.np is None:
        return ()
    nlm.denoise_file(noisy, path)
    return errors(path, reference)


def main(out, scenes):
    os.makedirs(out, exist_ok=True)
    print("| Scene | Samples | noisy: relMSE, FLIP | non-local means | ours: relMSE, FLIP, s |")
    print("|---|---:|---|---|---|")
    for scene in scenes or SCENES:
        name = os.path.splitext(os.path.basename(scene))[0]
        at = lambda what: os.path.join(out, f"{name}-{what}.exr")
        reference = at("reference")
        if not os.path.exists(reference):
            render(scene, reference, REFERENCE, "--seed", "77")
        for samples in LADDER:
            rows = []
            for what, more in [("noisy", ["--aov", "variance"]), ("ours", ["--denoise"])]:
                path = at(f"{samples}-{what}")
                seconds = render(scene, path, samples, *more, "--path-reuse", "off", "--splitting", "off")
                rows.append((*errors(path, reference), *([seconds] if seconds else [])))
            rows.insert(1, by_means(at(f"{samples}-noisy"), at(f"{samples}-means"), reference))
            cells = [", ".join(f"{value:.3g}" for value in row) for row in rows]
            print(f"| {name} | {samples} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
