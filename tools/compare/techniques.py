"""Do the techniques that change how light is found change the picture? Random scenes of mixed features (`random_scene.py`), each by
plain paths and with each technique.

    python tools/compare/techniques.py OUT [--scenes 1-40] [--ways sharing,guiding] [--without FEATURE,...] [--samples 64] [--edge 48] [--table]

needs `pip install OpenEXR numpy scipy pillow`. `OSCURA` names another binary. A line a comparison goes to OUT/results.jsonl; those that are there
already are not repeated. Pictures are means of independent renders (seeds), and so is their variance. Tests are Welch's: of the mean
of each channel, of each block of 8 x 8 pixels, and of the sum over the blocks of squared normal scores (chi-square); a comparison's p is
three times the least of the three, each corrected for its number of tests. Where it is below .01, it is repeated with other
seeds, four times as many of the technique and of plain paths, and that p counts: DIFFERS is p below .001 over the number of comparisons.

A block is not comparable if plain paths find its light too seldom: if the brightest pixel of one render among all renders of the
reference holds more than 4 % of the block's light (evenly: less than .1 %), and the whole picture is not where the blocks left out hold
more than half of the difference. A way that the scene can't have (the report has a warning) is skipped. Pictures of 192 pixels or more (--edge) have
trials of sharing and splitting. The way `control` is a picture that differs: no path has more than three bounces.
"""

import argparse
import json
import os
import subprocess
from pathlib import Path

import numpy as np
import OpenEXR
from random_scene import SIZE, RandomScene
from scipy import stats

PROGRAM = os.environ.get("OSCURA", str(Path(__file__).resolve().parents[2] / "target/release/oscura"))
BLOCK = 8
OFF = {"--path-reuse": "off", "--splitting": "off", "--guiding": "off", "--caustics": "off"}
WAYS = {
    "default": {key: "auto" for key in OFF},
    "sharing": OFF | {"--path-reuse": "4x4"},
    "splitting": OFF | {"--splitting": "4"},
    "guiding": OFF | {"--guiding": "on"},
    "caustics": OFF | {"--caustics": "on"},
    "all": {"--path-reuse": "off", "--splitting": "4", "--guiding": "on", "--caustics": "on"},
    "twin": OFF,
    "control": OFF | {"--depth": "3"},
}
# Seeds of the reference and of a technique, and how many times the samples of a technique the reference has.
SEEDS, MORE = 6, 4
SUSPECT, WRONG = 0.01, 0.001
LARGEST_SHARE = 0.04


def render(scene, options, samples, seed, edge):
    """The colours of a picture and its report."""
    path = scene.with_suffix(f".{os.getpid()}.exr")
    command = [PROGRAM, "render", str(scene), "-o", str(path), "--spp", str(samples), "--seed", str(seed), "--threads", "1", "--size", f"{edge}x{edge}"]
    command += ["--unbiased", "--float", "--no-denoise", "--json", *(word for pair in options.items() for word in pair)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    channels = {name: c.pixels for name, c in OpenEXR.File(str(path)).parts[0].channels.items()}
    path.unlink()
    pixels = channels["RGB"] if "RGB" in channels else channels["RGBA"][..., :3]
    return pixels.astype(np.float64), json.loads(done.stdout)


def renders(scene, options, samples, seeds, edge):
    """Pictures of several seeds; none where the scene can't have what the options ask for."""
    found = []
    for seed in seeds:
        pixels, report = render(scene, options, samples, seed, edge)
        asked = [key for key in OFF if options[key] not in ("off", "auto")]
        if len(asked) == 1 and "technique-unused" in report["warning_codes"]:
            return None
        found.append(pixels)
    return np.array(found)


def blocks(pictures):
    """Means of blocks: seed, row, column, channel."""
    n, height, width, _ = pictures.shape
    return pictures.reshape(n, height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3).mean((2, 4))


def welch(ours, reference):
    """p values of two-sided tests over the first axis; equal constants are 1."""
    floor = (1e-5 * (abs(reference.mean(0)) + 1e-6)) ** 2
    a, b = ours.var(0, ddof=1) / len(ours) + floor, reference.var(0, ddof=1) / len(reference) + floor
    freedom = (a + b) ** 2 / (a**2 / (len(ours) - 1) + b**2 / (len(reference) - 1))
    t = (ours.mean(0) - reference.mean(0)) / np.sqrt(a + b)
    return 2 * stats.t.sf(abs(t), freedom), t


def comparable(reference):
    """Blocks whose light plain paths find often enough."""
    grey = reference.mean(-1)
    n, height, width = grey.shape
    cut = grey.reshape(n, height // BLOCK, BLOCK, width // BLOCK, BLOCK)
    return cut.max((0, 2, 4)) <= LARGEST_SHARE * cut.sum((0, 2, 4))


def compare(ours, reference):
    """The p value of a comparison, and what it is made of."""
    inside = comparable(reference)
    a, b = blocks(ours), blocks(reference)
    difference = (a.mean(0) - b.mean(0)).mean(-1)
    left_out = abs(difference[~inside].sum()) / max(abs(difference).sum(), 1e-30)
    kept = left_out <= 0.5
    whole, t = welch(ours.mean((1, 2)), reference.mean((1, 2)))
    p, _ = welch(a.mean(-1), b.mean(-1))
    p = np.where(inside, p, 1.0)
    scores = stats.norm.isf(np.clip(p[inside] / 2, 1e-300, 0.5))
    parts = {
        "whole": min(1.0, 3 * whole.min()) if kept else 1.0,
        "block": min(1.0, inside.sum() * p.min()),
        "chi2": float(stats.chi2.sf((scores**2).sum(), max(1, inside.sum()))),
    }
    worst = np.unravel_index(p.argmin(), p.shape)
    return {
        "p": min(1.0, 3 * min(parts.values())),
        **parts,
        "ratio": (ours.mean((0, 1, 2)) / reference.mean((0, 1, 2))).round(5).tolist(),
        "t": t.round(2).tolist(),
        "worst": [int(v) for v in worst],
        "worst_ratio": float(a.mean((0, -1))[worst] / b.mean((0, -1))[worst]),
        "blocks": int(inside.sum()),
        "tests": int(inside.sum()) + 4,
    }


def tested(files, way, samples, seeds, reference, edge):
    """A comparison; none where the scene can't have the way."""
    file = files["twin" if way == "twin" else "scene"]
    if way == "twin" and not any(word in file.read_text() for word in ("dielectric", "transmission =", "glass_bsdf")):
        return None
    # The twin is as noisy as plain paths, or more.
    ours = renders(file, WAYS[way], samples * (MORE if way == "twin" else 1), seeds, edge)
    return ours if ours is None else (compare(ours, reference), ours)


def picture(path, ours, reference):
    """Both pictures, and their difference over the mean: red where ours is brighter, blue where it is darker."""
    from PIL import Image

    a, b = ours.mean(0), reference.mean(0)
    smooth = lambda v: sum(np.roll(v.mean(-1), (y, x), (0, 1)) for x in (-1, 0, 1) for y in (-1, 0, 1)) / 9
    d = np.clip(4 * (smooth(a) - smooth(b)) / (0.5 * smooth(a + b) + 0.01), -1, 1)
    difference = np.stack([1 + np.minimum(d, 0), 1 - abs(d), 1 - np.maximum(d, 0)], -1)
    shown = lambda v: np.clip(v / (2.5 * np.median(b.mean(-1)) + 1e-3), 0, 1) ** (1 / 2.2)
    strip = np.concatenate([shown(a), shown(b), difference], 1)
    Image.fromarray((255 * strip).astype(np.uint8)).resize((strip.shape[1] * 4, strip.shape[0] * 4), 0).save(path)


def scene(args, number, log, known):
    """All comparisons of a random scene."""
    folder = args.out / f"scene{number}"
    files = {name: RandomScene(number, folder, args.without, name == "twin").write() for name in ("scene", "twin")}
    references = {}

    def reference(seeds):
        if seeds not in references:
            references[seeds] = renders(files["scene"], OFF, MORE * args.samples, range(10_000 + seeds, 10_000 + 2 * seeds), args.edge)
        return references[seeds]

    for place, way in enumerate(args.ways):
        if (number, way) in known:
            continue
        first = 1000 * (place + 1)
        found = tested(files, way, args.samples, range(first, first + SEEDS), reference(SEEDS), args.edge)
        row = {"scene": number, "way": way, "p": None, "features": files["scene"].read_text().split("\n")[0][2:]}
        if found:
            again = bool(found[0]["p"] < SUSPECT)
            if again:
                found = tested(files, way, args.samples, range(first + 100, first + 100 + 4 * SEEDS), reference(4 * SEEDS), args.edge)
                picture(folder / f"{way}.png", found[1], reference(4 * SEEDS))
            row |= found[0] | {"again": again}
        print(json.dumps(row), file=log, flush=True)
        say(row)


def say(row):
    if row["p"] is None:
        print(f"{row['scene']:4} {row['way']:10} not used", flush=True)
        return
    ratio = " ".join(f"{v:.4f}" for v in row["ratio"])
    p = " ".join(f"{name} {row[name]:.2g}" for name in ("p", "whole", "block", "chi2"))
    worst = f"worst {row['worst']} {row['worst_ratio']:.3f}"
    print(f"{row['scene']:4} {row['way']:10} {ratio}  t {max(row['t'], key=abs):+.1f}  {p}  {worst}  {row['blocks']} blocks{' again' if row['again'] else ''}", flush=True)


def table(rows):
    """How many comparisons agree, by way."""
    rows = [row for row in rows if row["p"] is not None]
    limit = WRONG / max(1, len(rows))
    print("| way | scenes | tests | least p | differ | mean ratio | largest deviation |\n|---|" + "---:|" * 6)
    for way in WAYS:
        of = [row for row in rows if row["way"] == way]
        if of:
            ratios = np.array([row["ratio"] for row in of])
            differ = [row["scene"] for row in of if row["p"] < limit]
            far = abs(ratios - 1).max()
            cells = [way, len(of), sum(row["tests"] for row in of), f"{min(row['p'] for row in of):.2g}", differ or 0, f"{ratios.mean():.4f}", f"{100 * far:.2f} %"]
            print("| " + " | ".join(map(str, cells)) + " |")


def numbers(words):
    """1-3,7 as numbers."""
    ends = [[int(n) for n in word.split("-")] for word in words.split(",")]
    return [n for pair in ends for n in range(pair[0], pair[-1] + 1)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scenes", type=numbers, default=list(range(1, 41)))
    parser.add_argument("--ways", type=lambda words: words.split(","), default=[way for way in WAYS if way != "control"])
    parser.add_argument("--without", type=lambda words: words.split(","), default=[])
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--edge", type=int, default=SIZE, help="width and height in pixels, a multiple of 8")
    parser.add_argument("--table", action="store_true", help="print the table of what was compared")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    results = args.out / "results.jsonl"
    rows = [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []
    if not args.table:
        known = {(row["scene"], row["way"]) for row in rows}
        with open(results, "a") as log:
            for number in args.scenes:
                scene(args, number, log, known)
        return
    table(rows)


if __name__ == "__main__":
    main()
