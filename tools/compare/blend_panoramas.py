"""Blender scenes with panoramic cameras."""

import math

from blend_parts import add, ball, camera, floor, light, material, scene, world


def _around():
    """Objects in all directions around the origin."""
    floor()
    world((0.3, 0.35, 0.5))
    light("SUN", "Sun", 2, rotation=(0.5, 0.3, 0), angle=math.radians(8))
    for k, color in enumerate(((0.8, 0.1, 0.1), (0.1, 0.7, 0.1), (0.1, 0.2, 0.8), (0.8, 0.7, 0.1), (0.6, 0.1, 0.7))):
        angle = 2 * math.pi * k / 5 + 0.3
        of = material(f"ball {k}", Base_Color=(*color, 1), Roughness=0.6)
        ball(of, (3.2 * math.sin(angle), 3.2 * math.cos(angle), 0.4 + 0.5 * k), 0.8)
    grey = material("grey", Base_Color=(0.5, 0.5, 0.5, 1), Roughness=0.8)
    add("cube", grey, (0, 0, 4.5), "Above", size=1.2, rotation=(0.3, 0.2, 0.5))


def _see(kind, size=(160, 120), **settings):
    _around()
    scene().render.resolution_x, scene().render.resolution_y = size
    obj = camera((0.1, -0.2, 1.6), (1.3, 0.1, 0.7))
    obj.data.type, obj.data.panorama_type = "PANO", kind
    for key, value in settings.items():
        setattr(obj.data, key, value)
    return obj.data


def equirectangular():
    _see("EQUIRECTANGULAR", (192, 96))


def equirectangular_part():
    limits = {"latitude_min": -0.6, "latitude_max": 1.1, "longitude_min": -1.2, "longitude_max": 2.2}
    _see("EQUIRECTANGULAR", shift_x=0.1, shift_y=-0.05, **limits)


def fisheye_equidistant():
    _see("FISHEYE_EQUIDISTANT", fisheye_fov=math.radians(200), shift_y=0.1)


def fisheye_equisolid():
    _see("FISHEYE_EQUISOLID", fisheye_fov=math.radians(170), fisheye_lens=9, sensor_width=34)


def mirror_ball():
    _see("MIRRORBALL", (128, 128))


def panorama_out_of_focus():
    seen = _see("EQUIRECTANGULAR", (192, 96))
    seen.dof.use_dof, seen.dof.focus_distance, seen.dof.aperture_fstop = True, 1.2, 0.1
