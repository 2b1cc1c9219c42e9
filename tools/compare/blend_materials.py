"""Blender scenes with various materials."""

import bpy
import numpy as np

from blend_parts import add, ball, camera, floor, light, link, material, scene, shader, still_life, world


def glass():
    floor()
    world((0.5, 0.6, 0.8), 0.8)
    light("AREA", "Key", 150, (-3, -3, 5), (0.6, -0.5, 0), size=2)
    ball(material("glass", Transmission_Weight=1, Roughness=0, IOR=1.45, Base_Color=(1, 1, 1, 1)), (-1.4, 0, 0.8))
    ball(material("frosted", Transmission_Weight=1, Roughness=0.3, IOR=1.45, Base_Color=(0.8, 1, 0.8, 1)), (0.4, 0.6, 0.8))
    made, _, _ = shader("glass node", "BsdfGlass", Color=(1, 0.8, 0.8, 1), Roughness=0.0, IOR=1.5)
    ball(made, (1.6, -1.4, 0.8))
    camera()


def shaders():
    """Shader nodes other than Principled."""
    floor(shader("diffuse", "BsdfDiffuse", Color=(0.6, 0.55, 0.5, 1), Roughness=0.0)[0])
    world((0.3, 0.35, 0.4))
    light("AREA", "Key", 200, (-3, -3, 5), (0.6, -0.5, 0), size=2)
    glossy = "BsdfAnisotropic" if hasattr(bpy.types, "ShaderNodeBsdfAnisotropic") else "BsdfGlossy"
    ball(shader("glossy", glossy, Color=(0.9, 0.7, 0.4, 1), Roughness=0.25)[0], (-2.4, 0, 0.7), 0.7)
    ball(shader("emission", "Emission", Color=(0.2, 0.6, 1, 1), Strength=2.0)[0], (-0.8, 1.2, 0.5), 0.5)
    ball(plastic(glossy), (-0.4, -0.8, 0.7), 0.7)
    ball(veil(), (1.2, 0.4, 0.7), 0.7)
    ball(shader("rough diffuse", "BsdfDiffuse", Color=(0.7, 0.2, 0.5, 1), Roughness=0.0)[0], (2.4, -1.4, 0.6), 0.6)
    camera()


def plastic(glossy):
    """Diffuse and glossy, mixed by Fresnel."""
    made, tree, mix = shader("plastic", "MixShader")
    fresnel, under, over = (tree.nodes.new(f"ShaderNode{k}") for k in ("Fresnel", "BsdfDiffuse", glossy))
    fresnel.inputs["IOR"].default_value = 1.5
    under.inputs["Color"].default_value = (0.1, 0.5, 0.2, 1)
    over.inputs["Color"].default_value, over.inputs["Roughness"].default_value = (1, 1, 1, 1), 0.2
    tree.links.new(fresnel.outputs[0], mix.inputs[0])
    tree.links.new(under.outputs[0], mix.inputs[1])
    tree.links.new(over.outputs[0], mix.inputs[2])
    return made


def veil():
    """Half-transparent."""
    made, tree, mix = shader("veil", "MixShader")
    clear, cloth = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeBsdfDiffuse")
    cloth.inputs["Color"].default_value = (0.8, 0.3, 0.2, 1)
    mix.inputs[0].default_value = 0.6
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(cloth.outputs[0], mix.inputs[2])
    return made


def principled():
    """Inputs of the Principled BSDF that glTF's exporter drops or changes."""
    floor()
    world((0.3, 0.35, 0.4))
    light("AREA", "Key", 250, (-3, -4, 5), (0.6, -0.5, 0), size=2)
    rows = [
        material("high index", Base_Color=(0.1, 0.1, 0.12, 1), Roughness=0.3, IOR=2.2),
        material("coat", Base_Color=(0.6, 0.1, 0.1, 1), Roughness=0.6, Coat_Weight=1, Coat_Roughness=0.1),
        material("sheen", Base_Color=(0.2, 0.2, 0.5, 1), Roughness=0.8, Sheen_Weight=1, Sheen_Roughness=0.5),
        material("specular", Base_Color=(0.1, 0.3, 0.1, 1), Roughness=0.3, Specular_IOR_Level=0.2),
        material("glow", Base_Color=(0.1, 0.1, 0.1, 1), Emission_Color=(1, 0.5, 0.1, 1), Emission_Strength=3),
        material("ghost", Base_Color=(0.8, 0.8, 0.2, 1), Alpha=0.4),
    ]
    for i, made in enumerate(rows):
        ball(made, (-2.4 + 1.6 * (i % 3) + 0.6 * (i // 3), 1.2 - 2.2 * (i // 3), 0.7), 0.7)
    camera(location=(5, -7, 5), rotation=(1.0, 0, 0.6))


def procedural():
    """Procedural textures."""
    made = material("checker", Roughness=0.7)
    tree, shader_node = made.node_tree, made.node_tree.nodes["Principled BSDF"]
    checker, coordinates = tree.nodes.new("ShaderNodeTexChecker"), tree.nodes.new("ShaderNodeTexCoord")
    checker.inputs["Scale"].default_value = 1.0
    tree.links.new(coordinates.outputs["Object"], checker.inputs["Vector"])
    tree.links.new(checker.outputs[0], shader_node.inputs["Base Color"])
    floor(made)
    world((0.3, 0.35, 0.4))
    light("AREA", "Key", 250, (-3, -4, 5), (0.6, -0.5, 0), size=2)
    ball(noisy("noise", "Base Color"), (-1.2, 0, 0.9), 0.9)
    ball(noisy("polish", "Roughness", Metallic=1), (1.4, -0.6, 0.9), 0.9)
    camera()


def noisy(name, into, **inputs):
    made = material(name, **inputs)
    tree = made.node_tree
    noise, ramp = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeValToRGB")
    noise.inputs["Scale"].default_value = 3
    ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.4, 0.6
    ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (0.8, 0.1, 0.05, 1), (0.1, 0.3, 0.8, 1)
    tree.links.new(noise.outputs[0], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], tree.nodes["Principled BSDF"].inputs[into])
    return made


def textured():
    """Textured base colour, roughness and normals."""
    rng = np.random.default_rng(1)
    made = material("tiles")
    tree, shader_node = made.node_tree, made.node_tree.nodes["Principled BSDF"]
    cells = np.repeat(np.repeat(rng.random((8, 8, 3)), 16, 0), 16, 1).astype(np.float32)
    color, rough = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeTexImage")
    color.image, rough.image = eight_bit("color", cells), eight_bit("rough", cells[..., :1].repeat(3, -1))
    rough.image.colorspace_settings.name = "Non-Color"
    tree.links.new(color.outputs[0], shader_node.inputs["Base Color"])
    tree.links.new(rough.outputs[0], shader_node.inputs["Roughness"])
    floor(made)
    still_life()
    bpy.data.objects["Floor.001"].hide_render = True
    world((0.3, 0.35, 0.4))
    light("AREA", "Key", 250, (-3, -4, 5), (0.6, -0.5, 0), size=2)
    camera()


def eight_bit(name, values):
    height, width = values.shape[:2]
    image = bpy.data.images.new(name, width, height)
    full = np.ones((height, width, 4), np.float32)
    full[..., :3] = values
    image.pixels[:] = full.ravel()
    image.pack()
    return image


def posed():
    """An armature, shape keys and a camera on a path, at an intermediate frame."""
    floor()
    world((0.3, 0.35, 0.4))
    light("SUN", "Sun", 3, rotation=(0.7, 0.4, 0.2), angle=0.1)
    bpy.ops.object.armature_add(location=(0, 0, 0))
    rig = bpy.context.object
    column = add("cylinder", material("skin", Base_Color=(0.8, 0.5, 0.3, 1)), (0, 0, 1), "Column", radius=0.4, depth=2)
    group = column.vertex_groups.new(name="Bone")
    group.add([v.index for v in column.data.vertices if v.co.z > 0], 1, "REPLACE")
    column.modifiers.new("Rig", "ARMATURE").object = rig
    bone = rig.pose.bones["Bone"]
    bone.rotation_mode = "XYZ"
    for frame, angle in ((1, 0), (20, 1.2)):
        bone.rotation_euler = (angle, 0, 0)
        bone.keyframe_insert("rotation_euler", frame=frame)
    keyed = add("cube", material("keyed", Base_Color=(0.2, 0.3, 0.8, 1)), (2.2, 0, 0.5), "Keyed", size=1)
    keyed.shape_key_add(name="Basis")
    key = keyed.shape_key_add(name="Tall")
    for i, v in enumerate(keyed.data.vertices):
        key.data[i].co = v.co * (1 if v.co.z < 0 else 2)
    for frame, value in ((1, 0), (20, 1)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    moving = camera()
    for frame, x in ((1, 6), (20, 4)):
        moving.location.x = x
        moving.keyframe_insert("location", frame=frame)
    scene().frame_set(12)


def groups():
    """Shaders in node groups, with group inputs and modified textures."""
    floor()
    world((0.3, 0.35, 0.4))
    light("AREA", "Key", 250, (-3, -4, 5), (0.6, -0.5, 0), size=2)
    group = bpy.data.node_groups.new("Paint", "ShaderNodeTree")
    group.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Gloss", in_out="INPUT", socket_type="NodeSocketFloat")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    inner, noise = group.nodes.new("ShaderNodeBsdfPrincipled"), group.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 4
    group.links.new(start.outputs["Tint"], inner.inputs["Base Color"])
    group.links.new(noise.outputs[0], inner.inputs["Roughness"])
    group.links.new(inner.outputs[0], end.inputs[0])
    for i, tint in enumerate(((0.7, 0.2, 0.1, 1), (0.1, 0.3, 0.7, 1))):
        made, _, node = shader_group(f"painted {i}", group)
        node.inputs["Tint"].default_value = tint
        ball(made, (-1.6 + 2.2 * i, 0.4 * i, 0.8))
    made = material("corrected", Roughness=0.8)
    tree, shader_node = made.node_tree, made.node_tree.nodes["Principled BSDF"]
    cells = np.repeat(np.repeat(np.random.default_rng(2).random((16, 16, 3)), 8, 0), 8, 1).astype(np.float32)
    image, change, mapping, uv = (
        tree.nodes.new(f"ShaderNode{k}") for k in ("TexImage", "HueSaturation", "Mapping", "TexCoord")
    )
    image.image = eight_bit("cells", cells)
    change.inputs["Saturation"].default_value, change.inputs["Value"].default_value = 0.4, 0.9
    mapping.inputs["Scale"].default_value = (2, 2, 2)
    tree.links.new(uv.outputs["UV"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], image.inputs["Vector"])
    tree.links.new(image.outputs["Color"], change.inputs["Color"])
    tree.links.new(change.outputs[0], shader_node.inputs["Base Color"])
    add("plane", made, (0.3, -1.6, 0.02), "Card", size=2.4)
    camera()


def shader_group(name, group):
    made, tree, node = shader(name, "Group")
    node.node_tree = group
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return made, tree, node


def leaves():
    """Alpha-masked leaf cards, bumps, and particles."""
    floor()
    world((0.4, 0.45, 0.5))
    light("SUN", "Sun", 3, rotation=(0.7, 0.4, 0.2), angle=0.1)
    size = 64
    y, x = np.mgrid[0:size, 0:size] / size - 0.5
    image = bpy.data.images.new("leaf", size, size, alpha=True)
    full = np.ones((size, size, 4), np.float32)
    full[..., :3] = (0.2, 0.5, 0.1)
    full[..., 3] = np.hypot(x * 1.6, y) < 0.45
    image.pixels[:] = full.ravel()
    image.pack()
    made = material("leaf", Roughness=0.7)
    tree, shader_node = made.node_tree, made.node_tree.nodes["Principled BSDF"]
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs["Color"], shader_node.inputs["Base Color"])
    tree.links.new(node.outputs["Alpha"], shader_node.inputs["Alpha"])
    card = add("plane", made, (0, 0, -5), "Card", size=0.8)
    for i in range(5):
        link(f"Leaf {i}", card.data, (-2 + i, 1.5 - 0.5 * i, 0.6), (1.2, 0.2 * i, 0.3 * i))
    rough = material("bumpy", Base_Color=(0.6, 0.4, 0.3, 1), Roughness=0.6)
    tree, shader_node = rough.node_tree, rough.node_tree.nodes["Principled BSDF"]
    bump, noise = tree.nodes.new("ShaderNodeBump"), tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value, bump.inputs["Distance"].default_value = 6, 0.2
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], shader_node.inputs["Normal"])
    ball(rough, (2.2, -1.2, 0.8))
    patch = add("grid", material("soil", Base_Color=(0.3, 0.25, 0.2, 1)), (-2, -1.5, 0.05), "Patch", size=2)
    patch.modifiers.new("Seeds", "PARTICLE_SYSTEM")
    seeds = patch.particle_systems[0].settings
    seeds.type, seeds.count, seeds.render_type = "HAIR", 60, "OBJECT"
    seeds.use_advanced_hair, seeds.particle_size, seeds.hair_length = True, 0.1, 1
    seeds.instance_object = ball(material("seed", Base_Color=(0.8, 0.7, 0.2, 1)), (0, 0, -5), 1, "Seed")
    camera()
