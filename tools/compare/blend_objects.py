"""Blender scenes with camera settings, objects, and ray visibility."""

import bpy

from blend_parts import add, ball, camera, floor, light, link, material, scene, shader, still_life, world


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
    """Bokeh: five blades, rotated, and anamorphic."""
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
    """Objects visible to mirrors and shadows only."""
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


def visibility():
    """Ray visibility of objects and lights."""
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


def world_unseen():
    """A world hidden from glossy and transmission rays, and objects visible to some rays only."""
    floor()
    world((0.3, 0.35, 0.4))
    scene().world.cycles_visibility.glossy = scene().world.cycles_visibility.transmission = False
    light("AREA", "Key", 120, (-3, -3, 5), (0.6, -0.5, 0), size=2)
    ball(material("steel", Metallic=1, Roughness=0.15), (-1.6, 0, 0.8))
    ball(material("glass", Transmission_Weight=1, Roughness=0.0, IOR=1.45), (0, 0.4, 0.8))
    plain = material("plain", Base_Color=(0.2, 0.5, 0.7, 1), Roughness=0.4)
    ball(plain, (1.6, 0, 0.8)).visible_shadow = False
    ball(plain, (0.4, -1.6, 0.5), 0.5).visible_diffuse = False
    camera()


def orthographic():
    still_life()
    world((0.3, 0.35, 0.4))
    light("SUN", "Sun", 2, rotation=(0.7, 0.4, 0.2), angle=0.2)
    camera(type="ORTHO", ortho_scale=6, shift_x=0.1, shift_y=0.05)


def portrait():
    """A portrait picture: the sensor width applies to the height."""
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
    """Spheres on the vertices of a grid, by geometry nodes."""
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
    """Render visibility: viewport settings and excluded collections are ignored; film transparent."""
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
    """Text, curves and metaballs; a material linked to the object; an object without material."""
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
