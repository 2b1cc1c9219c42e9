"""Files of every layout and compression, read back by OpenEXR's own library and by OpenImageIO: channels, types, windows,
attributes, and pixels against those of the default file.

    python tools/compare/exr_files.py OUT [SCENE]

needs `pip install OpenEXR OpenImageIO numpy`; says so and succeeds where they are missing. `OSCURA` names another binary."""

import os
import subprocess
import sys

try:
    import numpy as np
    import OpenEXR
    import OpenImageIO as oiio
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(0)

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
OSCURA = os.environ.get("OSCURA", os.path.join(ROOT, "target", "release", "oscura"))
SIZE = (80, 48)
AOVS = "depth,normal,albedo,diffuse_direct,object_id,crypto_object,samples"
COMPRESSIONS = {
    "none": ("NO_COMPRESSION", 0.0),
    "rle": ("RLE_COMPRESSION", 0.0),
    "zip": ("ZIP_COMPRESSION", 0.0),
    "zips": ("ZIPS_COMPRESSION", 0.0),
    "piz": ("PIZ_COMPRESSION", 0.0),
    "pxr24": ("PXR24_COMPRESSION", 1e-4),
    "b44": ("B44_COMPRESSION", 0.2),
    "b44a": ("B44A_COMPRESSION", 0.2),
    "dwaa": ("DWAA_COMPRESSION", 0.1),
    "dwab": ("DWAB_COMPRESSION", 0.1),
}
failures = []


def check(what, holds, found=""):
    if not holds:
        failures.append(what)
        print(f"WRONG  {what} {found}")


def render(out, name, scene, *options, aovs=AOVS):
    path = os.path.join(out, f"{name}.exr")
    size = ["--width", str(SIZE[0]), "--height", str(SIZE[1])]
    command = [OSCURA, "render", scene, "-o", path, "--spp", "4", "--quiet", "--reproducible", "--aov", aovs, *size, *options]
    subprocess.run(command, check=True)
    return path


def planes(path):
    """All channels of all parts by OpenEXR: name -> pixels, and the headers."""
    file = OpenEXR.File(path, separate_channels=True)
    found = {}
    for part in file.parts:
        for name, channel in part.channels.items():
            check(f"{path}: {name} is there once", name not in found)
            found[name] = np.asarray(channel.pixels)
    return found, [part.header for part in file.parts]


def by_oiio(path):
    """The same by OpenImageIO, with the windows of each part."""
    found, windows, index = {}, [], 0
    image = oiio.ImageInput.open(path)
    while image.seek_subimage(index, 0):
        spec = image.spec()
        for k, name in enumerate(spec.channelnames):
            # Each in its own type: integers would be scaled.
            kind = oiio.UINT if str(spec.channelformat(k)) == "uint" else oiio.FLOAT
            if kind == oiio.FLOAT:
                found[name] = image.read_image(index, 0, k, k + 1, kind)[:, :, 0]
        windows.append(((spec.x, spec.y, spec.width, spec.height), (spec.full_x, spec.full_y, spec.full_width, spec.full_height), spec.tile_width))
        index += 1
    image.close()
    return found, windows


def same(what, found, truth, tolerance=0.0, has_integers=True):
    if not has_integers:
        truth = {name: pixels for name, pixels in truth.items() if pixels.dtype != np.uint32}
    check(f"{what}: channels", set(found) == set(truth), sorted(set(found) ^ set(truth)))
    for name in set(found) & set(truth):
        a, b = np.asarray(found[name], np.float64), np.asarray(truth[name], np.float64)
        if a.shape != b.shape:
            check(f"{what}: shape of {name}", False, (a.shape, b.shape))
            continue
        # Ids of mattes are no numbers: their bits count.
        far = ~((a == b) | (np.isnan(a) & np.isnan(b)) | (np.abs(a - b) <= tolerance * np.maximum(np.abs(b), 1.0)))
        check(f"{what}: pixels of {name}", not far.any(), f"{far.mean():.3f} differ")


def in_layer(name):
    if name in "RGBA":
        return f"ViewLayer.Combined.{name}"
    return {"Z": "ViewLayer.Depth.Z", "samples": "ViewLayer.Samples.X"}.get(name, f"ViewLayer.{name}")


def main(out, scene):
    os.makedirs(out, exist_ok=True)
    plain, headers = planes(render(out, "plain", scene))
    check("one part", len(headers) == 1)
    for key in ("chromaticities", "colorInteropID", "software", "samples", "seed", "worldToCamera", "worldToNDC", "aovSpace"):
        check(f"attribute {key}", key in headers[0], sorted(headers[0]))
    exact = {"R", "G", "B", "A", "Z", "N.X", "albedo.R", "DiffDir.R", "CryptoObject00.R", "object.id", "samples"}
    check("channels of the default file", exact <= set(plain), sorted(plain))
    for name, (constant, tolerance) in COMPRESSIONS.items():
        # These would change the ids of mattes, and are refused with them.
        aovs = AOVS if name not in ("pxr24", "dwaa", "dwab") else AOVS.replace("crypto_object,", "")
        path = render(out, name, scene, "--exr-compression", name, aovs=aovs)
        truth = {key: pixels for key, pixels in plain.items() if aovs == AOVS or not key.startswith("Crypto")}
        found, headers = planes(path)
        check(f"{name}: compression", headers[0]["compression"] == getattr(OpenEXR, constant), headers[0]["compression"])
        same(f"{name} by OpenEXR", found, truth, tolerance)
        same(f"{name} by OpenImageIO", by_oiio(path)[0], found, 1e-6, has_integers=False)
    path = render(out, "tiles", scene, "--exr-tiles", "32")
    same("tiles", planes(path)[0], plain)
    check("tiles are 32 wide", by_oiio(path)[1][0][2] == 32)
    found, headers = planes(render(out, "layers", scene, "--exr-layout", "layers"))
    same("layers", found, {in_layer(name): pixels for name, pixels in plain.items()})
    check("mattes of layers", headers[0].get("cryptomatte/542cafa/name") in ("ViewLayer.CryptoObject", b"ViewLayer.CryptoObject"), [k for k in headers[0] if k.startswith("crypto")])
    path = render(out, "parts", scene, "--exr-layout", "multipart")
    found, headers = planes(path)
    same("parts by OpenEXR", found, plain)
    same("parts by OpenImageIO", by_oiio(path)[0], found, 1e-6, has_integers=False)
    names = [header["name"] for header in headers]
    check("names of parts", names == ["rgba", "depth", "N", "albedo", "DiffDir", "object", "CryptoObject", "samples"], names)
    found, _ = planes(render(out, "types", scene, "--exr-half", "N,Z", "--exr-float", "rgba"))
    types = {name: pixels.dtype for name, pixels in found.items()}
    check("types", types["N.X"] == np.float16 and types["R"] == np.float32 and types["object.id"] == np.uint32, types)
    whole, _ = planes(render(out, "float", scene, "--float"))
    path = render(out, "crop", scene, "--float", "--crop", "10,8,50,40")
    same("crop", planes(path)[0], {name: pixels[8:40, 10:50] for name, pixels in whole.items()})
    check("windows of a crop", by_oiio(path)[1][0][:2] == ((10, 8, 40, 32), (0, 0, *SIZE)), by_oiio(path)[1])
    path = render(out, "overscan", scene, "--float", "--overscan", "10")
    check("windows of overscan", by_oiio(path)[1][0][:2] == ((-8, -5, 96, 58), (0, 0, *SIZE)), by_oiio(path)[1])
    inner = planes(path)[0]["albedo.G"][5:53, 8:88]
    check("the frame within overscan", abs(float(inner.mean()) - float(whole["albedo.G"].mean())) < 0.02)
    path = render(out, "acescg", scene, "--float", "--working-space", "acescg")
    found, headers = planes(path)
    # From OpenColorIO's configurations for ACES.
    matrix = np.array([[0.613097, 0.339523, 0.047379], [0.070194, 0.916354, 0.013452], [0.020616, 0.109570, 0.869815]])
    colors = lambda of: np.stack([of[letter] for letter in "RGB"], -1)
    far = abs(colors(found) - colors(whole) @ matrix.T) / (1 + abs(colors(found)))
    check("colours of ACEScg", far.max() < 1e-5, far.max())
    check("data beside ACEScg", np.array_equal(found["N.X"], whole["N.X"]))
    primaries = np.round(np.array(headers[0]["chromaticities"], float), 5).tolist()
    check("primaries of ACEScg", primaries == [0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767], primaries)
    print(f"{len(failures)} problems")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else os.path.join(ROOT, "assets", "cornell-box.gltf"))
