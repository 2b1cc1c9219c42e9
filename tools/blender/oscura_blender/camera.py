"""Cameras: their projections and lenses."""

import math
from itertools import chain

import numpy as np

from .scene_file import Exact
from .settings import resolution

# Kinds of objects that are nothing to see.
UNSEEN = ("CAMERA", "LIGHT", "EMPTY", "ARMATURE", "LIGHT_PROBE", "SPEAKER", "LATTICE")


def is_fitted_by_width(camera, width, height):
    """Does the sensor's size (or the scale of a parallel camera) hold for the picture's width?"""
    if camera.sensor_fit == "AUTO":
        return width >= height
    return camera.sensor_fit == "HORIZONTAL"


def frame(scene):
    """Width and height of the picture, in the height of its pixels."""
    width, height = resolution(scene)
    return width * pixel_aspect(scene), height


def pixel_aspect(scene):
    """Width of the picture's pixels over their height."""
    return scene.render.pixel_aspect_x / scene.render.pixel_aspect_y


def projection(camera, scene):
    """The keys of a camera that is no panorama."""
    width, height = frame(scene)
    share, aspect_ratio = height / width if is_fitted_by_width(camera, width, height) else 1, Exact(width / height)
    if camera.type == "ORTHO":
        return {"type": "orthographic", "view_height": Exact(camera.ortho_scale * share), "aspect_ratio": aspect_ratio}
    sensor = camera.sensor_height if camera.sensor_fit == "VERTICAL" else camera.sensor_width
    # Importers leave cameras of infinite focal lengths behind, and there is no angle of 0.
    tangent = max(sensor / (2 * camera.lens) * share, 1e-6)
    return {"vfov": Exact(math.degrees(2 * math.atan(tangent))), "aspect_ratio": aspect_ratio}


def boxes(graph):
    """Corners of the boxes around all that is shown, in the world: eight each."""
    known, of_data, matrices = [], [], []
    numbers = {}
    for instance in graph.object_instances:
        obj = instance.object
        if obj.type in UNSEEN:
            continue
        key = obj.original, obj.data.as_pointer() if obj.data is not None else None
        if key not in numbers:
            numbers[key] = len(known)
            known.append(np.array(obj.bound_box))
        of_data.append(numbers[key])
        matrices.extend(chain.from_iterable(instance.matrix_world))
    if not known:
        return np.zeros((0, 8, 3))
    matrices = np.array(matrices).reshape(-1, 4, 4)
    return np.array(known)[of_data] @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]


def _is_clipping(obj, camera, corners):
    """Can there be things at distances that the camera doesn't see?"""
    eye = np.array(obj.matrix_world.translation)
    nearest = np.linalg.norm(np.clip(eye, corners.min(axis=1), corners.max(axis=1)) - eye, axis=1)
    farthest = np.linalg.norm(corners - eye, axis=2).max(axis=1)
    # The corners of its picture see four times as far as its axis at most.
    return bool((nearest < 4 * camera.clip_start).any() or (farthest > camera.clip_end).any())


def entries(obj, camera, scene, corners, report):
    """The entries of [[camera]] for a camera, without its place; the corners are those of `boxes`."""
    width, height = frame(scene)
    by_width = is_fitted_by_width(camera, width, height)
    panorama = _panorama(obj, camera, (width, height), report) if camera.type == "PANO" else {}
    if panorama:
        # Of either edge, whatever the sensor.
        across, down = resolution(scene)
        shift = [camera.shift_x * across / down, camera.shift_y]
    else:
        shift = [s * (width / height if by_width else 1) for s in (camera.shift_x, camera.shift_y)]
    found = panorama or projection(camera, scene)
    if not panorama and pixel_aspect(scene) != 1:
        found["pixel_aspect"] = pixel_aspect(scene)
    if any(shift):
        found["shift"] = shift
    if _is_clipping(obj, camera, corners):
        found["clip"] = [camera.clip_start, max(camera.clip_end, camera.clip_start * 1.001 + 1e-6)]
    if camera.dof.use_dof:
        lens = _lens(obj, camera)
        if panorama and lens.keys() & SHAPE:
            report.warn(obj.name, "panoramas have a round lens: its blades and ratio are left out")
            lens = {key: value for key, value in lens.items() if key not in SHAPE}
        found.update(lens)
    return found


# Keys of the shape of lenses.
SHAPE = {"blades", "blade_rotation", "aperture_ratio"}


def _panorama(obj, camera, size, report):
    """The keys of a panoramic camera; none of a kind that the program hasn't."""
    # Until Blender 5.0 they were settings of Cycles.
    of = camera if hasattr(camera, "panorama_type") else camera.cycles
    kind, degrees = of.panorama_type, math.degrees
    if kind == "EQUIRECTANGULAR":
        longitude = [degrees(of.longitude_min), degrees(of.longitude_max)]
        latitude = [degrees(of.latitude_min), degrees(of.latitude_max)]
        if longitude[0] < longitude[1] and latitude[0] < latitude[1]:
            longitude = [max(longitude[0], -180), min(longitude[1], 180)]
            latitude = [max(latitude[0], -90), min(latitude[1], 90)]
            return {"type": "panorama", "longitude": longitude, "latitude": latitude}
        report.warn(obj.name, "panoramas that are mirrored or empty are not supported: it is rendered in perspective")
        return {}
    fisheye = {"type": "panorama", "projection": "fisheye_equisolid", "fov": min(degrees(of.fisheye_fov), 360)}
    if kind == "FISHEYE_EQUIDISTANT":
        return {**fisheye, "projection": "fisheye_equidistant"}
    if kind == "FISHEYE_EQUISOLID":
        return {**fisheye, "fisheye_lens": of.fisheye_lens, "sensor": _sensor(camera, size)}
    if kind == "MIRRORBALL":
        # Seen from afar, a ball shows equal solid angles in equal areas: it is a fisheye of all directions.
        return {**fisheye, "fov": 360, "fisheye_lens": 1, "sensor": [4, 4]}
    items = of.bl_rna.properties["panorama_type"].enum_items
    report.warn(obj.name, f"panoramas of type '{items[kind].name}' are not supported: it is rendered in perspective")
    return {}


def _sensor(camera, size):
    """Width and height of what the picture shows on the sensor, millimetres."""
    width, height = size
    if camera.sensor_fit == "VERTICAL":
        return [camera.sensor_height * width / height, camera.sensor_height]
    if is_fitted_by_width(camera, width, height):
        return [camera.sensor_width, camera.sensor_width * height / width]
    return [camera.sensor_width * width / height, camera.sensor_width]


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
