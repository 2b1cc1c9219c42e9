"""The model as a .glb: Blender's exporter writes meshes, materials and images; the nodes are written here, as the
renderer of Blender sees them: every instance, of whatever origin, at its own place."""

import json
import struct

from mathutils import Matrix

# From Blender's axes (z up) to those of glTF (y up).
Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))
Z_UP = Y_UP.inverted()

# So many placements of a mesh and more are written as instances.
INSTANCED = 8


class Glb:
    """The two chunks of a .glb file."""

    def __init__(self, path):
        with open(path, "rb") as file:
            data = file.read()
        length = struct.unpack_from("<I", data, 12)[0]
        self.json = json.loads(data[20 : 20 + length])
        self.binary = bytearray(data[20 + length + 8 :])

    def write(self, path):
        buffers = [{"byteLength": len(self.binary)}] if self.binary else []
        self.json["buffers"] = buffers
        if not buffers:
            del self.json["buffers"]
        text = json.dumps(self.json, ensure_ascii=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        self.binary += bytes(-len(self.binary) % 4)
        chunks = _chunk(b"JSON", text) + (_chunk(b"BIN\0", bytes(self.binary)) if buffers else b"")
        with open(path, "wb") as file:
            file.write(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)

    def add(self, data):
        """Adds bytes; gives where they begin, and their number."""
        self.binary += bytes(-len(self.binary) % 4)
        start = len(self.binary)
        self.binary += data
        return start, len(data)

    def add_accessor(self, rows):
        """Adds rows of floats; gives the number of their accessor."""
        start, length = self.add(b"".join(struct.pack(f"<{len(row)}f", *row) for row in rows))
        view = {"buffer": 0, "byteOffset": start, "byteLength": length}
        views = self.json.setdefault("bufferViews", [])
        views.append(view)
        kind = {3: "VEC3", 4: "VEC4"}[len(rows[0])]
        accessor = {"bufferView": len(views) - 1, "componentType": 5126, "count": len(rows), "type": kind}
        accessors = self.json.setdefault("accessors", [])
        accessors.append(accessor)
        return len(accessors) - 1


def _chunk(kind, body):
    return struct.pack("<I", len(body)) + kind + body


def _matrix(of):
    """A matrix as glTF has it: by columns."""
    return [of[row][column] for column in range(4) for row in range(4)]


def _split(of):
    """Translation, rotation and scale of a matrix as glTF has them; None for one that shears."""
    translation, rotation, scale = of.decompose()
    again = Matrix.LocRotScale(translation, rotation, scale)
    size = max(abs(x) for row in of.to_3x3() for x in row)
    if any(abs(a - b) > 1e-5 * size for p, q in zip(again.to_3x3(), of.to_3x3()) for a, b in zip(p, q)):
        return None
    return tuple(translation), (rotation.x, rotation.y, rotation.z, rotation.w), tuple(scale)


def _place_meshes(glb, placements, extras):
    """Nodes for meshes: of each the number and its placements, pairs of a name and a matrix in Blender's axes; extras by the
    number of a mesh."""
    nodes = []
    for mesh, places in placements.items():
        turned = [(name, Y_UP @ matrix @ Z_UP) for name, matrix in places]
        parts = [_split(matrix) for _, matrix in turned] if len(turned) >= INSTANCED else [None]
        if None in parts:
            own = {"extras": extras[mesh]} if mesh in extras else {}
            nodes += [{"name": name, "mesh": mesh, "matrix": _matrix(matrix), **own} for name, matrix in turned]
            continue
        keys = ("TRANSLATION", "ROTATION", "SCALE")
        attributes = {key: glb.add_accessor([part[k] for part in parts]) for k, key in enumerate(keys)}
        extension = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
        nodes.append({"name": turned[0][0], "mesh": mesh, "extensions": extension})
        if mesh in extras:
            nodes[-1]["extras"] = extras[mesh]
        used = glb.json.setdefault("extensionsUsed", [])
        if "EXT_mesh_gpu_instancing" not in used:
            used.append("EXT_mesh_gpu_instancing")
    return nodes


def _patch_materials(glb, patches):
    used = glb.json.setdefault("extensionsUsed", [])
    for material in glb.json.get("materials", []):
        patch = patches.get(material.get("name"), {})
        for name, extension in patch.get("extensions", {}).items():
            if extension.pop("tinted", False):
                base = material.get("pbrMetallicRoughness", {})
                extension["diffuseTransmissionColorFactor"] = base.get("baseColorFactor", [1, 1, 1])[:3]
                if "baseColorTexture" in base:
                    extension["diffuseTransmissionColorTexture"] = base["baseColorTexture"]
            material.setdefault("extensions", {}).setdefault(name, {}).update(extension)
            if name not in used:
                used.append(name)
        if "roughness" in patch:
            material.setdefault("pbrMetallicRoughness", {})["roughnessFactor"] = patch["roughness"]
        if "base_color" in patch:
            factor = material.setdefault("pbrMetallicRoughness", {}).setdefault("baseColorFactor", [1, 1, 1, 1])
            factor[:3] = patch["base_color"]
    if not used:
        del glb.json["extensionsUsed"]


def compose(glb, meshes, cameras, empties, patches, kept):
    """Gives the file of Blender's exporter its nodes: meshes (placements and extras, both by the name of the
    exported object), cameras (name,
    matrix, glTF camera) and empty nodes (name, matrix) in the place of lights; and materials what it leaves out of them, by
    name. Meshes that are known come from `kept`."""
    by_name = {node["name"]: node["mesh"] for node in glb.json.get("nodes", []) if "mesh" in node}
    kept.exchange(glb, by_name)
    placements, extras = [{by_name[name]: of for name, of in part.items() if name in by_name} for part in meshes]
    nodes = _place_meshes(glb, placements, extras)
    for index, (name, matrix, _) in enumerate(cameras):
        nodes.append({"name": name, "camera": index, "matrix": _matrix(Y_UP @ matrix)})
    nodes += [{"name": name, "matrix": _matrix(Y_UP @ matrix)} for name, matrix in empties]
    _patch_materials(glb, patches)
    glb.json["nodes"] = nodes
    if cameras:
        glb.json["cameras"] = [{"name": name, **camera} for name, _, camera in cameras]
    glb.json["scenes"] = [{"nodes": list(range(len(nodes)))}]
    glb.json["scene"] = 0
    if not nodes:
        del glb.json["nodes"], glb.json["scenes"][0]["nodes"]
