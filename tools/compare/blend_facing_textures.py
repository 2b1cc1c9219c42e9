"""Blender scenes with textures mixed by Layer Weight and Fresnel nodes."""

import bpy
import numpy as np

from blend_facing import GLOSSY
from blend_parts import add, ball, by_ramp, camera, floor, light, lit, material, new_nodes, shader, world


def _row(*materials):
    for i, made in enumerate(materials):
        ball(made, (-2.1 + 1.4 * i, 0.4 * (i % 2) - 0.4, 0.65), 0.65)


def _mixed(tree, factor, first, second):
    """A mix of two colours by a factor, each a tuple or an output."""
    mix = tree.nodes.new("ShaderNodeMixRGB")
    for source, target in ((factor, "Fac"), (first, "Color1"), (second, "Color2")):
        if isinstance(source, tuple):
            mix.inputs[target].default_value = (*source, 1)
        else:
            tree.links.new(source, mix.inputs[target])
    return mix.outputs[0]


def _ramp(tree, source, low, high):
    """A factor through a linear ramp between two positions."""
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = low, high
    tree.links.new(source, ramp.inputs[0])
    return ramp.outputs[0]


def _picture(folder):
    values = np.random.default_rng(3).random((16, 16, 1)) * np.array([0.8, 0.5, 0.2]) + 0.1
    image = bpy.data.images.new("cells", 64, 64)
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[..., :3] = np.repeat(np.repeat(values, 4, 0), 4, 1)
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(folder / "cells.png"), "PNG"
    image.save()
    return image


def places_color(folder):
    """Colours by noise, an image and a checker mixed by facing with others; an image multiplied by a colour ramp."""
    floor()
    lit()
    velvet, cloth, tiles, shot = (material(name, Roughness=0.8) for name in ("velvet", "cloth", "tiles", "shot silk"))
    tree, principled, weight, noise = new_nodes(velvet, "LayerWeight", "TexNoise")
    noise.inputs["Scale"].default_value = 6
    mixed = _mixed(tree, _ramp(tree, weight.outputs["Facing"], 0.3, 0.9), noise.outputs["Color"], (0.9, 0.85, 0.8))
    tree.links.new(mixed, principled.inputs["Base Color"])
    tree, principled, weight, image = new_nodes(cloth, "LayerWeight", "TexImage")
    image.image = _picture(folder)
    weight.inputs["Blend"].default_value = 0.7
    mixed = _mixed(tree, weight.outputs["Facing"], image.outputs["Color"], (0.1, 0.2, 0.7))
    tree.links.new(mixed, principled.inputs["Base Color"])
    tree, principled, fresnel, checker = new_nodes(tiles, "Fresnel", "TexChecker")
    fresnel.inputs["IOR"].default_value = 2.0
    checker.inputs["Scale"].default_value = 8
    mixed = _mixed(tree, fresnel.outputs[0], (0.6, 0.1, 0.1), checker.outputs["Color"])
    tree.links.new(mixed, principled.inputs["Base Color"])
    tree, principled, weight, image, times = new_nodes(shot, "LayerWeight", "TexImage", "VectorMath")
    image.image, times.operation = bpy.data.images["cells"], "MULTIPLY"
    by_ramp(tree, weight.outputs["Facing"], principled)
    colors = principled.inputs["Base Color"].links[0].from_socket
    tree.links.new(colors, times.inputs[0])
    tree.links.new(image.outputs["Color"], times.inputs[1])
    tree.links.new(times.outputs[0], principled.inputs["Base Color"])
    _row(velvet, cloth, tiles, shot)
    camera()


def places_shaders():
    """Shaders mixed by facing, one of them textured by noise; a transparent rim with noise, emission on a rim with waves,
    roughness by both."""
    floor()
    lit()
    rough = material("rough", Base_Color=(0.8, 0.6, 0.3, 1), Metallic=1.0)
    tree, principled, weight, noise = new_nodes(rough, "LayerWeight", "TexNoise")
    noise.inputs["Scale"].default_value = 4
    tree.links.new(_mixed(tree, weight.outputs["Facing"], noise.outputs[0], (0.1, 0.1, 0.1)), principled.inputs["Roughness"])
    made = [rough]
    for name, output, under, over in (
        ("two paints", "Facing", "BsdfDiffuse", "BsdfDiffuse"),
        ("lacquer", "Facing", "BsdfDiffuse", GLOSSY),
        ("plastic", "Fresnel", "BsdfDiffuse", GLOSSY),
    ):
        mixed, tree, mix = shader(name, "MixShader")
        weight, noise, first, second = (tree.nodes.new(f"ShaderNode{n}") for n in ("LayerWeight", "TexNoise", under, over))
        noise.inputs["Scale"].default_value = 5
        tree.links.new(noise.outputs["Color"], first.inputs["Color"])
        second.inputs["Color"].default_value = (0.9, 0.7, 0.2, 1)
        if over == GLOSSY:
            second.inputs["Roughness"].default_value = 0.25
        for source, target in ((weight.outputs[output], 0), (first.outputs[0], 1), (second.outputs[0], 2)):
            tree.links.new(source, mix.inputs[target])
        made.append(mixed)
    _row(*made)
    camera()


def places_forms():
    """Facing in other forms: in a group, as a dot product, by a bumped normal, through Map Range."""
    floor()
    lit()
    grouped, dotted, bumped, ranged = (material(name, Roughness=0.7) for name in ("grouped", "dotted", "bumped", "ranged"))
    group = bpy.data.node_groups.new("rim", "ShaderNodeTree")
    for name, way, kind in (("Inner", "INPUT", "Color"), ("Outer", "INPUT", "Color"), ("Color", "OUTPUT", "Color")):
        group.interface.new_socket(name, in_out=way, socket_type=f"NodeSocket{kind}")
    start, end, weight = (group.nodes.new(kind) for kind in ("NodeGroupInput", "NodeGroupOutput", "ShaderNodeLayerWeight"))
    group.links.new(_mixed(group, weight.outputs["Facing"], start.outputs[0], start.outputs[1]), end.inputs[0])
    tree, principled, noise, rim = new_nodes(grouped, "TexNoise", "Group")
    rim.node_tree = group
    rim.inputs[1].default_value = (0.9, 0.2, 0.1, 1)
    tree.links.new(noise.outputs["Color"], rim.inputs[0])
    tree.links.new(rim.outputs[0], principled.inputs["Base Color"])
    tree, principled, geometry, dot, noise = new_nodes(dotted, "NewGeometry", "VectorMath", "TexNoise")
    dot.operation = "DOT_PRODUCT"
    tree.links.new(geometry.outputs["Incoming"], dot.inputs[0])
    tree.links.new(geometry.outputs["Normal"], dot.inputs[1])
    tree.links.new(_mixed(tree, dot.outputs["Value"], (0.1, 0.5, 0.2), noise.outputs["Color"]), principled.inputs["Base Color"])
    tree, principled, weight, noise, bump = new_nodes(bumped, "LayerWeight", "TexNoise", "Bump")
    noise.inputs["Scale"].default_value, bump.inputs["Strength"].default_value = 12, 0.2
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], weight.inputs["Normal"])
    tree.links.new(_mixed(tree, weight.outputs["Facing"], noise.outputs["Color"], (0.2, 0.3, 0.9)), principled.inputs["Base Color"])
    tree, principled, weight, noise, share = new_nodes(ranged, "LayerWeight", "TexVoronoi", "MapRange")
    share.inputs["From Min"].default_value, share.inputs["From Max"].default_value = 0.2, 0.7
    tree.links.new(weight.outputs["Facing"], share.inputs[0])
    tree.links.new(_mixed(tree, share.outputs[0], noise.outputs["Color"], (0.02, 0.02, 0.02)), principled.inputs["Base Color"])
    _row(grouped, dotted, bumped, ranged)
    camera()


def places_light():
    """A transparent rim with noise, an emissive rim with waves, an emissive board textured by facing."""
    floor()
    world((0.1, 0.1, 0.12))
    light("AREA", "Key", 60, (-3, -4, 5), (0.6, -0.5, 0), size=2)
    ghost, tree, mix = shader("ghost", "MixShader")
    weight, clouds, times, clear, skin = (
        tree.nodes.new(f"ShaderNode{n}") for n in ("LayerWeight", "TexNoise", "Math", "BsdfTransparent", "BsdfDiffuse")
    )
    clouds.inputs["Scale"].default_value, times.operation = 3, "MULTIPLY"
    tree.links.new(weight.outputs["Facing"], times.inputs[0])
    tree.links.new(_ramp(tree, clouds.outputs[0], 0.3, 0.6), times.inputs[1])
    for source, target in ((times.outputs[0], 0), (clear.outputs[0], 1), (skin.outputs[0], 2)):
        tree.links.new(source, mix.inputs[target])
    rim, tree, mix = shader("rim", "MixShader")
    weight, wave, under, over = (tree.nodes.new(f"ShaderNode{n}") for n in ("LayerWeight", "TexWave", "BsdfDiffuse", "Emission"))
    wave.inputs["Scale"].default_value, over.inputs[1].default_value = 1.5, 4.0
    under.inputs[0].default_value = (0.4, 0.1, 0.1, 1)
    tree.links.new(_mixed(tree, wave.outputs["Fac"], (1, 0.3, 0.1), (0.1, 0.4, 1)), over.inputs[0])
    for source, target in ((weight.outputs["Facing"], 0), (under.outputs[0], 1), (over.outputs[0], 2)):
        tree.links.new(source, mix.inputs[target])
    board = material("board", Base_Color=(0, 0, 0, 1))
    tree, principled, weight, checker, gain = new_nodes(board, "LayerWeight", "TexChecker", "Math")
    gain.operation, gain.inputs[1].default_value, checker.inputs["Scale"].default_value = "MULTIPLY", 6.0, 5
    tree.links.new(weight.outputs["Facing"], gain.inputs[0])
    tree.links.new(checker.outputs["Color"], principled.inputs["Emission Color"])
    tree.links.new(gain.outputs[0], principled.inputs["Emission Strength"])
    card = add("plane", board, (0, 2.4, 1.3), "Card", size=2.0)
    card.rotation_euler = (1.2, 0, 0)
    _row(ghost, rim, material("white", Base_Color=(0.8, 0.8, 0.8, 1), Roughness=0.9))
    camera()
