"""Tests the render engine in Blender without a window.

    python test_engine.py            with a Python that has bpy; OSCURA names the program

Builds the extension as Blender does, installs it where it disturbs nobody, and renders.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import unittest
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent

# Blender looks here for what a user has installed.
USER = tempfile.mkdtemp(prefix="oscura-test-")
os.environ["BLENDER_USER_RESOURCES"] = USER

import bpy  # noqa: E402  (it reads the variable)
import numpy as np  # noqa: E402

from testing import PROGRAM  # noqa: E402

MODULE = "bl_ext.user_default.oscura"
SAMPLES, DEPTH = 7, 5


def extension_command(*arguments):
    """The module behind `blender --command extension`."""
    tool = Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core/bl_pkg/cli/blender_ext.py"
    return subprocess.run([sys.executable, str(tool), *map(str, arguments)], capture_output=True, text=True)


def build(folder):
    """Builds the extension."""
    package = Path(folder) / "oscura.zip"
    done = extension_command("build", "--source-dir", HERE / "engine", "--output-filepath", package)
    assert done.returncode == 0, done.stdout + done.stderr
    return package


def make_scene():
    """A plane, a light and a mirror ball for this render engine."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=MODULE)
    bpy.context.preferences.addons[MODULE].preferences.program = PROGRAM
    bpy.context.preferences.addons[MODULE].preferences.use_cache = False
    scene = bpy.context.scene
    scene.render.engine = "OSCURA"
    scene.render.resolution_x, scene.render.resolution_y = 48, 36
    scene.oscura.samples, scene.oscura.depth = SAMPLES, DEPTH
    bpy.ops.mesh.primitive_plane_add(size=6)
    bpy.ops.mesh.primitive_uv_sphere_add(location=(0, 0, 1))
    lamp = bpy.data.lights.new("Panel", "AREA")
    lamp.energy = 200
    link("Panel", lamp, (1, -1, 4))
    scene.camera = link("Eye", bpy.data.cameras.new("Eye"), (0, -6, 1.5))
    scene.camera.rotation_euler = (1.45, 0, 0)
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.1, 0.1, 0.1)
    return scene


def link(name, data, location):
    made = bpy.data.objects.new(name, data)
    made.location = location
    bpy.context.scene.collection.objects.link(made)
    return made


class EngineTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = Path(tempfile.mkdtemp(prefix="oscura-test-"))
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.ops.preferences.addon_enable(module="bl_pkg")
        cls.package = package = build(cls.folder)
        bpy.ops.extensions.package_install_files(filepath=str(package), repo="user_default", enable_on_install=True)
        cls.engine = sys.modules[f"{MODULE}.engine"]
        cls.exr = sys.modules[f"{MODULE}.exr"]
        cls.mattes = sys.modules[f"{MODULE}.mattes"]

    @classmethod
    def tearDownClass(cls):
        bpy.ops.preferences.addon_disable(module=MODULE)
        shutil.rmtree(cls.folder)
        shutil.rmtree(USER, ignore_errors=True)

    def setUp(self):
        self.scene = make_scene()
        self.filled = []
        fill = self.engine._fill
        self.addCleanup(setattr, self.engine, "_fill", fill)

        def noted(result, picture):
            fill(result, picture)
            entries = [p for p in result.layers[0].passes]
            self.filled.append({p.name: np.array(p.rect[:], np.float32).reshape(-1, p.channels) for p in entries})

        self.engine._fill = noted

    def command_line(self, *more):
        """The channels that the program renders from the saved file."""
        blend = self.folder / "scene.blend"
        picture = self.folder / ("####.exr" if "--frames" in more else "picture.exr")
        bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True)
        command = [PROGRAM, "render", str(blend), "-o", str(picture), "--float", "--blender", sys.executable, "--no-cache"]
        subprocess.run([*command, *more], check=True, capture_output=True)
        return self.exr.read(self.folder / "0002.exr" if "--frames" in more else picture)

    def test_extension_package(self):
        for path in (self.package, HERE / "engine"):
            done = extension_command("validate", path)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        with zipfile.ZipFile(self.package) as package:
            packed = set(package.namelist())
            self.assertEqual(packed, {p.name for p in (HERE / "engine").iterdir() if p.is_file()})
        # The validation reports problems.
        broken = self.folder / "broken"
        shutil.copytree(HERE / "engine", broken, ignore=shutil.ignore_patterns("__pycache__"))
        manifest = broken / "blender_manifest.toml"
        manifest.write_text(manifest.read_text().replace('blender_version_min = "4.2.0"', ""))
        self.assertNotEqual(extension_command("validate", broken).returncode, 0)

    def test_picture_equals_command_line(self):
        layer = self.scene.view_layers[0]
        layer.oscura.use_depth = layer.oscura.use_normal = layer.oscura.use_albedo = True
        bpy.ops.render.render()
        expected = self.command_line("--aov", "depth,normal,albedo")
        passes = self.filled[-1]
        self.assertEqual(set(passes), {"Combined", "Depth", "Normal", "Albedo"})
        for k, letter in enumerate("RGBA"):
            np.testing.assert_array_equal(passes["Combined"][:, k], expected[letter].ravel())
        self.assertGreater(passes["Combined"].std(), 0.05)
        np.testing.assert_array_equal(passes["Depth"][:, 0], expected["Z"].ravel())
        # The plane's normal is z in Blender.
        self.assertGreater(passes["Normal"][: 48 * 4, 2].mean(), 0.99)
        # The passes are in the render result.
        written = self.exr.read(self.saved_layers())
        for name, k in (("Combined.R", 0), ("Combined.B", 2), ("Depth.Z", 0), ("Normal.Z", 2), ("Albedo.G", 1)):
            ours = passes[name.split(".")[0]][:, k]
            np.testing.assert_array_equal(written[f"{layer.name}.{name}"].ravel(), ours)
        # The compositing node has the same.
        tree = bpy.data.scenes.new("compositing")
        tree.use_nodes = True
        nodes = getattr(tree, "node_tree", None) or bpy.data.node_groups.new("compositing", "CompositorNodeTree")
        node = nodes.nodes.new("CompositorNodeRLayers")
        node.scene = self.scene
        outputs = {socket.name for socket in node.outputs if socket.enabled}
        self.assertLessEqual({"Image", "Depth", "Normal", "Albedo"}, outputs)

    def test_passes_equal_command_line_and_add_up(self):
        layer = self.scene.view_layers[0]
        table = sys.modules[f"{MODULE}.passes"].TABLE
        for entry in table:
            setattr(layer.oscura, f"use_{entry.option}", True)
        bpy.ops.render.render()
        expected = self.command_line("--aov", ",".join(entry.option for entry in table))
        filled = self.filled[-1]
        self.assertEqual(set(filled), {"Combined", *(entry.name for entry in table)})
        for entry in table:
            if not entry.is_vector:
                for k, channel in enumerate(entry.channels):
                    np.testing.assert_array_equal(filled[entry.name][:, k], expected[channel].ravel(), channel)
        light = ("DiffDir", "DiffInd", "GlossDir", "GlossInd", "TransDir", "TransInd", "Emit", "Env")
        np.testing.assert_allclose(sum(filled[name] for name in light), filled["Combined"][:, :3], rtol=1e-5, atol=1e-6)
        self.assertTrue(all(filled[name].any() for name in ("DiffDir", "DiffInd", "DiffCol", "Env")))

    def test_cryptomatte_node(self):
        layer = self.scene.view_layers[0]
        layer.use_pass_cryptomatte_object, layer.pass_cryptomatte_depth = True, 4
        self.composite_matte("Sphere")
        bpy.ops.render.render()
        expected = self.command_line("--aov", "crypto_object", "--crypto-levels", "4")
        self.assertEqual(set(self.filled[-1]), {"Combined", "CryptoObject00", "CryptoObject01"})
        wanted = np.array([self.mattes.hashed(b"Sphere")], np.uint32).view(np.float32)[0]
        pairs = [(f"CryptoObject{k:02}.{id_name}", f"CryptoObject{k:02}.{share}") for k in (0, 1) for id_name, share in ("RG", "BA")]
        truth = sum(np.where(expected[ids] == wanted, expected[share], 0) for ids, share in pairs)
        self.assertGreater(truth.max(), 0.99)
        self.assertTrue(((truth > 0.1) & (truth < 0.9)).any())
        (written,) = self.folder.glob("matte*.exr")
        np.testing.assert_allclose(next(iter(self.exr.read(written).values())), truth, atol=1e-6)
        texts = self.exr.header_strings(self.saved_layers())
        key = f"cryptomatte/{self.mattes.key_of(f'{layer.name}.CryptoObject')}"
        self.assertEqual(texts[f"{key}/name"], f"{layer.name}.CryptoObject")
        self.assertIn('"Sphere":"%08x"' % self.mattes.hashed(b"Sphere"), texts[f"{key}/manifest"])

    def composite_matte(self, name):
        """Renders a matte by Blender's Cryptomatte node."""
        if bpy.app.version >= (5, 0, 0):
            tree = self.scene.compositing_node_group = bpy.data.node_groups.new("mattes", "CompositorNodeTree")
        else:
            self.scene.use_nodes = True
            tree = self.scene.node_tree
            tree.nodes.clear()
        node = tree.nodes.new("CompositorNodeCryptomatteV2")
        node.source, node.scene = "RENDER", self.scene
        node.layer_name, node.matte_id = f"{self.scene.view_layers[0].name}.CryptoObject", name
        picture = tree.nodes.new("CompositorNodeRLayers")
        picture.scene = self.scene
        tree.links.new(picture.outputs["Image"], node.inputs["Image"])
        file = tree.nodes.new("CompositorNodeOutputFile")
        if bpy.app.version >= (5, 0, 0):
            file.directory, file.file_name = str(self.folder), "matte"
            file.format.media_type = "MULTI_LAYER_IMAGE"
            file.file_output_items.clear()
            file.file_output_items.new("FLOAT", "matte")
        else:
            file.base_path = str(self.folder / "matte")
        file.format.file_format = "OPEN_EXR_MULTILAYER"
        file.format.color_depth, file.format.exr_codec = "32", "ZIP"
        if bpy.app.version < (5, 0, 0):
            file.layer_slots.clear()
            file.layer_slots.new("matte")
        tree.links.new(node.outputs["Matte"], file.inputs["matte"])

    def saved_layers(self):
        """The render result as a file of all its layers."""
        saved = self.folder / "layers.exr"
        image = self.scene.render.image_settings
        if hasattr(image, "media_type"):
            image.media_type = "MULTI_LAYER_IMAGE"
        image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"
        if hasattr(image, "use_exr_interleave"):
            image.use_exr_interleave = True
        bpy.data.images["Render Result"].save_render(str(saved))
        return saved

    def test_settings(self):
        self.scene.oscura.seed = 3
        first = self.command_line("--aov", "samples")
        self.assertEqual(set(first["samples"].ravel()), {SAMPLES})
        self.scene.oscura.seed = 4
        self.assertTrue((first["R"] != self.command_line()["R"]).any())

    def test_noise_denoising_and_passes(self):
        settings = self.scene.oscura
        settings.samples, settings.noise = 512, 20.0
        self.scene.view_layers[0].oscura.use_samples = True
        rough = self.command_line()
        self.assertLess(rough["samples"].mean(), 512)
        bpy.ops.render.render()
        np.testing.assert_array_equal(self.filled[-1]["Combined"][:, 0], rough["R"].ravel())
        settings.denoise = True
        smooth = self.command_line()
        noise = lambda picture: np.abs(np.diff(picture["G"], axis=1)).mean()
        self.assertLess(noise(smooth), noise(rough))
        np.testing.assert_array_equal(self.command_line("--no-denoise")["R"], rough["R"])

    def test_render_region(self):
        render = self.scene.render
        render.use_border = True
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.5, 1.0
        bpy.ops.render.render()
        expected = self.command_line()["G"]
        self.assertEqual(expected.shape, (18, 24))
        np.testing.assert_array_equal(self.filled[-1]["Combined"][:, 1], expected.ravel())

    def test_view_layers(self):
        ball = bpy.data.objects["Sphere"]
        aside = bpy.data.collections.new("aside")
        self.scene.collection.children.link(aside)
        self.scene.collection.objects.unlink(ball)
        aside.objects.link(ball)
        second = self.scene.view_layers.new("Second")
        second.layer_collection.children["aside"].exclude = True
        self.scene.oscura.refresh = 1000
        bpy.ops.render.render()
        # Updates may repeat a finished picture.
        with_ball, without = (self.filled[k]["Combined"][:, 0] for k in (0, -1))
        self.assertTrue((with_ball != without).any())
        np.testing.assert_array_equal(without, self.command_line("--view-layer", "Second")["R"].ravel())

    def test_export_operator(self):
        folder = self.folder / "exported"
        bpy.ops.export_scene.oscura(directory=str(folder))
        self.assertEqual({path.name for path in folder.iterdir()}, {"scene.mesh0.ply", "scene.mesh1.ply", "scene.toml", "scene.view"})
        with self.assertRaisesRegex(RuntimeError, "not empty"):
            bpy.ops.export_scene.oscura(directory=str(folder))
        bpy.ops.export_scene.oscura(directory=str(folder), use_replace=True)

    def test_cancel(self):
        self.scene.oscura.samples, self.scene.oscura.refresh = 1_000_000, 0.2
        engine = self.engine.Engine
        plain = engine.is_cancelled
        # After the first pictures and messages.
        engine.is_cancelled = lambda _: len(self.filled) >= 2 and children[0].status
        children = []
        start = self.engine.program.Process
        self.engine.program.Process = lambda command: children.append(start(command)) or children[-1]
        try:
            bpy.ops.render.render()
        finally:
            engine.is_cancelled = plain
            self.engine.program.Process = start
        self.assertIsNotNone(children[0].process.returncode)
        self.assertGreaterEqual(len(self.filled), 3)
        self.assertGreater(self.filled[-1]["Combined"][:, :3].mean(), 0.01)

    def test_error_messages(self):
        bpy.context.preferences.addons[MODULE].preferences.program = "/nowhere/oscura"
        with self.assertRaisesRegex(RuntimeError, "there is no program /nowhere/oscura"):
            bpy.ops.render.render()
        bpy.context.preferences.addons[MODULE].preferences.program = PROGRAM
        self.scene.camera.scale = (0, 0, 0)
        with self.assertRaisesRegex(RuntimeError, "camera 'Eye'"):
            bpy.ops.render.render()

    def test_animation(self):
        ball = bpy.data.objects["Sphere"]
        for frame, place in ((1, 0.0), (2, 1.0)):
            ball.location.x = place
            ball.keyframe_insert("location", frame=frame)
        self.scene.frame_start, self.scene.frame_end = 1, 2
        self.scene.oscura.refresh = 1000
        self.scene.render.filepath = str(self.folder / "frame.")
        bpy.ops.render.render(animation=True)
        self.assertTrue((self.filled[0]["Combined"] != self.filled[-1]["Combined"]).any())
        np.testing.assert_array_equal(self.filled[-1]["Combined"][:, 0], self.command_line("--frames", "2")["R"].ravel())


if __name__ == "__main__":
    from testing import main

    main()
