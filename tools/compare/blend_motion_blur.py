"""Blender scenes with motion blur: moving, rotating and deforming objects, and a moving camera."""

import blend_motion
from blend_parts import add, camera, keyed, light, material, scene, still_life, world


def blurred():
    """Object hierarchies, an armature, shape keys and a light."""
    blend_motion.motion()
    scene().frame_set(5)
    scene().camera.animation_data_clear()
    scene().camera.location, scene().camera.rotation_euler = (5, -7, 4), (1.15, 0, 0.6)
    scene().render.use_motion_blur, scene().render.motion_blur_shutter = True, 1.0


def blurred_camera():
    """A moving camera, with the shutter opening at the frame, and a rotating box."""
    still_life()
    world((0.3, 0.35, 0.4))
    light("AREA", "Key", 250, (-3, -4, 5), (0.6, -0.5, 0), size=2)
    eye = camera()
    keyed(eye, "location", {1: (6, -7, 4), 5: (5, -8, 4.4)})
    spinning = add("cube", material("spinning", Base_Color=(0.2, 0.5, 0.8, 1)), (-1.6, -1, 0.6), "Spinning", size=0.9)
    keyed(spinning, "rotation_euler", {1: (0, 0, 0), 5: (0, 0, 2)})
    scene().frame_set(3)
    render = scene().render
    render.use_motion_blur, render.motion_blur_shutter, render.motion_blur_position = True, 0.6, "START"
