"""Rectangles, and glTF files of one with any material."""

import json
from pathlib import Path

import numpy as np


def quad(corner, u, v, radiance=None):
    """A corner and two edges; the front is on the side of u x v, and only it emits."""
    return {"corner": corner, "u": u, "v": v, "radiance": radiance}


def front(q):
    """The unit normal of its front."""
    n = np.cross(q["u"], q["v"])
    return n / np.linalg.norm(n)


def write_png(path, texels):
    from PIL import Image

    Image.fromarray(texels).save(path)


def write_sheet(path, sheet, material, images):
    """A quad as a glTF file, its texture coordinates (0, 0) at the top left as glTF has it. Images with "mask" in their
    name are not interpolated."""
    corner, u, v = (np.array(sheet[key], np.float32) for key in ("corner", "u", "v"))
    positions = np.array([corner, corner + u, corner + u + v, corner + v], np.float32)
    normals = np.repeat([front(sheet)], 4, 0).astype(np.float32)
    coordinates = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    indices = np.array([0, 1, 2, 0, 2, 3], np.uint32)
    parts = [positions, normals, coordinates, indices]
    offsets = np.cumsum([0, *(p.nbytes for p in parts)]).tolist()
    data = Path(path).with_suffix(".bin")
    data.write_bytes(b"".join(p.tobytes() for p in parts))
    bounds = {"min": positions.min(0).tolist(), "max": positions.max(0).tolist()}
    gltf = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_specular"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {
                "primitives": [
                    {"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3, "material": 0}
                ]
            }
        ],
        "materials": [{"doubleSided": True, **material}],
        "buffers": [{"uri": data.name, "byteLength": offsets[-1]}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": offsets[k], "byteLength": p.nbytes} for k, p in enumerate(parts)
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", **bounds},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 3, "componentType": 5125, "count": 6, "type": "SCALAR"},
        ],
        "images": [{"uri": name} for name in images],
        "samplers": [{"magFilter": 9728, "minFilter": 9728}, {"magFilter": 9729, "minFilter": 9729}],
        "textures": [{"source": k, "sampler": 0 if "mask" in name else 1} for k, name in enumerate(images)],
    }
    Path(path).write_text(json.dumps(gltf))
