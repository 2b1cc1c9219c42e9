"""Uncompressed scan-line OpenEXR files: Cycles' settings for writing them, and a reader with numpy alone, for single-part and
multi-part files."""

import struct

import numpy as np

TYPES = {0: np.uint32, 1: np.float16, 2: np.float32}


def text(data, at):
    """A text that ends with 0, and where what follows begins."""
    end = data.index(0, at)
    return data[at:end].decode(), end + 1


def header(data, at):
    """Attributes of a part, and where what follows begins."""
    attributes = {}
    while data[at]:
        name, at = text(data, at)
        _, at = text(data, at)
        size = struct.unpack_from("<i", data, at)[0]
        attributes[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def channel_list(data):
    found, at = [], 0
    while data[at]:
        name, at = text(data, at)
        found.append((name, TYPES[struct.unpack_from("<i", data, at)[0]]))
        at += 16
    return found


def channels(path):
    """All channels by name, with the name of their part before them where there are several."""
    data = open(path, "rb").read()
    has_parts, at, parts = bool(data[5] & 0x10), 8, []
    while True:
        attributes, at = header(data, at)
        parts.append(attributes)
        if not has_parts or data[at] == 0:
            break
    at += has_parts
    pictures = {}
    for attributes in parts:
        x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
        assert attributes["compression"][0] == 0, "the file is compressed"
        width, height = x1 - x0 + 1, y1 - y0 + 1
        offsets = struct.unpack_from(f"<{height}Q", data, at)
        at += 8 * height
        prefix = attributes["name"].decode() + "." if has_parts else ""
        listed = channel_list(attributes["channels"])
        for name, kind in listed:
            pictures[prefix + name] = np.zeros((height, width), kind)
        for offset in offsets:
            offset += 4 * has_parts
            row = struct.unpack_from("<i", data, offset)[0] - y0
            offset += 8
            for name, kind in listed:
                pictures[prefix + name][row] = np.frombuffer(data, kind, width, offset)
                offset += width * np.dtype(kind).itemsize
    return pictures


def set_up(scene, size, samples, filter_width):
    """Sets Cycles up to render square pictures of a scene to such files, with all layers."""
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", samples
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", filter_width
    scene.render.resolution_x = scene.render.resolution_y = size
    image = scene.render.image_settings
    image.media_type, image.file_format = "MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER"
    image.color_depth, image.exr_codec = "32", "NONE"
