"""Curves and hair against Mitsuba 3: strands that grow out of the floor of the small scene of `material_scene.py`.

    python hair.py FOLDER [NAME...]

Both have round B-splines and the same model of hair (Chiang et al. 2016, near field). The ends of strands are below the floor: Mitsuba's have
no caps. What enters a fibre is unseen until it leaves it in both.
"""

import os
import sys
from pathlib import Path

import numpy as np

import material_scene
import common
import mitsuba as mi

SAMPLES = int(os.environ.get("SAMPLES", "256"))


def strands(count, radius, points, seed):
    """Arches from floor to floor: (count, points, 3), and the radius of each point."""
    random = np.random.default_rng(seed)
    angle = random.uniform(0, np.pi, count)
    width = random.uniform(0.5, 1.5, count)
    middle = random.uniform(-0.5, 0.5, (count, 2))
    # The outermost thirds are below the floor: splines don't reach their ends.
    t = np.linspace(-1.6, 1.6, points)
    wobble = random.normal(0, 0.06, (count, points, 3))
    x = middle[:, :1] + np.cos(angle)[:, None] * width[:, None] * t
    z = middle[:, 1:] + np.sin(angle)[:, None] * width[:, None] * t
    y = 0.9 * random.uniform(0.6, 1.2, (count, 1)) - 2.6 * t**2
    return np.stack([x, y, z], -1) + wobble, np.full((count, points), radius)


def straight(count, radius, seed):
    """Leaning straight strands out of the floor, beyond the top of the picture."""
    random = np.random.default_rng(seed)
    foot = np.column_stack([random.uniform(-1, 1, count), np.full(count, -1.4), random.uniform(-0.8, 0.4, count)])
    lean = np.column_stack([random.uniform(-1.5, 1.5, count), np.full(count, 6.0), random.uniform(-1, 1, count)])
    return np.stack([foot, foot + lean], 1), np.full((count, 2), radius)


def write(path, points, radii, first):
    """Writes strands: the formats differ in their first line."""
    lines = ["\n".join(f"{x:.7g} {y:.7g} {z:.7g} {r:.7g}" for (x, y, z), r in zip(p, q)) for p, q in zip(points, radii)]
    path.write_text(first + "\n\n".join(lines) + "\n")


def as_spline(points, radii, count=9):
    """Straight strands as B-splines, which extend slightly beyond their ends."""
    t = np.linspace(-0.2, 1.2, count)[None, :, None]
    return points[:, :1] + (points[:, 1:] - points[:, :1]) * t, np.repeat(radii[:, :1], count, 1)


def hair(absorption, roughness, radial, tilt):
    ours = {"type": "hair", "absorption": absorption, "roughness": roughness, "radial_roughness": radial, "tilt": tilt}
    theirs = {"type": "hair", "sigma_a": material_scene.rgb(absorption), "longitudinal_roughness": roughness}
    theirs |= {"azimuthal_roughness": radial, "scale_tilt": tilt, "int_ior": 1.55, "ext_ior": 1.0}
    return {**ours, "ior": 1.55}, theirs


def cases():
    """(name, strands, basis, oscura's material, Mitsuba's BSDF)."""
    clay = {"type": "lambert", "color": [0.8, 0.4, 0.1]}, {"type": "diffuse", "reflectance": material_scene.rgb([0.8, 0.4, 0.1])}
    thick, thin = strands(9, 0.07, 9, 3), strands(600, 0.006, 9, 4)
    yield "linear diffuse", straight(9, 0.08, 5), "linear", *clay
    yield "bspline diffuse", thick, "bspline", *clay
    yield "bspline thin diffuse", thin, "bspline", *clay
    yield "hair clear", thick, "bspline", *hair([0.0] * 3, 0.3, 0.3, 2.0)
    yield "hair brown", thick, "bspline", *hair([0.4, 0.8, 1.6], 0.3, 0.3, 2.0)
    yield "hair smooth", thick, "bspline", *hair([0.05, 0.2, 0.6], 0.12, 0.15, 3.0)
    yield "hair rough", thick, "bspline", *hair([0.1, 0.2, 0.4], 0.8, 0.9, 0.0)
    yield "hair linear", straight(9, 0.08, 5), "linear", *hair([0.05, 0.2, 0.6], 0.3, 0.3, 2.0)
    yield "hair thin blond", thin, "bspline", *hair([0.06, 0.1, 0.2], 0.3, 0.3, 2.0)


def main():
    folder, *names = sys.argv[1:]
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    print("| Curves | Ours / Mitsuba R G B | Standard error | Largest z | Blocks beyond 3 sigma | |\n|---|---|---|---:|---:|---|")
    failed = 0
    for name, (points, radii), basis, material, theirs in cases():
        if names and not any(n in name for n in names):
            continue
        stem = name.replace(" ", "-")
        write(folder / f"{stem}.curves", points, radii, "curves 1\n")
        subject = [f'file = "{stem}.curves"', f'basis = "{basis}"', 'material = "subject"']
        # Mitsuba's linear curves of hair are no B-splines along the same lines: light that passes them meets them again.
        if name == "hair linear":
            (points, radii), basis = as_spline(points, radii), "bspline"
        write(folder / f"{stem}.txt", points, radii, "")
        path = folder / f"{stem}.toml"
        material_scene.oscura_scene(path, subject, {"subject": material}, "curves", "[[curves]]")
        ours = material_scene.oscura_picture(path, SAMPLES)
        shape = {"type": f"{basis}curve", "filename": str(folder / f"{stem}.txt"), "bsdf": theirs}
        reference = material_scene.mitsuba_picture(theirs, "curves", SAMPLES, subject=shape)
        common.difference_picture(path.with_suffix(".difference.png"), ours, reference)
        a = common.compare(ours, reference)
        failed += not a.holds()
        common.print_row(name, a)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
