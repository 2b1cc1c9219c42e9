"""Inputs of shaders that vary over a surface and that glTF has no picture for: their means, evaluated by Cycles."""

from functools import partial

import bpy
import numpy as np

from . import bake, glow, pictures, shaders
from .context import opened
from .sizes import MOST_FACES

# Inputs whose means are taken, and those that Blender's exporter writes as pictures where they are plain ones.
INPUTS = (
    "IOR", "Specular IOR Level", "Anisotropic", "Anisotropic Rotation", "Coat Weight", "Coat Roughness", "Coat IOR",
    "Sheen Weight", "Sheen Roughness", "Thin Film Thickness", "Thin Film IOR", "Diffuse Roughness",
)  # fmt: skip
CARRIED = ("Coat Weight", "Coat Roughness")

# Inputs that mean nothing where another one is 0.
OF_LAYERS = {
    "Coat Roughness": "Coat Weight", "Coat IOR": "Coat Weight", "Sheen Roughness": "Sheen Weight",
    "Thin Film IOR": "Thin Film Thickness", "Anisotropic Rotation": "Anisotropic",
}  # fmt: skip

# Edge of the picture that is averaged, pixels.
EDGE = 64


def take(holders, report):
    """Puts means in the place of what varies, with a warning."""
    done = set()
    for holder in holders:
        for material in holder.data.materials:
            names = _varying(material) if material.name not in done else []
            done.add(material.name)
            if names:
                _take(holder, material, names)
                report.warn(material.name, f"{' and '.join(names)} vary over the surface: their means are taken")


def _varying(material):
    node = shaders.principled(material)
    if node is None:
        return []
    found = [name for name in INPUTS if name in node.inputs and node.inputs[name].is_linked and node.inputs[name].enabled]
    counts = lambda name: name not in OF_LAYERS or shaders.constant(node.inputs[OF_LAYERS[name]]) != 0
    found = [name for name in found if shaders.constant(node.inputs[name]) is None and counts(name)]
    return [name for name in found if not (name in CARRIED and pictures.is_carried(name, node.inputs[name]))]


def _take(holder, material, names):
    kitchen, mesh = glow.new_scene(), holder.data.copy()
    shown = bpy.data.objects.new("oscura mean", mesh)
    kitchen.collection.objects.link(shown)
    tree, node = material.node_tree, shaders.principled(material)
    try:
        with opened(kitchen):
            values = _evaluate(kitchen, shown, material, names) if len(mesh.polygons) <= MOST_FACES else {}
    finally:
        bpy.data.scenes.remove(kitchen)
        bpy.data.meshes.remove(mesh)
    for name in names:
        socket = node.inputs[name]
        for link in list(socket.links):
            tree.links.remove(link)
        if name in values:
            socket.default_value = values[name]


def _evaluate(kitchen, shown, material, names):
    """The mean of each input over the faces of a material."""
    baking = bake.Baking(shown, kitchen, bake.UV, EDGE, None)
    baking.select()
    baking.lay_out()
    inputs = shaders.principled(material).inputs
    pictures_of = [_baked(baking, material, source) for source in (None, *(shaders.source(inputs[name]) for name in names))]
    shares = pictures_of[0]
    weight = shares.sum()
    return {name: float((values * shares).sum() / weight) if weight > 0 else 0.0 for name, values in zip(names, pictures_of[1:])}


def _baked(baking, material, source):
    """What a socket gives on the faces of a material, as numbers; without one 1. 0 on all others."""
    shining = [partial(_shine, other, other == material, source) for other in baking.materials]
    pixels = glow.baked(EDGE, EDGE, shining, uv_layer=bake.UV)
    return np.nan_to_num(pixels[..., :3].mean(-1).ravel())


def _shine(material, is_asked, source, image):
    """Lets a material shine with a socket of it into a picture; gives what undoes it."""
    tree = material.node_tree

    def feed(inputs):
        inputs["Color"].default_value = (float(is_asked),) * 3 + (1.0,)
        if is_asked and source is not None:
            tree.links.new(source, inputs["Color"])

    return glow.shine(tree, shaders.end(tree), shaders.principled(material), image, feed)
