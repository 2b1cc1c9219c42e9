"""Scenes of Blender as artists build them, made with `bpy`: each is a function that fills an empty scene. See blend.py."""

import math

import bpy
import numpy as np


def scene():
    return bpy.context.scene


def link(name, data, location=(0, 0, 0), rotation=(0, 0, 0), scale=(1, 1, 1), into=None):
    obj = bpy.data.objects.new(name, data)
    obj.location, obj.rotation_euler, obj.scale = location, rotation, scale
    (into or scene().collection).objects.link(obj)
    return obj


def camera(location=(6, -7, 4), rotation=(1.15, 0, 0.7), **settings):
    data = bpy.data.cameras.new("Camera")
    for key, value in settings.items():
        setattr(data, key, value)
    scene().camera = link("Camera", data, location, rotation)
    return scene().camera


def light(kind, name, energy, location=(0, 0, 0), rotation=(0, 0, 0), scale=(1, 1, 1), **settings):
    data = bpy.data.lights.new(name, kind)
    data.energy = energy
    for key, value in settings.items():
        setattr(data, key, value)
    return link(name, data, location, rotation, scale)


def world(color=(0.1, 0.1, 0.1), strength=1.0):
    made = bpy.data.worlds.new("World")
    scene().world = made
    made.use_nodes = True
    background = made.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*color, 1)
    background.inputs["Strength"].default_value = strength
    return made.node_tree, background


def material(name, **inputs):
    """A Principled material; underscores stand for spaces."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    principled = made.node_tree.nodes["Principled BSDF"]
    for key, value in inputs.items():
        principled.inputs[key.replace("_", " ")].default_value = value
    return made


def shader(name, kind, **inputs):
    """A material of one other shader node; gives the material, its tree and the node."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    node = tree.nodes.new(f"ShaderNode{kind}")
    for key, value in inputs.items():
        node.inputs[key].default_value = value
    if node.outputs:
        tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return made, tree, node


def add(kind, of, location=(0, 0, 0), name=None, smooth=False, **settings):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(location=location, **settings)
    obj = bpy.context.object
    if of is not None:
        obj.data.materials.append(of)
    if name:
        obj.name = obj.data.name = name
    if smooth:
        bpy.ops.object.shade_smooth()
    return obj


def ball(of, location, radius=0.8, name=None):
    return add("uv_sphere", of, location, name, smooth=True, radius=radius, segments=48, ring_count=24)


def floor(of=None, size=14):
    return add("plane", of or material("floor", Base_Color=(0.6, 0.6, 0.6, 1), Roughness=0.9), size=size, name="Floor")


def still_life():
    floor()
    ball(material("red", Base_Color=(0.8, 0.1, 0.1, 1), Roughness=0.5), (0, 0, 0.8))
    grey = material("grey", Base_Color=(0.5, 0.5, 0.5, 1), Roughness=0.7)
    add("cube", grey, (2, 1, 0.7), "Box", size=1.4, rotation=(0, 0, 0.5))


def picture(name, pixels):
    """A picture of rows of linear RGB, packed into the file."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, float_buffer=True)
    full = np.ones((height, width, 4), np.float32)
    full[..., :3] = pixels
    image.pixels[:] = full.ravel()
    return image


def area_lights():
    still_life()
    world((0, 0, 0))
    light("AREA", "Square", 60, (-2, -2, 3), (0.5, -0.4, 0), shape="SQUARE", size=1)
    light("AREA", "Rectangle", 60, (3, -2, 3), (0.5, 0.4, 0), shape="RECTANGLE", size=0.4, size_y=2, color=(1, 0.5, 0.2))
    light("AREA", "Disk", 60, (-2, 2, 3), (-0.5, -0.4, 0), shape="DISK", size=1, color=(0.2, 0.5, 1))
    light("AREA", "Ellipse", 60, (2, 4, 3), (-0.5, 0.4, 0.3), (2, 1, 1), shape="ELLIPSE", size=0.5, size_y=1.5)
    camera()


def area_spread():
    still_life()
    world((0.02, 0.02, 0.02))
    light("AREA", "Narrow", 100, (-2, -1, 3), (0.2, -0.4, 0), size=1, spread=math.radians(40))
    light("AREA", "Wide", 60, (3, -2, 3), (0.4, 0.6, 0), size=1, spread=math.radians(120))
    camera()


def one_spread():
    still_life()
    world((0, 0, 0))
    light("AREA", "Only", 200, (0, -1, 4), (0.2, 0, 0), size=1.5, spread=math.radians(70))
    camera()


def sun_and_world():
    still_life()
    world((0.2, 0.3, 0.5), 0.7)
    light("SUN", "Sun", 3, rotation=(0.7, 0.4, 0.2), angle=math.radians(10), color=(1, 0.9, 0.7))
    camera()


def points_and_spots():
    still_life()
    world((0, 0, 0))
    light("POINT", "Bulb", 60, (-2, -2, 2), shadow_soft_size=0.25)
    light("POINT", "Spark", 40, (2.5, -1.5, 3), shadow_soft_size=0)
    light("SPOT", "Hard", 300, (0, 3, 4), (-0.6, 0, 0), spot_size=0.8, spot_blend=0, shadow_soft_size=0.1)
    light("SPOT", "Soft", 300, (-4, 0, 4), (0, -0.8, 0), spot_size=1.2, spot_blend=1, shadow_soft_size=0.3, color=(0.3, 0.5, 1))
    camera()


def lamps_in_view():
    """The camera sees through lamps, mirrors don't; no lamp shades another."""
    floor()
    ball(material("mirror", Metallic=1, Roughness=0.05, Base_Color=(0.9, 0.9, 0.9, 1)), (0, 0, 1), 1)
    ball(material("satin", Metallic=1, Roughness=0.3, Base_Color=(0.9, 0.6, 0.3, 1)), (2.2, 0.6, 0.8))
    world((0.05, 0.05, 0.06))
    light("AREA", "Front", 80, (1.5, -2.5, 1.8), (1.2, 0, 0.3), size=1.2)
    light("AREA", "Above", 80, (0, 0, 3), size=2)
    light("POINT", "Between", 30, (0, 0, 2.6), shadow_soft_size=0.2)
    light("AREA", "Shown", 20, (-2, 0, 2), (0, -1, 0.7), size=0.8, color=(0.3, 1, 0.3)).visible_camera = True
    camera()


def lamp_settings():
    still_life()
    world((0, 0, 0))
    warm = light("AREA", "Warm", 30, (-2, -2, 3), (0.5, -0.4, 0), size=1)
    if hasattr(warm.data, "use_temperature"):
        warm.data.use_temperature, warm.data.temperature, warm.data.exposure = True, 3000, 1
    each = light("AREA", "Each square metre", 10, (2, -2, 3), (0.5, 0.4, 0), size=2)
    if hasattr(each.data, "normalize"):
        each.data.normalize = False
    nodes = light("POINT", "Nodes", 20, (0, 3, 3), shadow_soft_size=0.1)
    nodes.data.use_nodes = True
    emission = nodes.data.node_tree.nodes["Emission"]
    emission.inputs["Strength"].default_value = 3
    emission.inputs["Color"].default_value = (0.2, 1, 0.4, 1)
    camera()


def sky_picture(turn=0.0, width=64):
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(width // 2) + 0.5) / (width // 2))
    pixels = np.stack([0.2 + 0.8 * u, 0.3 + 0 * u, 0.2 + 0.8 * v], -1)
    pixels[(abs(u - 0.3) < 0.04) & (abs(v - 0.7) < 0.06)] = (30, 25, 20)
    return picture("sky", pixels.astype(np.float32))


def world_picture(folder):
    still_life()
    tree, background = world(strength=0.8)
    image = sky_picture()
    image.filepath_raw, image.file_format = f"{folder}/sky.exr", "OPEN_EXR"
    image.save()
    node, mapping, coordinates = (tree.nodes.new(f"ShaderNode{k}") for k in ("TexEnvironment", "Mapping", "TexCoord"))
    node.image = bpy.data.images.load(f"{folder}/sky.exr")
    mapping.inputs["Rotation"].default_value = (0, 0, 1.1)
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], node.inputs["Vector"])
    tree.links.new(node.outputs[0], background.inputs["Color"])
    camera(rotation=(1.4, 0, 0.7))


def world_sky():
    still_life()
    tree, background = world(strength=0.1)
    node = tree.nodes.new("ShaderNodeTexSky")
    types = [i.identifier for i in node.bl_rna.properties["sky_type"].enum_items]
    node.sky_type = "NISHITA" if "NISHITA" in types else "MULTIPLE_SCATTERING"
    node.sun_elevation, node.sun_rotation, node.sun_size = 0.6, 2.0, math.radians(3)
    tree.links.new(node.outputs[0], background.inputs["Color"])
    camera(rotation=(1.4, 0, 0.7))


def world_nodes():
    """A tree of its own, turned about all axes, and another for the camera."""
    still_life()
    tree, background = world()
    noise, mapping, coordinates = (tree.nodes.new(f"ShaderNode{k}") for k in ("TexNoise", "Mapping", "TexCoord"))
    noise.inputs["Scale"].default_value = 1.5
    mapping.inputs["Rotation"].default_value = (0.4, 0.5, 1.1)
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], noise.inputs["Vector"])
    tree.links.new(noise.outputs["Color"], background.inputs["Color"])
    camera(rotation=(1.4, 0, 0.7))


def depth_of_field():
    still_life()
    world((0.3, 0.35, 0.4))
    light("AREA", "Key", 200, (-3, -3, 5), (0.6, -0.5, 0), size=2)
    for i in range(8):
        ball(material(f"ball {i}", Base_Color=(i / 8, 0.4, 1 - i / 8, 1)), (-3 + i, 4 - i, 0.3), 0.3)
    target = link("Target", None, (0, 0, 0.8))
    made = camera(lens=60)
    made.data.dof.use_dof, made.data.dof.aperture_fstop, made.data.dof.focus_object = True, 0.3, target


def blades():
    """Lights out of focus are as the lens: five blades, turned, and narrow."""
    floor()
    world((0.05, 0.05, 0.05))
    for i in range(5):
        glow, _, _ = shader(f"glow {i}", "Emission", Strength=40, Color=(1, 0.3 + 0.15 * i, 1 - 0.2 * i, 1))
        ball(glow, (-3 + 1.6 * i, 4 - i, 0.6 + 0.4 * i), 0.06)
    ball(material("red", Base_Color=(0.8, 0.1, 0.1, 1), Roughness=0.5), (0, 0, 0.8))
    lens = camera(lens=60).data.dof
    lens.use_dof, lens.aperture_fstop, lens.focus_distance = True, 0.1, 5.0
    lens.aperture_blades, lens.aperture_rotation, lens.aperture_ratio = 5, 0.4, 1.6


def unseen():
    """Things that only mirrors and shadows know."""
    floor()
    world((0.3, 0.35, 0.4))
    light("AREA", "Key", 200, (-3, -3, 5), (0.6, -0.5, 0), size=2)
    mirror = add("plane", material("mirror", Metallic=1, Roughness=0.1), (0, 3, 1.5), "Mirror", size=4)
    mirror.rotation_euler = (1.5, 0, 0.3)
    red = material("red", Base_Color=(0.8, 0.1, 0.1, 1), Roughness=0.5)
    ball(red, (-1, 0, 0.8))
    hidden = ball(red, (1.2, 0, 0.8))
    hidden.visible_camera = False
    camera()


def ray_kinds():
    """Things that some kinds of rays don't see, lamps among them."""
    floor()
    world((0.3, 0.35, 0.4))
    light("AREA", "Key", 200, (-3, -3, 5), (0.6, -0.5, 0), size=2)
    light("AREA", "Gloss", 60, (3, -2, 3), (0.7, 0.7, 0), size=1, color=(0.3, 1, 0.3)).visible_diffuse = False
    mirror = add("plane", material("mirror", Metallic=1, Roughness=0.1), (0, 3, 1.5), "Mirror", size=4)
    mirror.rotation_euler = (1.5, 0, 0.3)
    red = material("red", Base_Color=(0.8, 0.1, 0.1, 1), Roughness=0.5)
    ball(red, (-1.6, 0, 0.8)).visible_shadow = False
    ball(red, (0, 0.4, 0.8)).visible_glossy = False
    ball(red, (1.6, 0, 0.8)).visible_diffuse = False
    camera()


def orthographic():
    still_life()
    world((0.3, 0.35, 0.4))
    light("SUN", "Sun", 2, rotation=(0.7, 0.4, 0.2), angle=0.2)
    camera(type="ORTHO", ortho_scale=6, shift_x=0.1, shift_y=0.05)


def portrait():
    """A tall picture: the sensor's width holds for the height."""
    scene().render.resolution_x, scene().render.resolution_y = 180, 240
    scene().render.resolution_percentage = 50
    still_life()
    world((0.3, 0.35, 0.4))
    light("SUN", "Sun", 2, rotation=(0.7, 0.4, 0.2), angle=0.2)
    camera(lens=28, shift_x=-0.08, shift_y=0.12)


def sensor_fit():
    still_life()
    world((0.3, 0.35, 0.4))
    light("SUN", "Sun", 2, rotation=(0.7, 0.4, 0.2), angle=0.2)
    camera(lens=40, sensor_fit="VERTICAL", sensor_height=20, shift_x=0.2, shift_y=-0.1)


def instances():
    """Collections, arrays, geometry nodes and render levels."""
    floor()
    world((0.3, 0.35, 0.4))
    light("SUN", "Sun", 3, rotation=(0.7, 0.4, 0.2), angle=0.1)
    kit = bpy.data.collections.new("Kit")
    blue, red = (material(n, Base_Color=c) for n, c in (("blue", (0.1, 0.2, 0.8, 1)), ("red", (0.8, 0.2, 0.1, 1))))
    for obj in (add("cube", blue, (0, 0, 0.3), size=0.6), add("cone", red, (0, 0, 0.9), radius1=0.4, depth=0.6)):
        scene().collection.objects.unlink(obj)
        kit.objects.link(obj)
    for i in range(4):
        placed = link(f"Kit {i}", None, (-3 + 1.2 * i, -1, 0), (0.3 * i, 0, 0.5 * i), (1, 1 + 0.3 * i, 1))
        placed.instance_type, placed.instance_collection = "COLLECTION", kit
    tower = add("cube", blue, (-2, 2, 0.25), "Tower", size=0.5)
    array = tower.modifiers.new("Array", "ARRAY")
    array.count, array.use_relative_offset = 6, True
    array.relative_offset_displace = (1.3, 0, 0.4)
    soft = add("cube", red, (2.5, -1, 0.6), "Soft", size=1.2)
    levels = soft.modifiers.new("Subdivision", "SUBSURF")
    levels.levels, levels.render_levels = 0, 3
    scatter()
    camera(location=(7, -8, 5))


def scatter():
    """Balls on the vertices of a grid, by geometry nodes."""
    grid = add("grid", None, (1, 3, 0.2), "Scatter", x_subdivisions=5, y_subdivisions=4, size=3)
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    points, sphere, paint = (
        tree.nodes.new(k) for k in ("GeometryNodeInstanceOnPoints", "GeometryNodeMeshUVSphere", "GeometryNodeSetMaterial")
    )
    sphere.inputs["Radius"].default_value = 0.2
    paint.inputs["Material"].default_value = material("green", Base_Color=(0.1, 0.6, 0.2, 1))
    tree.links.new(start.outputs[0], points.inputs["Points"])
    tree.links.new(sphere.outputs[0], paint.inputs["Geometry"])
    tree.links.new(paint.outputs[0], points.inputs["Instance"])
    tree.links.new(points.outputs[0], end.inputs[0])
    grid.modifiers.new("Scatter", "NODES").node_group = tree


def hidden_things():
    """Only what a final render shows counts: not the viewport, not excluded collections; film transparent."""
    still_life()
    world((0.4, 0.3, 0.2))
    light("POINT", "Key", 100, (-3, -3, 3), shadow_soft_size=0.2)
    grey = material("plain", Base_Color=(0.2, 0.7, 0.7, 1))
    ball(grey, (-1.5, -1, 0.5), 0.5, "Unrendered").hide_render = True
    ball(grey, (-2.2, 1, 0.5), 0.5, "Unshown").hide_viewport = True
    shut = bpy.data.collections.new("Shut")
    scene().collection.children.link(shut)
    obj = ball(grey, (1, -2, 0.5), 0.5, "Excluded")
    scene().collection.objects.unlink(obj)
    shut.objects.link(obj)
    bpy.context.view_layer.layer_collection.children["Shut"].exclude = True
    scene().render.film_transparent = True
    camera()


def other_objects():
    """Text, curves and metaballs; a material on the object; an object without a material."""
    floor()
    world((0.3, 0.35, 0.4))
    light("SUN", "Sun", 3, rotation=(0.7, 0.4, 0.2), angle=0.1)
    gold = material("gold", Base_Color=(0.9, 0.6, 0.2, 1), Roughness=0.4)
    text = bpy.data.curves.new("Text", "FONT")
    text.body, text.extrude, text.size = "oscura", 0.1, 1.4
    text.materials.append(gold)
    link("Text", text, (-2, -2, 0.1), (1.2, 0, 0.5))
    bpy.ops.curve.primitive_bezier_circle_add(location=(2, 1, 0.8), radius=0.8)
    ring = bpy.context.object
    ring.data.bevel_depth, ring.data.bevel_resolution = 0.25, 6
    ring.data.materials.append(material("blue", Base_Color=(0.1, 0.2, 0.8, 1)))
    balls = bpy.data.metaballs.new("Meta")
    for x in (0, 0.7):
        balls.elements.new().co = (x, 0, 0)
    balls.elements[0].radius = balls.elements[1].radius = 1
    balls.render_resolution = 0.1
    link("Meta", balls, (-1.5, 2, 0.6))
    bare = add("cube", None, (0.6, -0.5, 0.4), "Bare", size=0.8)
    twin = link("Twin", bare.data, (3.2, -1.5, 0.4))
    bare.data.materials.append(None)
    twin.material_slots[0].link = "OBJECT"
    twin.material_slots[0].material = gold
    camera()


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
    """Diffuse under a gloss, mixed by Fresnel."""
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
    """Half transparent."""
    made, tree, mix = shader("veil", "MixShader")
    clear, cloth = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeBsdfDiffuse")
    cloth.inputs["Color"].default_value = (0.8, 0.3, 0.2, 1)
    mix.inputs[0].default_value = 0.6
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(cloth.outputs[0], mix.inputs[2])
    return made


def principled():
    """Inputs of the Principled shader that glTF's exporter leaves out or alters."""
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
    """Node trees that no picture holds."""
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
    """Pictures on base colour, roughness and normals."""
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
    """An armature, shape keys and a camera on a path, in the middle of their motion."""
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
    """Shaders in node groups, with inputs from outside and pictures that are changed on the way."""
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
    """Cards cut out by a picture's alpha, bumps, and particles."""
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


def ray_kinds():
    """A world that the camera sees otherwise, and black lamps behind glass."""
    still_life()
    tree, background = world((0.2, 0.5, 0.9))
    path, mix, other = (tree.nodes.new(f"ShaderNode{k}") for k in ("LightPath", "MixShader", "Background"))
    other.inputs["Color"].default_value = (0.5, 0.45, 0.4, 1)
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(other.outputs[0], mix.inputs[1])
    tree.links.new(background.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["World Output"].inputs["Surface"])
    camera(location=(4, -5, 6), rotation=(0.8, 0, 0.7))


SCENES = [
    area_lights, area_spread, one_spread, sun_and_world, points_and_spots, lamps_in_view, lamp_settings, world_picture,
    world_sky, world_nodes, depth_of_field, blades, unseen, ray_kinds, orthographic, portrait, sensor_fit, instances, hidden_things, other_objects,
    glass, shaders, principled, procedural, textured, posed,
    groups, leaves, ray_kinds,
]  # fmt: skip
