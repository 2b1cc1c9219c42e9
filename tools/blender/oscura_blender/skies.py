"""Sky nodes: Cycles renders the sky to a picture, without its sun, which is a light of its own."""

import math
import os

import bpy
import numpy as np
from mathutils import Vector

from . import cache, fingerprint, stills

# Width of the picture of a sky.
WIDTH = 2048

# Pixels along the edge of pictures of the sun, and their width in diameters of it.
EDGE, AROUND = 128, 1.5

# Suns are lights as long as they are smaller, radians.
LARGEST = math.radians(10)


def has_sun(node):
    """Does a sky node show the disk of the sun?"""
    return node.sky_type not in ("PREETHAM", "HOSEK_WILKIE") and node.sun_disc


def file(node, target, number):
    """Writes the picture of a sky node without its sun, from the cache if it is there; gives the file's name."""
    name = f"{target.name}.sky{number}.exr"
    path = os.path.join(target.folder, name)

    def make():
        with _alone(node) as scene:
            stills.look_around(scene)
            stills.prepare(scene, (WIDTH, WIDTH // 2), 1)
            scene.render.filepath = path
            bpy.ops.render.render(write_still=True, scene=scene.name)
        return np.fromfile(path, np.uint8)

    key = cache.digest()
    key.update(repr(("sky", WIDTH, _settings(node))).encode())
    target.store.kept(key, make).tofile(path)
    return name


def sun(world, node, target):
    """The sun that a world shows by a sky node: its direction (Blender's axes), its angle in radians and its irradiance in three colours; None for
    one that is no light: cut by the horizon, or large."""
    angle, elevation = node.sun_size, node.sun_elevation
    if angle > LARGEST or elevation < AROUND * angle or elevation > math.pi - AROUND * angle:
        return None
    to_sun = Vector((math.sin(node.sun_rotation) * math.cos(elevation), math.cos(node.sun_rotation) * math.cos(elevation), math.sin(elevation)))
    key = cache.digest()
    key.update(repr(("sun", EDGE)).encode())
    fingerprint.add_tree(key, world.node_tree)
    irradiance = target.store.kept(key, lambda: _irradiance(world, to_sun, angle))
    return (to_sun, angle, [float(c) for c in irradiance]) if irradiance.min() > 0 else None


def _irradiance(world, to_sun, angle):
    """Irradiance of a surface that faces a disk in a direction, without the light around the disk, in three colours; 0 where there is no disk."""
    with stills.around(world.copy()) as scene:
        camera = bpy.data.cameras.new("oscura camera")
        camera.angle, camera.clip_start = AROUND * angle, 1e-4
        stills.place(scene, camera, rotation_euler=to_sun.to_track_quat("-Z", "Y").to_euler())
        stills.prepare(scene, (EDGE, EDGE), 1)
        pixels = stills.shown(scene)
    at = AROUND * ((np.arange(EDGE) + 0.5) / EDGE * 2 - 1)
    radius = np.hypot(*np.meshgrid(at, at))
    disk = pixels - pixels[radius > 1.1].mean(0)
    solid_angle = (2 * math.tan(AROUND * angle / 2) / EDGE) ** 2
    return disk[radius < 1.05].sum(0) * solid_angle if (disk[radius < 0.9] > 0).all() else np.zeros(3)


def _settings(node):
    """All settings of a node but its place in the tree."""
    skipped = {"name", "label", "location", "location_absolute", "width", "height", "select", "parent", "color", "texture_mapping", "color_mapping"}
    values = {}
    for prop in node.bl_rna.properties:
        if prop.identifier not in skipped and prop.type in ("BOOLEAN", "INT", "FLOAT", "ENUM"):
            value = getattr(node, prop.identifier)
            values[prop.identifier] = tuple(value) if getattr(prop, "is_array", False) else value
    return sorted(values.items())


def _alone(node):
    """A scene that shows nothing but a sky, without the disk of its sun."""
    world = bpy.data.worlds.new("oscura sky")
    world.use_nodes = True
    tree = world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    for key, value in _settings(node):
        if not sky.is_property_readonly(key):
            setattr(sky, key, value)
    sky.sun_disc = False
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])
    return stills.around(world)
