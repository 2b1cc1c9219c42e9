"""A small scene for one material, written for oscura and for Mitsuba 3 alike: a ball or a sheet over a grey floor, lit by
an even background and three lights of different size, distance and colour."""

import json
from pathlib import Path

import numpy as np

import common

common.find_llvm()
import mitsuba as mi  # noqa: E402

mi.set_variant("llvm_ad_rgb")

# Edge of the pictures, pixels.
SIZE = 96
DEPTH = 100
BACKGROUND = [0.2, 0.25, 0.3]
CAMERA = {"look_from": [0.0, 1.0, 4.5], "look_at": [0.0, 0.0, 0.0], "vfov": 32.0}
# The sheet leans back; corner and edges.
SHEET = ([-1.1, -0.8, 0.4], [2.2, 0.0, 0.0], [0.0, 1.6, -0.9])


def quad(corner, u, v, radiance=None):
    return {"corner": corner, "u": u, "v": v, "radiance": radiance}


# Front faces are on the side of u x v, and only they emit.
FLOOR = quad([-6, -1, 6], [12, 0, 0], [0, 0, -12])
LIGHTS = [
    quad([2.5, -0.5, -0.5], [0, 0, 2], [0, 2, 0], [7, 4, 2]),
    quad([-1.2, 2.5, -0.6], [1.2, 0, 0], [0, 0, 1.2], [9, 10, 12]),
    quad([-2.0, -0.6, -2.5], [4, 0, 0], [0, 1.4, 0], [0.5, 1.5, 0.7]),
]


def front(q):
    n = np.cross(q["u"], q["v"])
    return n / np.linalg.norm(n)


def rectangle(q, bsdf):
    """Mitsuba's rectangle spans -1..1 in x and y and faces z."""
    u, v = np.array(q["u"], float), np.array(q["v"], float)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = u / 2, v / 2, front(q)
    matrix[:3, 3] = np.array(q["corner"]) + u / 2 + v / 2
    shape = {"type": "rectangle", "to_world": mi.ScalarTransform4f(matrix), "bsdf": bsdf}
    if q["radiance"]:
        shape["emitter"] = {"type": "area", "radiance": rgb(q["radiance"])}
    return shape


def rgb(value):
    return {"type": "rgb", "value": [float(c) for c in np.broadcast_to(value, 3)]}


def diffuse(color):
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(color)}}


def mitsuba_scene(bsdf, on_sheet):
    camera = mi.ScalarTransform4f().look_at(CAMERA["look_from"], CAMERA["look_at"], [0, 1, 0])
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "component_format": "float32"}
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": DEPTH + 1},
        "sensor": {"type": "perspective", "fov": CAMERA["vfov"], "fov_axis": "y", "to_world": camera, "film": film},
        "background": {"type": "constant", "radiance": rgb(BACKGROUND)},
        "floor": rectangle(FLOOR, diffuse(0.5)),
        "subject": rectangle(quad(*SHEET), bsdf) if on_sheet else {"type": "sphere", "radius": 1.0, "bsdf": bsdf},
    }
    for k, light in enumerate(LIGHTS):
        scene[f"light{k}"] = rectangle(light, {"type": "diffuse", "reflectance": rgb(0)})
    return mi.load_dict(scene)


def mitsuba_picture(bsdf, on_sheet, samples, seeds=4):
    scene = mitsuba_scene(bsdf, on_sheet)
    part = samples // seeds
    return common.Picture.of([np.array(mi.render(scene, spp=part, seed=s))[..., :3] for s in range(seeds)])


def toml(value):
    """A value of a scene file."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {toml(v)}" for k, v in value.items()) + " }"
    return json.dumps(value)


def oscura_scene(path, subject, materials):
    """Writes the scene file. `subject` are the lines of the object that is looked at."""
    lines = [f"camera = {toml({**CAMERA, 'aspect_ratio': 1.0})}", f"environment = {toml({'background': BACKGROUND})}"]
    lines += ["[materials]", 'floor = { type = "lambert", color = 0.5 }']
    lines += [f"{name} = {toml(material)}" for name, material in materials.items()]
    lines += [f'light{k} = {toml({"type": "emissive", "radiance": q["radiance"]})}' for k, q in enumerate(LIGHTS)]
    lines += ["[[objects]]", *subject]
    for k, q in [("floor", FLOOR), *((f"light{k}", q) for k, q in enumerate(LIGHTS))]:
        lines += ["[[objects]]", f"quad = {toml({key: q[key] for key in ('corner', 'u', 'v')})}", f'material = "{k}"']
    Path(path).write_text("\n".join(lines) + "\n")


def oscura_picture(path, samples):
    options = ["--width", str(SIZE), "--height", str(SIZE), "--depth", str(DEPTH)]
    return common.render(path, Path(path).parent, options, samples // 2)


def write_png(path, texels):
    from PIL import Image

    Image.fromarray(texels).save(path)


def write_sheet(path, material, images):
    """The sheet as a glTF file, its texture coordinates (0, 0) at the top left as glTF has it."""
    corner, u, v = (np.array(x, np.float32) for x in SHEET)
    positions = np.array([corner, corner + u, corner + u + v, corner + v], np.float32)
    normals = np.repeat([front(quad(*SHEET))], 4, 0).astype(np.float32)
    coordinates = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    indices = np.array([0, 1, 2, 0, 2, 3], np.uint32)
    parts = [positions, normals, coordinates, indices]
    offsets = np.cumsum([0, *(p.nbytes for p in parts)]).tolist()
    data = Path(path).with_suffix(".bin")
    data.write_bytes(b"".join(p.tobytes() for p in parts))
    bounds = {"min": positions.min(0).tolist(), "max": positions.max(0).tolist()}
    gltf = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_specular"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {
                "primitives": [
                    {"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3, "material": 0}
                ]
            }
        ],
        "materials": [{"doubleSided": True, **material}],
        "buffers": [{"uri": data.name, "byteLength": offsets[-1]}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": offsets[k], "byteLength": p.nbytes} for k, p in enumerate(parts)
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", **bounds},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 3, "componentType": 5125, "count": 6, "type": "SCALAR"},
        ],
        "images": [{"uri": name} for name in images],
        "samplers": [{"magFilter": 9728, "minFilter": 9728}, {"magFilter": 9729, "minFilter": 9729}],
        "textures": [{"source": k, "sampler": 0 if "mask" in name else 1} for k, name in enumerate(images)],
    }
    Path(path).write_text(json.dumps(gltf))
