"""Which inputs of a shader Blender's glTF exporter can write: constants, and pictures that are looked up as glTF does."""

import bpy
import numpy as np

from . import shaders, vertex_colors

# Inputs that may be pictures in glTF, with what their values are.
COLOR, DATA, NORMAL = "color", "data", "normal"
INPUTS = {
    "Base Color": COLOR,
    "Emission Color": COLOR,
    "Metallic": DATA,
    "Roughness": DATA,
    "Alpha": DATA,
    "Transmission Weight": DATA,
    "Normal": NORMAL,
}

# Channels in which glTF has numbers; the exporter takes others for them.
CHANNELS = {"Roughness": ("Green", "G", "Color"), "Metallic": ("Blue", "B", "Color")}


def is_carried(name, socket):
    """Does the exporter write what feeds an input as Cycles reads it?"""
    source = shaders.source(socket)
    if source is None or shaders.constant(socket) is not None:
        return source is None
    kind = INPUTS.get(name)
    if kind == NORMAL:
        return _is_normal_map(source)
    if name == "Base Color" and vertex_colors.is_carried(source):
        return True
    if kind == COLOR:
        return source.name == "Color" and _is_plain(source.node, is_data=False) and not _is_multiplied(source.node)
    if name == "Alpha":
        return source.name == "Alpha" and _is_plain(source.node, is_data=None)
    if source.node.bl_idname in ("ShaderNodeSeparateColor", "ShaderNodeSeparateRGB"):
        before = shaders.source(source.node.inputs[0])
        is_channel = source.name in CHANNELS.get(name, ("Red", "R"))
        return is_channel and before is not None and before.name == "Color" and _is_plain(before.node, is_data=True)
    return source.name == "Color" and _is_plain(source.node, is_data=True) and _is_grey(source.node.image)


def _is_normal_map(source):
    node = source.node
    if node.bl_idname != "ShaderNodeNormalMap" or node.mute or node.space != "TANGENT":
        return False
    before = shaders.source(node.inputs["Color"])
    is_plain = before is not None and before.name == "Color" and _is_plain(before.node, is_data=True)
    return is_plain and shaders.constant(node.inputs["Strength"]) is not None


def _is_plain(node, is_data):
    """A picture in the space of glTF's textures (any, if `is_data` is None), by texture coordinates."""
    if node.bl_idname != "ShaderNodeTexImage" or node.mute or node.image is None:
        return False
    image = node.image
    if image.source not in ("FILE", "GENERATED") or not _has_eight_bits(image):
        return False
    name = image.colorspace_settings.name
    if is_data is not None and name != ("Non-Color" if is_data else "sRGB"):
        return False
    return node.projection == "FLAT" and node.extension in ("REPEAT", "EXTEND", "MIRROR") and _is_by_uv(node.inputs["Vector"])


def _is_multiplied(node):
    """Does Cycles multiply colours by alpha, which it does where nothing uses the latter?"""
    return not node.outputs["Alpha"].is_linked and node.image.alpha_mode in ("STRAIGHT", "PREMUL") and _is_clear(node.image)


def _is_clear(image):
    """Is a picture anywhere less than opaque? Only those are decoded for this that have alpha by their headers."""
    if image.session_uid not in _clear:
        _clear[image.session_uid] = _may_be_clear(image) and _least_alpha(image) < 1
    return _clear[image.session_uid]


# What is known of pictures.
_clear = {}


def _may_be_clear(image):
    """Has a picture alpha, as far as the header of its file tells?"""
    media = kind(image)
    if media != "image/png":
        return media is None
    head = content(image, 65_536)
    # With alpha there are kinds 4 and 6; others have it in a chunk before the picture.
    return head[25] in (4, 6) or b"tRNS" in head.split(b"IDAT")[0]


def _least_alpha(image):
    if image.channels < 4 or not image.size[0]:
        return 1.0
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    if image.source == "FILE" and not image.is_dirty:
        image.buffers_free()
    return float(values[3::4].min())


def _has_eight_bits(image):
    """Is it there, and no picture of floats? Only those whose headers don't tell are decoded for this, which takes long."""
    return kind(image) is not None or (bool(image.size[0]) and not image.is_float)


def kind(image):
    """The media type of a picture of eight bits that glTF takes as its file is; None for others."""
    if image.source != "FILE" or image.is_dirty:
        return None
    head = content(image, 32)
    if head.startswith(b"\xff\xd8\xff"):
        return "image/jpeg"
    return "image/png" if head.startswith(b"\x89PNG") and len(head) > 24 and head[24] <= 8 else None


def content(image, most=-1):
    """The first bytes of a picture's file, or all; empty where it can't be read."""
    if image.packed_file:
        data = image.packed_file.data
        return data if most < 0 else data[:most]
    try:
        with open(bpy.path.abspath(image.filepath_raw, library=image.library), "rb") as file:
            return file.read(most)
    except OSError:
        return b""


def _is_by_uv(vector):
    source = shaders.source(vector)
    if source is None:
        return not vector.is_linked
    node = source.node
    if node.bl_idname == "ShaderNodeUVMap":
        return not node.from_instancer
    if node.bl_idname == "ShaderNodeTexCoord":
        return source.name == "UV"
    if node.bl_idname != "ShaderNodeMapping" or node.mute or node.vector_type not in ("POINT", "TEXTURE"):
        return False
    values = [shaders.constant(i) for i in node.inputs if i.name != "Vector" and i.enabled]
    return None not in values and _is_by_uv(node.inputs["Vector"]) and node.inputs["Vector"].is_linked


def _is_grey(image):
    """A picture whose channels are all alike, as far as a sample tells: any of them will do."""
    pixels = image.pixels[: 4 * 4096]
    step = image.channels
    if step < 3:
        return True
    return all(abs(pixels[i] - pixels[i + k]) < 1e-3 for i in range(0, len(pixels) - step, step) for k in (1, 2))


def mean_of(source):
    """The mean of what a picture's node gives, as a number; a half of what is no picture."""
    node = source.node if source is not None else None
    if node is not None and node.bl_idname in ("ShaderNodeSeparateColor", "ShaderNodeSeparateRGB"):
        return mean_of(shaders.source(node.inputs[0]))
    image = getattr(node, "image", None)
    if image is None or not image.size[0]:
        return 0.5
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return float(values[1 % image.channels :: image.channels].mean())
