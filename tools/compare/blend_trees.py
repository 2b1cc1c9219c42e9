"""Blender scenes with node trees that depend on object, side, view or ray type."""

import bpy

from blend_parts import add, ball, by_ramp, camera, floor, link, lit, material, new_nodes, shader, world


def object_info():
    """Spheres with one mesh and material coloured by Object Info: random, colour, location and index; instances, too."""
    floor()
    lit()
    random, own, place, number = (material(name, Roughness=0.7) for name in ("random", "own", "place", "number"))
    for made, output in ((random, "Random"), (own, "Color"), (place, "Location"), (number, "Object Index")):
        tree, principled, info = new_nodes(made, "ObjectInfo")
        if output == "Color":
            tree.links.new(info.outputs[output], principled.inputs["Base Color"])
        elif output == "Location":
            part = tree.nodes.new("ShaderNodeVectorMath")
            part.operation, part.inputs[1].default_value = "MULTIPLY", (0.2, 0.2, 0.2)
            tree.links.new(info.outputs[output], part.inputs[0])
            tree.links.new(part.outputs[0], principled.inputs["Base Color"])
        else:
            half = tree.nodes.new("ShaderNodeMath")
            half.operation, half.inputs[1].default_value = "MULTIPLY", 1.0 if output == "Random" else 0.25
            tree.links.new(info.outputs[output], half.inputs[0])
            by_ramp(tree, half.outputs[0], principled)
    data = ball(random, (0, 0, -5), 0.4).data
    for row, made in enumerate((random, own, place, number)):
        shared = data.copy()
        shared.materials[0] = made
        for i in range(4):
            placed = link(f"{made.name} {i}", shared, (0.25 + 0.9 * i - 1.8 * (row != 2), 0.9 * row - 1, 0.4 + 0.2 * (row == 2)))
            placed.color, placed.pass_index = (0.2 * i + 0.1, 0.5, 0.8 - 0.2 * i, 1), i + 1
    gathered = bpy.data.collections.new("Gathered")
    link("Member", data, (0, 0, 0), into=gathered)
    for i in range(4):
        link(f"Instance {i}", None, (-2.6, 0.9 * i - 1, 0.4)).instance_type = "COLLECTION"
        bpy.data.objects[f"Instance {i}"].instance_collection = gathered
    camera()


def object_noise():
    """Noise by object location, offset by a custom property."""
    floor()
    lit()
    made = material("speckled", Roughness=0.8)
    tree, principled, geometry, moved, noise, own = new_nodes(made, "NewGeometry", "VectorMath", "TexNoise", "Attribute")
    own.attribute_type, own.attribute_name = "OBJECT", "shift"
    noise.inputs["Scale"].default_value = 1.2
    tree.links.new(geometry.outputs["Position"], moved.inputs[0])
    tree.links.new(own.outputs["Fac"], moved.inputs[1])
    tree.links.new(moved.outputs[0], noise.inputs["Vector"])
    by_ramp(tree, noise.outputs[0], principled)
    data = add("cube", made, (0, 0, -5), size=1).data
    for i in range(5):
        placed = link(f"Cube {i}", data, (-2 + i, 0.5 * i - 1, 0.5), (0, 0, 0.4 * i))
        placed["shift"] = 2.0 * i
    camera()


def instancer_attributes():
    """Geometry nodes instances with a colour attribute, and particles with their index."""
    lit()
    tinted = material("tinted", Roughness=0.8)
    tree, principled, own = new_nodes(tinted, "Attribute")
    own.attribute_type, own.attribute_name = "INSTANCER", "tint"
    by_ramp(tree, own.outputs["Fac"], principled)
    cube = add("cube", tinted, (0, 0, -5), "Tinted", size=0.6)
    base = add("grid", material("soil", Base_Color=(0.4, 0.4, 0.4, 1)), (0, 0, 0), "Base", size=5, x_subdivisions=4, y_subdivisions=4)
    group = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    node = lambda kind: group.nodes.new(kind)
    start, end, source, put, store, index, share, join = (
        node(k)
        for k in (
            "NodeGroupInput", "NodeGroupOutput", "GeometryNodeObjectInfo", "GeometryNodeInstanceOnPoints",
            "GeometryNodeStoreNamedAttribute", "GeometryNodeInputIndex", "ShaderNodeMath", "GeometryNodeJoinGeometry",
        )
    )  # fmt: skip
    source.inputs[0].default_value = cube
    source.inputs["As Instance"].default_value = True
    store.domain, share.operation, share.inputs[1].default_value = "INSTANCE", "DIVIDE", 24.0
    store.inputs["Name"].default_value = "tint"
    for a, b in (
        (start.outputs[0], put.inputs["Points"]), (source.outputs["Geometry"], put.inputs["Instance"]),
        (index.outputs[0], share.inputs[0]), (share.outputs[0], store.inputs["Value"]),
        (put.outputs[0], store.inputs["Geometry"]), (start.outputs[0], join.inputs[0]),
        (store.outputs[0], join.inputs[0]), (join.outputs[0], end.inputs[0]),
    ):  # fmt: skip
        group.links.new(a, b)
    base.modifiers.new("Scatter", "NODES").node_group = group
    numbered = material("numbered", Roughness=0.8)
    tree, principled, info, share = new_nodes(numbered, "ParticleInfo", "Math")
    share.operation, share.inputs[1].default_value = "DIVIDE", 20.0
    tree.links.new(info.outputs["Index"], share.inputs[0])
    by_ramp(tree, share.outputs[0], principled)
    patch = add("plane", material("sand", Base_Color=(0.5, 0.45, 0.3, 1)), (0, -4, 0), "Patch", size=3)
    patch.modifiers.new("Seeds", "PARTICLE_SYSTEM")
    seeds = patch.particle_systems[0].settings
    seeds.count, seeds.render_type, seeds.particle_size, seeds.frame_start, seeds.frame_end = 20, "OBJECT", 0.25, 1, 1
    seeds.lifetime, seeds.physics_type = 100, "NO"
    seeds.instance_object = ball(numbered, (0, 0, -5), 1, "Seed")
    camera()


def two_sides():
    """Cards with another colour on the back, and one transparent from behind."""
    floor()
    lit()
    made, tree, mix = shader("two colours", "MixShader")
    side, front, back = (tree.nodes.new(f"ShaderNode{k}") for k in ("NewGeometry", "BsdfDiffuse", "BsdfDiffuse"))
    front.inputs["Color"].default_value, back.inputs["Color"].default_value = (0.8, 0.1, 0.1, 1), (0.1, 0.2, 0.8, 1)
    tree.links.new(side.outputs["Backfacing"], mix.inputs[0])
    tree.links.new(front.outputs[0], mix.inputs[1])
    tree.links.new(back.outputs[0], mix.inputs[2])
    half, tree, mix = shader("front only", "MixShader")
    side, front, clear = (tree.nodes.new(f"ShaderNode{k}") for k in ("NewGeometry", "BsdfDiffuse", "BsdfTransparent"))
    front.inputs["Color"].default_value = (0.2, 0.7, 0.2, 1)
    tree.links.new(side.outputs["Backfacing"], mix.inputs[0])
    tree.links.new(front.outputs[0], mix.inputs[1])
    tree.links.new(clear.outputs[0], mix.inputs[2])
    inside = material("tree of colours", Roughness=0.6)
    tree, principled, side, blend = new_nodes(inside, "NewGeometry", "Mix")
    blend.data_type = "RGBA"
    blend.inputs[6].default_value, blend.inputs[7].default_value = (0.9, 0.6, 0.1, 1), (0.1, 0.6, 0.6, 1)
    tree.links.new(side.outputs["Backfacing"], blend.inputs[0])
    tree.links.new(blend.outputs[2], principled.inputs["Base Color"])
    for i, of in enumerate((made, half, inside)):
        for k, turn in enumerate((1.2, -1.9)):
            card = add("plane", of, (-2.2 + 2.2 * i, 1.4 - 2.4 * k, 1), f"Card {i} {k}", size=1.6)
            card.rotation_euler = (turn, 0, 0.5)
    camera()


def fresnel_behind():
    """Sheets that reflect by Fresnel and are otherwise transparent, from front and back, with total reflection at grazing
    angles behind."""
    floor()
    tree, background = world()
    gradient, place, height = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("ValToRGB", "TexCoord", "SeparateXYZ"))
    gradient.color_ramp.elements[0].color, gradient.color_ramp.elements[1].color = (0.5, 0.4, 0.3, 1), (0.4, 0.6, 1.2, 1)
    tree.links.new(place.outputs["Generated"], height.inputs[0])
    tree.links.new(height.outputs[2], gradient.inputs[0])
    tree.links.new(gradient.outputs[0], background.inputs["Color"])
    for i, kind in enumerate(("Fresnel", "LayerWeight")):
        made, tree, mix = shader(kind, "MixShader")
        weight, clear, mirror = (tree.nodes.new(f"ShaderNode{name}") for name in (kind, "BsdfTransparent", "BsdfGlossy"))
        mirror.inputs["Roughness"].default_value = 0.0
        tree.links.new(weight.outputs[0], mix.inputs[0])
        tree.links.new(clear.outputs[0], mix.inputs[1])
        tree.links.new(mirror.outputs[0], mix.inputs[2])
        for k, turn in enumerate((1.3, 1.3 + 3.14159)):
            card = add("plane", made, (-2 + 2.4 * i, 1.6 - 2.6 * k, 1), f"Card {i} {k}", size=2)
            card.rotation_euler = (turn, 0, 0.5)
    ball(material("red", Base_Color=(0.8, 0.1, 0.1, 1), Roughness=0.5), (0, 2.4, 0.8))
    camera()


def ray_tricks():
    """Light Path: glass without shadows, a light with separate camera colour, a box visible only in mirrors, one invisible
    there."""
    floor()
    lit()
    clear, tree, mix = shader("clear shadow", "MixShader")
    path, glass, nothing = (tree.nodes.new(f"ShaderNode{k}") for k in ("LightPath", "BsdfGlass", "BsdfTransparent"))
    tree.links.new(path.outputs["Is Shadow Ray"], mix.inputs[0])
    tree.links.new(glass.outputs[0], mix.inputs[1])
    tree.links.new(nothing.outputs[0], mix.inputs[2])
    ball(clear, (-1.6, -0.6, 0.8))
    lamp, tree, mix = shader("dimmed lamp", "MixShader")
    path, shines, shown = (tree.nodes.new(f"ShaderNode{k}") for k in ("LightPath", "Emission", "Emission"))
    shines.inputs["Strength"].default_value, shines.inputs["Color"].default_value = 12.0, (1, 0.6, 0.2, 1)
    shown.inputs["Color"].default_value = (0.2, 0.9, 0.4, 1)
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(shines.outputs[0], mix.inputs[1])
    tree.links.new(shown.outputs[0], mix.inputs[2])
    ball(lamp, (0.4, 1.6, 1.2), 0.4)
    glow = material("glow", Base_Color=(0, 0, 0, 1), Emission_Color=(0.3, 0.4, 1, 1))
    tree, principled, path, strength = new_nodes(glow, "LightPath", "Math")
    strength.operation, strength.inputs[1].default_value = "MULTIPLY", 6.0
    tree.links.new(path.outputs["Is Camera Ray"], strength.inputs[0])
    tree.links.new(strength.outputs[0], principled.inputs["Emission Strength"])
    ball(glow, (2.2, 1.2, 0.4), 0.4)
    ball(material("mirror", Metallic=1, Roughness=0.02), (1.2, -0.6, 0.8))
    hidden, tree, mix = shader("seen in mirrors", "MixShader")
    path, nothing, red = (tree.nodes.new(f"ShaderNode{k}") for k in ("LightPath", "BsdfTransparent", "BsdfDiffuse"))
    red.inputs["Color"].default_value = (0.8, 0.1, 0.1, 1)
    tree.links.new(path.outputs["Is Glossy Ray"], mix.inputs[0])
    tree.links.new(nothing.outputs[0], mix.inputs[1])
    tree.links.new(red.outputs[0], mix.inputs[2])
    # A little above the floor: where faces are coplanar Cycles passes both at half of the samples.
    add("cube", hidden, (2.6, -2, 0.62), "Hidden", size=1.2)
    camera()


def view_trees():
    """Glossy over diffuse by Fresnel and by Layer Weight, a colour by facing, distance fog by Camera Data."""
    floor(_by_distance())
    lit()
    glossy = "BsdfAnisotropic" if hasattr(bpy.types, "ShaderNodeBsdfAnisotropic") else "BsdfGlossy"
    for i, (weight, output) in enumerate((("Fresnel", 0), ("LayerWeight", 0), ("LayerWeight", 1))):
        for k, ground in enumerate(("BsdfDiffuse", "BsdfPrincipled")):
            made, tree, mix = shader(f"{weight} {output} {ground}", "MixShader")
            factor, under, over = (tree.nodes.new(f"ShaderNode{n}") for n in (weight, ground, glossy))
            under.inputs[0].default_value = (0.1, 0.4, 0.3, 1)
            if k:
                under.inputs["Roughness"].default_value = 0.6
            over.inputs["Color"].default_value, over.inputs["Roughness"].default_value = (1, 1, 1, 1), 0.15
            if weight == "LayerWeight":
                factor.inputs["Blend"].default_value = 0.3
            tree.links.new(factor.outputs[output], mix.inputs[0])
            tree.links.new(under.outputs[0], mix.inputs[1])
            tree.links.new(over.outputs[0], mix.inputs[2])
            ball(made, (-2.2 + 1.7 * i, 1.0 - 1.8 * k, 0.7), 0.7)
    velvet = material("velvet", Roughness=0.9, Specular_IOR_Level=0)
    tree, principled, facing = new_nodes(velvet, "LayerWeight")
    by_ramp(tree, facing.outputs["Facing"], principled)
    ball(velvet, (2.9, 0.2, 0.7), 0.7)
    camera()


def _by_distance():
    made = material("by distance", Roughness=0.9)
    tree, principled, eye, share = new_nodes(made, "CameraData", "MapRange")
    share.inputs["From Min"].default_value, share.inputs["From Max"].default_value = 6, 14
    tree.links.new(eye.outputs["View Distance"], share.inputs[0])
    by_ramp(tree, share.outputs[0], principled)
    return made


def bright_bakes():
    """Emission textures above 1 from node trees."""
    floor()
    world((0, 0, 0))
    screen = material("screen", Base_Color=(0, 0, 0, 1), Emission_Strength=1.0)
    tree, principled, checker, gain = new_nodes(screen, "TexChecker", "VectorMath")
    checker.inputs["Scale"].default_value = 4
    checker.inputs["Color1"].default_value, checker.inputs["Color2"].default_value = (1, 0.5, 0.1, 1), (0.05, 0.1, 0.4, 1)
    gain.operation = "SCALE"
    gain.inputs["Scale"].default_value = 12
    tree.links.new(checker.outputs["Color"], gain.inputs[0])
    tree.links.new(gain.outputs[0], principled.inputs["Emission Color"])
    card = add("plane", screen, (-1.4, 2, 1.2), "Screen", size=2.2)
    card.rotation_euler = (1.5, 0, 0)
    waves = material("waves", Base_Color=(0, 0, 0, 1), Emission_Color=(0.2, 0.6, 1, 1))
    tree, principled, wave, gain = new_nodes(waves, "TexWave", "Math")
    wave.inputs["Scale"].default_value = 0.6
    gain.operation, gain.inputs[1].default_value = "MULTIPLY", 9.0
    tree.links.new(wave.outputs["Fac"], gain.inputs[0])
    tree.links.new(gain.outputs[0], principled.inputs["Emission Strength"])
    card = add("plane", waves, (1.6, 2, 1.2), "Waves", size=2.2)
    card.rotation_euler = (1.5, 0, 0)
    ball(material("grey", Base_Color=(0.6, 0.6, 0.6, 1), Roughness=0.8), (0, 0, 0.6), 0.6)
    camera()


def nooks():
    """The Ambient Occlusion node as a colour."""
    made = material("worn", Roughness=0.9)
    tree, principled, nook = new_nodes(made, "AmbientOcclusion")
    nook.inputs["Distance"].default_value = 1.0
    by_ramp(tree, nook.outputs["AO"], principled)
    floor(made, 8)
    lit()
    ball(made, (-1, 0, 0.6))
    add("cube", made, (1.2, 0, 0.6), "Box", size=1.2)
    camera()
