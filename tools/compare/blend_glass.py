"""Blender scenes with coloured and dispersive glass."""

import math

import bpy
from blend_parts import add, ball, camera, floor, light, material, shader, world


def _glass(name, kind="BsdfGlass", **inputs):
    return shader(name, kind, **{"Roughness": 0.0, **inputs})[0]


def _splitting(name, iors, roughness=0.0):
    """Dispersive glass as a sum of three shaders, for red, green and blue light."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    last = None
    for channel, ior in enumerate(iors):
        node = tree.nodes.new("ShaderNodeBsdfGlass")
        node.inputs["Color"].default_value = [float(k in (channel, 3)) for k in range(4)]
        node.inputs["IOR"].default_value, node.inputs["Roughness"].default_value = ior, roughness
        if last is not None:
            both = tree.nodes.new("ShaderNodeAddShader")
            tree.links.new(last.outputs[0], both.inputs[0])
            tree.links.new(node.outputs[0], both.inputs[1])
            node = both
        last = node
    tree.links.new(last.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return made


def jewels():
    """Gold, coloured stones and a dispersive one, velvet, small area lights."""
    world((0.15, 0.15, 0.17))
    camera((0, -3.2, 1.6), (1.15, 0, 0), lens=55)
    fibres = {"Sheen_Weight": 1.0, "Sheen_Roughness": 0.4, "Sheen_Tint": (0.9, 0.4, 0.6, 1)}
    floor(material("velvet", Base_Color=(0.1, 0.01, 0.05, 1), Roughness=1.0, **fibres), 8)
    gold = material("gold", Metallic=1.0, Roughness=0.12, Base_Color=(1, 0.72, 0.3, 1))
    stones = (
        _splitting("diamond", (2.39, 2.42, 2.45)),
        _glass("emerald", Color=(0.2, 0.9, 0.4, 1), IOR=1.76),
        _glass("ruby", Color=(0.9, 0.1, 0.2, 1), IOR=1.76),
    )
    for k, (x, stone) in enumerate(zip((-0.9, 0, 0.9), stones)):
        ring = {"rotation": (math.pi / 2, 0, 0.3 * k), "major_radius": 0.3, "minor_radius": 0.05, "major_segments": 64}
        add("torus", gold, (x, 0, 0.36), f"Ring {k}", smooth=True, **ring)
        add("ico_sphere", stone, (x, 0, 0.78), f"Stone {k}", radius=0.16, subdivisions=1)
    light("AREA", "Key", 60, (-2, -2, 3), (0.7, -0.5, 0), size=0.6)
    light("AREA", "Rim", 40, (2, 1.5, 2), (-0.8, 0.6, 0), size=0.4)


def tinted_glass():
    """Spheres, cubes and sheets of saturated colours: smooth, rough, refraction without reflection, and below a glossy layer by
    Fresnel."""
    world((0.5, 0.55, 0.6))
    floor(size=10)
    blue = {"Color": (0.15, 0.4, 0.9, 1), "IOR": 1.6}
    ball(_glass("smooth", **blue), (-2.1, 0, 0.6), 0.55)
    ball(_glass("frosted", **{**blue, "Roughness": 0.35}), (-0.7, 0, 0.6), 0.55)
    ball(_glass("bent", "BsdfRefraction", **blue), (0.7, 0, 0.6), 0.55)
    add("cube", _glass("block", Color=(0.9, 0.3, 0.1, 1), IOR=1.5), (2.1, 0, 0.5), "Block", size=0.9, rotation=(0, 0, 0.6))
    add("cube", _glass("prism", "BsdfRefraction", Color=(0.9, 0.6, 0.1, 1), IOR=1.5), (0.9, -1.6, 0.35), "Prism", size=0.6, rotation=(0, 0, 0.3))
    pane = add("plane", _glass("pane", Color=(0.3, 0.8, 0.3, 1), IOR=1.45), (-1.2, -1.5, 0.6), "Pane", size=1)
    pane.rotation_euler = (math.pi / 2, 0, 0.5)
    light("AREA", "Key", 300, (-3, -4, 5), (0.6, -0.5, 0), size=2)
    camera((0, -7, 3), (1.2, 0, 0), lens=40)


def splitting_glass():
    """A lens, a prism and a rough sphere with dispersion, in front of stripes."""
    world((0.4, 0.4, 0.4))
    floor(size=12)
    strong = (1.45, 1.55, 1.65)
    ball(_splitting("lens", strong), (-1.5, 0, 0.75), 0.7)
    ball(_splitting("frosted", strong, roughness=0.2), (1.6, 0.2, 0.75), 0.7)
    add("cylinder", _splitting("prism", strong), (0.1, -0.6, 0.7), "Prism", vertices=3, radius=0.6, depth=1.2)
    dark = material("dark", Base_Color=(0.02, 0.02, 0.02, 1), Roughness=1.0)
    for k in range(9):
        add("cube", dark, (k - 4, 2.5, 1), f"Stripe {k}", size=1).scale = (0.3, 0.05, 2)
    light("AREA", "Key", 300, (-3, -4, 5), (0.6, -0.5, 0), size=2)
    camera((0, -7, 2.4), (1.3, 0, 0), lens=42)
