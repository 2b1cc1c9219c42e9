"""A random scene of mixed features as a scene file: lights, environments, materials, media, motion.

    python tools/compare/random_scene.py SEED FOLDER [--without FEATURE,...] [--twin]

Each part is drawn from random numbers of its own, so that leaving out one feature keeps the others: this is how a scene on which two
techniques disagree is made smaller. The first line of the file lists the features. --twin writes the same scene with something invisible
that moves and with panes that are wedges of .3 degrees: neither light samples through panes nor lobes towards refracted lights
apply to it, while its picture is the same.

Lamps are large enough for plain paths to find what they light through glass and by mirrors, unless nothing in the scene is smooth.
"""

import argparse
import random
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image

SIZE = 48

# Features with which paths are not shared, or caustics not sought by paths from lights.
RESTLESS = {
    *("camera", "motion", "unseen", "link", "smoke", "cloud", "fog", "pool", "subsurface", "mix", "cut-out", "half there", "nodes", "milk"),
    *("thin sheet", "smooth nodes", "glass mix", "rough glass", "glass table", "frosted", "pane", "double", "sheet", "open sheet"),
}


def text(value):
    """A value in TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {text(v)}" for key, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(text(v) for v in value) + "]"
    return repr(round(value, 4))


class RandomScene:
    """A scene under construction."""

    def __init__(self, seed, folder, without=(), is_twin=False):
        self.seed, self.folder, self.without, self.is_twin = seed, Path(folder), set(without), is_twin
        self.features, self.tables, self.materials, self.textures, self.moves = [], [], {}, {}, False
        self.camera, self.render, self.environment = {}, {"width": SIZE, "height": SIZE, "filter": "box"}, {}
        self.folder.mkdir(parents=True, exist_ok=True)
        self.place = self.of("place").choice(["room", "room", "window", "open"])
        self.is_smooth = self.of("smooth").random() < 0.6
        # Such scenes let all techniques take part.
        self.is_calm = self.of("calm").random() < 0.5
        for draw in PARTS:
            draw(self)

    def of(self, name):
        """The random number generator of a part."""
        return random.Random(zlib.crc32(f"{self.seed}/{name}".encode()))

    def has(self, feature, probability):
        """Is a feature enabled at random?"""
        drawn = self.of(f"has {feature}").random() < probability and feature not in self.without
        drawn = drawn and not (self.is_calm and {feature, feature.split()[0]} & RESTLESS)
        if drawn:
            self.features.append(feature)
        return drawn

    def choice(self, feature, choices):
        """One of several choices, each of which is a feature; the first if that is excluded."""
        drawn = self.of(f"choice {feature}").choice(choices)
        is_left_out = drawn in self.without or feature in self.without or self.is_calm and drawn in RESTLESS
        drawn = choices[0] if is_left_out else drawn
        self.features.append(f"{feature}:{drawn}")
        return drawn

    def add(self, table, **keys):
        self.tables.append((table, keys))

    def write(self):
        name = "twin.toml" if self.is_twin else "scene.toml"
        lines = ["# " + " ".join(self.features)]
        parts = {"render": self.render, "camera": self.camera, "environment": self.environment}
        parts |= {f"textures.{k}": v for k, v in self.textures.items()} | {f"materials.{k}": v for k, v in self.materials.items()}
        for header, keys in parts.items():
            if keys:
                lines += ["", f"[{header}]"] + [f"{key} = {text(value)}" for key, value in keys.items()]
        for table, keys in self.tables:
            lines += ["", f"[[{table}]]"] + [f"{key} = {text(value)}" for key, value in keys.items()]
        path = self.folder / name
        path.write_text("\n".join(lines) + "\n")
        return path


def color(r, low=0.1, high=0.9):
    return [r.uniform(low, high) for _ in range(3)]


def point(r, low, high):
    return [r.uniform(a, b) for a, b in zip(low, high)]


def picture(scene, name, pixels):
    """Writes an 8-bit image."""
    Image.fromarray(np.clip(255 * pixels, 0, 255).astype(np.uint8)).save(scene.folder / name)
    return name


def ply(scene, name, properties, rows, faces=()):
    """Writes a text PLY file."""
    lines = ["ply", "format ascii 1.0", f"element vertex {len(rows)}"]
    lines += [f"property float {p}" for p in properties.split()]
    if faces:
        lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    lines += ["end_header"] + [" ".join(f"{v:.6f}" for v in row) for row in rows]
    lines += [f"{len(face)} " + " ".join(map(str, face)) for face in faces]
    (scene.folder / name).write_text("\n".join(lines) + "\n")
    return name


def settings(scene):
    r = scene.of("settings")
    scene.render["depth"] = r.choice([5, 9, 100])
    scene.camera |= {"look_from": [r.uniform(-1.2, 1.2), r.uniform(0.9, 1.7), 2.8], "look_at": [0, r.uniform(0.5, 1), -0.5], "vfov": r.uniform(45, 65), "aspect_ratio": 1}
    if scene.has("defocus", 0.25):
        scene.camera |= {"defocus_angle": r.uniform(1, 4), "focus_distance": r.uniform(2, 4), "blades": 6}
    if scene.has("camera motion", 0.1):
        scene.camera["motion"] = {"translate": [0.2, 0, 0]}
        scene.moves = True
    if scene.has("panorama", 0.05):
        scene.camera["type"] = "panorama"


def images(scene):
    """Textures for materials."""
    rng = np.random.default_rng(scene.seed)
    blocks = lambda n, channels: np.kron(rng.random((n, n, channels)), np.ones((64 // n, 64 // n, 1)))
    picture(scene, "color.png", blocks(8, 3))
    picture(scene, "mask.png", np.repeat((blocks(8, 1) > 0.45).astype(float), 3, 2))
    height = np.kron(rng.random((8, 8)), np.ones((8, 8)))
    smooth = sum(np.roll(height, (a, b), (0, 1)) for a in range(-4, 5) for b in range(-4, 5)) / 81
    picture(scene, "bumps.png", np.repeat(smooth[..., None], 3, 2))
    slopes = np.stack([6 * (smooth - np.roll(smooth, 1, 1)), 6 * (smooth - np.roll(smooth, 1, 0)), np.ones_like(smooth)], -1)
    picture(scene, "normals.png", 0.5 + 0.5 * slopes / np.linalg.norm(slopes, axis=-1, keepdims=True))
    r = scene.of("textures")
    scene.textures |= {
        "color": {"type": "image", "file": "color.png"},
        "mask": {"type": "image", "file": "mask.png", "encoding": "linear", "interpolation": "nearest"},
        "checker": {"type": "checker", "size": r.uniform(0.2, 0.6), "even": color(r), "odd": color(r)},
        "marble": {"type": "marble", "frequency": 3, "low": color(r), "high": color(r)},
        "nodes": {
            "type": "nodes",
            "result": "ramp.color",
            "nodes": {
                "noise": {"type": "noise_texture", "scale": 4, "detail": 3},
                "ramp": {"type": "color_ramp", "factor": "noise.factor", "stops": [[0.4, *color(r), 1], [0.6, *color(r), 1]]},
            },
        },
        "alpha": {"type": "nodes", "result": "step.value", "nodes": {"noise": {"type": "noise_texture", "scale": 3}, "step": {"type": "math", "operation": "greater_than", "a": "noise.factor", "b": 0.5}}},
    }


def diffuse(r, scene, name):
    paint = scene.choice(f"paint {name}", ["plain", "color", "checker", "marble", "nodes"])
    return {"type": "lambert", "color": color(r, 0.2, 0.8) if paint == "plain" else paint}


def surface(scene, name):
    """A random material."""
    r = scene.of(f"material {name}")
    rough = ["diffuse", "oren-nayar", "plastic", "rough metal", "sheen", "rough coat", "subsurface", "mix", "cut-out", "half there", "translucent", "nodes", "bump", "normal map", "velvet", "phong", "rough glass", "milk"]
    smooth = ["metal", "mirror", "coat", "glass", "tinted glass", "thin sheet", "film", "smooth nodes", "glass mix"]
    kind = scene.choice(f"material {name}", rough + (2 * smooth if scene.is_smooth else []))
    rough_coat = {"clearcoat": 0.9, "clearcoat_roughness": r.uniform(0.2, 0.5)}
    made = {
        "diffuse": lambda: diffuse(r, scene, name),
        "oren-nayar": lambda: {"type": "oren-nayar", "color": color(r), "roughness": r.random()},
        "plastic": lambda: {"type": "pbr", "base_color": color(r), "roughness": r.uniform(0.25, 0.7)},
        "rough metal": lambda: {"type": "pbr", "base_color": color(r, 0.4), "metallic": 1, "roughness": r.uniform(0.35, 0.9), "anisotropy": r.choice([0, 0.6])},
        "sheen": lambda: {"type": "pbr", "base_color": color(r), "sheen_color": color(r), "sheen_roughness": r.uniform(0.3, 0.8)},
        "rough coat": lambda: {"type": "pbr", "base_color": "color", "roughness": 0.6, **rough_coat},
        "subsurface": lambda: {"type": "pbr", "base_color": color(r), "roughness": 0.5, "subsurface": {"color": color(r, 0.4), "radius": r.uniform(0.03, 0.2), "anisotropy": r.choice([0, 0.5])}},
        "mix": lambda: mix(scene, name, r, {"type": "lambert", "color": color(r)}, {"type": "pbr", "metallic": 1, "roughness": r.uniform(0.3, 0.6)}),
        "cut-out": lambda: {"type": "pbr", "base_color": color(r), "roughness": 0.6, "opacity": r.choice(["mask", "alpha"])},
        "half there": lambda: {"type": "pbr", "base_color": color(r), "roughness": 0.6, "opacity": r.uniform(0.3, 0.8)},
        "translucent": lambda: {"type": "pbr", "base_color": color(r), "diffuse_transmission": r.uniform(0.3, 0.9), "diffuse_transmission_color": color(r)},
        "nodes": lambda: nodes(r, 0.4),
        "bump": lambda: {"type": "pbr", "base_color": color(r), "roughness": 0.5, "normal": "bumped"},
        "normal map": lambda: {"type": "pbr", "base_color": color(r), "roughness": 0.5, "normal": "bumped", "metallic": 1},
        "velvet": lambda: {"type": "velvet", "color": color(r)},
        "phong": lambda: {"type": "phong", "diffuse": 0.4, "specular": 0.4, "exponent": r.uniform(5, 60)},
        "rough glass": lambda: {"type": "dielectric", "ior": r.uniform(1.2, 1.8), "roughness": r.uniform(0.2, 0.6), "tint": color(r, 0.7, 1)},
        "milk": lambda: {"type": "dielectric", "ior": 1.33, "roughness": 0.3, "medium": {"density": r.uniform(2, 6), "color": color(r, 0.7, 1), "anisotropy": 0.4}},
        "metal": lambda: {"type": "metal", "name": r.choice(["gold", "copper", "silver"]), "roughness": r.uniform(0.05, 0.25)},
        "mirror": lambda: {"type": "metal", "color": color(r, 0.6), "fuzz": 0},
        "coat": lambda: {"type": "pbr", "base_color": color(r), "roughness": 0.6, "clearcoat": 1},
        "glass": lambda: {"type": "dielectric", "ior": r.uniform(1.2, 1.8)},
        "tinted glass": lambda: {"type": "pbr", "transmission": 1, "volume": True, "roughness": r.choice([0, 0.15]), "attenuation_color": color(r, 0.4), "attenuation_distance": r.uniform(0.2, 1)},
        "thin sheet": lambda: {"type": "pbr", "transmission": r.uniform(0.5, 1), "roughness": r.choice([0, 0, 0.3]), "base_color": color(r, 0.6)},
        "film": lambda: {"type": "pbr", "metallic": 1, "roughness": 0.2, "base_color": color(r), "iridescence": 1},
        "smooth nodes": lambda: nodes(r, 0.1),
        "glass mix": lambda: mix(scene, name, r, {"type": "lambert", "color": color(r)}, {"type": "dielectric", "ior": 1.5, "thin": True}),
    }[kind]()
    if made.get("normal") == "bumped":
        scene.textures["bumped"] = {"type": "nodes", "result": "bump.normal", "nodes": {"noise": {"type": "noise_texture", "scale": 5}, "bump": {"type": "bump", "height": "noise.factor", "distance": 0.05}}}
    scene.materials[name] = made
    return kind


def mix(scene, name, r, a, b):
    scene.materials |= {f"{name}_a": a, f"{name}_b": b}
    weight = r.uniform(0.3, 0.7)
    weights = r.choice([("checker", weight), (weight, 1 - weight)])
    return {"type": "mix", "components": [{"material": f"{name}_{part}", "weight": w if w != "checker" else 0.5} for part, w in zip("ab", weights)]}


def nodes(r, roughness):
    """Blender's shader nodes, mixed by noise."""
    second = r.choice([{"type": "glossy_bsdf", "color": color(r), "roughness": roughness}, {"type": "glass_bsdf", "color": color(r, 0.6, 1), "roughness": roughness, "ior": 1.45}, {"type": "transparent_bsdf", "color": color(r)}, {"type": "translucent_bsdf", "color": color(r)}])
    first = r.choice([{"type": "principled_bsdf", "base_color": color(r), "roughness": 0.4}, {"type": "diffuse_bsdf", "color": color(r)}])
    return {
        "type": "nodes",
        "surface": "both",
        "nodes": {
            "noise": {"type": "noise_texture", "scale": 3, "detail": 2},
            "mask": {"type": "color_ramp", "factor": "noise.factor", "stops": [[0.45, 0, 0, 0, 1], [0.55, 1, 1, 1, 1]]},
            "a": first,
            "b": second,
            "both": {"type": "mix_shader", "factor": "mask.color", "a": "a", "b": "b"},
        },
    }


def walls(scene):
    """A room, or a ground."""
    scene.features.append(f"place:{scene.place}")
    r = scene.of("walls")
    scene.materials |= {"floor": diffuse(r, scene, "floor"), "wall": {"type": "lambert", "color": color(r, 0.4, 0.8)}}
    if scene.has("glossy floor", 0.3):
        scene.materials["floor"] = {"type": "pbr", "base_color": color(r, 0.3, 0.7), "roughness": r.uniform(0.3, 0.6)}
    edge = 12 if scene.place == "open" else 2
    quad = lambda name, corner, u, v, material="wall": scene.add("objects", name=name, quad={"corner": corner, "u": u, "v": v}, material=material)
    quad("floor", [-edge, 0, 3], [2 * edge, 0, 0], [0, 0, -3 - edge], "floor")
    if scene.place == "open":
        return
    quad("ceiling", [-2, 2.5, 3], [0, 0, -5], [4, 0, 0])
    quad("back", [-2, 0, -2], [4, 0, 0], [0, 2.5, 0])
    quad("front", [-2, 0, 3], [0, 2.5, 0], [4, 0, 0])
    quad("left", [-2, 0, 3], [0, 0, -5], [0, 2.5, 0])
    if scene.place == "room":
        quad("right", [2, 0, 3], [0, 2.5, 0], [0, 0, -5])
        return
    # A window of 3 x 1.6 metres.
    quad("below", [2, 0, 3], [0, 0.6, 0], [0, 0, -5])
    quad("above", [2, 2.2, 3], [0, 0.3, 0], [0, 0, -5])
    quad("behind", [2, 0.6, -1.5], [0, 1.6, 0], [0, 0, -0.5])
    quad("before", [2, 0.6, 3], [0, 1.6, 0], [0, 0, -1.5])
    glazing = scene.choice("glazing", ["none", "pane", "double", "sheet", "frosted", "open sheet"])
    if glazing != "none":
        window(scene, glazing)


def window(scene, glazing):
    """The contents of the window."""
    glass = {"type": "dielectric", "ior": 1.5, "tint": [0.9, 0.97, 0.95]}
    scene.is_smooth |= glazing != "frosted"
    if glazing in ("sheet", "open sheet"):
        glass = {"type": "dielectric", "thin": True} if glazing == "sheet" else {"type": "pbr", "transmission": 1, "roughness": 0.2, "keeps_radiance": True, "ior": 1.3}
        scene.add("objects", quad={"corner": [2, 0.6, 1.5], "u": [0, 1.6, 0], "v": [0, 0, -3]}, material="window")
    elif glazing == "frosted":
        glass = {"type": "dielectric", "ior": 1.5, "roughness": 0.3}
    scene.materials["window"] = glass
    if glazing in ("pane", "double", "frosted"):
        for x in [2.0, 2.06][: 2 if glazing == "double" else 1]:
            pane(scene, f"pane{x}", [x, 0.6, -1.5], [x + 0.03, 2.2, 1.5], "window")


def pane(scene, name, low, high, material):
    """A thin box, for the twin a wedge, wider by 0.01 mm per millimetre along one edge."""
    more = 0.005 * (high[1] - low[1]) if scene.is_twin else 0
    rows = [[x + (more if x == high[0] and y == high[1] else 0), y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    file = ply(scene, f"{name}{'_twin' if scene.is_twin else ''}.ply", "x y z", rows, triangles)
    scene.add("objects", mesh=file, material=material)


def objects(scene):
    """Objects with random materials."""
    r = scene.of("objects")
    count = r.choice([3, 4, 5])
    for k in range(count):
        draws = scene.of(f"object {k}")
        x, z = -1.4 + 2.8 * (k + 0.5) / count + draws.uniform(-0.1, 0.1), draws.uniform(-1.2, 0.8)
        size, angle = draws.uniform(0.28, 0.45), draws.uniform(0, 90)
        if not scene.has(f"object {k}", 0.9):
            continue
        surface(scene, f"m{k}")
        shape = scene.choice(f"shape {k}", ["sphere", "box", "pyramid", "quad", "disk", "mesh"])
        turn = {"rotate": {"axis": [0, 1, 0], "angle": angle}}
        keys = {
            "sphere": {"sphere": {"center": [0, 1.02 * size, 0], "radius": size}},
            "box": {"box": {"min": [-0.8 * size, 0.002, -0.8 * size], "max": [0.8 * size, 2 * size, 0.8 * size]}},
            "pyramid": {"pyramid": {"base": [0, 0.002, 0], "size": [2 * size, 1.6 * size], "height": 2.2 * size}},
            "quad": {"quad": {"corner": [-size, 0.02, -0.1], "u": [2 * size, 0, 0], "v": [0, 2 * size, 0.2]}},
            "disk": {"disk": {"center": [0, size + 0.02, 0], "radius": size, "normal": [0.4, 0.3, 1]}},
            "mesh": {"mesh": bumpy_ball(scene, k, draws, size), "smooth": 60},
        }[shape]
        placed = {"name": f"o{k}", **keys, "material": f"m{k}", "transform": [turn, {"translate": [x, 0, z]}]}
        if scene.has(f"motion {k}", 0.05):
            placed["motion"] = draws.choice([{"translate": [0.3, 0.1, 0]}, {"rotate": {"axis": [0, 1, 0], "angle": 40, "center": [x, 0, z]}}])
            scene.moves = True
        if scene.has(f"unseen {k}", 0.06):
            placed["visible_to"] = draws.choice([["camera", "diffuse"], ["camera", "glossy", "shadow"], ["diffuse", "glossy", "transmission", "volume", "shadow"]])
        scene.add("objects", **placed)


def bumpy_ball(scene, k, r, size):
    """A sphere with waves."""
    n, m, waves = 24, 12, r.choice([0.0, 0.12])
    rows, faces = [], []
    for j in range(m + 1):
        for i in range(n):
            a, b = 2 * np.pi * i / n, np.pi * j / m
            radius = size * (1 + waves * np.sin(3 * a) * np.sin(b) ** 2)
            rows.append([radius * np.sin(b) * np.cos(a), 1.15 * size + radius * np.cos(b), radius * np.sin(b) * np.sin(a)])
    for j in range(m):
        for i in range(n):
            a, b, c, d = j * n + i, j * n + (i + 1) % n, (j + 1) * n + (i + 1) % n, (j + 1) * n + i
            faces += [t for t in ((a, b, c), (a, c, d)) if not (j == 0 and t == (a, b, c)) and not (j == m - 1 and t == (a, c, d))]
    return ply(scene, f"ball{k}.ply", "x y z", rows, faces)


def slab(scene):
    """A table top or a pool."""
    r = scene.of("slab")
    if scene.has("glass table", 0.15):
        scene.is_smooth = True
        scene.materials["table"] = {"type": "dielectric", "ior": 1.5}
        pane(scene, "table", [-1.2, 0.95, -0.9], [0.2, 0.99, 0.5], "table")
    if scene.has("pool", 0.12):
        scene.is_smooth = True
        scene.materials["water"] = {"type": "pbr", "transmission": 1, "volume": True, "roughness": 0, "ior": 1.33, "attenuation_color": [0.6, 0.9, 0.9], "attenuation_distance": 1}
        if r.random() < 0.5:
            scene.materials["water"]["medium"] = {"density": 0.4, "color": 0.8}
        scene.add("objects", box={"min": [-1.9, 0.001, 0.2], "max": [1.9, 0.35, 1.6]}, material="water")


def media(scene):
    """Smoke and fog."""
    r = scene.of("media")
    if scene.has("smoke", 0.2):
        scene.materials["smoke"] = {"type": "medium", "density": r.uniform(0.5, 3), "color": color(r, 0.5, 1), "anisotropy": r.choice([0, 0.7, -0.3])}
        scene.add("objects", sphere={"center": [r.uniform(-0.8, 0.8), 1.2, -0.6], "radius": 0.5}, material="smoke")
    if scene.has("cloud", 0.15):
        scene.materials["cloud"] = {
            "type": "medium",
            "density": "dense.result",
            "color": color(r, 0.6, 1),
            "anisotropy": 0.3,
            "resolution": 16,
            "emission": r.choice([0, 0.2]),
            "nodes": {"noise": {"type": "noise_texture", "scale": 2}, "dense": {"type": "map_range", "value": "noise.factor", "from_min": 0.35, "from_max": 0.7, "to_min": 0, "to_max": 6}},
        }
        scene.add("objects", box={"min": [-1.2, 0.7, -1], "max": [0.2, 1.9, 0.2]}, material="cloud")
    if scene.has("fog", 0.15):
        fog = {"density": r.uniform(0.05, 0.2), "color": color(r, 0.6, 1), "anisotropy": r.choice([0, 0.5]), "radius": 12}
        scene.environment["fog"] = fog


def extras(scene):
    """Hair, instances."""
    r = scene.of("extras")
    if scene.has("hair", 0.15):
        scene.materials["fur"] = {"type": "hair", "melanin": r.uniform(0.1, 0.8), "roughness": 0.35}
        x = r.uniform(-0.5, 0.5)
        strands = []
        for _ in range(150):
            foot = [x + r.uniform(-0.3, 0.3), 0.01, r.uniform(0.6, 1)]
            lean = r.uniform(-0.1, 0.1)
            strands.append([[foot[0] + lean * t * t, foot[1] + 0.35 * t, foot[2] + 0.05 * t] for t in (0, 0.33, 0.66, 1)])
        scene.add("curves", strands=strands, radius=[0.008, 0.002], material="fur")
    if scene.has("copies", 0.2):
        rows = [[r.uniform(-1.6, 1.6), 0.06, r.uniform(-1.6, 1.4), r.uniform(0.6, 1.3)] for _ in range(25)]
        file = ply(scene, "copies.ply", "x y z scale", rows)
        surface(scene, "copied")
        shape = r.choice([{"sphere": {"center": [0, 0, 0], "radius": 0.045}}, {"box": {"min": [-0.04, -0.04, -0.04], "max": [0.04, 0.04, 0.04]}}])
        scene.add("objects", name="copies", **shape, material="copied", instances=file)


def lamp(scene, k, kind):
    """A light of some type."""
    r = scene.of(f"lamp {k}")
    x, z = r.uniform(-1.2, 1.2), r.uniform(-1.2, 1)
    radius = r.uniform(0.15, 0.3) if scene.is_smooth else r.choice([0, 0.02, 0.2])
    power = r.uniform(20, 60)
    link = {"light_link": {"exclude": ["o0"]}} if scene.has(f"link {k}", 0.06) else {}
    tint = color(r, 0.5, 1)
    size = [r.uniform(0.5, 1.4), r.uniform(0.5, 1.2)]
    light = {"name": f"lamp{k}", "color": tint, **link}
    aim = [-0.3 * x, -1, -0.3 * z]
    emissive = lambda **material: scene.materials.update({f"lamp{k}": {"type": "emissive", "two_sided": True, **material}})
    if kind == "area":
        spread = r.choice([180, 180, 120])
        scene.add("lights", **light, area={"center": [x, 2.35, z], "direction": aim, "size": size, "shape": r.choice(["rectangle", "ellipse"]), "spread": spread, "power": power})
    elif kind == "picture":
        scene.add("lights", **light, area={"center": [x, 2.35, z], "direction": aim, "size": size, "image": "color.png", "power": 2 * power})
    elif kind == "point":
        scene.add("lights", **light, point={"position": [x, 2, z], "radius": radius, "power": power})
    elif kind == "soft":
        scene.add("lights", **light, point={"position": [x, 2, z], "radius": max(radius, 0.1), "soft_falloff": True, "power": power}, visible_to_camera=False, obstacle=False)
    elif kind == "spot":
        scene.add("lights", **light, spot={"position": [x, 2.2, z], "direction": aim, "angle": r.uniform(60, 120), "radius": radius, "blend": 0.3, "power": power})
    elif kind == "emissive quad":
        emissive(radiance=[8 * c for c in tint])
        scene.add("objects", quad={"corner": [x, 2.3, z], "u": [0.6, 0, 0], "v": [0, 0.1, 0.6]}, material=f"lamp{k}")
    elif kind == "emissive ball":
        emissive(radiance=[10 * c for c in tint])
        scene.add("objects", sphere={"center": [x, 2, z], "radius": 0.25}, material=f"lamp{k}")
    elif kind == "textured":
        scene.materials[f"lamp{k}"] = {"type": "pbr", "base_color": 0.5, "emission": r.choice(["color", "checker", "marble", "nodes"])}
        scene.add("objects", quad={"corner": [-1.5, 0.8, -1.9], "u": [3, 0, 0], "v": [0, 1.2, 0]}, material=f"lamp{k}")
    elif kind == "emissive mesh":
        emissive(radiance=[9 * c for c in tint])
        mesh = bumpy_ball(scene, f"lamp{k}", r, 0.22)
        scene.add("objects", mesh=mesh, material=f"lamp{k}", transform=[{"translate": [x, 1.7, z]}])


def lights(scene):
    """Lights and the environment."""
    kinds = ["area", "point", "soft", "spot", "picture", "emissive quad", "emissive ball", "textured", "emissive mesh"]
    r = scene.of("lights")
    count = r.choice([1, 2, 3]) if scene.place == "room" else r.choice([0, 1, 2])
    for k in range(count):
        if k == 0 or scene.has(f"lamp {k}", 1):
            lamp(scene, k, scene.choice(f"lamp kind {k}", kinds))
    if scene.place == "room" and count:
        return
    # As wide as plain paths can find through glass.
    angle = r.uniform(12, 25) if scene.is_smooth else r.choice([0.2, 0.5, 5])
    sun = {"direction": [-1, r.uniform(-0.9, -0.5), r.uniform(-0.5, 0.5)], "angle": angle, "irradiance": [x * r.uniform(1, 4) for x in (1, 0.95, 0.85)]}
    kind = scene.choice("environment", ["even", "gradient", "sky", "picture", "nodes", "sun"])
    if kind in ("even", "sun"):
        scene.environment["background"] = color(r, 0.3, 1)
    elif kind == "gradient":
        scene.environment["sky"] = {"nadir": color(r, 0.2, 1), "zenith": color(r, 0.2, 1)}
    elif kind == "sky":
        scene.environment["sky"] = {"sun_elevation": r.uniform(15, 70), "sun_azimuth": 90, "sun_size": angle or 0.5, "strength": 0.02}
    elif kind == "picture":
        scene.environment |= {"image": environment_picture(scene), "rotation": r.uniform(0, 360)}
    else:
        scene.environment["texture"] = "nodes"
        scene.environment["resolution"] = 64
    if kind == "sun" or kind in ("picture", "nodes", "even") and scene.has("sun", 0.3):
        scene.environment["sun"] = sun
    elif scene.has("sun lamp", 0.2):
        scene.add("lights", name="sun", sun=sun | {"irradiance": 3})
    if scene.place == "window" and scene.has("portal", 0.3):
        scene.add("portals", center=[2.2, 1.4, 0], direction=[-1, 0, 0], size=[3, 1.6])
    if scene.has("unsampled environment", 0.08):
        scene.environment["sampled"] = False


def environment_picture(scene):
    """An environment image with clouds and a bright spot."""
    rng = np.random.default_rng(scene.seed + 1)
    image = np.kron(rng.random((8, 16, 3)) * 0.8, np.ones((4, 4, 1)))
    row, column = rng.integers(6, 14), rng.integers(0, 56)
    image[row : row + 5, column : column + 6] += [12, 11, 9]
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": image.astype(np.float32)}).write(str(scene.folder / "around.exr"))
    return "around.exr"


def twin(scene):
    """Moving objects, and the shutter."""
    if scene.is_twin:
        scene.materials["hidden"] = {"type": "lambert"}
        scene.add("objects", sphere={"center": [0, -40, 0], "radius": 0.1}, material="hidden", motion={"translate": [0.1, 0, 0]})
    if scene.moves or scene.is_twin:
        scene.camera["shutter"] = 0.8


PARTS = [settings, images, walls, slab, objects, media, extras, lights, twin]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seed", type=int)
    parser.add_argument("folder")
    parser.add_argument("--without", default="")
    parser.add_argument("--twin", action="store_true")
    args = parser.parse_args()
    print(RandomScene(args.seed, args.folder, args.without.split(","), args.twin).write())


if __name__ == "__main__":
    main()
