"""Sky textures: Cycles renders the sky without the sun disc to an image. The sun is a light."""

import math

import bpy
import numpy as np
from mathutils import Vector

from . import cache, cycles, fingerprint

# Width of the image.
WIDTH = 2048

# Pixels along the edge of the picture of the sun disc, and its field of view in diameters of the disc.
SUN_WIDTH, FIELD_OF_VIEW = 128, 1.5

# The largest sun that is a light, radians.
MAX_ANGLE = math.radians(10)


def has_sun(node):
    return node.sky_type not in ("PREETHAM", "HOSEK_WILKIE") and node.sun_disc


def render(node, export, path):
    """Writes the image of a sky texture."""

    def make():
        with _sky_scene(node) as scene:
            cycles.add_panoramic_camera(scene)
            cycles.set_up(scene, (WIDTH, WIDTH // 2), 1)
            return cycles.render_to(scene, path)

    export.cache.get(cache.new_digest("sky", WIDTH, _settings(node)), make).tofile(path)


def sun(world, node, export):
    """The sun of a world with a sky texture: the direction to it (Blender's axes), its angle in radians and its irradiance; None where it is no
    light: large, or cut by the horizon."""
    angle, elevation, rotation = node.sun_size, node.sun_elevation, node.sun_rotation
    if angle > MAX_ANGLE or elevation < FIELD_OF_VIEW * angle or elevation > math.pi - FIELD_OF_VIEW * angle:
        return None
    direction = Vector((math.sin(rotation) * math.cos(elevation), math.cos(rotation) * math.cos(elevation), math.sin(elevation)))
    digest = cache.new_digest("sun", SUN_WIDTH)
    fingerprint.add_tree(digest, world.node_tree)
    irradiance = export.cache.get(digest, lambda: _irradiance(world, direction, angle))
    return (direction, angle, [float(c) for c in irradiance]) if irradiance.min() > 0 else None


def _irradiance(world, direction, angle):
    """Irradiance by the disc of the sun, without the sky around it; 0 where there is no disc."""
    with cycles.world_scene(world.copy()) as scene:
        camera = bpy.data.cameras.new("oscura camera")
        camera.angle, camera.clip_start = FIELD_OF_VIEW * angle, 1e-4
        cycles.add_object(scene, camera, rotation_euler=direction.to_track_quat("-Z", "Y").to_euler())
        cycles.set_up(scene, (SUN_WIDTH, SUN_WIDTH), 1)
        pixels = cycles.render(scene)
    at = FIELD_OF_VIEW * ((np.arange(SUN_WIDTH) + 0.5) / SUN_WIDTH * 2 - 1)
    radius = np.hypot(*np.meshgrid(at, at))
    disc = pixels - pixels[radius > 1.1].mean(0)
    solid_angle = (2 * math.tan(FIELD_OF_VIEW * angle / 2) / SUN_WIDTH) ** 2
    return disc[radius < 1.05].sum(0) * solid_angle if (disc[radius < 0.9] > 0).all() else np.zeros(3)


def _settings(node):
    """The properties of a sky texture: those that other nodes don't have."""
    common = bpy.types.ShaderNode.bl_rna.properties
    own = [prop for prop in node.bl_rna.properties if prop.identifier not in common and prop.type in ("BOOLEAN", "INT", "FLOAT", "ENUM")]
    values = {prop.identifier: getattr(node, prop.identifier) for prop in own}
    return sorted((key, tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value) for key, value in values.items())


def _sky_scene(node):
    """A scene with a world of only the sky, without the sun disc."""
    world = bpy.data.worlds.new("oscura sky")
    world.use_nodes = True
    tree = world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    for key, value in _settings(node):
        setattr(sky, key, value)
    sky.sun_disc = False
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])
    return cycles.world_scene(world)
