"""Scenes of Blender of the kinds that artists build in a day: a kitchen, a bottle on a stage, a meadow, a street at night, a bust,
titles in motion. They use many things at once, and were tried before anything was made for them."""

import math

import bpy
import numpy as np

from blend_parts import add, ball, camera, floor, light, link, material, scene, shader, world


def _nodes(made, *kinds):
    """A material's tree, its Principled shader, and new nodes."""
    tree = made.node_tree
    return (tree, tree.nodes.get("Principled BSDF"), *(tree.nodes.new(f"ShaderNode{kind}") for kind in kinds))


def _ramp(tree, source, target, *colors):
    """Colours an input by a number: evenly spaced colours."""
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    elements = ramp.color_ramp.elements
    while len(elements) < len(colors):
        elements.new(0.5)
    for i, color in enumerate(colors):
        elements[i].position, elements[i].color = i / (len(colors) - 1), (*color, 1)
    tree.links.new(source, ramp.inputs[0])
    tree.links.new(ramp.outputs[0], target)
    return ramp


def _wood(name="wood"):
    """Planks: stretched noise through waves, with bumps and gloss of the same."""
    made = material(name, Roughness=0.4)
    tree, principled, place, mapping, noise, wave, bump, gloss = _nodes(
        made, "TexCoord", "Mapping", "TexNoise", "TexWave", "Bump", "MapRange"
    )
    mapping.inputs["Scale"].default_value = (1, 6, 1)
    noise.inputs["Scale"].default_value, wave.inputs["Distortion"].default_value = 2, 4
    tree.links.new(place.outputs["Object"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], noise.inputs["Vector"])
    tree.links.new(noise.outputs["Color"], wave.inputs["Vector"])
    _ramp(tree, wave.outputs["Fac"], principled.inputs["Base Color"], (0.25, 0.1, 0.04), (0.5, 0.27, 0.12), (0.3, 0.14, 0.06))
    gloss.inputs["To Min"].default_value, gloss.inputs["To Max"].default_value = 0.3, 0.6
    tree.links.new(wave.outputs["Fac"], gloss.inputs[0])
    tree.links.new(gloss.outputs[0], principled.inputs["Roughness"])
    bump.inputs["Strength"].default_value, bump.inputs["Distance"].default_value = 0.3, 0.02
    tree.links.new(wave.outputs["Fac"], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], principled.inputs["Normal"])
    return made


def kitchen():
    """A room with a window pane, sun, tiles, wood, a glass of water that overlaps it, a lamp of frosted glass."""
    tree, background = world((0.5, 0.65, 0.9), 1.5)
    plaster = material("plaster", Base_Color=(0.75, 0.72, 0.68, 1), Roughness=0.9)
    tiles = material("tiles", Roughness=0.15)
    _tiles(tiles)
    add("plane", tiles, (0, 0, 0), "Floor", size=6)
    for name, at, turn in (("Back", (0, 3, 1.5), (math.pi / 2, 0, 0)), ("Left", (-3, 0, 1.5), (0, math.pi / 2, 0)), ("Above", (0, 0, 3), (math.pi, 0, 0))):
        add("plane", plaster, at, name, size=6).rotation_euler = turn
    wall = add("cube", plaster, (3.05, 0, 1.5), "Right", size=1)
    wall.scale = (0.1, 6, 3)
    hole = add("cube", None, (3.05, 0.5, 1.6), "Hole", size=1)
    hole.scale, hole.hide_render, hole.display_type = (1, 1.8, 1.4), True, "WIRE"
    cut = wall.modifiers.new("Window", "BOOLEAN")
    cut.object, cut.operation = hole, "DIFFERENCE"
    pane = material("pane", Transmission_Weight=1, Roughness=0, IOR=1.45, Base_Color=(1, 1, 1, 1))
    pane_of = add("plane", pane, (3.05, 0.5, 1.6), "Pane", size=1)
    pane_of.rotation_euler, pane_of.scale = (0, math.pi / 2, 0), (1.4, 1.8, 1)
    light("SUN", "Sun", 6, rotation=(0.2, 0.9, 0.1), angle=0.02, color=(1, 0.9, 0.75))
    table = add("cube", _wood(), (0.3, 0.6, 0.75), "Table", size=1)
    table.scale = (2.2, 1.2, 0.08)
    table.modifiers.new("Bevel", "BEVEL").width = 0.02
    for x in (-0.7, 1.3):
        for y in (0.1, 1.1):
            add("cylinder", material("steel", Metallic=1, Roughness=0.25, Base_Color=(0.7, 0.7, 0.72, 1)), (x, y, 0.36), radius=0.03, depth=0.72)
    _tumbler((0.6, 0.4, 0.79))
    globe = material("globe", Transmission_Weight=1, Roughness=0.4, IOR=1.3, Emission_Color=(1, 0.8, 0.5, 1), Emission_Strength=1.5)
    ball(globe, (-1.2, 1.8, 1.9), 0.25)
    light("POINT", "Lamp", 60, (-1.2, 0.6, 2.6), shadow_soft_size=0.15, color=(1, 0.7, 0.4))
    camera((-1.6, -2.4, 1.7), (1.35, 0, -0.55), lens=24)


def _tiles(made):
    tree, principled, brick, uv, mapping, bump = _nodes(made, "TexBrick", "TexCoord", "Mapping", "Bump")
    brick.offset = 0
    for name, color in (("Color1", (0.8, 0.8, 0.78)), ("Color2", (0.15, 0.2, 0.25)), ("Mortar", (0.3, 0.3, 0.3))):
        brick.inputs[name].default_value = (*color, 1)
    brick.inputs["Scale"].default_value, brick.inputs["Brick Width"].default_value = 5, 0.5
    brick.inputs["Row Height"].default_value = 0.5
    tree.links.new(uv.outputs["UV"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], brick.inputs["Vector"])
    tree.links.new(brick.outputs["Color"], principled.inputs["Base Color"])
    tree.links.new(brick.outputs["Fac"], bump.inputs["Height"])
    bump.invert, bump.inputs["Distance"].default_value = True, 0.02
    tree.links.new(bump.outputs[0], principled.inputs["Normal"])


def _tumbler(at):
    """A turned profile with a thick wall, and water that reaches a little into it."""
    glass = material("tumbler", Transmission_Weight=1, Roughness=0, IOR=1.5, Base_Color=(1, 1, 1, 1))
    profile = [(0, 0), (0.12, 0), (0.14, 0.3), (0.125, 0.3), (0.11, 0.03), (0, 0.03)]
    _turned("Tumbler", profile, glass, at)
    water = material("tea", Transmission_Weight=1, Roughness=0, IOR=1.33, Base_Color=(1, 1, 1, 1))
    tree = water.node_tree
    absorb = tree.nodes.new("ShaderNodeVolumeAbsorption")
    absorb.inputs["Color"].default_value, absorb.inputs["Density"].default_value = (0.8, 0.3, 0.05, 1), 12
    tree.links.new(absorb.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
    _turned("Tea", [(0, 0.025), (0.113, 0.025), (0.122, 0.2), (0, 0.2)], water, at)


def _turned(name, profile, of, at, steps=48):
    """A closed surface of revolution."""
    verts, faces = [], []
    rings = [[(r * math.cos(2 * math.pi * k / steps), r * math.sin(2 * math.pi * k / steps), z) for k in range(steps)] if r else [(0, 0, z)] for r, z in profile]
    starts = []
    for ring in rings:
        starts.append(len(verts))
        verts += ring
    for (a, b), (s, t) in zip(zip(rings, rings[1:]), zip(starts, starts[1:])):
        for k in range(steps):
            n = (k + 1) % steps
            face = [s + (k if len(a) > 1 else 0), s + (n if len(a) > 1 else 0), t + (n if len(b) > 1 else 0), t + (k if len(b) > 1 else 0)]
            faces.append(tuple(dict.fromkeys(face)))
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(verts, [], faces)
    mesh.materials.append(of)
    mesh.validate()
    return link(name, mesh, at)


def bottle():
    """A stage for a product: a bent backdrop, soft boxes that shine, a bottle whose label is a mask between two shaders."""
    world((0.03, 0.03, 0.035))
    backdrop = add("plane", material("paper", Base_Color=(0.55, 0.6, 0.65, 1), Roughness=0.8), (0, 0, 0), "Backdrop", size=8)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.subdivide(number_cuts=12)
    bpy.ops.object.mode_set(mode="OBJECT")
    for vertex in backdrop.data.vertices:
        if vertex.co.y > 1.5:
            vertex.co.z, vertex.co.y = (vertex.co.y - 1.5) ** 2 * 0.8, 1.5 + (vertex.co.y - 1.5) * 0.4
    bpy.ops.object.shade_smooth()
    glow, tree, emission = shader("soft box", "Emission", Strength=6.0)
    gradient, place = tree.nodes.new("ShaderNodeTexGradient"), tree.nodes.new("ShaderNodeTexCoord")
    gradient.gradient_type = "SPHERICAL"
    tree.links.new(place.outputs["Object"], gradient.inputs[0])
    _ramp(tree, gradient.outputs["Fac"], emission.inputs["Color"], (0.1, 0.1, 0.12), (1, 0.97, 0.9))
    for x, turn in ((-2.6, 1.1), (2.6, -1.1)):
        box = add("plane", glow, (x, -0.6, 2.2), "Box", size=1.6)
        box.rotation_euler = (0, turn, 0)
    made, tree, mix = shader("bottle", "MixShader")
    glass, label, mask, place, apart, inside = (
        tree.nodes.new(f"ShaderNode{k}") for k in ("BsdfGlass", "BsdfPrincipled", "Math", "TexCoord", "SeparateXYZ", "TexChecker")
    )
    glass.inputs["Color"].default_value = (0.7, 0.95, 0.8, 1)
    mask.operation, mask.inputs[1].default_value, mask.inputs[2].default_value = "COMPARE", 0.55, 0.25
    tree.links.new(place.outputs["Object"], apart.inputs[0])
    tree.links.new(apart.outputs["Z"], mask.inputs[0])
    tree.links.new(mask.outputs[0], mix.inputs[0])
    inside.inputs["Scale"].default_value = 12
    inside.inputs["Color1"].default_value, inside.inputs["Color2"].default_value = (0.9, 0.85, 0.7, 1), (0.6, 0.05, 0.05, 1)
    tree.links.new(inside.outputs["Color"], label.inputs["Base Color"])
    tree.links.new(glass.outputs[0], mix.inputs[1])
    tree.links.new(label.outputs[0], mix.inputs[2])
    profile = [(0, 0), (0.32, 0), (0.34, 0.04), (0.34, 1.0), (0.12, 1.3), (0.11, 1.6), (0, 1.6)]
    _turned("Bottle", profile, made, (0.2, 0, 0.001))
    chrome = material("brushed", Metallic=1, Roughness=0.3, Anisotropic=0.7, Base_Color=(0.9, 0.85, 0.8, 1))
    cap = add("cylinder", chrome, (-0.9, 0.2, 0.3), "Tin", True, radius=0.35, depth=0.6, vertices=64)
    cap.data.polygons.foreach_set("use_smooth", [len(p.vertices) == 4 for p in cap.data.polygons])
    lens = camera((0.0, -4.2, 1.5), (1.4, 0, 0), lens=50).data.dof
    lens.use_dof, lens.focus_distance, lens.aperture_fstop = True, 4.2, 1.4
    scene().view_settings.exposure = 0.5


def meadow():
    """Hills by displacement, painted by height and vertex colours, with grass and stones by geometry nodes, and leaves that shine through."""
    tree, background = world(strength=0.5)
    sky = tree.nodes.new("ShaderNodeTexSky")
    types = [i.identifier for i in sky.bl_rna.properties["sky_type"].enum_items]
    sky.sky_type = "NISHITA" if "NISHITA" in types else "MULTIPLE_SCATTERING"
    sky.sun_disc = False
    background.inputs["Strength"].default_value = 0.08
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    light("SUN", "Sun", 4, rotation=(0.8, 0.2, 0.5), angle=0.01)
    ground = material("ground", Roughness=1.0, Specular_IOR_Level=0.1)
    tree, principled, painted, geometry, apart, mix = _nodes(ground, "VertexColor", "NewGeometry", "SeparateXYZ", "Mix")
    painted.layer_name = "Paint"
    mix.data_type = "RGBA"
    tree.links.new(geometry.outputs["Normal"], apart.inputs[0])
    tree.links.new(apart.outputs["Z"], mix.inputs[0])
    mix.inputs[6].default_value = (0.35, 0.3, 0.25, 1)
    tree.links.new(painted.outputs["Color"], mix.inputs[7])
    tree.links.new(mix.outputs[2], principled.inputs["Base Color"])
    hills = add("grid", ground, (0, 0, 0), "Hills", True, x_subdivisions=64, y_subdivisions=64, size=12)
    clouds = bpy.data.textures.new("clouds", "CLOUDS")
    clouds.noise_scale = 2.0
    moved = hills.modifiers.new("Hills", "DISPLACE")
    moved.texture, moved.strength, moved.mid_level = clouds, 1.5, 0.5
    colors = hills.data.color_attributes.new("Paint", "FLOAT_COLOR", "POINT")
    at = np.array([v.co for v in hills.data.vertices])
    share = (0.5 + 0.5 * np.sin(at[:, :1] * 2) * np.cos(at[:, 1:2] * 1.5)).clip(0, 1)
    values = share * (0.15, 0.35, 0.05, 1) + (1 - share) * (0.4, 0.35, 0.1, 1)
    colors.data.foreach_set("color", values.astype(np.float32).ravel())
    blade, tree, both = shader("blade", "AddShader")
    up, through, own = (tree.nodes.new(f"ShaderNode{k}") for k in ("BsdfDiffuse", "BsdfTranslucent", "ObjectInfo"))
    _ramp(tree, own.outputs["Random"], up.inputs["Color"], (0.05, 0.15, 0.02), (0.2, 0.3, 0.05))
    through.inputs["Color"].default_value = (0.1, 0.25, 0.02, 1)
    tree.links.new(up.outputs[0], both.inputs[0])
    tree.links.new(through.outputs[0], both.inputs[1])
    mesh = bpy.data.meshes.new("Blade")
    mesh.from_pydata([(-0.04, 0, 0), (0.04, 0, 0), (0.02, 0.05, 0.35), (0.0, 0.15, 0.6)], [], [(0, 1, 2), (0, 2, 3)])
    mesh.materials.append(blade)
    hidden = bpy.data.collections.new("Kit")
    link("Blade", mesh, into=hidden)
    _sow(hills, hidden)
    camera((5, -6, 3.2), (1.25, 0, 0.7), lens=35)


def _sow(on, collection):
    """Instances of a collection, spread over faces, turned and sized by chance."""
    group = bpy.data.node_groups.new("Sow", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start, end, spread, source, put, turn, size, join = (
        group.nodes.new(k)
        for k in (
            "NodeGroupInput", "NodeGroupOutput", "GeometryNodeDistributePointsOnFaces", "GeometryNodeCollectionInfo",
            "GeometryNodeInstanceOnPoints", "FunctionNodeRandomValue", "FunctionNodeRandomValue", "GeometryNodeJoinGeometry",
        )
    )  # fmt: skip
    spread.inputs["Density"].default_value = 12.0
    source.inputs["Collection"].default_value = collection
    source.inputs["Separate Children"].default_value = True
    turn.data_type = "FLOAT_VECTOR"
    turn.inputs["Max"].default_value = (0.3, 0.3, 6.283)
    size.inputs[2].default_value, size.inputs[3].default_value = 0.5, 1.2
    for a, b in (
        (start.outputs[0], spread.inputs[0]), (spread.outputs["Points"], put.inputs["Points"]),
        (source.outputs[0], put.inputs["Instance"]), (turn.outputs[0], put.inputs["Rotation"]),
        (size.outputs[1], put.inputs["Scale"]), (start.outputs[0], join.inputs[0]), (put.outputs[0], join.inputs[0]),
        (join.outputs[0], end.inputs[0]),
    ):  # fmt: skip
        group.links.new(a, b)
    on.modifiers.new("Sow", "NODES").node_group = group


def street():
    """Houses with lit windows by nodes, a wet road, fog, street lamps with spots, a neon sign of a curve."""
    tree, background = world((0.01, 0.015, 0.03))
    house = material("house", Roughness=0.8)
    tree, principled, place, brick, own, shift = _nodes(house, "TexCoord", "TexBrick", "ObjectInfo", "VectorMath")
    principled.inputs["Base Color"].default_value = (0.25, 0.2, 0.18, 1)
    brick.offset, brick.squash = 0, 1
    for name, value in (("Scale", 3.0), ("Mortar Size", 0.08), ("Brick Width", 0.5), ("Row Height", 0.5)):
        brick.inputs[name].default_value = value
    brick.inputs["Color1"].default_value, brick.inputs["Color2"].default_value = (1, 0.7, 0.3, 1), (0.02, 0.02, 0.03, 1)
    brick.inputs["Mortar"].default_value = (0, 0, 0, 1)
    tree.links.new(place.outputs["Generated"], shift.inputs[0])
    tree.links.new(own.outputs["Location"], shift.inputs[1])
    tree.links.new(shift.outputs[0], brick.inputs["Vector"])
    tree.links.new(brick.outputs["Color"], principled.inputs["Emission Color"])
    principled.inputs["Emission Strength"].default_value = 1.5
    data = None
    for i in range(4):
        for side in (-1, 1):
            if data is None:
                data = add("cube", house, (0, 0, -50), "House kit", size=1).data
            block = link(f"House {i} {side}", data, (side * 3.2, 1.5 + 2.6 * i, 1.5 + 0.4 * ((i * 3 + side) % 3)))
            block.scale = (2, 2.2, 3 + 0.8 * ((i * 3 + side) % 3))
    road = material("road", Base_Color=(0.03, 0.03, 0.035, 1))
    tree, principled, noise, place, mix, bump = _nodes(road, "TexNoise", "TexCoord", "MapRange", "Bump")
    noise.inputs["Scale"].default_value = 1.5
    tree.links.new(place.outputs["Object"], noise.inputs["Vector"])
    mix.inputs["From Min"].default_value, mix.inputs["From Max"].default_value = 0.45, 0.55
    mix.inputs["To Min"].default_value, mix.inputs["To Max"].default_value = 0.08, 0.6
    tree.links.new(noise.outputs[0], mix.inputs[0])
    tree.links.new(mix.outputs[0], principled.inputs["Roughness"])
    add("plane", road, (0, 5, 0), "Road", size=16)
    for i in range(3):
        light("SPOT", f"Street lamp {i}", 220, (-1.5, 1 + 3 * i, 3), spot_size=1.6, spot_blend=0.4, shadow_soft_size=0.1, color=(1, 0.75, 0.45))
        add("cylinder", material("pole", Base_Color=(0.1, 0.1, 0.1, 1)), (-1.8, 1 + 3 * i, 1.5), radius=0.04, depth=3)
    neon, _, _ = shader("neon", "Emission", Color=(1, 0.1, 0.5, 1), Strength=12.0)
    curve = bpy.data.curves.new("Sign", "FONT")
    curve.body, curve.size, curve.bevel_depth, curve.fill_mode = "BAR", 0.7, 0.03, "NONE"
    curve.materials.append(neon)
    link("Sign", curve, (1.1, 0.3, 1.6), (math.pi / 2, 0, 0))
    camera((0.2, -3.6, 1.3), (1.5, 0, 0), lens=26)


def bust():
    """A head of skin by a painted picture, with eyes, a cloth that shines at its edges, three lamps by temperature, a checked floor."""
    floor()
    world((0.05, 0.06, 0.08))
    skin = material("skin", Roughness=0.45, Subsurface_Weight=1.0, Subsurface_Scale=0.05)
    tree, principled, noise, place = _nodes(skin, "TexNoise", "TexCoord")
    principled.inputs["Subsurface Radius"].default_value = (1.0, 0.3, 0.15)
    noise.inputs["Scale"].default_value = 3
    tree.links.new(place.outputs["Object"], noise.inputs["Vector"])
    _ramp(tree, noise.outputs[0], principled.inputs["Base Color"], (0.75, 0.4, 0.3), (0.85, 0.6, 0.5))
    bpy.ops.mesh.primitive_monkey_add(location=(0, 0, 1.4))
    head = bpy.context.object
    head.data.materials.append(skin)
    head.modifiers.new("Smooth", "SUBSURF").render_levels = 2
    bpy.ops.object.shade_smooth()
    head.rotation_euler = (0, 0, 0.4)
    cloth = material("cloth", Base_Color=(0.15, 0.02, 0.03, 1), Roughness=0.9, Sheen_Weight=1.0, Sheen_Roughness=0.4)
    cloth.node_tree.nodes["Principled BSDF"].inputs["Sheen Tint"].default_value = (1, 0.4, 0.4, 1)
    add("cone", cloth, (0, 0, 0.3), "Plinth", True, radius1=0.9, radius2=0.5, depth=0.8, vertices=64)
    rim = material("rim", Roughness=0.6)
    tree, principled, facing = _nodes(rim, "LayerWeight")
    facing.inputs["Blend"].default_value = 0.4
    _ramp(tree, facing.outputs["Facing"], principled.inputs["Base Color"], (0.02, 0.05, 0.3), (0.6, 0.8, 1.0))
    ball(rim, (1.6, 0.6, 0.5), 0.5)
    car = material("car paint", Metallic=0.8, Roughness=0.35, Coat_Weight=1.0, Coat_Roughness=0.03)
    tree, principled, flakes, place = _nodes(car, "TexVoronoi", "TexCoord")
    flakes.inputs["Scale"].default_value = 60
    tree.links.new(place.outputs["Object"], flakes.inputs["Vector"])
    _ramp(tree, flakes.outputs["Color"], principled.inputs["Base Color"], (0.5, 0.02, 0.02), (0.9, 0.1, 0.05))
    ball(car, (-1.6, -0.3, 0.5), 0.5)
    for name, power, at, turn, kelvin in (
        ("Key", 150, (-3, -3, 4), (0.7, -0.5, 0), 5600), ("Fill", 40, (3.5, -3, 2), (1.1, 0.7, 0), 7500), ("Rim", 200, (1.5, 4, 3.5), (-0.9, 0.3, 0), 3200),
    ):  # fmt: skip
        lamp = light("AREA", name, power, at, turn, size=1.5)
        if hasattr(lamp.data, "use_temperature"):
            lamp.data.use_temperature, lamp.data.temperature = True, kelvin
    camera((0.8, -5.5, 2.0), (1.42, 0, 0.12), lens=50)


def titles():
    """Titles: bevelled letters along an array, wires, a bent path, gradients by vertex, an empty parent, a mirror floor."""
    floor(material("mirror", Metallic=0.0, Roughness=0.08, Base_Color=(0.02, 0.02, 0.03, 1)))
    tree, background = world()
    place, apart = (tree.nodes.new(f"ShaderNode{k}") for k in ("TexCoord", "SeparateXYZ"))
    tree.links.new(place.outputs["Generated"], apart.inputs[0])
    _ramp(tree, apart.outputs["Z"], background.inputs["Color"], (0.3, 0.1, 0.2), (0.1, 0.2, 0.6))
    gold = material("gold", Metallic=1, Roughness=0.2)
    tree, principled, place, apart = _nodes(gold, "TexCoord", "SeparateXYZ")
    tree.links.new(place.outputs["Generated"], apart.inputs[0])
    _ramp(tree, apart.outputs["X"], principled.inputs["Base Color"], (1, 0.7, 0.2), (0.9, 0.3, 0.5), (0.3, 0.5, 1))
    text = bpy.data.curves.new("Title", "FONT")
    text.body, text.extrude, text.bevel_depth, text.size, text.align_x = "OPEN", 0.15, 0.03, 1.6, "CENTER"
    text.materials.append(gold)
    group = link("Group", None, (0, 0, 0.1), (0, 0, 0.2))
    link("Title", text, (0, 0, 0), (math.pi / 2, 0, 0)).parent = group
    cage = add("ico_sphere", material("wire", Base_Color=(0.8, 0.8, 0.8, 1), Metallic=1, Roughness=0.3), (-2.4, 1, 1), "Cage", radius=0.8, subdivisions=2)
    cage.modifiers.new("Wires", "WIREFRAME").thickness = 0.05
    bpy.ops.curve.primitive_nurbs_path_add(location=(0, 1.8, 1.4))
    path = bpy.context.object
    path.data.splines[0].points[1].co.z = 1.0
    chain = add("torus", material("link", Base_Color=(0.1, 0.6, 0.5, 1), Roughness=0.3), (0, 1.8, 1.4), "Chain", True, major_radius=0.22, minor_radius=0.06)
    many = chain.modifiers.new("Array", "ARRAY")
    many.fit_type, many.curve = "FIT_CURVE", path
    bend = chain.modifiers.new("Curve", "CURVE")
    bend.object = path
    edges = material("edges", Roughness=0.5)
    tree, principled, wires, mixed = _nodes(edges, "Wireframe", "Mix")
    mixed.data_type = "RGBA"
    wires.inputs[0].default_value = 0.03
    mixed.inputs[6].default_value, mixed.inputs[7].default_value = (0.05, 0.05, 0.2, 1), (1, 0.5, 0.1, 1)
    tree.links.new(wires.outputs[0], mixed.inputs[0])
    tree.links.new(mixed.outputs[2], principled.inputs["Emission Color"])
    principled.inputs["Emission Strength"].default_value = 1.0
    add("ico_sphere", edges, (2.5, 0.6, 0.8), "Low", radius=0.7, subdivisions=1)
    light("AREA", "Key", 200, (-3, -4, 5), (0.6, -0.5, 0), size=2)
    camera((0.5, -6, 1.8), (1.42, 0, 0.08), lens=35)
