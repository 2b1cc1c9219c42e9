"""A small scene for one material, written for oscura and for Mitsuba 3: a sphere or a sheet over a grey floor, lit by a
constant environment and three lights of different size, distance and colour."""

import json
from pathlib import Path

import numpy as np

import common
from sheet import front, quad

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

# Front faces are on the side of u x v, and only they emit.
FLOOR = quad([-6, -1, 6], [12, 0, 0], [0, 0, -12])
LIGHTS = [
    quad([2.5, -0.5, -0.5], [0, 0, 2], [0, 2, 0], [7, 4, 2]),
    quad([-1.2, 2.5, -0.6], [1.2, 0, 0], [0, 0, 1.2], [9, 10, 12]),
    quad([-2.0, -0.6, -2.5], [4, 0, 0], [0, 1.4, 0], [0.5, 1.5, 0.7]),
]


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


def backing():
    """A black sheet two millimetres behind the sheet."""
    sheet = quad(*SHEET)
    return quad((np.array(sheet["corner"]) - 0.002 * front(sheet)).tolist(), sheet["u"], sheet["v"])


def floor_color(shape):
    """Black under bent normals: what the floor sees of them at grazing angles differs by design, as oscura bends normals
    back until the mirror direction leaves the surface, and Mitsuba loses that light."""
    return 0.0 if shape == "backed sheet" else 0.5


def mitsuba_scene(bsdf, shape, subject=None):
    camera = mi.ScalarTransform4f().look_at(CAMERA["look_from"], CAMERA["look_at"], [0, 1, 0])
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "component_format": "float32"}
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": DEPTH + 1},
        "sensor": {"type": "perspective", "fov": CAMERA["vfov"], "fov_axis": "y", "to_world": camera, "film": film},
        "background": {"type": "constant", "radiance": rgb(BACKGROUND)},
        "floor": rectangle(FLOOR, diffuse(floor_color(shape))),
        "subject": subject,
    }
    if subject is None:
        ball = {"type": "sphere", "radius": 1.0, "bsdf": bsdf}
        scene["subject"] = ball if shape == "ball" else rectangle(quad(*SHEET), bsdf)
    if shape == "backed sheet":
        scene["backing"] = rectangle(backing(), diffuse(0))
    for k, light in enumerate(LIGHTS):
        scene[f"light{k}"] = rectangle(light, {"type": "diffuse", "reflectance": rgb(0)})
    return mi.load_dict(scene)


def mitsuba_picture(bsdf, shape, samples, seeds=4, subject=None):
    scene = mitsuba_scene(bsdf, shape, subject)
    part = samples // seeds
    return common.Picture.of([np.array(mi.render(scene, spp=part, seed=s))[..., :3] for s in range(seeds)])


def toml(value):
    """A value of a scene file."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {toml(v)}" for k, v in value.items()) + " }"
    return json.dumps(value)


def oscura_scene(path, subject, materials, shape, table="[[objects]]"):
    """Writes the scene file. `subject` are the lines of the table of what is looked at."""
    quads = [("floor", FLOOR), *((f"light{k}", q) for k, q in enumerate(LIGHTS))]
    if shape == "backed sheet":
        quads.append(("backing", backing()))
        materials = {**materials, "backing": {"type": "lambert", "color": 0.0}}
    lines = [f"camera = {toml({**CAMERA, 'aspect_ratio': 1.0})}", f"environment = {toml({'background': BACKGROUND})}"]
    lines += ["[materials]", f'floor = {{ type = "lambert", color = {floor_color(shape)} }}']
    lines += [f"{name} = {toml(material)}" for name, material in materials.items()]
    lines += [f'light{k} = {toml({"type": "emissive", "radiance": q["radiance"]})}' for k, q in enumerate(LIGHTS)]
    lines += [table, *subject]
    for name, q in quads:
        lines += ["[[objects]]", f"quad = {toml({key: q[key] for key in ('corner', 'u', 'v')})}", f'material = "{name}"']
    Path(path).write_text("\n".join(lines) + "\n")


def oscura_picture(path, samples):
    options = ["--width", str(SIZE), "--height", str(SIZE), "--depth", str(DEPTH)]
    return common.render(path, Path(path).parent, options, samples // 2)
