"""Blender's glTF exports against Cycles' renders of the same scenes, per object.

    python blender.py FOLDER REFERENCES OUT [SCENE...]

FOLDER holds X.glb, REFERENCES Cycles' X.ref.exr and X.var.exr (the mean and its variance). Each object is measured over
the pixels where the camera sees its bounding sphere or box, a little away from the silhouette; first as the file is,
then with two known differences of the models taken out of it (see `as_cycles`).
"""

import json
import os
import sys
from pathlib import Path

import numpy as np

import common

# Samples of each of the two renders; pixels of the references.
SAMPLES = int(os.environ.get("SAMPLES", "1024"))
SIZE = 256

# Spheres are measured up to this fraction of their radius.
INSIDE = 0.93


def rotation(node):
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def rays(gltf):
    """Origin and directions through the pixel centres, of a camera without parents."""
    node = next(n for n in gltf["nodes"] if "camera" in n)
    tangent = np.tan(gltf["cameras"][node["camera"]]["perspective"]["yfov"] / 2)
    at = ((np.arange(SIZE) + 0.5) / SIZE * 2 - 1) * tangent
    x, y = np.meshgrid(at, -at)
    d = np.stack([x, y, -np.ones_like(x)], -1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    return np.array(node["translation"]), d @ rotation(node).T


def through_ball(origin, d, centre, radius):
    """Distance to a sphere along each ray, infinite for misses."""
    to = centre - origin
    along = d @ to
    gap = np.linalg.norm(to) ** 2 - along**2
    return np.where(gap < radius**2, along - np.sqrt(np.maximum(radius**2 - gap, 0)), np.inf)


def through_box(origin, d, centre, turn, low, high):
    """Distance to a rotated box along each ray, infinite for misses."""
    o, d = turn.T @ (origin - centre), d @ turn
    with np.errstate(divide="ignore"):
        t = np.stack([(low - o) / d, (high - o) / d])
    near, far = t.min(0).max(-1), t.max(0).min(-1)
    return np.where((near < far) & (far > 0), near, np.inf)


def objects(gltf):
    """(name of the material, centre, rotation, low, high, is it a sphere) of each node with a mesh."""
    for node in gltf["nodes"]:
        if "mesh" not in node or "scale" in node:
            continue
        mesh = gltf["meshes"][node["mesh"]]
        primitive = mesh["primitives"][0]
        box = gltf["accessors"][primitive["attributes"]["POSITION"]]
        low, high = np.array(box["min"]), np.array(box["max"])
        name = gltf["materials"][primitive["material"]]["name"]
        is_ball = mesh["name"].startswith("Sphere")
        yield name, np.array(node.get("translation", [0, 0, 0])), rotation(node), low, high, is_ball


def masks(gltf):
    """By material: pixels that certainly show it. Flat objects get the remaining pixels."""
    origin, d = rays(gltf)
    nearest = np.full(d.shape[:2], np.inf)
    owner = np.full(d.shape[:2], -1)
    names, cores = [], []
    for k, (name, centre, turn, low, high, is_ball) in enumerate(objects(gltf)):
        names.append(name)
        if is_ball:
            t = through_ball(origin, d, centre, high[1])
            core = np.isfinite(through_ball(origin, d, centre, INSIDE * high[1]))
        else:
            slack = 0.01 * (high - low).max()
            t = through_box(origin, d, centre, turn, low - slack * (high == low), high + slack * (high == low))
            core = np.isfinite(t)
        cores.append(core)
        closer = t < nearest
        nearest[closer], owner[closer] = t[closer], k
    return {name: (owner == k) & shrunk(owner == k) & cores[k] for k, name in enumerate(names)}


def shrunk(mask):
    """Eroded by one pixel."""
    padded = np.pad(mask, 1)
    return padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]


def in_coded_values(png, times=32):
    """A texture enlarged by interpolation between its coded values, which is how Cycles filters 8-bit textures; glTF
    filters light. What is left to interpolate light in is a step of a thirty-second of a texel: with an eighth, dark
    squares beside bright ones were still 1 to 2 % too bright."""
    import io

    from PIL import Image

    texels = np.asarray(Image.open(io.BytesIO(png)), np.float64)
    for axis in (0, 1):
        n = texels.shape[axis]
        at = (np.arange(n * times) + 0.5) / times - 0.5
        low = np.floor(at).astype(int)
        part = (at - low).reshape([-1 if k == axis else 1 for k in range(texels.ndim)])
        texels = texels.take(low % n, axis) * (1 - part) + texels.take((low + 1) % n, axis) * part
    data = io.BytesIO()
    Image.fromarray(np.round(texels).astype(np.uint8)).save(data, "PNG")
    return data.getvalue()


def cycles_anisotropy(material):
    """The roughness and strength of KHR_materials_anisotropy that give the two alphas of Blender's Principled BSDF:
    alpha over and times the aspect sqrt(1 - 0.9 anisotropy)."""
    extension = material.get("extensions", {}).get("KHR_materials_anisotropy")
    if extension is None:
        return
    aspect = np.sqrt(1 - 0.9 * extension["anisotropyStrength"])
    alpha = material["pbrMetallicRoughness"].get("roughnessFactor", 1) ** 2
    along, across = alpha / aspect, alpha * aspect
    material["pbrMetallicRoughness"]["roughnessFactor"] = float(np.sqrt(across))
    extension["anisotropyStrength"] = float(np.sqrt((along - across) / (1 - across)))


def as_cycles(source, target):
    """Writes a scene with known differences of the models removed."""
    data = Path(source).read_bytes()
    length = int.from_bytes(data[12:16], "little")
    gltf, binary = json.loads(data[20 : 20 + length]), bytearray(data[28 + length :])
    for image in gltf.get("images", []):
        view = gltf["bufferViews"][image["bufferView"]]
        start = view.get("byteOffset", 0)
        larger = in_coded_values(bytes(binary[start : start + view["byteLength"]]))
        view["byteOffset"], view["byteLength"] = len(binary), len(larger)
        binary += larger + bytes(-len(larger) % 4)
    for sampler in gltf.get("samplers", []):
        sampler["minFilter"] = 9729  # linear: Cycles has no mip maps
    for material in gltf["materials"]:
        cycles_anisotropy(material)
    gltf["buffers"][0]["byteLength"] = len(binary)
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    chunk = lambda kind, body: len(body).to_bytes(4, "little") + kind + body
    chunks = chunk(b"JSON", text) + chunk(b"BIN\0", bytes(binary))
    Path(target).write_bytes(b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks)


def table(title, ours, reference, parts):
    print(f"\n| {title} | Pixels | Ours / Cycles R G B | Standard error | Blocks beyond 3 sigma |")
    print("|---|---:|---|---|---|")
    for name, mask in {"all": None, **parts}.items():
        pixels = SIZE * SIZE if mask is None else int(mask.sum())
        if pixels == 0 or not reference.mean[mask].any():
            continue  # hidden or out of view
        a = common.compare(ours, reference, mask)
        cells = [name, str(pixels), common.by_channel(a.ratio, 4), common.by_channel(a.sigma, 4)]
        print(f"| {' | '.join(cells)} | {100 * a.beyond_3:.1f} % of {a.blocks} |", flush=True)


def main():
    folder, references, out, *scenes = sys.argv[1:]
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    options = ["--width", str(SIZE), "--height", str(SIZE), "--depth", "64", "--glass", "solid"]
    for scene in scenes or ["materials", "glass", "room", "instances", "lights"]:
        asset, matched = Path(folder) / f"{scene}.glb", out / f"{scene}-as-cycles.glb"
        as_cycles(asset, matched)
        reference = common.Picture(*(common.read(Path(references) / f"{scene}.{k}.exr") for k in ("ref", "var")))
        parts = masks(common.read_glb(asset)) if scene in ("materials", "glass") else {}
        for title, file in ((scene, asset), (f"{scene}, as Cycles", matched)):
            ours = common.render(file, out, options, SAMPLES)
            common.difference_picture(out / f"{file.stem}.difference.png", ours, reference)
            table(title, ours, reference, parts)


if __name__ == "__main__":
    main()
