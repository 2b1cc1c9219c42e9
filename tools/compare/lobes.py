"""Lobe by lobe against Mitsuba 3: the same small scene in both, tested by blocks.

    python lobes.py FOLDER [NAME...]

Two conventions differ, and are made equal in what Mitsuba renders: its microfacets are shadowed by the separable product
of Smith's G1, oscura's reflection by the height-correlated term (Heitz 2014, eq. 99). `Adjusted` multiplies Mitsuba's
reflection by their ratio, and by Schlick's Fresnel term where oscura's material has that. The other rows are Mitsuba's as
they are. Transmission through rough glass uses the separable term in both.
"""

import os
import sys
from pathlib import Path

import numpy as np

import material_scene
import common
import drjit as dr
import mitsuba as mi
from sheet import quad, write_png, write_sheet

# Samples of each picture, over all its seeds.
SAMPLES = int(os.environ.get("SAMPLES", "2048"))


class Adjusted(mi.BSDF):
    """Another BSDF, its reflection times a ratio that depends on both directions; samples stay the same."""

    def __init__(self, props):
        super().__init__(props)
        self.alpha = props["alpha"]
        self.f0 = props.get("schlick", -1.0)
        self.nested = props["nested"]
        self.m_components = [self.nested.flags(k) for k in range(self.nested.component_count())]
        self.m_flags = self.nested.flags()

    def factor(self, wi, wo):
        alpha_squared = dr.square(self.alpha)

        def excess(v):  # 1 / G1 - 1
            cosine = dr.square(v.z)
            return 0.5 * (dr.sqrt(1 + alpha_squared * (1 - cosine) / cosine) - 1)

        a, b = excess(wi), excess(wo)
        ratio = (1 + a) * (1 + b) / (1 + a + b)
        if self.f0 >= 0:
            cosine = dr.dot(wi, dr.normalize(wi + wo))
            ratio *= self.f0 + (1 - self.f0) * (1 - cosine) ** 5
        return dr.select(wi.z * wo.z > 0, ratio, 1)

    def sample(self, ctx, si, sample1, sample2, active=True):
        chosen, weight = self.nested.sample(ctx, si, sample1, sample2, active)
        return chosen, weight * self.factor(si.wi, chosen.wo)

    def eval(self, ctx, si, wo, active=True):
        return self.nested.eval(ctx, si, wo, active) * self.factor(si.wi, wo)

    def pdf(self, ctx, si, wo, active=True):
        return self.nested.pdf(ctx, si, wo, active)

    def eval_pdf(self, ctx, si, wo, active=True):
        value, pdf = self.nested.eval_pdf(ctx, si, wo, active)
        return value * self.factor(si.wi, wo), pdf

    def to_string(self):
        return f"Adjusted[{self.nested}]"


mi.register_bsdf("adjusted", Adjusted)


def adjusted(nested, alpha, schlick=-1.0):
    return {"type": "adjusted", "alpha": float(alpha), "schlick": schlick, "nested": nested}


GOLD = {"eta": [0.143036, 0.375307, 1.44205], "k": [3.983, 2.38556, 1.60336]}


def ball(name, ours, theirs):
    return name, (lambda folder: (['sphere = { center = [0, 0, 0], radius = 1 }', 'material = "subject"'], ours)), theirs, "ball"


def lobes():
    """(name, oscura's subject and material, Mitsuba's BSDF, shape) of each case."""
    yield ball("diffuse", {"type": "lambert", "color": [0.8, 0.4, 0.1]}, material_scene.diffuse([0.8, 0.4, 0.1]))
    for roughness in (0.1, 0.3, 0.5, 0.75, 1.0):
        alpha = roughness**2
        white = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha}
        gold = {"type": "roughconductor", "distribution": "ggx", "alpha": alpha}
        gold |= {key: material_scene.rgb(value) for key, value in GOLD.items()}
        measured = {"type": "metal", "name": "gold", "roughness": roughness}
        yield ball(f"roughconductor gold {roughness}", measured, adjusted(gold, alpha))
        schlick = {"type": "metal", "color": 0.5, "roughness": roughness}
        yield ball(f"roughconductor Schlick 0.5 {roughness}", schlick, adjusted(white, alpha, 0.5))
    mirror = {"type": "conductor", **{key: material_scene.rgb(value) for key, value in GOLD.items()}}
    yield ball("conductor gold", {"type": "metal", "name": "gold", "roughness": 0.0}, mirror)
    for ior in (1.33, 1.5, 2.4):
        ours = {"type": "dielectric", "ior": ior}
        yield ball(f"dielectric {ior}", ours, {"type": "dielectric", "int_ior": ior, "ext_ior": 1.0})
    thin = {"type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0}
    yield ball("thindielectric 1.5", {"type": "dielectric", "ior": 1.5, "thin": True}, thin)
    for ior, roughness in [(1.5, 0.1), (1.5, 0.3), (1.5, 0.5), (1.5, 0.75), (1.5, 1.0), (1.1, 0.5), (2.4, 0.3)]:
        alpha = roughness**2
        glass = {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha, "int_ior": ior, "ext_ior": 1.0}
        ours = {"type": "dielectric", "ior": ior, "roughness": roughness}
        yield ball(f"roughdielectric {ior} {roughness}", ours, adjusted(glass, alpha))
    yield from sheets()


def sheet(name, texels, material, theirs, shape="sheet"):
    def write(folder):
        stem = name.replace(" ", "-")
        write_png(folder / f"{stem}.png", texels)
        write_sheet(folder / f"{stem}.gltf", quad(*material_scene.SHEET), material, [f"{stem}.png"])
        return [f'mesh = "{stem}.gltf"'], None

    return name, write, theirs, shape


def picture(texels, filtering):
    """A texture of Mitsuba's without any decoding. Its first row is at v = 0, which is the sheet's lower edge."""
    values = np.ascontiguousarray(texels[::-1].astype(np.float32) / 255)
    return {"type": "bitmap", "bitmap": mi.Bitmap(values), "raw": True, "filter_type": filtering}


LAMBERT = {"metallicFactor": 0.0, "baseColorFactor": [0.8, 0.4, 0.1, 1.0]}
NO_REFLECTION = {"extensions": {"KHR_materials_specular": {"specularFactor": 0.0}}}


def bumps(size=64):
    """A normal map of slopes up to 0.5, with no symmetry that would hide a flipped or turned axis."""
    y, x = np.mgrid[0:size, 0:size] / size
    wave = lambda a, b, phase: 2 * np.pi * (a * x + b * y) + phase
    slope_x = 0.3 * np.sin(wave(2, 1, 0.4)) + 0.2 * np.cos(wave(1, 3, 1.0))
    slope_y = 0.25 * np.sin(wave(1, 2, 2.0)) + 0.25 * (x - 0.3)
    n = np.stack([slope_x, slope_y, np.ones_like(x)], -1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return np.round((n * 0.5 + 0.5) * 255).astype(np.uint8)


# Mitsuba can shade what bent normals see of lights near the horizon (Conty Estevez et al. 2019); oscura has another remedy,
# switched off here as well.
UNSHADED = {"use_shadowing_function": False, "flip_invalid_normals": False}


def sheets():
    random = np.random.default_rng(7)
    opacity = random.integers(0, 256, (16, 16), np.uint8)
    for mode, values in (("BLEND", opacity), ("MASK", np.where(opacity > 127, 255, 0).astype(np.uint8))):
        texels = np.dstack([np.full((16, 16, 3), 255, np.uint8), values])
        material = {"pbrMetallicRoughness": {**LAMBERT, "baseColorTexture": {"index": 0}}, "alphaMode": mode, **NO_REFLECTION}
        mask = {"type": "mask", "opacity": picture(values[..., None], "nearest"), "nested": material_scene.diffuse([0.8, 0.4, 0.1])}
        yield sheet(f"mask {mode}", texels, material, mask)
    normals = bumps()
    # Backed, because Mitsuba's bent normals let light through where they face a viewer behind the sheet.
    map_ = {"normalTexture": {"index": 0}}
    bent = lambda nested: {"type": "normalmap", "normalmap": picture(normals, "bilinear"), "bsdf": nested, **UNSHADED}
    diffuse = {"type": "diffuse", "reflectance": material_scene.rgb([0.8, 0.4, 0.1])}
    yield sheet("normalmap diffuse", normals, {"pbrMetallicRoughness": LAMBERT, **NO_REFLECTION, **map_}, bent(diffuse), "backed sheet")
    for roughness in (0.4, 0.7):
        alpha = roughness**2
        metal = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha}
        ours = {"pbrMetallicRoughness": {"metallicFactor": 1.0, "roughnessFactor": roughness}, **map_}
        yield sheet(f"normalmap metal {roughness}", normals, ours, bent(adjusted(metal, alpha)), "backed sheet")


def main():
    folder, *names = sys.argv[1:]
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    print("| Lobe | Ours / Mitsuba R G B | Standard error | Largest z | Blocks beyond 3 sigma | |\n|---|---|---|---:|---:|---|")
    failed = 0
    for name, write, theirs, shape in lobes():
        if names and not any(n in name for n in names):
            continue
        subject, material = write(folder)
        path = folder / f"{name.replace(' ', '-')}.toml"
        material_scene.oscura_scene(path, subject, {"subject": material} if material else {}, shape)
        ours = material_scene.oscura_picture(path, SAMPLES)
        reference = material_scene.mitsuba_picture(theirs, shape, SAMPLES)
        common.difference_picture(path.with_suffix(".difference.png"), ours, reference)
        a = common.compare(ours, reference)
        failed += not a.holds()
        common.print_row(name, a)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
