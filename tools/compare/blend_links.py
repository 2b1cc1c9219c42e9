"""Blender scenes with light linking and shadow linking."""

import bpy
from blend_parts import add, ball, camera, floor, light, link, material, scene, world


def linked(name, include=(), exclude=()):
    """A linking collection of objects or collections, outside the scene."""
    made = bpy.data.collections.new(name)
    for states, members in (("INCLUDE", include), ("EXCLUDE", exclude)):
        for member in members:
            if isinstance(member, bpy.types.Collection):
                made.children.link(member)
                made.collection_children[-1].light_linking.link_state = states
            else:
                made.objects.link(member)
                made.collection_objects[-1].light_linking.link_state = states
    return made


def row():
    """A floor with plastic, metal and clay spheres."""
    ground = floor(material("floor", Base_Color=(0.6, 0.6, 0.6, 1), Roughness=0.5))
    plastic = material("plastic", Base_Color=(0.7, 0.2, 0.1, 1), Roughness=0.2)
    metal = material("metal", Base_Color=(0.8, 0.7, 0.5, 1), Roughness=0.3, Metallic=1.0)
    clay = material("clay", Base_Color=(0.4, 0.4, 0.6, 1), Roughness=1.0)
    balls = [ball(of, (x, 0, 0.8), name=name) for of, x, name in ((plastic, -2, "Left"), (metal, 0, "Middle"), (clay, 2, "Right"))]
    world((0.05, 0.06, 0.08))
    camera(location=(3, -8, 4), rotation=(1.15, 0, 0.35))
    return ground, balls


def light_links():
    """An area light linked to one sphere, a sun to all but two, a point light to a collection, an emissive board to the
    floor."""
    ground, (left, middle, right) = row()
    mirror = material("mirror", Base_Color=(0.9, 0.9, 0.9, 1), Roughness=0.0, Metallic=1.0)
    wall = add("plane", mirror, (0, 2.5, 1.5), "Mirror", size=5, rotation=(1.5708, 0, 0))
    key = light("AREA", "Key", 300, (-2, -3, 4), (0.6, 0, -0.2), size=1.0)
    key.light_linking.receiver_collection = linked("for the left", [left])
    sun = light("SUN", "Sun", 2.0, rotation=(0.6, 0.5, 0), angle=0.1)
    sun.light_linking.receiver_collection = linked("not those", (), [middle, wall])
    group = bpy.data.collections.new("Group")
    scene().collection.children.link(group)
    for obj in (middle, right):
        scene().collection.objects.unlink(obj)
        group.objects.link(obj)
    point = light("POINT", "Point", 200, (2, -2.5, 3), shadow_soft_size=0.3)
    point.light_linking.receiver_collection = linked("a group", [group], [right])
    glow = material("glow", Base_Color=(0, 0, 0, 1), Emission_Color=(0.2, 0.9, 0.4, 1), Emission_Strength=4.0)
    board = add("plane", glow, (3.5, -1, 1), "Board", size=1.2, rotation=(0, -1.2, 0))
    board.light_linking.receiver_collection = linked("for the floor", [ground])


def shadow_links():
    """Lights with excluded or exclusive shadow casters."""
    ground, (left, middle, right) = row()
    key = light("AREA", "Key", 300, (-3, -3, 4), (0.7, 0, -0.6), size=0.6)
    key.light_linking.blocker_collection = linked("no ball in the middle", (), [middle])
    sun = light("SUN", "Sun", 2.0, rotation=(0.9, 0.3, 0.5), angle=0.05)
    sun.light_linking.blocker_collection = linked("the right one only", [right])
    spot = light("SPOT", "Spot", 400, (2, -4, 4), (0.8, 0, 0.4), shadow_soft_size=0.1, spot_size=1.2)
    spot.light_linking.blocker_collection = linked("left and floor", [left, ground])
    spot.light_linking.receiver_collection = linked("floor and left", [left, ground])


def linked_instances():
    """Instances of a collection, one of whose instancers is linked."""
    floor()
    clay = material("clay", Base_Color=(0.7, 0.5, 0.3, 1), Roughness=0.6)
    kept = bpy.data.collections.new("Kept")
    scene().collection.children.link(kept)
    for number in range(2):
        obj = ball(clay, (1.2 * number, 0, 0.5), radius=0.5, name=f"Ball {number}")
        scene().collection.objects.unlink(obj)
        kept.objects.link(obj)
    bpy.context.view_layer.layer_collection.children["Kept"].exclude = True
    makers = []
    for number in range(3):
        maker = link(f"Maker {number}", None, (3 * number - 4, 0, 0))
        maker.instance_type, maker.instance_collection = "COLLECTION", kept
        makers.append(maker)
    rim = light("AREA", "Rim", 400, (0, -3, 4), (0.6, 0, 0), size=2.0)
    rim.light_linking.receiver_collection = linked("one maker", [makers[1]])
    sun = light("SUN", "Sun", 1.0, rotation=(0.4, 0.5, 0), angle=0.1)
    sun.light_linking.blocker_collection = linked("another maker", [makers[0]])
    world((0.1, 0.1, 0.1))
    camera()


def shadowless():
    """A light of each type without shadows, and one with shadows."""
    row()
    light("AREA", "Key", 200, (-3, -3, 4), (0.7, 0, -0.6), size=0.8, use_shadow=False)
    light("SUN", "Sun", 1.0, rotation=(0.9, 0.3, 0.5), angle=0.05, use_shadow=False)
    light("POINT", "Point", 100, (2, -2, 3), shadow_soft_size=0.2, use_shadow=False)
    light("SPOT", "Spot", 300, (3, -4, 4), (0.8, 0, 0.6), shadow_soft_size=0.1, spot_size=1.0)
