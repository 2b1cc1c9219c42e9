"""Blender scenes with further features: UDIM tiles, mirrored objects, newer shaders, procedural textures, shadow catchers, IES
profiles, libraries."""

import math

import bpy
import numpy as np
from blend_parts import add, ball, camera, floor, light, link, lit, material, new_nodes, picture, scene, shader, world


def _checked(colors, side=8, cells=4):
    """A checker image of two colours."""
    y, x = np.mgrid[0:side, 0:side] * cells // side
    return np.where(((x + y) % 2 == 0)[..., None], *(np.array(color) for color in colors))


def _image(made, image, **settings):
    tree, principled, node = new_nodes(made, "TexImage")
    node.image = image
    for key, value in settings.items():
        setattr(node, key, value)
    tree.links.new(node.outputs["Color"], principled.inputs["Base Color"])
    return tree, node


def udims(folder):
    """An image of two UDIM tiles, a second UV map, clipped images, box projection."""
    lit()
    camera()
    floor()
    for tile, colors in ((1001, ((0.8, 0.1, 0.1), (0.1, 0.1, 0.1))), (1002, ((0.1, 0.6, 0.2), (0.9, 0.9, 0.9)))):
        made = picture(f"tile{tile}", _checked(colors, 64))
        made.filepath_raw, made.file_format = str(folder / f"udims.{tile}.exr"), "OPEN_EXR"
        made.save()
    tiled = bpy.data.images.load(str(folder / "udims.1001.exr"))
    tiled.source = "TILED"
    tiled.filepath = str(folder / "udims.<UDIM>.exr")
    if len(tiled.tiles) < 2:
        tiled.tiles.new(1002)
    wide = add("plane", None, (-1.5, 0, 0.01), "Wide", size=2)
    for loop in wide.data.uv_layers[0].data:
        loop.uv[0] *= 2
    wide.data.materials.append(material("tiled", Roughness=0.8))
    _image(wide.data.materials[0], tiled)

    second = add("plane", None, (1.2, -0.5, 0.01), "Second", size=2)
    other = second.data.uv_layers.new(name="Other")
    for loop in other.data:
        loop.uv = (0.5 * loop.uv[0], 0.5 * loop.uv[1])
    made = material("second", Roughness=0.8)
    tree, node = _image(made, picture("cells", _checked(((0.1, 0.2, 0.8), (0.9, 0.7, 0.1)), 64)))
    chosen = tree.nodes.new("ShaderNodeUVMap")
    chosen.uv_map = "Other"
    tree.links.new(chosen.outputs[0], node.inputs[0])
    second.data.materials.append(made)

    for k, (extension, projection) in enumerate((("CLIP", "FLAT"), ("EXTEND", "FLAT"), ("REPEAT", "BOX"))):
        made = material(extension, Roughness=0.8)
        cells = picture(f"cells {extension}", _checked(((0.7, 0.2, 0.5), (0.2, 0.7, 0.6)), 64))
        tree, node = _image(made, cells, extension=extension, projection=projection)
        node.projection_blend = 0.3
        coordinates, mapping = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
        mapping.inputs["Scale"].default_value = (2, 2, 2)
        mapping.inputs["Location"].default_value = (-0.5, -0.5, 0)
        tree.links.new(coordinates.outputs["UV" if projection == "FLAT" else "Object"], mapping.inputs[0])
        tree.links.new(mapping.outputs[0], node.inputs[0])
        add("cube", made, (-2 + 2 * k, 2.5, 0.7), f"Box {k}", size=1.4, rotation=(0, 0, 0.4))


def near_and_far():
    """Clipping distances, and non-square pixels."""
    lit()
    scene().render.pixel_aspect_x = 1.5
    camera(clip_start=6.0, clip_end=11.0)
    floor()
    grey = material("grey", Base_Color=(0.5, 0.4, 0.3, 1))
    for k in range(6):
        ball(grey, (3.2 - 1.6 * k, -4 + 2 * k, 0.6), 0.6, f"Ball {k}")


def newer_shaders():
    """Metallic, Sheen, Toon, Refraction, mixed shaders."""
    lit()
    camera()
    floor()
    kinds = [
        ("BsdfMetallic", {"Base Color": (0.8, 0.6, 0.2, 1), "Roughness": 0.3}),
        ("BsdfSheen", {"Color": (0.8, 0.3, 0.6, 1), "Roughness": 0.4}),
        ("BsdfToon", {"Color": (0.2, 0.5, 0.8, 1), "Size": 0.7}),
        ("BsdfRefraction", {"Color": (0.9, 0.95, 1, 1), "IOR": 1.3, "Roughness": 0.2}),
        ("BsdfTranslucent", {"Color": (0.3, 0.8, 0.3, 1)}),
    ]
    for k, (kind, inputs) in enumerate(kinds):
        try:
            made = shader(kind, kind, **inputs)[0]
        except RuntimeError:
            made = material(kind)
        ball(made, (3 - 1.5 * k, -1.5 + 1.2 * k, 0.7), 0.7, kind)


def patterns():
    """Blender's procedural textures, attributes, and math nodes between them."""
    lit()
    camera()
    floor()
    kinds = ("Voronoi", "Wave", "Magic", "Brick", "Checker", "WhiteNoise")
    for k, kind in enumerate(kinds):
        made = material(kind, Roughness=0.7)
        tree, principled, node, ramp = new_nodes(made, f"Tex{kind}", "ValToRGB")
        ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (0.8, 0.1, 0.05, 1), (0.05, 0.3, 0.8, 1)
        coordinates = tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(coordinates.outputs["Object"], node.inputs["Vector"])
        if kind == "WhiteNoise":
            snapped = tree.nodes.new("ShaderNodeVectorMath")
            snapped.operation = "SNAP"
            snapped.inputs[1].default_value = (0.4, 0.4, 0.4)
            tree.links.new(coordinates.outputs["Object"], snapped.inputs[0])
            tree.links.new(snapped.outputs[0], node.inputs["Vector"])
        output = next(o for o in node.outputs if o.name in ("Fac", "Distance", "Value", "Factor", "Color") and o.enabled)
        tree.links.new(output, ramp.inputs[0])
        tree.links.new(ramp.outputs[0], principled.inputs["Base Color"])
        add("cube", made, (-2.4 + 2.4 * (k % 3), -1.5 + 2.8 * (k // 3), 0.6), kind, size=1.2, rotation=(0, 0, 0.3))
    made = material("painted", Roughness=0.6)
    tree, principled, node = new_nodes(made, "VertexColor")
    node.layer_name = "Paint"
    tree.links.new(node.outputs[0], principled.inputs["Base Color"])
    painted = ball(made, (3, 2.5, 0.8), 0.8, "Painted")
    colors = painted.data.color_attributes.new("Paint", "FLOAT_COLOR", "POINT")
    for vertex, color in zip(painted.data.vertices, colors.data):
        x, y, z = vertex.co
        color.color = (0.5 + 0.5 * math.sin(3 * x), 0.5 + 0.5 * math.cos(3 * y), 0.5 + 0.5 * z, 1)


def mirrored():
    """Negative scales, smooth by angle, solidify, bevels, parents with scales, missing materials."""
    lit()
    camera()
    floor()
    letter = bpy.data.curves.new("F", "FONT")
    letter.body, letter.extrude, letter.size = "F", 0.1, 2.0
    made = material("letter", Base_Color=(0.7, 0.2, 0.1, 1), Metallic=0.6, Roughness=0.3)
    letter.materials.append(made)
    link("F", letter, (-2.5, 0, 0.1), (1.2, 0, 0.3))
    link("F mirrored", letter, (-0.6, 1, 0.1), (1.2, 0, 0.3), (-1, 1, 1))
    parent = link("Parent", None, (1, 0, 0.5), (0, 0, 0.6), (1, -1.5, 0.7))
    child = add("cylinder", material("child", Base_Color=(0.2, 0.6, 0.3, 1), Roughness=0.3), name="Child", radius=0.6, depth=1.2, vertices=24)
    child.parent = parent
    child.rotation_euler = (0.5, 0.3, 0)
    with bpy.context.temp_override(object=child, active_object=child, selected_objects=[child], selected_editable_objects=[child]):
        bpy.ops.object.shade_smooth_by_angle(angle=0.6)
    shell = add("uv_sphere", material("shell", Base_Color=(0.8, 0.7, 0.2, 1)), (2.8, -1, 0.6), "Shell", radius=0.7, segments=24, ring_count=12)
    solid = shell.modifiers.new("Solidify", "SOLIDIFY")
    solid.thickness = 0.1
    soft = add("cube", material("soft", Base_Color=(0.3, 0.4, 0.8, 1), Roughness=0.4), (2, 2.5, 0.7), "Soft", size=1.3)
    bevel = soft.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.segments = 0.15, 3
    soft.modifiers.new("Weighted", "WEIGHTED_NORMAL")
    add("ico_sphere", None, (-2, 3, 0.6), "Bare", radius=0.6)
    lost = material("lost", Roughness=0.7)
    image = bpy.data.images.new("lost", 4, 4)
    image.source, image.filepath = "FILE", "//nowhere/lost.png"
    _image(lost, image)
    add("cube", lost, (-3.4, -1.4, 0.4), "Lost", size=0.8)


def catchers():
    """A sphere on a shadow catcher, and a holdout, with a transparent film."""
    lit()
    camera()
    ground = floor()
    ground.is_shadow_catcher = True
    scene().render.film_transparent = True
    ball(material("red", Base_Color=(0.8, 0.2, 0.1, 1)), (0, 0, 0.8))
    hole = add("cube", material("hole"), (2, 1, 0.7), "Hole", size=1.4)
    hole.is_holdout = True
    light("SUN", "Sun", 2, rotation=(0.6, 0.3, 0), angle=0.05)


def _profile(folder):
    """An IES file, bright below and to one side."""
    path = folder / "profile.ies"
    polar, around = range(0, 91, 10), range(0, 361, 30)
    rows = (
        " ".join(f"{1000 * math.cos(math.radians(a)) ** 4 * (1 + 0.8 * math.sin(math.radians(h))):.1f}" for a in polar)
        for h in around
    )
    head = f"IESNA:LM-63-2002\n[TEST] made\nTILT=NONE\n1 1000 1 {len(polar)} {len(around)} 1 2 0 0 0\n1 1 10\n"
    lines = " ".join(map(str, polar)), " ".join(map(str, around)), *rows
    path.write_text(head + "\n".join(lines) + "\n")
    return path


def _profiled(path, *of, **settings):
    """A light with an IES file."""
    lamp = light(*of, **settings)
    lamp.data.use_nodes = True
    tree = lamp.data.node_tree
    node = tree.nodes.new("ShaderNodeTexIES")
    node.mode, node.filepath = "EXTERNAL", str(path)
    tree.links.new(node.outputs[0], tree.nodes["Emission"].inputs["Strength"])


def profiles(folder):
    """Lights with IES profiles, images and Blackbody nodes."""
    floor()
    camera()
    world((0.02, 0.02, 0.02))
    add("plane", material("wall", Base_Color=(0.7, 0.7, 0.7, 1)), (0, 3, 2.5), "Wall", size=10, rotation=(math.pi / 2, 0, 0))
    path = _profile(folder)
    for kind, at, turn in (("POINT", (-2, 1.5, 3), (0.3, 0.1, 0.5)), ("SPOT", (0.5, -1, 3), (0.2, -0.1, 2.0))):
        _profiled(path, kind, f"Profiled {kind}", 0.15, at, turn, shadow_soft_size=0.0)
    warm = light("POINT", "Warm", 30, (2, 1, 2), shadow_soft_size=0.1)
    warm.data.use_nodes = True
    tree = warm.data.node_tree
    body = tree.nodes.new("ShaderNodeBlackbody")
    body.inputs[0].default_value = 2700
    tree.links.new(body.outputs[0], tree.nodes["Emission"].inputs["Color"])


def soft_profiles(folder):
    """Lights with IES profiles and a radius, above objects in their light."""
    floor()
    camera()
    world((0.02, 0.02, 0.02))
    path = _profile(folder)
    _profiled(path, "POINT", "Ball", 0.25, (-1.8, 0.5, 3), (0.3, 0.1, 0.5), shadow_soft_size=0.3, use_soft_falloff=False)
    _profiled(path, "POINT", "Disk", 0.2, (2.2, 1.5, 2.6), (-0.2, 0.1, 1.5), shadow_soft_size=0.25)
    _profiled(path, "SPOT", "Cone", 0.2, (0.5, -1.8, 3), (0.2, -0.1, 2.0), shadow_soft_size=0.2, spot_size=1.2)
    for k in range(5):
        post = material("post", Base_Color=(0.5, 0.5, 0.5, 1), Roughness=0.8)
        add("cube", post, (-2.4 + 1.2 * k, 0.4 * (k % 2) - 0.4, 0.6), f"Post {k}", size=1, scale=(0.25, 0.25, 1.2))


def libraries(folder):
    """A collection linked from another file, instanced twice, one of them moved."""
    lit()
    camera()
    floor()
    kept = bpy.data.collections.new("Kept")
    scene().collection.children.link(kept)
    one = ball(material("linked", Base_Color=(0.1, 0.5, 0.7, 1), Roughness=0.3), (0, 0, 0.8))
    two = add("cube", material("boxed", Base_Color=(0.7, 0.5, 0.1, 1)), (1.2, 0, 0.4), "Linked box", size=0.8)
    for obj in (one, two):
        scene().collection.objects.unlink(obj)
        kept.objects.link(obj)
    bpy.data.libraries.write(str(folder / "library.blend"), {kept})
    for obj in (one, two):
        bpy.data.objects.remove(obj)
    bpy.data.collections.remove(kept)
    with bpy.data.libraries.load(str(folder / "library.blend"), link=True) as (_, into):
        into.collections = ["Kept"]
    for k in range(2):
        made = link(f"Instance {k}", None, (-2 + 3 * k, k, 0), (0, 0, 0.5 * k), (1, 1, 1 + 0.5 * k))
        made.instance_type, made.instance_collection = "COLLECTION", into.collections[0]


def strands():
    """Hair particles with children, and hair curves."""
    lit()
    camera()
    floor()
    scene().cycles_curves.shape = "THICK"
    fur, _, fibre = shader("fur", "BsdfHairPrincipled", Roughness=0.3)
    fibre.parametrization = "MELANIN"
    fibre.inputs["Melanin"].default_value = 0.4
    for k, (children, of) in enumerate((("NONE", fur), ("SIMPLE", material("wool", Base_Color=(0.7, 0.25, 0.1, 1), Roughness=0.8)))):
        body = add("uv_sphere", material(f"skin {k}", Base_Color=(0.5, 0.4, 0.35, 1)), (-1.2 + 2.6 * k, 0.3 * k, 1), f"Body {k}", radius=0.7)
        body.scale = (1, 1, 0.8)
        body.data.materials.append(of)
        system = body.modifiers.new("Fur", "PARTICLE_SYSTEM").particle_system
        settings = system.settings
        settings.type, settings.count, settings.hair_length, settings.hair_step = "HAIR", 600, 0.35, 4
        settings.material, settings.render_step, settings.child_type = 2, 3, children
        settings.root_radius, settings.tip_radius, settings.radius_scale = 1.0, 0.2, 0.02
        settings.brownian_factor = 0.05
        settings.rendered_child_count, settings.child_percent = 5, 2
    made = bpy.data.hair_curves.new("Curves")
    made.add_curves([6] * 200)
    dice = np.random.default_rng(3)
    roots = np.concatenate([dice.uniform(-0.5, 0.5, (200, 2)), np.zeros((200, 1))], axis=1)
    along = np.linspace(0, 1, 6)[None, :, None]
    bent = np.concatenate([0.3 * along**2, 0.1 * np.sin(5 * along), along], axis=2)
    points = roots[:, None] + bent * dice.uniform(0.7, 1.2, (200, 1, 1))
    made.position_data.foreach_set("vector", points.astype(np.float32).ravel())
    radius = made.attributes.get("radius") or made.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.tile(np.linspace(0.02, 0.004, 6), 200).astype(np.float32))
    made.materials.append(shader("reed", "BsdfDiffuse", Color=(0.3, 0.6, 0.2, 1))[0])
    link("Reed", made, (-3, 2, 0), (0, 0, 0.5), (1, 1, 1.3))
