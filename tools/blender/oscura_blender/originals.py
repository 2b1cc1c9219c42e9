"""Pictures that reach the model as their files are: Blender's exporter would decode each of them only to count its channels,
which takes longer than all else. It gets a picture of one pixel in the place of each, and the model what the file holds."""

import os
import struct
import zlib

import bpy

from . import pictures, shaders

# Inputs whose pictures the exporter doesn't join with others.
INPUTS = ("Base Color", "Emission Color", "Normal")
ALONE = ("Alpha", *INPUTS)


class Originals:
    """Pictures that were replaced: the bytes of each stand-in, with the picture and its kind."""

    def __init__(self):
        self.replaced = {}
        self._nodes = []  # with their own pictures

    def replace(self, materials):
        """Puts stand-ins into nodes whose pictures are written as they are."""
        kinds = {}  # by picture; None for those that are also used in other ways
        users = {}
        for material in dict.fromkeys(materials):
            wanted = _unchanged(material)
            for node in _pictures(material.node_tree):
                kind = pictures.kind(node.image) if node in wanted else None
                kinds[node.image] = kind if kinds.get(node.image, kind) == kind else None
                users.setdefault(node.image, []).append(node)
        for image, kind in kinds.items():
            if kind is not None:
                self._replace(image, kind, users[image])

    def _replace(self, image, kind, nodes):
        data = _pixel(len(self.replaced))
        made = bpy.data.images.new("oscura stand-in", 1, 1)
        made.pack(data=data, data_len=len(data))
        made.source = "FILE"
        made.colorspace_settings.name = image.colorspace_settings.name
        made.alpha_mode = image.alpha_mode
        name = image.name
        image.name = "oscura replaced"
        made.name = name
        for node in nodes:
            node.image = made
        self._nodes += [(node, image) for node in nodes]
        self.replaced[data] = (image, kind)

    def restore(self):
        """Takes the stand-ins out again."""
        for node, image in self._nodes:
            node.image = image
        self.replaced, self._nodes = {}, []

    def exchange(self, glb, folder=None):
        """Puts in what the files hold, or with a folder links to them there; false if the exporter made something else of a
        stand-in."""
        found = set()
        for entry in glb.json.get("images", []):
            view = glb.json["bufferViews"][entry["bufferView"]]
            start = view.get("byteOffset", 0)
            data = bytes(glb.binary[start : start + view["byteLength"]])
            if data in self.replaced:
                found.add(data)
                image, entry["mimeType"] = self.replaced[data]
                if folder is not None and (name := _linked(image, folder, len(found))):
                    del entry["bufferView"], entry["mimeType"]
                    entry["uri"] = name
                    continue
                view["byteOffset"], view["byteLength"] = glb.add(pictures.content(image))
        return len(found) == len(self.replaced)


def _linked(image, folder, number):
    """The name of a link to a picture's file; None for one that is packed, or where there are no links."""
    if image.packed_file:
        return None
    name = f"picture.{number}{IMAGES[pictures.kind(image)]}"
    try:
        os.symlink(os.path.abspath(bpy.path.abspath(image.filepath_raw, library=image.library)), os.path.join(folder, name))
    except (OSError, NotImplementedError):
        return None
    return name


# Endings of the kinds of pictures.
IMAGES = {"image/jpeg": ".jpg", "image/png": ".png"}


def _pictures(tree):
    """All nodes of a tree and its groups that show a picture."""
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeTexImage" and node.image is not None:
            yield node
        elif getattr(node, "node_tree", None):
            yield from _pictures(node.node_tree)


def _unchanged(material):
    """The nodes of a material whose pictures are written as they are."""
    shader = shaders.output(material.node_tree)
    if shader is None or shader.bl_idname != "ShaderNodeBsdfPrincipled":
        return set()
    feeding = {}
    for name in ALONE:
        source = shaders.source(shader.inputs[name]) if name in shader.inputs else None
        if source is not None and name == "Normal" and source.node.bl_idname == "ShaderNodeNormalMap":
            source = shaders.source(source.node.inputs["Color"])
        if source is not None and source.node.bl_idname == "ShaderNodeTexImage":
            feeding[name] = source.node
        elif source is not None and name == "Alpha":
            feeding[name] = None
    # One picture has both; with two the exporter joins them.
    if feeding.get("Alpha", feeding.get("Base Color")) != feeding.get("Base Color"):
        feeding.pop("Base Color", None)
    if shaders.constant(shader.inputs["Emission Strength"]) in (None, 0):
        feeding.pop("Emission Color", None)
    wanted = {feeding[name] for name in INPUTS if name in feeding}
    others = {link.from_node for link in material.node_tree.links if link.to_node.bl_idname not in _READERS}
    return wanted - others


# What may look at a picture that is written as it is.
_READERS = ("ShaderNodeBsdfPrincipled", "ShaderNodeNormalMap", "NodeReroute")


def _pixel(number):
    """A PNG of one pixel; each number has bytes of its own."""
    chunk = lambda kind, body: struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0))
    mark = chunk(b"tEXt", b"Comment\0oscura stand-in " + str(number).encode())
    return b"\x89PNG\r\n\x1a\n" + head + mark + chunk(b"IDAT", zlib.compress(b"\0\x80\x80\x80")) + chunk(b"IEND", b"")
