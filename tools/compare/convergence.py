"""Denoised pictures beside noisy ones as samples are added: relMSE, FLIP, the error of the means of blocks of 32 x 32 pixels and the mean,
of the same samples; what the network says before the residual is restored, too; CPU time and memory.

    python tools/compare/convergence.py OUT [SCENE...]
    python tools/compare/convergence.py OUT --sheet     # OUT/sheet.png: noisy, network, denoised, reference at the first three numbers

Two references of other seeds make errors unbiased by the references' own noise: the error of a picture X is the mean of
(X - A)(X - B) / (R^2 + 0.01), with R the mean of the references A and B. FLIP (Andersson et al. 2020) is `oscura compare`'s, against R, and
contains the noise of it. The network alone is `oscura denoise` of a picture whose variance is said to be so large that nothing of the
residual stands out of it.

Needs `pip install numpy OpenEXR`, sheets `pillow`. `OSCURA` names another binary, `REFERENCE` the samples of each reference (256), `LADDER`
the numbers of samples, `WIDTH` the width (160). Parts (`.part`) in OUT are kept: another binary denoises the same samples again. The scenes
of `scenes/showcase` are built first: `python3 scenes/showcase/room/build.py`."""

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
    "forest": "scenes/showcase/forest/scene.toml",
    "furnished room": "scenes/showcase/room/scene.toml",
    "street": "scenes/showcase/street/scene.toml",
}


def run(*arguments):
    """The output, CPU seconds and the most memory in MB of a run of the program."""
    process = subprocess.Popen([OSCURA, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    out, problems = process.stdout.read(), process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"{' '.join(arguments)}: {problems}")
    return out, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def render(scene, path, samples, *more):
    """Renders what isn't there; gives the CPU seconds that it took."""
    times = path + ".json"
    if not os.path.exists(path):
        fixed = ["--width", WIDTH, "--float", "--path-reuse", "off"]
        _, seconds, _ = run("render", *scene.split(), "-o", path, "--spp", samples, *fixed, *more, "--quiet")
        with open(times, "w") as file:
            json.dump(seconds, file)
    with open(times) as file:
        return json.load(file)


def channels(path):
    return {name: channel.pixels for name, channel in OpenEXR.File(path, separate_channels=True).channels().items()}


def write(path, planes):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {name: np.ascontiguousarray(plane, np.float32) for name, plane in planes.items()}).write(path)


def read(path):
    planes = channels(path)
    return np.stack([planes[name] for name in "RGB"], -1).astype(np.float64)


def error(picture, references):
    first, second = references
    mean = 0.5 * (first + second)
    return float(((picture - first) * (picture - second) / (mean**2 + 0.01)).mean())


def blocks(picture):
    height, width = (n // BLOCK * BLOCK for n in picture.shape[:2])
    return picture[:height, :width].reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3).mean((1, 3))


def figures(path, references, reference):
    """relMSE, FLIP, the error of the blocks' means, and the picture's mean over the references'."""
    picture = read(path)
    ratio = picture.mean() / np.mean(references)
    flip = json.loads(run("compare", path, reference, "--json")[0])["flip"]
    return error(picture, references), flip, error(blocks(picture), [blocks(reference) for reference in references]), ratio


def denoised_by_network(noisy, path):
    """What the network makes of a picture: no residual stands out of so much noise."""
    planes = channels(noisy)
    planes.update({f"variance.{name}": np.full_like(planes["R"], 1e12) for name in "RGB"})
    write(path + ".in.exr", planes)
    run("denoise", path + ".in.exr", "-o", path, "--quiet")
    os.remove(path + ".in.exr")


class Ladder:
    """The pictures of a scene in a folder."""

    def __init__(self, out, name):
        self.scene = SCENES.get(name, name)
        self.stem = os.path.join(out, name.replace(" ", "-").replace("/", "-"))

    def at(self, what):
        return f"{self.stem}-{what}"

    def references(self):
        for seed in ("77", "78"):
            render(self.scene, self.at(f"{seed}.exr"), REFERENCE, "--seed", seed)
        references = [read(self.at(f"{seed}.exr")) for seed in ("77", "78")]
        write(self.at("reference.exr"), dict(zip("RGB", np.moveaxis(np.mean(references, 0), -1, 0))))
        return references

    def row(self, samples, references):
        part, kinds = self.at(f"{samples}.part"), ["noisy", "network", "denoised"]
        paths = [self.at(f"{samples}-{what}.exr") for what in kinds]
        seconds = render(self.scene, part, samples, "--denoise")
        _, before, _ = run("merge", part, "-o", paths[0], "--no-denoise", "--float", "--quiet")
        denoised_by_network(paths[0], paths[1])
        _, after, memory = run("merge", part, "-o", paths[2], "--denoise", "--float", "--quiet")
        found = [figures(path, references, self.at("reference.exr")) for path in paths]
        cells = [", ".join(f"{value[0]:.3g}" for value in found), f"{found[2][0] / found[0][0]:.2f}"]
        cells.append(", ".join(f"{value[1]:.4f}" for value in found))
        cells += [", ".join(f"{value[i]:.3g}" for value in found[::2]) for i in (2, 3)]
        return cells + [f"{seconds:.2f}, {after - before:.2f}", f"{memory:.0f}"]


def sheet(out, names):
    from PIL import Image

    def shown(path):
        picture = np.clip(read(path), 0, None)
        picture = picture / (1 + picture) if picture.mean() > 0.5 else picture
        srgb = np.where(picture <= 0.0031308, 12.92 * picture, 1.055 * np.maximum(picture, 1e-9) ** (1 / 2.4) - 0.055)
        return np.uint8(np.clip(255 * srgb + 0.5, 0, 255))

    for name in names:
        ladder = Ladder(out, name)
        rows = []
        for samples in LADDER[:3]:
            paths = [ladder.at(f"{samples}-{what}.exr") for what in ("noisy", "network", "denoised")]
            rows.append(np.concatenate([shown(path) for path in [*paths, ladder.at("reference.exr")]], 1))
        picture = Image.fromarray(np.concatenate(rows))
        picture.resize((2 * picture.width, 2 * picture.height), Image.NEAREST).save(ladder.at("sheet.png"))


def main(out, names):
    os.makedirs(out, exist_ok=True)
    if names and names[-1] == "--sheet":
        return sheet(out, names[:-1] or list(SCENES))
    print("| Scene | Samples | relMSE: noisy, network, denoised | denoised over noisy | FLIP: noisy, network, denoised "
          "| blocks' relMSE: noisy, denoised | mean over the reference's | s: render, denoise | MB |")
    print("|---|---:|---|---:|---|---|---|---|---:|")
    for name in names or SCENES:
        ladder = Ladder(out, name)
        references = ladder.references()
        for samples in LADDER:
            print(f"| {name} | {samples} | {' | '.join(ladder.row(samples, references))} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
