"""Tests glass, blackbody, light groups, and the cache.

    python test_export.py            with a Python that has bpy
"""

import json
import tempfile
import unittest
from pathlib import Path

import bpy
import numpy as np
from testing import main, run_exporter


def make_scene(path, grey=0.5, height=0.0):
    """Two meshes with a color attribute, one with a baked node and one with an image texture."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    picture = bpy.data.images.new("picture", 64, 64)
    picture.pixels[:] = np.random.default_rng(1).random(64 * 64 * 4).tolist()
    picture.filepath_raw, picture.file_format = str(path.with_suffix(".png")), "PNG"
    picture.save()
    for kind in ("ShaderNodeTexSky", "ShaderNodeTexImage"):
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=60, y_subdivisions=60)
        mesh = bpy.context.object.data
        mesh.vertices[0].co.z = height
        mesh.color_attributes.new("Tint", "BYTE_COLOR", "CORNER")
        material = bpy.data.materials.new(kind)
        material.use_nodes = True
        tree = material.node_tree
        shader = tree.nodes["Principled BSDF"]
        shader.inputs["Roughness"].default_value = grey
        node = tree.nodes.new(kind)
        if kind == "ShaderNodeTexImage":
            node.image = bpy.data.images.load(picture.filepath_raw)
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        mesh.materials.append(material)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def contents(folder):
    """The exported files but the answer."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix in (".ply", ".exr", ".png", ".toml")}


def make_glass(path):
    """An absorbing glass sphere and a light with a Blackbody node, in light groups."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_uv_sphere_add()
    ball = bpy.context.object
    ball.lightgroup = "balls here"
    material = bpy.data.materials.new("glass")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes["Principled BSDF"].inputs["Transmission Weight"].default_value = 1.0
    tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.25, 1.0, 1.0, 1.0)
    absorption = tree.nodes.new("ShaderNodeVolumeAbsorption")
    absorption.inputs["Color"].default_value = (1.0, 0.5, 0.25, 1.0)
    absorption.inputs["Density"].default_value = 4.0
    tree.links.new(absorption.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
    ball.data.materials.append(material)
    light = bpy.data.lights.new("lamp", "POINT")
    light.use_nodes = True
    body = light.node_tree.nodes.new("ShaderNodeBlackbody")
    body.inputs[0].default_value = 2500
    light.node_tree.links.new(body.outputs[0], light.node_tree.nodes["Emission"].inputs["Color"])
    lamp = bpy.data.objects.new("lamp", light)
    lamp.lightgroup = "key"
    bpy.context.scene.collection.objects.link(lamp)
    # An area light without area emits nothing.
    line = bpy.data.lights.new("line", "AREA")
    line.shape, line.size, line.size_y = "RECTANGLE", 1.0, 0.0
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("line", line))
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


class GlassTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="oscura-test-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def export(self):
        """The scene file."""
        make_glass(self.folder / "scene.blend")
        return run_exporter(self.folder / "scene.blend", self.folder)

    def check_lamp(self, settings):
        (lamp,) = settings["lights"]
        self.assertEqual(lamp["group"], "key")
        red, green, blue = lamp["color"]
        self.assertTrue(red > 2 * green > 4 * blue, lamp["color"])

    def test_absorption_blackbody_and_light_groups(self):
        settings = self.export()
        self.check_lamp(settings)
        glass, (ball,) = settings["materials"]["glass"], settings["objects"]
        self.assertEqual((ball["light_group"], ball["materials"], glass["volume"]), ("balls_here", ["glass"], True))
        # Absorption: the density times one minus the color.
        np.testing.assert_allclose(glass["medium"]["density"], [0.0, 2.0, 3.0], rtol=1e-5)
        self.assertEqual(glass["medium"]["color"], [0.0] * 3)
        surface = glass["nodes"][glass["surface"]]
        self.assertEqual((surface["transmission_weight"], surface["base_color"]), (1.0, [0.25, 1.0, 1.0]))

class CacheTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="oscura-test-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.cache = self.folder / "cache"

    def export(self, *more):
        """The files of an export."""
        out = Path(tempfile.mkdtemp(dir=self.folder))
        run_exporter(self.folder / "scene.blend", out, "--bake", "32", *more)
        self.assertIsNone(json.loads((out / "answer.json").read_text())["error"])
        return contents(out)

    def cached(self):
        return self.export("--cache", str(self.cache))

    def kept(self):
        """The files in the cache, by name."""
        return {path.name: path.stat().st_ino for path in self.cache.iterdir()}

    def test_cache_hits(self):
        make_scene(self.folder / "scene.blend")
        expected = self.export()
        self.assertEqual(self.cached(), expected)
        first = self.kept()
        self.assertEqual(len(first), 1)
        self.assertTrue(all(name.endswith(".oscura") and len(name) == 39 for name in first))
        self.assertEqual(self.cached(), expected)
        self.assertEqual(self.kept(), first, "nothing was made again")
        # The image is copied unchanged.
        self.assertIn((self.folder / "scene.png").read_bytes(), expected.values())

    def test_cache_misses(self):
        for change in ({}, {"grey": 0.25}, {"height": 0.5}):
            make_scene(self.folder / "scene.blend", **change)
            before = len(self.kept()) if self.cache.exists() else 0
            self.assertEqual(self.cached(), self.export())
            self.assertEqual(len(self.kept()), before + 1, change)

    def test_damaged_cache_files(self):
        make_scene(self.folder / "scene.blend")
        expected = self.cached()
        for path in self.cache.iterdir():
            path.write_bytes(path.read_bytes()[:100])
        self.assertEqual(self.cached(), expected)
        self.assertTrue(all(path.stat().st_size > 100 for path in self.cache.iterdir()))

    def test_unwritable_cache(self):
        make_scene(self.folder / "scene.blend")
        self.cache.write_text("no folder")
        self.assertEqual(self.cached(), self.export())


if __name__ == "__main__":
    main()
