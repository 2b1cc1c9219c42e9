"""Can a picture's samples tell the error that is left after denoising? Two pictures A and B of other seeds are denoised apart, D(A) and D(B). What
their mean F is off by, squared, is

    (D(A) - D(B))^2 / 4 + (A - D(A)) (B - D(B))

on average: the first term is what differs by chance, the second the squared bias, since the noise of A has nothing to do with that of B.
It is taken relative to F^2 + 0.01, with the mean of the eight pixels around in place of F where that is less: where noise is left, F is too bright.

    python tools/compare/denoised_error.py OUT [SCENE...]

Parts and references in OUT are those of `convergence.py`, with its settings; `LADDER` has the samples of each of the two. `estimate / true`
is of F; in brackets the standard error of the estimate from the spread of pixels."""

import os
import sys

import numpy as np
from convergence import LADDER, SCENES, Ladder, error, read, render, run


def around(picture):
    """The mean of the eight pixels around each pixel."""
    height, width = picture.shape[:2]
    padded = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    total = sum(padded[y : y + height, x : x + width] for y in range(3) for x in range(3))
    return (total - picture) / 8


def pair(ladder, samples, seed):
    """The noisy and the denoised picture."""
    part = ladder.at(f"{samples}-seed{seed}.part")
    render(ladder.scene, part, samples, "--denoise", "--seed", seed)
    pictures = []
    for what, how in [("noisy", "--no-denoise"), ("denoised", "--denoise")]:
        path = ladder.at(f"{samples}-seed{seed}-{what}.exr")
        run("merge", part, "-o", path, how, "--float", "--quiet")
        pictures.append(read(path))
    return pictures


def estimate(a, clean_a, b, clean_b):
    """The estimate of F's relMSE, its standard error, and the share of what differs by chance."""
    mean = 0.5 * (clean_a + clean_b)
    scale = np.minimum(mean, around(mean)) ** 2 + 0.01
    chance, bias = 0.25 * (clean_a - clean_b) ** 2 / scale, (a - clean_a) * (b - clean_b) / scale
    of_pixels = (chance + bias).mean(-1)
    return of_pixels.mean(), of_pixels.std() / np.sqrt(of_pixels.size), chance.mean() / of_pixels.mean()


def main(out, names):
    os.makedirs(out, exist_ok=True)
    print("| Scene | Samples | relMSE: noisy, denoised | estimate / true | by chance |")
    print("|---|---:|---|---:|---:|")
    for name in names or SCENES:
        ladder = Ladder(out, name)
        references = ladder.references()
        for samples in LADDER:
            (a, clean_a), (b, clean_b) = (pair(ladder, samples, seed) for seed in ("5", "6"))
            found, deviation, chance = estimate(a, clean_a, b, clean_b)
            true = error(0.5 * (clean_a + clean_b), references)
            cells = [f"{error(0.5 * (a + b), references):.3g}, {true:.3g}", f"{found / true:.2f} ({deviation / true:.2f})"]
            print(f"| {name} | 2 x {samples} | {' | '.join(cells)} | {chance:.2f} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
