"""Blender scenes with volumes, subsurface scattering, translucency, coats, metal edge tints, displacement and bumps."""


from blend_parts import add, ball, camera, floor, light, material, shader, world


def _lit():
    world((0.3, 0.35, 0.4))
    light("AREA", "Key", 250, (-3, -4, 5), (0.6, -0.5, 0), size=2)


def translucent():
    """Backlit cards of leaves and paper, a rough wall, and a coloured pane."""
    floor()
    world((0.2, 0.22, 0.25))
    light("AREA", "Behind", 300, (0, 4, 2.5), (-1.3, 0, 3.14159), size=2)
    paper, _, _ = shader("paper", "BsdfTranslucent", Color=(0.8, 0.7, 0.5, 1))
    leaf, tree, mix = shader("leaf", "MixShader")
    up, through = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeBsdfTranslucent")
    up.inputs["Color"].default_value, through.inputs["Color"].default_value = (0.1, 0.4, 0.1, 1), (0.5, 0.7, 0.1, 1)
    mix.inputs[0].default_value = 0.4
    tree.links.new(up.outputs[0], mix.inputs[1])
    tree.links.new(through.outputs[0], mix.inputs[2])
    pane, _, _ = shader("pane", "BsdfTransparent", Color=(0.9, 0.3, 0.2, 1))
    rough, _, _ = shader("rough", "BsdfDiffuse", Color=(0.7, 0.6, 0.5, 1), Roughness=1.0)
    for i, of in enumerate((paper, leaf, pane)):
        card = add("plane", of, (-2.2 + 2.2 * i, 1.0, 1), f"Card {i}", size=1.7)
        card.rotation_euler = (1.5, 0, 0.3)
    ball(rough, (0.6, -1.6, 0.6), 0.6)
    camera()


def media_in_solids():
    """A box of fog, coloured water in glass, emissive smoke."""
    floor()
    _lit()
    haze, tree, node = shader("haze", "VolumeScatter", Color=(0.8, 0.9, 1.0, 1), Density=0.8)
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
    tree.links.remove(tree.nodes["Material Output"].inputs["Surface"].links[0])
    add("cube", haze, (-2, 0.8, 0.8), "Haze", size=1.5)
    glowing, tree, node = shader("glowing", "VolumePrincipled", Density=1.5)
    node.inputs["Color"].default_value = (0.3, 0.3, 0.3, 1)
    node.inputs["Emission Strength"].default_value, node.inputs["Emission Color"].default_value = 0.6, (1, 0.4, 0.1, 1)
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
    tree.links.remove(tree.nodes["Material Output"].inputs["Surface"].links[0])
    ball(glowing, (0.6, 1.2, 0.8), 0.7)
    milk = material("milk", Transmission_Weight=1, Roughness=0, IOR=1.33, Base_Color=(1, 1, 1, 1))
    scatter = milk.node_tree.nodes.new("ShaderNodeVolumeScatter")
    scatter.inputs["Color"].default_value, scatter.inputs["Density"].default_value = (0.9, 0.8, 0.6, 1), 2.0
    milk.node_tree.links.new(scatter.outputs[0], milk.node_tree.nodes["Material Output"].inputs["Volume"])
    ball(milk, (1.2, -1.4, 0.7), 0.7)
    camera()


def foggy():
    """A room filled with scattering air."""
    floor()
    tree, _ = world((0, 0, 0))
    air = tree.nodes.new("ShaderNodeVolumeScatter")
    air.inputs["Density"].default_value, air.inputs["Color"].default_value = 0.05, (0.9, 0.9, 1, 1)
    tree.links.new(air.outputs[0], tree.nodes["World Output"].inputs["Volume"])
    light("AREA", "Key", 800, (-2, -2, 4), (0.4, -0.4, 0), size=1)
    ball(material("red", Base_Color=(0.8, 0.1, 0.1, 1)), (0, 0, 0.8))
    camera()


def waxen():
    """Subsurface scattering by both nodes."""
    floor()
    _lit()
    skin = material(
        "skin", Base_Color=(0.8, 0.5, 0.4, 1), Subsurface_Weight=1.0, Subsurface_Radius=(1.0, 0.4, 0.2), Subsurface_Scale=0.3
    )
    ball(skin, (-1.2, 0, 0.9), 0.9)
    wax, _, node = shader("wax", "SubsurfaceScattering", Color=(0.9, 0.85, 0.6, 1), Scale=0.5)
    node.inputs["Radius"].default_value = (1, 0.8, 0.5)
    ball(wax, (1.2, -0.4, 0.8), 0.8)
    camera()


def tinted_layers():
    """A tinted coat, metals with edge tint, rough clay."""
    floor()
    _lit()
    rows = [
        material("stain", Base_Color=(0.7, 0.6, 0.4, 1), Roughness=0.6, Coat_Weight=1, Coat_Roughness=0.1, Coat_Tint=(0.8, 0.3, 0.1, 1)),
        material("edged", Metallic=1, Roughness=0.3, Base_Color=(0.9, 0.7, 0.4, 1), Specular_Tint=(0.9, 0.3, 0.3, 1)),
        material("clay", Base_Color=(0.7, 0.4, 0.3, 1), Diffuse_Roughness=1.0, Specular_IOR_Level=0.0, Roughness=1.0),
        material("film", Base_Color=(0.05, 0.05, 0.05, 1), Roughness=0.1, Thin_Film_Thickness=400.0, Thin_Film_IOR=1.6),
    ]
    for i, made in enumerate(rows):
        ball(made, (-2.4 + 1.6 * i, 0.9 - 0.8 * i, 0.7), 0.7)
    camera()


def reliefs():
    """Vertex displacement, and the same as bump mapping."""
    floor()
    _lit()
    for i, method in enumerate(("DISPLACEMENT", "BUMP")):
        made = material(method, Base_Color=(0.6, 0.5, 0.3, 1), Roughness=0.8)
        made.displacement_method = method
        tree = made.node_tree
        noise, relief = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeDisplacement")
        noise.inputs["Scale"].default_value = 2.5
        relief.inputs["Scale"].default_value = 0.5
        tree.links.new(noise.outputs[0], relief.inputs["Height"])
        tree.links.new(relief.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
        stone = add("ico_sphere", made, (-1.2 + 2.4 * i, 0, 0.9), method, True, radius=0.9, subdivisions=6)
        stone.rotation_euler = (0, 0, 0.4 * i)
    camera()


def vector_reliefs():
    """Vector displacement in each space, and by a vector without a displacement node."""
    floor()
    _lit()
    for i, space in enumerate(("OBJECT", "WORLD", "TANGENT", None)):
        made = material(f"moved {space}", Base_Color=(0.3, 0.5, 0.6, 1), Roughness=0.6)
        made.displacement_method = "DISPLACEMENT"
        tree = made.node_tree
        place, noise = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeTexNoise")
        noise.inputs["Scale"].default_value = 2.0
        moved = tree.nodes.new("ShaderNodeVectorDisplacement" if space else "ShaderNodeVectorMath")
        if space:
            moved.space, moved.inputs["Midlevel"].default_value = space, 0.5
        else:
            moved.operation, moved.inputs[1].default_value = "SUBTRACT", (0.5, 0.5, 0.5)
        tree.links.new(place.outputs["Object"], noise.inputs["Vector"])
        tree.links.new(noise.outputs["Color"], moved.inputs[0])
        tree.links.new(moved.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
        ball = add("uv_sphere", made, (-2.1 + 1.4 * i, 0, 0.8), made.name, True, radius=0.5, segments=64, ring_count=32)
        ball.scale, ball.rotation_euler = (1, 1, 1.4), (0, 0.4, 0.5)
    camera()
