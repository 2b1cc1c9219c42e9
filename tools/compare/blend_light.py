"""Blender scenes with lights and worlds."""

import math

import bpy
import numpy as np

from blend_parts import ball, camera, floor, light, material, picture, still_life, world


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


def _near_lamps(soft):
    """A large point light and a large spot light close to and overlapping the objects they light."""
    still_life()
    world((0, 0, 0))
    light("POINT", "Bulb", 120, (1.0, -1.2, 1.4), shadow_soft_size=0.9, use_soft_falloff=soft)
    light("SPOT", "Spot", 320, (-1.0, -1.2, 1.6), (0.3, 0, 0), spot_size=2, shadow_soft_size=0.6, use_soft_falloff=soft)
    camera()


def near_soft_lamps():
    _near_lamps(True)


def near_hard_lamps():
    _near_lamps(False)


def lamps_in_view():
    """Lights visible to the camera but not in mirrors; lights don't occlude each other."""
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


def _lamp_tree(lamp, *kinds):
    """The node tree of a light, its Emission, and new nodes."""
    lamp.data.use_nodes = True
    tree = lamp.data.node_tree
    return (tree, tree.nodes["Emission"], *(tree.nodes.new(f"ShaderNode{kind}") for kind in kinds))


def gobo():
    """A spot light that projects a texture (gobo)."""
    world((0.02, 0.02, 0.02))
    still_life()
    lamp = light("SPOT", "Gobo", 600, (0, -3, 5), (0.5, 0, 0), shadow_soft_size=0.0, spot_size=1.0, spot_blend=0.2)
    tree, emission, slide, coordinates, parts, depth, flat, mapping = _lamp_tree(
        lamp, "TexImage", "TexCoord", "SeparateXYZ", "CombineXYZ", "VectorMath", "Mapping"
    )
    across, down = np.meshgrid(np.arange(64) // 8, np.arange(64) // 8)
    cells = ((across + down) % 2)[..., None]
    slide.image = picture("slide", np.where(cells, (0.1, 0.2, 0.8), (1.0, 0.6, 0.2)).astype(np.float32))
    flat.operation, mapping.inputs["Location"].default_value = "DIVIDE", (0.5, 0.5, 0)
    tree.links.new(coordinates.outputs["Normal"], parts.inputs[0])
    for entry in depth.inputs:
        tree.links.new(parts.outputs[2], entry)
    tree.links.new(coordinates.outputs["Normal"], flat.inputs[0])
    tree.links.new(depth.outputs[0], flat.inputs[1])
    tree.links.new(flat.outputs[0], mapping.inputs[0])
    tree.links.new(mapping.outputs[0], slide.inputs[0])
    tree.links.new(slide.outputs[0], emission.inputs["Color"])
    camera()


def lamp_picture():
    """A textured area light (screen), and a disk with a ring."""
    world((0.02, 0.02, 0.02))
    still_life()
    lamp = light("AREA", "Screen", 400, (-2, -2, 3.5), (0.6, -0.5, 0), shape="RECTANGLE", size=2.5, size_y=1.5)
    tree, emission, screen, place = _lamp_tree(lamp, "TexImage", "NewGeometry")
    quarters = np.full((16, 16, 3), 0.1, np.float32)
    quarters[:8, :8, 0] = quarters[8:, :8, 1] = quarters[:8, 8:, 2] = 1
    quarters[8:, 8:] = 1
    screen.image = picture("screen", quarters)
    tree.links.new(place.outputs["Parametric"], screen.inputs[0])
    tree.links.new(screen.outputs[0], emission.inputs["Color"])
    ring = light("AREA", "Ring", 100, (3, 1, 3), (-0.3, 0.6, 0), shape="DISK", size=1.5)
    tree, emission, place, distance, bright = _lamp_tree(ring, "NewGeometry", "VectorMath", "Math")
    distance.operation, distance.inputs[1].default_value = "DISTANCE", (0.5, 0.5, 0)
    bright.operation, bright.inputs[1].default_value = "GREATER_THAN", 0.3
    tree.links.new(place.outputs["Parametric"], distance.inputs[0])
    tree.links.new(distance.outputs["Value"], bright.inputs[0])
    tree.links.new(bright.outputs[0], emission.inputs["Strength"])
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
    """A world node tree rotated about all axes, with a separate camera background."""
    still_life()
    tree, background = world()
    noise, mapping, coordinates = (tree.nodes.new(f"ShaderNode{k}") for k in ("TexNoise", "Mapping", "TexCoord"))
    noise.inputs["Scale"].default_value = 1.5
    mapping.inputs["Rotation"].default_value = (0.4, 0.5, 1.1)
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], noise.inputs["Vector"])
    tree.links.new(noise.outputs["Color"], background.inputs["Color"])
    camera(rotation=(1.4, 0, 0.7))


def world_for_the_camera():
    """An environment image with a small sun, rotated about all axes; the camera sees a constant background."""
    still_life()
    tree, background = world()
    sky, mapping, coordinates, path, mix, other = (
        tree.nodes.new(f"ShaderNode{k}") for k in ("TexEnvironment", "Mapping", "TexCoord", "LightPath", "MixShader", "Background")
    )
    sky.image = sky_picture()
    mapping.inputs["Rotation"].default_value = (0.2, 0.1, 1.3)
    other.inputs["Color"].default_value = (0.9, 0.8, 0.6, 1)
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], sky.inputs["Vector"])
    tree.links.new(sky.outputs["Color"], background.inputs["Color"])
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(background.outputs[0], mix.inputs[1])
    tree.links.new(other.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["World Output"].inputs["Surface"])
    camera()


def ray_kinds():
    """A world with separate camera rays, and lights hidden behind glass."""
    still_life()
    tree, background = world((0.2, 0.5, 0.9))
    path, mix, other = (tree.nodes.new(f"ShaderNode{k}") for k in ("LightPath", "MixShader", "Background"))
    other.inputs["Color"].default_value = (0.5, 0.45, 0.4, 1)
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(other.outputs[0], mix.inputs[1])
    tree.links.new(background.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["World Output"].inputs["Surface"])
    camera(location=(4, -5, 6), rotation=(0.8, 0, 0.7))
