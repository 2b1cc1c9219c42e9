"""Non-local means, for comparison with denoisers that know more: weights by how alike square patches of the picture are, less
what noise alone makes them differ (Rousselle, Knaus and Zwicker 2012, section 4; Buades, Coll and Morel 2005).

    python tools/compare/nlm.py IN.exr OUT.exr

IN has `R G B` and `variance.R` and so on, as `oscura render --aov variance` writes; OUT has `R G B`."""

import sys

try:
    import numpy as np
    import OpenEXR
except ImportError:  # `denoisers.py` leaves the column out then.
    np = OpenEXR = None

# Pixels to each side of a window in which pixels are averaged, and of a patch that is compared.
WINDOW, PATCH = 10, 3
# How much of the noise's standard deviation patches may differ by.
STRENGTH = 0.45


def box(values):
    """Means over patches; at the edges the nearest pixels count again."""
    for axis in (0, 1):
        padded = np.pad(values, [(PATCH + 1, PATCH) if a == axis else (0, 0) for a in (0, 1)], mode="edge")
        sums = padded.cumsum(axis)
        width = 2 * PATCH + 1
        values = (np.take(sums, range(width, sums.shape[axis]), axis) - np.take(sums, range(sums.shape[axis] - width), axis)) / width
    return values


def denoised(picture, variance):
    """Both of shape (height, width, 3), as is what it gives."""
    height, width, _ = picture.shape
    edge = [(WINDOW, WINDOW), (WINDOW, WINDOW), (0, 0)]
    around, noise_around = np.pad(picture, edge, mode="reflect"), np.pad(variance, edge, mode="reflect")
    total, weights = np.zeros_like(picture), np.zeros((height, width, 1))
    for dy in range(2 * WINDOW + 1):
        for dx in range(2 * WINDOW + 1):
            other, noise = around[dy : dy + height, dx : dx + width], noise_around[dy : dy + height, dx : dx + width]
            by_noise = variance + np.minimum(variance, noise)
            distance = ((picture - other) ** 2 - by_noise) / (1e-10 + STRENGTH**2 * (variance + noise))
            weight = np.exp(-np.maximum(0.0, box(distance.mean(2))))[:, :, None]
            total += weight * other
            weights += weight
    return total / weights


def denoise_file(source, target):
    """From file to file."""
    channels = OpenEXR.File(source, separate_channels=True).channels()
    of = lambda prefix: np.stack([np.asarray(channels[prefix + c].pixels, np.float64) for c in "RGB"], 2)
    result = denoised(of(""), np.nan_to_num(of("variance."), posinf=1e10)).astype(np.float32)
    planes = {c: np.ascontiguousarray(result[:, :, i]) for i, c in enumerate("RGB")}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, planes).write(target)


if __name__ == "__main__":
    denoise_file(sys.argv[1], sys.argv[2])
