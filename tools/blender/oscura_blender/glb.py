"""The model as a .glb: Blender's exporter writes meshes, materials and images; the nodes are written here, as the
renderer of Blender sees them: every instance, of whatever origin, at its own place."""

import json
import os
import struct

from mathutils import Matrix

from . import brushed
from .motion import animate
from .report import ALIASES
from .trees import SETTINGS

# From Blender's axes (z up) to those of glTF (y up).
Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))
Z_UP = Y_UP.inverted()

# So many placements of a mesh and more are written as instances.
INSTANCED = 8


class Glb:
    """The two chunks of a .glb file."""

    def __init__(self, path):
        with open(path, "rb") as file:
            length = struct.unpack_from("<I", file.read(20), 12)[0]
            self.json = json.loads(file.read(length))
            file.read(8)
            self.binary = bytearray(max(os.path.getsize(path) - file.tell(), 0))
            file.readinto(self.binary)

    def write(self, path):
        buffers = [{"byteLength": len(self.binary)}] if self.binary else []
        self.json["buffers"] = buffers
        if not buffers:
            del self.json["buffers"]
        text = json.dumps(self.json, ensure_ascii=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        self.binary += bytes(-len(self.binary) % 4)
        chunks = [(b"JSON", text), (b"BIN\0", self.binary)][: 1 + len(buffers)]
        with open(path, "wb") as file:
            file.write(b"glTF" + struct.pack("<II", 2, 12 + sum(8 + len(body) for _, body in chunks)))
            for kind, body in chunks:
                file.write(struct.pack("<I", len(body)) + kind)
                file.write(body)

    def add(self, data):
        """Adds bytes; gives where they begin, and their number."""
        self.binary += bytes(-len(self.binary) % 4)
        start = len(self.binary)
        self.binary += data
        return start, len(data)

    def add_accessor(self, rows, has_bounds=False):
        """Adds rows of floats; gives the number of their accessor."""
        start, length = self.add(b"".join(struct.pack(f"<{len(row)}f", *row) for row in rows))
        view = {"buffer": 0, "byteOffset": start, "byteLength": length}
        views = self.json.setdefault("bufferViews", [])
        views.append(view)
        kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[len(rows[0])]
        accessor = {"bufferView": len(views) - 1, "componentType": 5126, "count": len(rows), "type": kind}
        if has_bounds:
            # As single precision has them.
            rounded = [struct.unpack("<f", struct.pack("<f", row[0]))[0] for row in rows]
            accessor.update({"min": [min(rounded)], "max": [max(rounded)]})
        accessors = self.json.setdefault("accessors", [])
        accessors.append(accessor)
        return len(accessors) - 1


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


class Nodes:
    """The nodes of the model: those that move have their matrices at all moments."""

    def __init__(self, glb, moves):
        self.glb, self.moves = glb, moves
        self.nodes = []
        self.moving = []  # (number of the node, its parts at all moments)

    def add(self, node, matrix, mark, turn):
        """Adds a node at a matrix; `turn` takes matrices of Blender's axes to those of glTF."""
        matrices = self.moves.of(mark) if self.moves is not None else None
        parts = [_split(turn(m)) for m in matrices] if matrices else [None]
        if None not in parts:
            self.moving.append((len(self.nodes), _evened(parts)))
        now = _split(turn(matrix)) if None not in parts else None
        if now is None:
            self.nodes.append({**node, "matrix": _matrix(turn(matrix))})
        else:
            # Only nodes of such parts can be animated.
            self.nodes.append({**node, **dict(zip(("translation", "rotation", "scale"), now))})

    def add_meshes(self, mesh, places, extras):
        """Adds all placements (name, matrix, mark) of a mesh, together where they are many and stand still."""
        turn = lambda matrix: Y_UP @ matrix @ Z_UP
        own = {"extras": extras} if extras else {}
        still = [p for p in places if self.moves is None or self.moves.of(p[2]) is None]
        parts = [_split(turn(matrix)) for _, matrix, _ in still]
        if len(still) < INSTANCED or None in parts:
            still = []
        for name, matrix, mark in places:
            if not still or self.moves is not None and self.moves.of(mark) is not None:
                self.add({"name": name, "mesh": mesh, **own}, matrix, mark, turn)
        if not still:
            return
        keys = ("TRANSLATION", "ROTATION", "SCALE")
        attributes = {key: self.glb.add_accessor([part[k] for part in parts]) for k, key in enumerate(keys)}
        extension = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
        self.nodes.append({"name": still[0][0], "mesh": mesh, "extensions": extension, **own})
        used = self.glb.json.setdefault("extensionsUsed", [])
        if "EXT_mesh_gpu_instancing" not in used:
            used.append("EXT_mesh_gpu_instancing")


def _evened(parts):
    """Rotations by whichever of their two signs is nearer to the one before."""
    found = [parts[0]]
    for translation, rotation, scale in parts[1:]:
        if sum(a * b for a, b in zip(rotation, found[-1][1])) < 0:
            rotation = tuple(-r for r in rotation)
        found.append((translation, rotation, scale))
    return found


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
    for material in glb.json.get("materials", []):
        # Copies are called as what they were made of, unless the file of settings speaks of either.
        original = ALIASES.get(material.get("name"))
        if original is not None and not (SETTINGS.get(material["name"]) or SETTINGS.get(original)):
            material["name"] = original
    if not used:
        del glb.json["extensionsUsed"]


def compose(glb, found, others, patches, kept, moves=None):
    """Gives the file of Blender's exporter its nodes: meshes where they were collected, cameras (name, matrix, glTF camera)
    and empty nodes (name, matrix) in the place of lights; and materials what it leaves out of them, by name. Meshes that are
    known come from `kept`; what moves is animated."""
    cameras, empties = others
    by_name = {node["name"]: node["mesh"] for node in glb.json.get("nodes", []) if "mesh" in node}
    kept.exchange(glb, by_name)
    brushed.add(glb, by_name, found.brushed, [material["name"] for material in glb.json.get("materials", [])])
    made = Nodes(glb, moves)
    for name, places in found.placements.items():
        if name in by_name:
            marked = [(*place, mark) for place, mark in zip(places, found.marks[name])]
            made.add_meshes(by_name[name], marked, found.extras.get(name))
    turn = lambda matrix: Y_UP @ matrix
    for index, (name, matrix, _) in enumerate(cameras):
        made.add({"name": name, "camera": index}, matrix, ("camera", name), turn)
    for name, matrix in empties:
        made.add({"name": name}, matrix, _mark_of(name, found), turn)
    _patch_materials(glb, patches)
    # By this the loader knows that all glass is meant to be solid, and that nothing was lost.
    glb.json["asset"]["generator"] += ", oscura"
    animate(glb, moves, made.moving)
    glb.json["nodes"] = made.nodes
    if cameras:
        glb.json["cameras"] = [{"name": name, **camera} for name, _, camera in cameras]
    glb.json["scenes"] = [{"nodes": list(range(len(made.nodes)))}]
    glb.json["scene"] = 0
    if not made.nodes:
        del glb.json["nodes"], glb.json["scenes"][0]["nodes"]


def _mark_of(name, found):
    """What tells the light of an empty node apart; its name begins with its number."""
    return found.light_marks[int(name.split(":")[0].removeprefix("light "))]
