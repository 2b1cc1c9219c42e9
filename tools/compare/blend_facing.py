"""Blender scenes with Layer Weight and Fresnel nodes."""

import bpy

from blend_parts import add, ball, by_ramp, camera, floor, light, lit, material, new_nodes, shader, world

GLOSSY = "BsdfAnisotropic" if hasattr(bpy.types, "ShaderNodeBsdfAnisotropic") else "BsdfGlossy"


def _row(*materials):
    for i, made in enumerate(materials):
        ball(made, (-2.1 + 1.4 * i, 0.4 * (i % 2) - 0.4, 0.65), 0.65)


def facing_color():
    """Facing as a colour and as a mix factor; Fresnel; on roughness and metallic."""
    floor()
    lit()
    grey, mixed, fresnel, rough = (material(name, Roughness=0.8) for name in ("grey", "mixed", "fresnel", "rough"))
    tree, principled, weight = new_nodes(grey, "LayerWeight")
    tree.links.new(weight.outputs["Facing"], principled.inputs["Base Color"])
    for made, output, blend in ((mixed, "Facing", 0.7), (fresnel, "Fresnel", 0.6)):
        tree, principled, weight, mix = new_nodes(made, "LayerWeight", "MixRGB")
        weight.inputs["Blend"].default_value = blend
        mix.inputs["Color1"].default_value, mix.inputs["Color2"].default_value = (0.7, 0.1, 0.05, 1), (0.1, 0.3, 0.9, 1)
        tree.links.new(weight.outputs[output], mix.inputs["Fac"])
        tree.links.new(mix.outputs[0], principled.inputs["Base Color"])
    tree, principled, weight = new_nodes(rough, "LayerWeight")
    principled.inputs["Base Color"].default_value = (0.8, 0.6, 0.3, 1)
    tree.links.new(weight.outputs["Facing"], principled.inputs["Metallic"])
    tree.links.new(weight.outputs["Facing"], principled.inputs["Roughness"])
    _row(grey, mixed, fresnel, rough)
    camera()


def facing_mix():
    """Glossy mixed with diffuse by Fresnel, by facing and by facing through a ramp; a transparent rim."""
    floor()
    lit()
    made = []
    for name in ("Fresnel", "LayerWeight", "ramp", "ghost"):
        mixed, tree, mix = shader(name, "MixShader")
        factor = tree.nodes.new("ShaderNodeFresnel" if name == "Fresnel" else "ShaderNodeLayerWeight")
        under, over = (tree.nodes.new(f"ShaderNode{n}") for n in ("BsdfDiffuse", "BsdfTransparent" if name == "ghost" else GLOSSY))
        under.inputs[0].default_value = (0.1, 0.4, 0.3, 1)
        source = factor.outputs["Facing" if name != "Fresnel" else 0]
        if name != "ghost":
            over.inputs["Color"].default_value, over.inputs["Roughness"].default_value = (1, 1, 1, 1), 0.2
        if name == "ramp":
            ramp = tree.nodes.new("ShaderNodeValToRGB")
            ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.2, 0.6
            tree.links.new(source, ramp.inputs[0])
            source = ramp.outputs[0]
        tree.links.new(source, mix.inputs[0])
        tree.links.new(under.outputs[0], mix.inputs[1])
        tree.links.new(over.outputs[0], mix.inputs[2])
        made.append(mixed)
    _row(*made)
    camera()


def facing_light():
    """Emission by facing: as strength, as colour, mixed with a reflective shader."""
    floor()
    world((0.02, 0.02, 0.03))
    light("AREA", "Key", 40, (-3, -4, 5), (0.6, -0.5, 0), size=2)
    strong, colored = (material(name, Base_Color=(0.1, 0.1, 0.1, 1)) for name in ("strong", "colored"))
    tree, principled, weight, gain = new_nodes(strong, "LayerWeight", "Math")
    principled.inputs["Emission Color"].default_value = (1, 0.5, 0.2, 1)
    gain.operation, gain.inputs[1].default_value = "MULTIPLY", 4.0
    tree.links.new(weight.outputs["Facing"], gain.inputs[0])
    tree.links.new(gain.outputs[0], principled.inputs["Emission Strength"])
    tree, principled, weight = new_nodes(colored, "LayerWeight")
    principled.inputs["Emission Strength"].default_value = 2.0
    by_ramp(tree, weight.outputs["Facing"], principled, "Emission Color")
    rim, tree, mix = shader("rim", "MixShader")
    weight, under, over = (tree.nodes.new(f"ShaderNode{n}") for n in ("LayerWeight", "BsdfDiffuse", "Emission"))
    weight.inputs["Blend"].default_value = 0.3
    under.inputs[0].default_value, over.inputs[0].default_value = (0.5, 0.1, 0.1, 1), (0.2, 0.6, 1, 1)
    over.inputs[1].default_value = 3.0
    for source, target in ((weight.outputs["Facing"], 0), (under.outputs[0], 1), (over.outputs[0], 2)):
        tree.links.new(source, mix.inputs[target])
    card = add("plane", colored, (0, 2.4, 1.3), "Card", size=2.0)
    card.rotation_euler = (1.2, 0, 0)
    _row(strong, colored, rim, material("white", Base_Color=(0.8, 0.8, 0.8, 1), Roughness=0.9))
    camera()


def facing_ramp():
    """Facing through colour ramps: velvet, car paint, a toon outline with constant steps."""
    floor()
    lit()
    velvet, paint, toon = material("velvet", Roughness=0.9), material("paint", Metallic=1.0, Roughness=0.3), material("toon", Roughness=1)
    for made, blend in ((velvet, 0.5), (paint, 0.25), (toon, 0.4)):
        tree, principled, weight = new_nodes(made, "LayerWeight")
        weight.inputs["Blend"].default_value = blend
        by_ramp(tree, weight.outputs["Facing"], principled)
        if made == toon:
            ramp = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeValToRGB")
            ramp.color_ramp.interpolation = "CONSTANT"
    _row(velvet, paint, toon)
    camera()
