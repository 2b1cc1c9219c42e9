"""Common parts of the exporter's tests, which run it as a process on scenes made with `bpy`."""

import json
import os
import subprocess
import sys
import tempfile
import tomllib
import unittest
from pathlib import Path

import bpy
import numpy as np

HERE = Path(__file__).resolve().parent
PROGRAM = os.environ.get("OSCURA", str(HERE.parent.parent / "target/release/oscura"))
sys.path.insert(0, str(HERE))


def run_exporter(scene, out, *more):
    """Exports a scene to a folder; returns the scene file."""
    command = [sys.executable, str(HERE / "export.py"), "--", str(scene), str(out), "scene", str(out / "answer.json"), *more]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{done.stdout[-2000:]}\n{done.stderr[-2000:]}")
    return tomllib.loads((out / "scene.toml").read_text())


def shader_tree(name, *kinds):
    """A material, its tree, its Principled shader and new nodes."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    return (material, tree, tree.nodes["Principled BSDF"], *(tree.nodes.new(f"ShaderNode{kind}") for kind in kinds))


def read_ply(path):
    """The header of a PLY file, vertex properties by name, and triangles."""
    head, rest = path.read_bytes().split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    count = {words[1]: int(words[2]) for words in map(str.split, lines) if words[0] == "element"}
    names = [line.split()[2] for line in lines if line.startswith("property float")]
    size = 4 * count["vertex"] * len(names)
    rows = np.frombuffer(rest[:size], "<f4").reshape(count["vertex"], len(names))
    kind = [("count", "u1"), ("corners", "<i4", 3)]
    kind += [("material", "<u2")] if any(line.endswith("material_index") for line in lines) else []
    return lines, dict(zip(names, rows.T)), np.frombuffer(rest[size:], kind, count["face"])


class SceneTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="oscura-test-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        self.scene.render.engine = "CYCLES"
        self.scene.cycles.volume_bounces = 12
        eye = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
        eye.location = (0, 0, 8)
        self.scene.collection.objects.link(eye)
        self.scene.camera = eye

    def add_plane(self, material, name="Plane", location=(0, 0, 0), data=None):
        if data is None:
            bpy.ops.mesh.primitive_plane_add()
            data = bpy.context.object.data
            bpy.data.objects.remove(bpy.context.object)
            data.materials.append(material)
        made = bpy.data.objects.new(name, data)
        made.location = location
        self.scene.collection.objects.link(made)
        return made

    def export(self, *more):
        """The scene file and the answer."""
        bpy.ops.wm.save_as_mainfile(filepath=str(self.folder / "scene.blend"))
        settings = run_exporter(self.folder / "scene.blend", self.folder, *more)
        return settings, json.loads((self.folder / "answer.json").read_text())

    def placed(self, settings):
        """Objects of the scene file by name."""
        return {entry["name"]: entry for entry in settings.get("objects", []) if "mesh" in entry}

    def mesh(self, settings, name):
        """The vertex properties of an object's mesh."""
        return read_ply(self.folder / self.placed(settings)[name]["mesh"])[1]

    def extent(self, name):
        """The corners of the exported object's bounding box, as the program loads it, in Blender's axes."""
        done = subprocess.run([PROGRAM, "inspect", "--json", str(self.folder / "scene.toml")], capture_output=True, text=True, check=True)
        objects = {entry["name"]: entry for entry in json.loads(done.stdout)["objects"]}
        corners = np.array(objects[name]["extent"])[:, [0, 2, 1]] * (1, -1, 1)
        return np.array([corners.min(0), corners.max(0)])

    def surface(self, table):
        """The surface node of a material, and a function for the node that an input is linked to."""
        nodes = table["nodes"]
        return nodes[table["surface"]], lambda node, key: nodes[node[key].split(".")[0]]

    def pixels(self, path):
        """The pixels of an image without a color space conversion."""
        image = bpy.data.images.load(path)
        image.colorspace_settings.name = "Non-Color"
        width, height = image.size
        pixels = np.array(image.pixels[:]).reshape(height, width, -1)
        bpy.data.images.remove(image)
        return pixels


def main():
    """Runs the tests of the calling module."""
    done = unittest.main(exit=False, verbosity=2)
    sys.stdout.flush()
    sys.stderr.flush()
    # The module `bpy` may hang while it tidies up.
    os._exit(0 if done.result.wasSuccessful() else 1)
