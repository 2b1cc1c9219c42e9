"""Blender scenes with generated coordinates on deformed and repeated meshes, hair colours, and animated materials."""

import math

import bpy
import mathutils
import numpy as np

from blend_parts import add, ball, by_ramp, camera, floor, light, link, lit, material, new_nodes, picture, scene, world


def _pattern(name, kind="TexNoise", scale=5.0):
    made = material(name, Roughness=0.5)
    tree, shader, node = new_nodes(made, kind)
    node.inputs["Scale"].default_value = scale
    by_ramp(tree, node.outputs[0], shader)
    return made


def generated():
    """Procedural textures by generated coordinates on objects with modifiers and shape keys."""
    lit()
    camera()
    floor()
    array = add("cube", _pattern("wave", "TexWave", 3), (-3.2, 1.5, 0.5), "Row", size=0.8).modifiers.new("Array", "ARRAY")
    array.count, array.relative_offset_displace = 4, (1.3, 0, 0)
    bent = add("cylinder", _pattern("bent", "TexWave", 4), (1.5, -1, 1.2), "Bent", radius=0.35, depth=2.4, vertices=24)
    bpy.context.view_layer.objects.active = bent
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide(number_cuts=8)
    bpy.ops.object.mode_set(mode="OBJECT")
    bend = bent.modifiers.new("Bend", "SIMPLE_DEFORM")
    bend.deform_method, bend.angle, bend.deform_axis = "BEND", 1.6, "X"
    head = add("monkey", _pattern("cells", "TexVoronoi", 4), (-1, -2, 1), "Head")
    head.shape_key_add(name="Basis")
    wide = head.shape_key_add(name="Wide")
    for point in wide.data:
        point.co.x *= 1.8
    wide.value = 0.8
    head.modifiers.new("Subdivision", "SUBSURF").render_levels = 2
    half = add("cube", _pattern("half", scale=4), (2.6, 1.6, 0.7), "Half", size=1.2)
    half.data.transform(mathutils.Matrix.Translation((0.7, 0, 0)))
    half.modifiers.new("Mirror", "MIRROR")
    sheet = add("plane", _pattern("sheet", scale=3), (0, 3, 1.2), "Sheet", size=2)
    sheet.rotation_euler = (1.2, 0, 0)
    sheet.modifiers.new("Thick", "SOLIDIFY").thickness = 0.3


def _fibre(name):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    fibre = tree.nodes.new("ShaderNodeBsdfHairPrincipled")
    tree.links.new(fibre.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return made, tree, fibre


def _grow(obj, of, count=2500, length=0.3, **settings):
    obj.data.materials.append(of)
    grown = obj.modifiers.new("Fur", "PARTICLE_SYSTEM").particle_system.settings
    grown.type, grown.count, grown.hair_length, grown.radius_scale = "HAIR", count, length, 0.012
    grown.material = len(obj.data.materials)
    for key, value in settings.items():
        setattr(grown, key, value)


def _blades(count=400):
    """Randomly leaning curves with a colour attribute."""
    chance = np.random.default_rng(1)
    roots = np.stack([chance.uniform(-2, 2, count), chance.uniform(-2.6, -1.4, count), np.zeros(count)], 1)
    lean = chance.uniform(-0.15, 0.15, (count, 3))
    points = np.stack([roots + 0.3 * k * k * lean + np.array([0, 0, 0.15]) * k for k in range(4)], 1)
    data = bpy.data.hair_curves.new("Grass")
    data.add_curves([4] * count)
    data.position_data.foreach_set("vector", points.astype(np.float32).ravel())
    radii = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    radii.data.foreach_set("value", np.tile([0.02, 0.017, 0.012, 0.003], count).astype(np.float32))
    blade = material("blade", Roughness=0.6)
    tree, shader, info = new_nodes(blade, "HairInfo")
    by_ramp(tree, info.outputs["Random"], shader)
    data.materials.append(blade)
    link("Grass", data)


def furs():
    """Fur coloured by its skin's texture, with children; random melanin with dye; dark roots and light tips over noise; random
    grass."""
    lit()
    camera((0, -6, 3), (1.1, 0, 0), lens=40)
    floor()
    skin = material("skin", Base_Color=(0.4, 0.3, 0.25, 1))
    y, x = np.mgrid[0:32, 0:64]
    spots = np.where(((x // 8 + y // 8) % 2 == 0)[..., None], (0.05, 0.05, 0.1), (0.8, 0.5, 0.1))
    spotted = material("spots", Roughness=0.5)
    tree, shader, image = new_nodes(spotted, "TexImage")
    image.image = picture("spots", spots.astype(np.float32))
    tree.links.new(image.outputs[0], shader.inputs["Base Color"])
    _grow(ball(skin, (-2.2, 0, 1), 0.75, "Cat"), spotted, 600, 0.25, child_type="SIMPLE", rendered_child_count=8)
    red, _, fibre = _fibre("red")
    fibre.parametrization = "MELANIN"
    for key, value in (("Melanin", 0.6), ("Melanin Redness", 0.4), ("Random Color", 0.9), ("Tint", (0.9, 0.5, 0.4, 1))):
        fibre.inputs[key].default_value = value
    _grow(ball(skin, (0, 0, 1), 0.75, "Fox"), red)
    tips, tree, fibre = _fibre("tips")
    fibre.parametrization = "COLOR"
    info, ramp, noise, mix = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("HairInfo", "ValToRGB", "TexNoise", "MixRGB"))
    for element, position, color in zip(ramp.color_ramp.elements, (0.3, 0.8), ((0.02, 0.01, 0.01, 1), (0.9, 0.85, 0.8, 1))):
        element.position, element.color = position, color
    noise.inputs["Scale"].default_value = 3
    mix.blend_type, mix.inputs[0].default_value = "MULTIPLY", 0.6
    tree.links.new(info.outputs["Intercept"], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], mix.inputs[1])
    tree.links.new(noise.outputs["Color"], mix.inputs[2])
    tree.links.new(mix.outputs[0], fibre.inputs["Color"])
    _grow(ball(skin, (2.2, 0, 1), 0.75, "Hedgehog"), tips, length=0.35)
    _blades()


def keyed_materials():
    """Materials, a world and a row of boxes with keyframes and drivers, and a camera bound to a marker."""
    tree, background = world((0.8, 0.8, 0.85), 0.8)
    for frame, strength in ((1, 0.2), (40, 1.4)):
        background.inputs["Strength"].default_value = strength
        background.inputs["Strength"].keyframe_insert("default_value", frame=frame)
    light("SUN", "Sun", 3, rotation=(0.6, 0.3, 0.2), angle=0.1)
    floor()
    keyed = material("keyed", Roughness=0.4)
    base = keyed.node_tree.nodes["Principled BSDF"].inputs["Base Color"]
    noisy = material("noisy")
    tree, shader, checker = new_nodes(noisy, "TexChecker")
    tree.links.new(checker.outputs[0], shader.inputs["Base Color"])
    for frame, color in ((1, (1, 0, 0, 1)), (40, (0, 1, 0, 1))):
        for socket in (base, checker.inputs["Color1"]):
            socket.default_value = color
            socket.keyframe_insert("default_value", frame=frame)
    ball(keyed, (2.4, -2, 0.7), 0.7)
    for i in range(5):
        box = add("cube", noisy, (i - 2, 0, 0.4), size=0.7)
        box.driver_add("scale", 2).driver.expression = f"1 + 0.5 * sin(frame * 0.1 + {i})"
    other = camera((20, -20, 20), (0.6, 0, 0))
    other.name = "Other"
    chosen = camera((7, -7, 7), (math.radians(54.7), 0, math.radians(45)), type="ORTHO", ortho_scale=8)
    scene().camera = other
    scene().timeline_markers.new("chosen", frame=10).camera = chosen
    scene().frame_set(20)
