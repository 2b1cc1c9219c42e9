"""What tests of the exporter share: it runs as a program, on scenes that are made by script."""

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
sys.path.insert(0, str(HERE))

from oscura_blender.glb import Glb  # noqa: E402  (the path comes first)


def run_exporter(scene, out, *more):
    """The model that comes of a scene's file, in a folder."""
    command = [sys.executable, str(HERE / "export.py"), "--", str(scene), str(out), "scene", str(out / "answer.json"), *more]
    subprocess.run(command, check=True, capture_output=True)
    return Glb(out / "scene.glb")


def shader_tree(name, *kinds):
    """A material, its tree, its Principled shader and new nodes."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    return (material, tree, tree.nodes["Principled BSDF"], *(tree.nodes.new(f"ShaderNode{kind}") for kind in kinds))


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
        """The model, the file of settings, and the answer."""
        bpy.ops.wm.save_as_mainfile(filepath=str(self.folder / "scene.blend"))
        model = run_exporter(self.folder / "scene.blend", self.folder, *more)
        settings = tomllib.loads((self.folder / "scene.oscura.toml").read_text())
        return model.json, settings, json.loads((self.folder / "answer.json").read_text())

    def export_glb(self, *more):
        """The same with the model's bytes."""
        model, settings, answer = self.export(*more)
        return Glb(str(self.folder / "scene.glb")), settings, answer

    def picture(self, model, material):
        """The file of a material's base colour."""
        glb = Glb(str(self.folder / "scene.glb"))
        texture = model["textures"][material["pbrMetallicRoughness"]["baseColorTexture"]["index"]]
        view = glb.json["bufferViews"][model["images"][texture["source"]]["bufferView"]]
        path = self.folder / "paint.png"
        start = view.get("byteOffset", 0)
        path.write_bytes(glb.binary[start : start + view["byteLength"]])
        return str(path)

    def pixels(self, path):
        """The numbers of a picture as they are stored."""
        image = bpy.data.images.load(path)
        image.colorspace_settings.name = "Non-Color"
        width, height = image.size
        pixels = np.array(image.pixels[:]).reshape(height, width, -1)
        bpy.data.images.remove(image)
        return pixels


def main():
    """Runs the tests of the program."""
    done = unittest.main(exit=False, verbosity=2)
    sys.stdout.flush()
    sys.stderr.flush()
    # The module `bpy` may hang while it tidies up.
    os._exit(0 if done.result.wasSuccessful() else 1)
