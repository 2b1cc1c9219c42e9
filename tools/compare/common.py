"""Shared by comparisons: running oscura, pictures with their noise, and the test of agreement.

A `Picture` is the mean of independent renders of one scene together with the variance of that mean. Two pictures agree
where their difference is no more than their noise explains.
"""

import glob
import json
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parent.parent

# The renderer's exact model without what it adds to it by default: compensation of what microfacets lose, and the
# softening of shadows where shading normals differ from geometric ones.
PLAIN = ["--microfacet", "single", "--terminator", "off", "--filter", "box", "--float"]

# Edge of the blocks that are tested, pixels. Blocks make the variance, estimated from two renders, a fair one.
BLOCK = 8

# Relative rounding error of single-precision sums: the only noise of a constant background.
ROUNDING = 1e-5


@dataclass
class Picture:
    """Linear radiance and the variance of its pixels, both of shape (height, width, 3)."""

    mean: np.ndarray
    variance: np.ndarray

    @staticmethod
    def of(parts):
        """From independent renders of the same scene."""
        parts = np.asarray(parts, np.float64)
        return Picture(parts.mean(0), parts.var(0, ddof=1) / len(parts))


@dataclass
class Agreement:
    """Agreement of a picture with a reference, over all pixels or those of a mask. Arrays are per channel."""

    ratio: np.ndarray  # mean over the reference's mean
    sigma: np.ndarray  # standard error of the ratio
    z: np.ndarray  # difference of the means in standard errors
    beyond_3: float  # fraction of blocks that differ by more than 3 standard deviations
    blocks: int  # number of blocks times channels

    def holds(self):
        """Means within 4 standard errors, at most 2 % of the blocks beyond 3."""
        return bool((abs(self.z) < 4).all()) and self.beyond_3 <= 0.02


def block_means(values):
    """Means of square blocks; incomplete rows and columns are omitted."""
    height, width = (n // BLOCK * BLOCK for n in values.shape[:2])
    cut = values[:height, :width]
    return cut.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3).mean((1, 3))


def compare(ours, reference, mask=None):
    """Compares two pictures; with a mask (height, width), its pixels, and the blocks completely inside."""
    inside = np.ones(ours.mean.shape[:2], bool) if mask is None else mask
    of = lambda values: values[inside].mean(0)
    sigma = np.sqrt((of(ours.variance) + of(reference.variance)) / inside.sum())
    difference = of(ours.mean) - of(reference.mean)
    rounding = ROUNDING * block_means(reference.mean)
    deviation = np.sqrt(block_means(ours.variance + reference.variance) / BLOCK**2 + rounding**2 + 1e-20)
    z = (block_means(ours.mean) - block_means(reference.mean)) / deviation
    whole = block_means(np.repeat(inside[..., None].astype(float), 3, 2)) == 1
    beyond = float((abs(z[whole]) > 3).mean()) if whole.any() else 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        return Agreement(
            of(ours.mean) / of(reference.mean),
            sigma / of(reference.mean),
            difference / (sigma + 1e-20),
            beyond,
            int(whole.sum()),
        )


def read(path):
    """The colour of an EXR file."""
    import mitsuba

    if mitsuba.variant() is None:
        mitsuba.set_variant("scalar_rgb")
    bitmap = mitsuba.Bitmap(str(path)).convert(
        mitsuba.Bitmap.PixelFormat.RGB, mitsuba.Struct.Type.Float32, srgb_gamma=False
    )
    return np.array(bitmap, np.float64)


def render(scene, out, options, samples, seeds=(1, 2)):
    """Renders a scene file by oscura, with its noise."""
    program = os.environ.get("OSCURA", str(PROJECT / "target/release/oscura"))
    parts = []
    for seed in seeds:
        path = Path(out) / f"{Path(scene).stem}.{seed}.exr"
        command = [program, "render", str(scene), "-o", str(path), "--quiet", *PLAIN, *options]
        command += ["--spp", str(samples), "--path-reuse", "off", "--seed", str(seed)]
        command += ["--threads", os.environ.get("THREADS", str(os.cpu_count()))]
        subprocess.run(command, check=True)
        parts.append(read(path))
    return Picture.of(parts)


def find_llvm():
    """Points Mitsuba at a usable libLLVM: the Rust toolchain brings one."""
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        found = glob.glob(os.path.expanduser("~/.rustup/toolchains/*/lib/libLLVM.so*"))
        if found:
            os.environ["DRJIT_LIBLLVM_PATH"] = sorted(found)[0]


def difference_picture(path, ours, reference):
    """Difference over mean, smoothed over 3 x 3 pixels: red where ours is brighter, blue where it is darker; a quarter is
    full colour."""
    from PIL import Image

    def smooth(values):
        grey = np.pad(values.mean(-1), 1, mode="edge")
        shifted = [grey[y : y + values.shape[0], x : x + values.shape[1]] for y in range(3) for x in range(3)]
        return np.mean(shifted, 0)

    a, b = smooth(ours.mean), smooth(reference.mean)
    d = np.clip(4 * (a - b) / (0.5 * (a + b) + 0.02), -1, 1)
    rgb = np.stack([1 + np.minimum(d, 0), 1 - abs(d), 1 - np.maximum(d, 0)], -1)
    Image.fromarray((255 * rgb).astype(np.uint8)).save(path)


def by_channel(values, digits):
    """Numbers as a table shows them."""
    return " ".join(f"{v:.{digits}f}" for v in values)


def print_row(name, found):
    """A row of a table: how a scene compares."""
    cells = [name, by_channel(found.ratio, 4), by_channel(found.sigma, 4), f"{max(found.z, key=abs):+.1f}"]
    print(f"| {' | '.join(cells)} | {100 * found.beyond_3:.2f} % | {'agrees' if found.holds() else 'DIFFERS'} |", flush=True)


def read_glb(path):
    """The JSON of a .glb file."""
    data = Path(path).read_bytes()
    length = int.from_bytes(data[12:16], "little")
    return json.loads(data[20 : 20 + length])
