#!/usr/bin/env python3
"""Checks the layers of pictures with OpenEXR's own library: light passes and light groups add up to the picture, and
Cryptomattes hold what covers each pixel.

    layers.py OSCURA SCENE [SCENE...]

renders each scene small, with all channels, and prints one line a check. Ends with 1 if one fails, with 77 where the
OpenEXR module or numpy is missing (pip install OpenEXR numpy).
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import numpy as np
    import OpenEXR
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

PASSES = ["DiffDir", "DiffInd", "GlossDir", "GlossInd", "TransDir", "TransInd", "Emit", "Env"]
MATTES = ["CryptoObject", "CryptoMaterial", "CryptoAsset"]


def murmur3_32(data):
    """MurmurHash3_x86_32 with seed 0, from its description."""
    mask = 0xFFFFFFFF
    rotated = lambda x, r: ((x << r) | (x >> (32 - r))) & mask
    scrambled = lambda k: rotated(k * 0xCC9E2D51 & mask, 15) * 0x1B873593 & mask
    whole = len(data) // 4 * 4
    h = 0
    for i in range(0, whole, 4):
        h = rotated(h ^ scrambled(int.from_bytes(data[i : i + 4], "little")), 13)
        h = (h * 5 + 0xE6546B64) & mask
    h ^= scrambled(int.from_bytes(data[whole:], "little")) ^ len(data)
    for shift, factor in [(16, 0x85EBCA6B), (13, 0xC2B2AE35)]:
        h = (h ^ (h >> shift)) * factor & mask
    return h ^ (h >> 16)


def matte_id(name):
    """The id of a name: a hash that is a plain float (specification 1.2.0)."""
    h = murmur3_32(name.encode("utf-8"))
    return h ^ (1 << 23) if (h >> 23) & 255 in (0, 255) else h


class Picture:
    """A file with its planes and its header."""

    def __init__(self, path):
        (part,) = OpenEXR.File(str(path), separate_channels=True).parts
        self.header = part.header
        self.planes = {name: np.asarray(channel.pixels) for name, channel in part.channels.items()}

    def sum_of(self, layers, component):
        return sum(self.planes[f"{layer}.{component}"].astype(np.float64) for layer in layers)

    def manifest(self, kind):
        """Ids by name; the key of a matte in the header is made of its own name."""
        key = f"{murmur3_32(kind.encode()):08x}"[:7]
        entry = lambda what: self.header[f"cryptomatte/{key}/{what}"]
        assert entry("name") == kind and entry("hash") == "MurmurHash3_32", kind
        assert entry("conversion") == "uint32_to_float32", kind
        return {name: int(digits, 16) for name, digits in json.loads(entry("manifest")).items()}

    def ranks(self, kind):
        """Pairs of planes: ids as integers, shares."""
        layer = 0
        while f"{kind}{layer:02}.R" in self.planes:
            for id_name, share in [("R", "G"), ("B", "A")]:
                ids = self.planes[f"{kind}{layer:02}.{id_name}"]
                assert ids.dtype == np.float32, "ids must be 32-bit floats"
                yield ids.view(np.uint32), self.planes[f"{kind}{layer:02}.{share}"]
            layer += 1

    def matte(self, kind, id):
        """The share of each pixel that an id covers, as compositors decode it."""
        return sum(np.where(ids == id, share, 0) for ids, share in self.ranks(kind))


class Checks:
    """Prints each check, and remembers failures."""

    def __init__(self):
        self.failed = 0

    def check(self, holds, what):
        self.failed += not holds
        print(("ok    " if holds else "FAILS ") + what)


def render(oscura, scene, path, *arguments):
    command = [oscura, "render", scene, "-o", path, "--width", "96", "--float", "--quiet", "--aov", "all"]
    subprocess.run([str(c) for c in [*command, *arguments]], check=True)
    return Picture(path)


def check_sums(checks, picture, scene):
    groups = sorted({name.rsplit(".", 1)[0] for name in picture.planes if name.startswith("RGBA_")})
    for what, layers in [("light passes", PASSES), ("light groups", groups)]:
        worst = 0.0
        for component in "RGB":
            whole = picture.planes[component].astype(np.float64)
            difference = abs(picture.sum_of(layers, component) - whole)
            worst = max(worst, float((difference / np.maximum(whole, 1e-4)).max()))
        checks.check(worst < 1e-5, f"{scene.name}: {len(layers)} {what} add up within {worst:.1e}")


def check_mattes(checks, picture, single, scene):
    """`single` has one sample per pixel: there an object's coverage is 0 or 1."""
    for kind, number in zip(MATTES, ["object.id", "material.id", None]):
        manifest = picture.manifest(kind)
        right = all(matte_id(name) == id for name, id in manifest.items())
        checks.check(right, f"{scene.name}: {kind} has {len(manifest)} names with the hashes of these")
        ranks = list(picture.ranks(kind))
        sorted_by_share = all((a[1] >= b[1]).all() for a, b in zip(ranks, ranks[1:]))
        checks.check(sorted_by_share, f"{scene.name}: {kind} has the largest share first")
        known = np.array(sorted(set(manifest.values())), np.uint32)
        shown = np.unique(np.concatenate([ids[share > 0] for ids, share in ranks]))
        checks.check(np.isin(shown, known).all(), f"{scene.name}: {kind} shows names of the manifest only")
        total = sum(share.astype(np.float64) for _, share in ranks)
        hits = picture.planes["facing.V"] > 0
        most = float(abs(total[hits] - 1).max()) if scene.name.startswith("closed") else float(total.max() - 1)
        checks.check(most < 1e-5, f"{scene.name}: {kind} covers no pixel more than once")
        if number is None:
            continue
        ids, shares = next(iter(single.ranks(kind)))
        numbers = single.planes[number]
        pairs = {(int(n), int(i)) for n, i in zip(numbers.ravel(), ids.ravel()) if n > 0}
        one_each = len(pairs) == len({n for n, _ in pairs})
        whole = bool((shares[numbers > 0] == 1).all() and (shares[numbers == 0] == 0).all())
        checks.check(one_each and whole, f"{scene.name}: {kind} tells {len(pairs)} apart as {number} does")


def check_means(checks, picture, singles, scene):
    """The means of decoded mattes agree with single-sample renders of object hits."""
    kind, number = "CryptoObject", "object.id"
    numbers = {}
    for single in singles:
        ids, _ = next(iter(single.ranks(kind)))
        for n, i in zip(single.planes[number].ravel(), ids.ravel()):
            numbers.setdefault(int(i), set()).add(int(n))
    worst = 0.0
    for id, of_id in numbers.items():
        if 0 in of_id:
            continue
        means = [np.isin(single.planes[number], list(of_id)).mean() for single in singles]
        error = np.std(means, ddof=1) / len(means) ** 0.5 + 1e-4
        worst = max(worst, abs(picture.matte(kind, id).mean() - np.mean(means)) / error)
    checks.check(worst < 5, f"{scene.name}: {len(numbers)} mattes cover what object.id says ({worst:.1f} deviations)")


def main():
    oscura, scenes = Path(sys.argv[1]).resolve(), [Path(argument) for argument in sys.argv[2:]]
    checks = Checks()
    with tempfile.TemporaryDirectory() as folder:
        for scene in scenes:
            path = Path(folder) / "picture.exr"
            picture = render(oscura, scene, path, "--spp", 32, "--light-groups")
            one = ["--spp", 1, "--filter", "box"]
            singles = [render(oscura, scene, path, *one, "--seed", seed) for seed in range(1, 17)]
            check_sums(checks, picture, scene)
            check_mattes(checks, picture, singles[0], scene)
            many = render(oscura, scene, path, "--spp", 64, "--filter", "box", "--crypto-levels", 16)
            check_means(checks, many, singles, scene)
    sys.exit(checks.failed > 0)


if __name__ == "__main__":
    main()
