"""What each technique that decides by itself brings: scenes by default and without one technique, in turns.

    python tools/bench/features.py render PROGRAM FOLDER SCENES.json [--samples 16] [--seeds 3] [--used]
    python tools/bench/features.py table PROGRAM FOLDER

SCENES.json holds a list of [name, arguments of `oscura render`]. `render` uses one thread and appends a line a picture to
FOLDER/runs.jsonl; with --used it switches off only what the default uses. `table` prints gains, (error x CPU time) without
over with, from scenes that use the technique: of all pixels, without the worst hundredth, and of denoised pictures, and the ratios of FLIP.

The error is half the squared difference of two seeds, relative to the mean of all pictures: no reference is needed. Denoised pictures
and FLIP are compared with the mean of all pictures of other seeds, whose own noise makes their ratios smaller than they are.
"""

import argparse
import itertools
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import OpenEXR

WAYS = {
    "default": [],
    "sharing": ["--path-reuse", "off"],
    "splitting": ["--splitting", "off"],
    "guiding": ["--guiding", "off"],
}
USED = {
    "sharing": lambda report: report["path_reuse"] is not None,
    "splitting": lambda report: report["branches"] > 1,
    "guiding": lambda report: report["guide_cells"] is not None,
}


def render(args):
    """Renders all scenes, seed by seed."""
    scenes = json.loads(Path(args.scenes).read_text())
    with open(args.folder / "runs.jsonl", "a") as log:
        for seed, (scene, arguments) in itertools.product(range(1, args.seeds + 1), scenes):
            default = None
            for way, options in WAYS.items():
                if args.used and default and not USED[way](default):
                    continue
                picture = args.folder / f"{scene}.{args.samples}.{way}.{seed}.exr".replace("/", "_")
                report = rendered(args, [*arguments, *options, "--seed", str(seed), "-o", str(picture)])
                default = default or report
                run = {"scene": scene, "samples": args.samples, "way": way, "seed": seed, "file": str(picture), "report": report}
                print(json.dumps(run), file=log, flush=True)


def rendered(args, arguments):
    """The report of a render."""
    command = [args.program, "render", *arguments, "--spp", str(args.samples), "--size", args.size, "--threads", "1", "--float"]
    command += ["--no-denoise", "--aov", "denoising_albedo,denoising_normal", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def pixels(path):
    """The colours of a picture."""
    channels = {name: channel.pixels for name, channel in OpenEXR.File(str(path)).parts[0].channels.items()}
    rgb = channels.get("RGB", channels.get("RGBA"))
    return rgb[..., :3].astype(np.float64)


def write(path, image):
    """Writes colours."""
    channels = {"RGB": np.ascontiguousarray(image, dtype=np.float32)}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, channels).write(str(path))


def both(errors):
    """Means of all errors, and without the largest hundredth."""
    errors = np.sort(errors.ravel())
    return np.array([errors.mean(), errors[: int(len(errors) * 0.99)].mean()])


class Scene:
    """The pictures of a scene."""

    def __init__(self, program, runs):
        self.program = program
        self.runs = {(r["samples"], r["way"], r["seed"]): r for r in runs}
        self.images = {key: pixels(r["file"]) for key, r in self.runs.items()}
        mean = self.mean_without(None)
        self.weight = 1 / (mean.mean(-1, keepdims=True) ** 2 + 1e-2 * mean.mean() ** 2)

    def mean_without(self, seed):
        """The mean of all pictures of other seeds."""
        others = [(key[0], image) for key, image in self.images.items() if key[2] != seed]
        return sum(n * image for n, image in others) / sum(n for n, _ in others)

    def seeds(self, samples, way):
        return [seed for n, w, seed in self.runs if (n, w) == (samples, way)]

    def variance(self, samples, way, seeds):
        """The pixel error by pairs of seeds."""
        images = [self.images[samples, way, seed] for seed in seeds]
        squares = [((a - b) ** 2 / 2 * self.weight).mean(-1) for a, b in itertools.combinations(images, 2)]
        return both(sum(squares) / len(squares))

    def seconds(self, samples, way, seeds):
        return np.exp(np.mean([np.log(self.runs[samples, way, seed]["report"]["render_cpu_s"]) for seed in seeds]))

    def seen(self, samples, way, seed):
        """FLIP of a picture, FLIP and the error of the denoised one."""
        with tempfile.TemporaryDirectory() as folder:
            reference, noisy, clean = (Path(folder) / f"{name}.exr" for name in ("reference", "noisy", "clean"))
            mean = self.mean_without(seed)
            write(reference, mean)
            write(noisy, self.images[samples, way, seed])
            file = self.runs[samples, way, seed]["file"]
            subprocess.run([self.program, "denoise", file, "-o", clean, "--quiet"], check=True)
            image = pixels(clean)
            write(clean, image)
            flips = [self.flip(picture, reference) for picture in (noisy, clean)]
        return np.array([*flips, *both(((image - mean) ** 2 * self.weight).mean(-1))])

    def flip(self, picture, reference):
        done = subprocess.run([self.program, "compare", picture, reference, "--json"], capture_output=True, text=True)
        return json.loads(done.stdout)["flip"]

    def gains(self, samples, way):
        """Gains; none where a seed doesn't use the technique or with a single seed."""
        common = [s for s in self.seeds(samples, "default") if s in self.seeds(samples, way)]
        if way == "default" or len(common) < 2 or not all(USED[way](self.runs[samples, "default", s]["report"]) for s in common):
            return None
        time = self.seconds(samples, way, common) / self.seconds(samples, "default", common)
        error = self.variance(samples, way, common) / self.variance(samples, "default", common)
        seen = [sum(self.seen(samples, w, s) for s in common[:2]) for w in (way, "default")]
        flip, denoised_flip, *denoised = seen[0] / seen[1]
        return [time, *(error * time), flip, *(np.array(denoised) * time), denoised_flip]


def table(args):
    """Prints gains by technique and number of samples."""
    runs = [json.loads(line) for line in (args.folder / "runs.jsonl").read_text().splitlines()]
    scenes = {name: Scene(args.program, list(of)) for name, of in itertools.groupby(sorted(runs, key=by_scene), by_scene)}
    for samples, way in sorted({(run["samples"], run["way"]) for run in runs}):
        rows = {name: scene.gains(samples, way) for name, scene in scenes.items()}
        rows = {name: row for name, row in rows.items() if row}
        if rows:
            print(f"\n| {way}, {samples} samples | time | gain | trimmed | FLIP | denoised | trimmed | FLIP |\n|---|" + "---:|" * 7)
            rows["geometric mean"] = np.exp(np.mean(np.log(list(rows.values())), 0))
            for name, row in rows.items():
                print(f"| {name} | " + " | ".join(f"{value:.2f}" for value in row) + " |")


def by_scene(run):
    return run["scene"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    for name, run in (("render", render), ("table", table)):
        command = commands.add_parser(name)
        command.set_defaults(run=run)
        command.add_argument("program")
        command.add_argument("folder", type=Path)
        if name == "render":
            command.add_argument("scenes")
            command.add_argument("--samples", type=int, default=16)
            command.add_argument("--seeds", type=int, default=3)
            command.add_argument("--size", default="256x144")
            command.add_argument("--used", action="store_true", help="switch off only what the default uses")
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
