"""Node trees of lamps that are more than a plain Emission: Cycles itself renders what a lamp lights with its tree and with a plain
one. The quotient is a picture of an area light, a profile of points and spots, and has a mean for suns."""

import math
import os
from contextlib import contextmanager

import bmesh
import bpy
import numpy as np

from . import context, glow, shaders, stills

# Pixels along the longer side of an area light; steps around the axis of another lamp, and along it.
EDGE, AROUND, ALONG = 256, 512, 256

# Quotients that differ by no more are the same.
EVEN = 5e-3


def take(light, name, place, distance, folder, report):
    """The lights that a light with its tree is: for each a factor on the energy, one on the colour, and what else its entry has
    ("image" or "profile", the names of files in the folder). `distance` is how far away things are, metres."""
    file = bpy.path.clean_name(name)
    with _alone(light) as shown:
        quotient = shown(distance)
        lit = quotient.min(2) >= 0
        peak = max(float(quotient.max()), 1e-30)
        is_even = lit.any() and np.ptp(quotient[lit], axis=0).max() <= EVEN * peak
        farther = shown(2 * distance) if light.type in ("POINT", "SPOT") else quotient
    if not lit.any():
        report.warn(place, "the node tree of this light is not carried over")
        return [_factor(np.ones(3))]
    if np.abs(farther - quotient)[lit].max(initial=0) > EVEN * peak:
        message = f"it is as bright as in Blender {distance:.3g} m away, and falls off with the square of the distance"
        report.warn(place, f"the node tree of this light is not carried over as it is: {message}")
    quotient = np.maximum(quotient, 0.0)
    if is_even or light.type == "SUN":
        if not is_even:
            report.warn(place, "the node tree of this light is not carried over: its mean is taken")
        return [_factor(quotient[lit].mean(0))]
    if light.type == "AREA":
        glow.save(quotient, os.path.join(folder, f"{file}.exr"))
        return [(1.0, [1.0] * 3, {"image": f"{file}.exr"})]
    return _profiles(quotient, _reach(light), file, folder)


def _factor(color):
    """A factor and a colour of a peak of 1."""
    peak = float(max(color))
    return peak, [float(c) / max(peak, 1e-30) for c in color], {}


def _profiles(quotient, reach, file, folder):
    """A light for each colour, of one if all are alike."""
    color = quotient.max((0, 1))
    alike = np.abs(quotient / np.maximum(color, 1e-30) - (quotient / np.maximum(color, 1e-30)).mean(2, keepdims=True)).max() <= EVEN
    found = []
    for end, channels in (("", (0, 1, 2)),) if alike else ((" red", (0,)), (" green", (1,)), (" blue", (2,))):
        own = quotient[..., list(channels)].max(2)
        if own.max() <= 0:
            continue
        path = f"{file}{end.replace(' ', '_')}.ies"
        write_profile(own / own.max(), reach, os.path.join(folder, path))
        factor, tint, _ = _factor([color[c] if c in channels else 0.0 for c in range(3)])
        found.append((factor, tint, {"profile": path, "end": end}))
    return found


@contextmanager
def _alone(light):
    """A function that renders a light alone: by how far away what it lights is, the quotient of its light and that of a plain one,
    rows from below; -1 where that doesn't shine."""
    own = light.copy()
    own.energy, own.color = 1000.0, (1, 1, 1)
    for key, value in (("exposure", 0.0), ("use_temperature", False), ("normalize", True), ("use_shadow", True)):
        if hasattr(own, key):
            setattr(own, key, value)
    scene = context.new_scene("oscura lamp")
    try:
        stills.place(scene, own, visible_camera=light.type == "AREA")
        screen = _stage(scene, own)
        end, plain = shaders.end(own.node_tree), own.node_tree.nodes.new("ShaderNodeEmission")
        kept = shaders.source(end.inputs["Surface"])

        def shown(away):
            if screen is not None:
                screen.scale = (away,) * 3
            pictures = []
            for source in (kept, plain.outputs[0]):
                own.node_tree.links.new(source, end.inputs["Surface"])
                pictures.append(stills.shown(scene))
            whole, even = pictures
            return np.where(even > 1e-6 * even.max(), whole / np.maximum(even, 1e-30), -1.0)

        yield shown
    finally:
        objects = list(scene.collection.objects)
        bpy.data.scenes.remove(scene)
        bpy.data.batch_remove([obj.data for obj in objects] + objects)


def _stage(scene, light):
    """Puts a camera before an area light, one over a plain in a sun, and else into a ball around the lamp, which is returned."""
    if light.type == "AREA":
        light.spread = math.pi
        size = light.size, (light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size)
        light.shape, light.size, light.size_y = "RECTANGLE", *size
        stills.look_along(scene, max(size), location=(0, 0, -max(size)), rotation_euler=(0, math.pi, 0))
        stills.prepare(scene, [max(round(EDGE * s / max(size)), 1) for s in size], 4)
        return None
    if light.type == "SUN":
        stills.place(scene, _plain(), location=(0, 0, -1))
        stills.look_along(scene, 1.0)
        stills.prepare(scene, (8, 8), 4)
        return None
    light.shadow_soft_size = 0.0
    # By half a pixel, so that their middles are steps from x on.
    stills.look_around(scene, math.pi / AROUND, _reach(light) - math.pi / 2)
    stills.prepare(scene, (AROUND, ALONG), 4)
    return stills.place(scene, _ball())


def _reach(light):
    """How far from its axis a lamp shines, radians."""
    return light.spot_size / 2 if light.type == "SPOT" else math.pi


def _ball():
    mesh, form = bpy.data.meshes.new("oscura ball"), bmesh.new()
    bmesh.ops.create_icosphere(form, subdivisions=5, radius=1.0)
    form.to_mesh(mesh)
    form.free()
    return mesh


def _plain():
    mesh = bpy.data.meshes.new("oscura plain")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
    return mesh


def write_profile(values, reach, path):
    """Writes a picture around a lamp, from its axis on, as a profile (IES LM-63): longitudes run clockwise in it."""
    rows, columns = values.shape
    steps = values[:, (columns // 2 - np.arange(columns + 1)) % columns]
    # At the axis there is one value.
    table = np.concatenate([np.full((1, columns + 1), steps[0].mean()), steps, steps[-1:]]).T
    down = np.degrees(reach) * np.array([0.0, *(np.arange(rows) + 0.5) / rows, 1.0])
    around = np.linspace(0.0, 360.0, columns + 1)
    text = lambda numbers: " ".join(f"{n:.6g}" for n in numbers)
    with open(path, "w", encoding="ascii", newline="\n") as file:
        file.write("IESNA:LM-63-2002\nTILT=NONE\n")
        file.write(f"1 -1 1 {len(down)} {len(around)} 1 2 0 0 0\n1 1 0\n{text(down)}\n{text(around)}\n")
        file.writelines(f"{text(row)}\n" for row in table)
