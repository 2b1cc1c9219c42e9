"""The model: a .glb with cameras, empty nodes in the place of lights, and the animation of both."""

import json
import struct

from mathutils import Matrix

# From Blender's axes (z up) to those of glTF (y up).
Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))


class Glb:
    """The two chunks of a .glb file."""

    def __init__(self):
        # The generator, by which the loader leaves warnings about losses to the exporter.
        self.json = {"asset": {"version": "2.0", "generator": "Blender I/O, oscura"}, "scene": 0}
        self.binary = bytearray()

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
    """The nodes of the model: those that move have their matrices at all times."""

    def __init__(self, glb, moves):
        self.glb, self.moves = glb, moves
        self.nodes = []
        self.moving = []  # (number of the node, its parts at all times)

    def add(self, node, matrix, mark):
        """Adds a node at a matrix."""
        turn = lambda matrix: Y_UP @ matrix
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


def _evened(parts):
    """Rotations by whichever of their two signs is nearer to the one before."""
    found = [parts[0]]
    for translation, rotation, scale in parts[1:]:
        if sum(a * b for a, b in zip(rotation, found[-1][1])) < 0:
            rotation = tuple(-r for r in rotation)
        found.append((translation, rotation, scale))
    return found


def write(path, found, cameras, empties, moves):
    """Writes cameras (name, matrix, glTF camera) and empty nodes (name, matrix)."""
    glb = Glb()
    made = Nodes(glb, moves)
    for index, (name, matrix, _) in enumerate(cameras):
        made.add({"name": name, "camera": index}, matrix, ("camera", name))
    for name, matrix in empties:
        made.add({"name": name}, matrix, _mark_of(name, found))
    _animate(glb, moves, made.moving)
    glb.json["scenes"] = [{"nodes": list(range(len(made.nodes)))}] if made.nodes else [{}]
    if made.nodes:
        glb.json["nodes"] = made.nodes
    if cameras:
        glb.json["cameras"] = [{"name": name, **camera} for name, _, camera in cameras]
    glb.write(path)


def _animate(glb, moves, nodes):
    """Writes the animation: nodes with their matrices at all times."""
    if moves is None or not nodes:
        return
    animation = {"channels": [], "samplers": []}
    times = glb.add_accessor([(time,) for time in moves.times()], has_bounds=True)
    for node, parts in nodes:
        for k, path in enumerate(("translation", "rotation", "scale")):
            animation["channels"].append({"sampler": len(animation["samplers"]), "target": {"node": node, "path": path}})
            output = glb.add_accessor([part[k] for part in parts])
            animation["samplers"].append({"input": times, "output": output, "interpolation": "LINEAR"})
    glb.json["animations"] = [animation]


def _mark_of(name, found):
    """The mark of the light of an empty node, whose name begins with its number."""
    return found.light_marks[int(name.split(":")[0].removeprefix("light "))]
