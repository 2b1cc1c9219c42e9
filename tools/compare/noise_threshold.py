"""Errors of denoised renders that stop at a noise threshold: the program's bound, and the true error by two references of other
seeds.

    python tools/compare/noise_threshold.py OUT [SCENE...]

`NOISE` is the threshold in percent (5), `MAX` the maximum number of samples (1024), `SEEDS` the seeds. References in OUT, scenes, width and
the binary are those of `convergence.py`. Errors are roots of the relMSE, in percent."""

import json
import os
import sys

from convergence import SCENES, WIDTH, Ladder, error, read, run

NOISE = os.environ.get("NOISE", "5")
MAX = os.environ.get("MAX", "1024")
SEEDS = os.environ.get("SEEDS", "5 6").split()


def picture(ladder, seed, references):
    """Samples, bound and true error in percent, and CPU seconds."""
    path = ladder.at(f"threshold-{NOISE}-{seed}.exr")
    stop = ["--noise", NOISE, "--denoise", "--max-spp", MAX, "--seed", seed]
    out, seconds, _ = run("render", *ladder.scene.split(), "-o", path, *stop, "--width", WIDTH, "--float", "--json", "--quiet")
    report = json.loads(out.strip().splitlines()[-1])
    true = 100 * max(error(read(path), references), 0) ** 0.5
    return report["samples_per_pixel"], 100 * report["estimated_error"], true, seconds


def main(out, names):
    os.makedirs(out, exist_ok=True)
    print("| Scene | Samples: bound, true error, seconds |")
    print("|---|---|")
    for name in names or SCENES:
        ladder = Ladder(out, name)
        references = ladder.references()
        rows = [picture(ladder, seed, references) for seed in SEEDS]
        cells = "; ".join(f"{samples:.0f}: {bound:.1f}, {true:.1f}, {seconds:.1f}" for samples, bound, true, seconds in rows)
        print(f"| {name} | {cells} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
