"""Cameras: projections and depth of field."""

import math
from itertools import chain

import bpy
import numpy as np

from . import cycles, motion, scene_file
from .report import Stop
from .scene_file import Exact
from .settings import resolution

# Types of objects that aren't rendered.
INVISIBLE = ("CAMERA", "LIGHT", "EMPTY", "ARMATURE", "LIGHT_PROBE", "SPEAKER", "LATTICE")

# Keys that panoramas don't have: they have a round aperture.
APERTURE_SHAPE = ("blades", "blade_rotation", "aperture_ratio")


def tables(export):
    """The tables of all cameras, the active one first."""
    scene, report, moves = export.scene, export.report, export.moves
    if scene.camera is None:
        report.warn("", "has no active camera")
    shutter = motion.Shutter(scene, export.layer, export.options)
    for obj in export.cameras:
        matrix = obj.matrix_world.normalized()
        if scene_file.is_singular(matrix):
            if obj == scene.camera:
                raise Stop(f"the scale of the camera '{obj.name}' is 0")
            report.warn(obj.name, "this camera is left out, since its scale is 0")
            continue
        matrices = moves.matrices_of(("camera", obj.name)) if moves is not None else None
        placement = scene_file.placement(matrix, moves and moves.frames, matrices)
        entries = {"name": obj.name, **placement, **_entries(obj, _data(obj), scene, export.boxes, report)}
        if shutter.frames > 0:
            entries.update({"shutter": shutter.frames, "shutter_position": shutter.position})
        yield "[[camera]]", entries


def _data(obj):
    """The camera of an object. Objects of other types see as in Cycles."""
    if obj.type == "CAMERA":
        return obj.data
    camera = bpy.data.cameras.new("oscura camera")
    camera.clip_start, camera.clip_end = 1e-5, 1e5
    if obj.type == "LIGHT" and obj.data.type == "SPOT":
        camera.lens = 16 / math.tan(obj.data.spot_size / 2)
    return camera


def bounding_boxes(depsgraph):
    """The corners of the bounding boxes of all visible objects in the world, shape (boxes, 8, 3)."""
    boxes, indices, matrices = [], [], []
    known = {}
    for instance in depsgraph.object_instances:
        obj = instance.object
        if obj.type in INVISIBLE:
            continue
        key = obj.original, obj.data.as_pointer() if obj.data is not None else None
        if key not in known:
            known[key] = len(boxes)
            boxes.append(np.array(obj.bound_box))
        indices.append(known[key])
        matrices.extend(chain.from_iterable(instance.matrix_world))
    if not boxes:
        return np.zeros((0, 8, 3))
    matrices = np.array(matrices).reshape(-1, 4, 4)
    return np.array(boxes)[indices] @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]


def _pixel_aspect(scene):
    return scene.render.pixel_aspect_x / scene.render.pixel_aspect_y


def _fits_width(camera, width, height):
    """Is the sensor size (or orthographic scale) that of the picture's width?"""
    if camera.sensor_fit == "AUTO":
        return width >= height
    return camera.sensor_fit == "HORIZONTAL"


def _entries(obj, camera, scene, boxes, report):
    """Entries of a camera without its place."""
    across, down = resolution(scene)
    aspect = _pixel_aspect(scene)
    width, height = across * aspect, down
    entries = _panorama(obj, camera, (width, height), report) if camera.type == "PANO" else {}
    is_panorama = bool(entries)
    if is_panorama:
        # Shifts of panoramas are relative to width and height, whatever the sensor.
        shift = [camera.shift_x * across / down, camera.shift_y]
    else:
        entries = _projection(camera, width, height)
        shift = [s * (width / height if _fits_width(camera, width, height) else 1) for s in (camera.shift_x, camera.shift_y)]
        if aspect != 1:
            entries["pixel_aspect"] = aspect
    if any(shift):
        entries["shift"] = shift
    if _clips(obj, camera, boxes):
        entries["clip"] = [camera.clip_start, max(camera.clip_end, camera.clip_start * 1.001 + 1e-6)]
    if camera.dof.use_dof:
        lens = _depth_of_field(obj, camera)
        if is_panorama and any(key in lens for key in APERTURE_SHAPE):
            report.warn(obj.name, "panoramic cameras have a round aperture: its blades and ratio are left out")
            lens = {key: value for key, value in lens.items() if key not in APERTURE_SHAPE}
        entries.update(lens)
    return entries


def _projection(camera, width, height):
    share, aspect_ratio = height / width if _fits_width(camera, width, height) else 1, Exact(width / height)
    if camera.type == "ORTHO":
        return {"type": "orthographic", "view_height": Exact(camera.ortho_scale * share), "aspect_ratio": aspect_ratio}
    sensor = camera.sensor_height if camera.sensor_fit == "VERTICAL" else camera.sensor_width
    # Importers make cameras with an infinite focal length, but an angle of 0 is none.
    tangent = max(sensor / (2 * camera.lens) * share, 1e-6)
    return {"vfov": Exact(math.degrees(2 * math.atan(tangent))), "aspect_ratio": aspect_ratio}


def _clips(obj, camera, boxes):
    """May there be objects outside the clipping distances? At the picture's corners these are at most four times as far along the ray."""
    eye = np.array(obj.matrix_world.translation)
    nearest = np.linalg.norm(np.clip(eye, boxes.min(axis=1), boxes.max(axis=1)) - eye, axis=1)
    farthest = np.linalg.norm(boxes - eye, axis=2).max(axis=1)
    return bool((nearest < 4 * camera.clip_start).any() or (farthest > camera.clip_end).any())


def _panorama(obj, camera, size, report):
    """Entries of a panoramic camera; empty for types that oscura doesn't have."""
    settings, degrees = cycles.panorama_settings(camera), math.degrees
    kind = settings.panorama_type
    if kind == "EQUIRECTANGULAR":
        longitude = [degrees(settings.longitude_min), degrees(settings.longitude_max)]
        latitude = [degrees(settings.latitude_min), degrees(settings.latitude_max)]
        if longitude[0] < longitude[1] and latitude[0] < latitude[1]:
            longitude = [max(longitude[0], -180), min(longitude[1], 180)]
            latitude = [max(latitude[0], -90), min(latitude[1], 90)]
            return {"type": "panorama", "longitude": longitude, "latitude": latitude}
        report.warn(obj.name, "mirrored or empty panoramas are not supported: it is rendered in perspective")
        return {}
    fisheye = {"type": "panorama", "projection": "fisheye_equisolid", "fov": min(degrees(settings.fisheye_fov), 360)}
    if kind == "FISHEYE_EQUIDISTANT":
        return {**fisheye, "projection": "fisheye_equidistant"}
    if kind == "FISHEYE_EQUISOLID":
        return {**fisheye, "fisheye_lens": settings.fisheye_lens, "sensor": _sensor(camera, size)}
    if kind == "MIRRORBALL":
        # From far away a mirror ball shows equal solid angles in equal areas: it is an equisolid fisheye of all directions.
        return {**fisheye, "fov": 360, "fisheye_lens": 1, "sensor": [4, 4]}
    name = settings.bl_rna.properties["panorama_type"].enum_items[kind].name
    report.warn(obj.name, f"panoramas of type '{name}' are not supported: it is rendered in perspective")
    return {}


def _sensor(camera, size):
    """Width and height of the picture on the sensor, millimetres."""
    width, height = size
    if camera.sensor_fit == "VERTICAL":
        return [camera.sensor_height * width / height, camera.sensor_height]
    if _fits_width(camera, width, height):
        return [camera.sensor_width, camera.sensor_width * height / width]
    return [camera.sensor_width * width / height, camera.sensor_width]


def _depth_of_field(obj, camera):
    dof = camera.dof
    distance = dof.focus_distance
    if dof.focus_object is not None:
        focus = dof.focus_object.matrix_world
        if dof.focus_subtarget and dof.focus_object.type == "ARMATURE":
            bone = dof.focus_object.pose.bones.get(dof.focus_subtarget)
            focus = focus @ bone.matrix if bone else focus
        distance = abs((obj.matrix_world.normalized().inverted() @ focus.translation).z)
    distance = max(distance, 1e-5)
    if camera.type == "ORTHO":
        # In Cycles the radius of the aperture is half of 1 / f-stop.
        angle = math.degrees(2 * math.atan(1 / (2 * dof.aperture_fstop) / distance))
        entries = {"defocus_angle": angle, "focus_distance": distance}
    else:
        entries = {"f_stop": dof.aperture_fstop, "focal_length": camera.lens, "focus_distance": distance}
    if dof.aperture_blades > 2:
        entries["blades"] = dof.aperture_blades
        entries["blade_rotation"] = math.degrees(dof.aperture_rotation)
    if abs(dof.aperture_ratio - 1) > 1e-6:
        entries["aperture_ratio"] = dof.aperture_ratio
    return entries
