"""Cameras: as glTF has them, and what it can't carry."""

import math

from .settings import resolution


def is_fitted_by_width(camera, width, height):
    """Does the sensor's size (or the scale of a parallel camera) hold for the picture's width?"""
    if camera.sensor_fit == "AUTO":
        return width >= height
    return camera.sensor_fit == "HORIZONTAL"


def gltf(camera, scene):
    """The camera as glTF has it."""
    width, height = resolution(scene)
    width *= scene.render.pixel_aspect_x
    height *= scene.render.pixel_aspect_y
    by_width = is_fitted_by_width(camera, width, height)
    if camera.type == "ORTHO":
        half_height = camera.ortho_scale / 2 * (height / width if by_width else 1)
        sides = {"xmag": half_height * width / height, "ymag": half_height}
        return {"type": "orthographic", "orthographic": {**sides, **_range(camera)}}
    sensor = camera.sensor_height if camera.sensor_fit == "VERTICAL" else camera.sensor_width
    tangent = sensor / (2 * camera.lens) * (height / width if by_width else 1)
    lens = {"yfov": 2 * math.atan(tangent), "aspectRatio": width / height}
    return {"type": "perspective", "perspective": {**lens, **_range(camera)}}


def _range(camera):
    near = max(camera.clip_start, 1e-6)
    return {"znear": near, "zfar": max(camera.clip_end, near * 2)}


def entries(obj, camera, scene, is_active, report):
    """The entries of [[camera]] for a camera of the model."""
    width, height = resolution(scene)
    by_width = is_fitted_by_width(camera, width, height)
    shift = [s * (width / height if by_width else 1) for s in (camera.shift_x, camera.shift_y)]
    found = {"name": obj.name}
    if is_active:
        found["default"] = True
    if any(shift):
        found["shift"] = shift
    if camera.type == "PANO":
        report.warn(obj.name, "panoramic cameras are not supported: it is rendered in perspective")
    if camera.dof.use_dof:
        found.update(_lens(obj, camera))
    return found


def _lens(obj, camera):
    dof = camera.dof
    distance = dof.focus_distance
    if dof.focus_object is not None:
        focus = dof.focus_object.matrix_world
        if dof.focus_subtarget and dof.focus_object.type == "ARMATURE":
            bone = dof.focus_object.pose.bones.get(dof.focus_subtarget)
            focus = focus @ bone.matrix if bone else focus
        placed = obj.matrix_world.normalized()
        distance = abs((placed.inverted() @ focus.translation).z)
    distance = max(distance, 1e-5)
    shape = {}
    if dof.aperture_blades > 2:
        shape["blades"] = dof.aperture_blades
        shape["blade_rotation"] = math.degrees(dof.aperture_rotation)
    if abs(dof.aperture_ratio - 1) > 1e-6:
        shape["aperture_ratio"] = dof.aperture_ratio
    if camera.type == "ORTHO":
        # Cycles: the radius is half of 1 / f-stop.
        radius = 1 / (2 * dof.aperture_fstop)
        angle = math.degrees(2 * math.atan(radius / distance))
        return {"defocus_angle": angle, "focus_distance": distance, **shape}
    return {"f_stop": dof.aperture_fstop, "focal_length": camera.lens, "focus_distance": distance, **shape}
