"""Tries what the exporter writes of glass, black bodies and groups of lights, of trees that ask about objects, sides and rays,
of media, motion and settings, and what it keeps for the next time.

    python test_export.py            with a Python that has bpy
"""

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

import bmesh  # isort: skip (bpy puts it on the path)

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from oscura_blender.glb import Glb  # noqa: E402  (the path comes first)


def make_scene(path, grey=0.5, height=0.0):
    """Two grids of many corners: one of noise, which is baked, one with a picture; vertex colours on both."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    picture = bpy.data.images.new("picture", 64, 64)
    picture.pixels[:] = np.random.default_rng(1).random(64 * 64 * 4).tolist()
    picture.filepath_raw, picture.file_format = str(path.with_suffix(".png")), "PNG"
    picture.save()
    for kind in ("ShaderNodeTexNoise", "ShaderNodeTexImage"):
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


def contents(glb):
    """The model without its layout: JSON, and the bytes of each view."""
    views = [(view.pop("byteOffset", 0), view.pop("byteLength")) for view in glb.json["bufferViews"]]
    del glb.json["buffers"]
    return glb.json, [bytes(glb.binary[start : start + length]) for start, length in views]


def make_glass(path):
    """A ball of glass that absorbs, and a lamp with a black body's colour, both in groups of lights."""
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
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def run_exporter(scene, out, *more):
    """The model that comes of a scene's file, in a folder."""
    command = [sys.executable, str(HERE / "export.py"), "--", str(scene), str(out), "scene", str(out / "answer.json"), *more]
    subprocess.run(command, check=True, capture_output=True)
    return Glb(out / "scene.glb")


class GlassTest(unittest.TestCase):
    def test_absorption_black_bodies_and_groups(self):
        with tempfile.TemporaryDirectory(prefix="oscura-test-") as folder:
            folder = Path(folder)
            make_glass(folder / "scene.blend")
            model = run_exporter(folder / "scene.blend", folder).json
            (material,) = model["materials"]
            volume = material["extensions"]["KHR_materials_volume"]
            # Of each metre: the density times what the colour lacks.
            absorbed = -np.log(volume["attenuationColor"]) / volume["attenuationDistance"]
            np.testing.assert_allclose(absorbed, [0.0, 2.0, 3.0], rtol=1e-5)
            np.testing.assert_allclose(material["pbrMetallicRoughness"]["baseColorFactor"][:3], [0.5, 1, 1], rtol=1e-5)
            self.assertIn({"light_group": "balls_here"}, [node.get("extras") for node in model["nodes"]])
            (settings,) = folder.glob("*.toml")
            (lamp,) = tomllib.loads(settings.read_text())["lights"]
            self.assertEqual(lamp["group"], "key")
            red, green, blue = lamp["color"]
            self.assertTrue(red > 2 * green > 4 * blue, lamp["color"])


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
        eye = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
        eye.location = (0, 0, 8)
        self.scene.collection.objects.link(eye)
        self.scene.camera = eye

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


class TreesTest(SceneTest):
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

    def test_objects_of_one_mesh_have_their_own_colours_without_pictures(self):
        material, tree, shader, info = shader_tree("own", "ObjectInfo")
        tree.links.new(info.outputs["Color"], shader.inputs["Base Color"])
        colors = [(0.25, 0.5, 0.75), (0.5, 0.125, 0.0)]
        data = None
        for k, color in enumerate(colors):
            made = self.add_plane(material, f"Plane {k}", (3 * k, 0, 0), data)
            data, made.color = made.data, (*color, 1)
        model, _, answer = self.export()
        self.assertNotIn("images", model)
        found = {}
        for node in model["nodes"]:
            if "mesh" in node:
                number = model["meshes"][node["mesh"]]["primitives"][0]["material"]
                found[node["name"]] = model["materials"][number]["pbrMetallicRoughness"]["baseColorFactor"][:3]
        np.testing.assert_allclose([found["Plane 0"], found["Plane 1"]], colors, atol=1e-6)
        self.assertEqual(answer["warnings"], [])

    def test_attributes_of_objects_are_read_by_name(self):
        material, tree, shader, own = shader_tree("own", "Attribute")
        own.attribute_type, own.attribute_name = "OBJECT", "polish"
        tree.links.new(next(out for out in own.outputs if out.identifier == "Fac"), shader.inputs["Roughness"])
        self.add_plane(material)["polish"] = 0.375
        model, _, _ = self.export()
        (made,) = model["materials"]
        self.assertAlmostEqual(made["pbrMetallicRoughness"]["roughnessFactor"], 0.375, places=6)

    def test_sides_become_faces_that_lie_back_to_back(self):
        material, tree, shader, side, mix = shader_tree("sides", "NewGeometry", "Mix")
        mix.data_type = "RGBA"
        mix.inputs[6].default_value, mix.inputs[7].default_value = (1, 0, 0, 1), (0, 0, 1, 1)
        tree.links.new(side.outputs["Backfacing"], mix.inputs[0])
        tree.links.new(mix.outputs[2], shader.inputs["Base Color"])
        self.add_plane(material)
        model, _, _ = self.export()
        (mesh,) = model["meshes"]
        found = {}
        for primitive in mesh["primitives"]:
            made = model["materials"][primitive["material"]]
            self.assertFalse(made.get("doubleSided", False))
            found[tuple(made["pbrMetallicRoughness"]["baseColorFactor"][:3])] = primitive["attributes"]["NORMAL"]
        self.assertEqual(set(found), {(1, 0, 0), (0, 0, 1)})

    def test_kinds_of_rays_see_their_own_materials(self):
        material, tree, shader, path, strength = shader_tree("lamp", "LightPath", "Math")
        shader.inputs["Emission Color"].default_value = (1, 1, 1, 1)
        strength.operation, strength.inputs[1].default_value = "MULTIPLY", 3.0
        tree.links.new(path.outputs["Is Camera Ray"], strength.inputs[0])
        tree.links.new(strength.outputs[0], shader.inputs["Emission Strength"])
        self.add_plane(material)
        model, settings, answer = self.export()
        by_name = {made["name"]: made for made in model["materials"]}
        rays = {tuple(entry["visible_to"]): by_name[name] for name, entry in settings["materials"].items()}
        shines = {seen: "emissiveFactor" in made for seen, made in rays.items()}
        self.assertEqual(shines, {("camera",): True, ("diffuse", "glossy", "transmission", "volume", "shadow"): False})
        self.assertEqual(answer["warnings"], [])

    def test_of_three_looks_by_rays_two_are_kept(self):
        material, tree, shader, path, both = shader_tree("three", "LightPath", "CombineColor")
        tree.links.new(path.outputs["Is Camera Ray"], both.inputs[0])
        tree.links.new(path.outputs["Is Diffuse Ray"], both.inputs[1])
        tree.links.new(both.outputs[0], shader.inputs["Base Color"])
        self.add_plane(material)
        _, settings, answer = self.export()
        seen = {tuple(entry["visible_to"]) for entry in settings["materials"].values()}
        self.assertEqual(seen, {("camera",), ("diffuse", "glossy", "transmission", "volume", "shadow")})
        self.assertEqual(answer["warnings"][0][0], "three")

    def test_what_differs_with_the_direction_is_said_by_name(self):
        material, tree, shader, weight, noise, step = shader_tree("velvet", "LayerWeight", "TexNoise", "Math")
        noise.inputs["Scale"].default_value, step.operation = 20, "GREATER_THAN"
        tree.links.new(weight.outputs["Facing"], step.inputs[0])
        tree.links.new(noise.outputs[0], step.inputs[1])
        tree.links.new(step.outputs[0], shader.inputs["Base Color"])
        self.add_plane(material)
        _, _, answer = self.export("--bake", "64")
        ((place, message),) = answer["warnings"]
        self.assertEqual(place, "velvet")
        self.assertIn("Layer Weight", message)

    def test_what_differs_with_the_angle_of_view_alone_becomes_a_table(self):
        material, tree, shader, weight, gain, mix = shader_tree("velvet", "LayerWeight", "Math", "MixRGB")
        weight.inputs["Blend"].default_value = 0.25
        mix.inputs["Color1"].default_value, mix.inputs["Color2"].default_value = (1, 0.5, 0, 1), (0, 0.5, 1, 1)
        tree.links.new(weight.outputs["Facing"], mix.inputs["Fac"])
        tree.links.new(mix.outputs[0], shader.inputs["Base Color"])
        gain.operation, gain.inputs[1].default_value = "MULTIPLY", 6.0
        shader.inputs["Emission Color"].default_value = (1, 0.5, 0.25, 1)
        tree.links.new(weight.outputs["Facing"], gain.inputs[0])
        tree.links.new(gain.outputs[0], shader.inputs["Emission Strength"])
        self.add_plane(material)
        model, settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        self.assertNotIn("images", model)
        told = settings["materials"]["velvet"]
        tables = {key: settings["textures"][told[key]] for key in ("base_color", "emission")}
        self.assertEqual({table["type"] for table in tables.values()}, {"facing"})
        # By a blend of 0.25 facing is 1 - cos^0.5; rows are evenly spaced cosines.
        facing = 1 - np.linspace(0, 1, len(tables["base_color"]["colors"])) ** 0.5
        color = np.stack([1 - facing, 0 * facing + 0.5, facing], 1)
        np.testing.assert_allclose(tables["base_color"]["colors"], color, atol=2e-5)
        np.testing.assert_allclose(tables["emission"]["colors"], 6 * facing[:, None] * [1, 0.5, 0.25], atol=1e-4)

    def test_what_the_angle_of_view_mixes_from_place_to_place_becomes_two_pictures_and_a_table(self):
        material, tree, shader, weight, checker, mix, times, gain = shader_tree(
            "cloth", "LayerWeight", "TexChecker", "MixRGB", "MixRGB", "Math"
        )
        weight.inputs["Blend"].default_value = 0.25
        checker.inputs["Scale"].default_value = 1.5
        checker.inputs["Color1"].default_value, checker.inputs["Color2"].default_value = (1, 0.25, 0, 1), (0.5, 0.5, 0, 1)
        mix.inputs["Color2"].default_value = (0, 0.5, 1, 1)
        tree.links.new(weight.outputs["Facing"], mix.inputs["Fac"])
        tree.links.new(checker.outputs["Color"], mix.inputs["Color1"])
        tree.links.new(mix.outputs[0], shader.inputs["Base Color"])
        gain.operation, gain.inputs[1].default_value = "MULTIPLY", 6.0
        tree.links.new(weight.outputs["Facing"], gain.inputs[0])
        tree.links.new(gain.outputs[0], shader.inputs["Emission Strength"])
        tree.links.new(checker.outputs["Color"], shader.inputs["Emission Color"])
        self.add_plane(material)
        model, settings, answer = self.export("--bake", "64")
        self.assertEqual(answer["warnings"], [])
        facing = 1 - np.linspace(0, 1, 64) ** 0.5
        (told,), textures = settings["materials"].values(), settings["textures"]
        for key in ("base_color", "emission"):
            mixed = textures[told[key]]
            self.assertEqual((mixed["type"], textures[mixed["a"]]["type"]), ("mix", "own"))
            table = np.array(textures[mixed["factor"]]["colors"])
            # Where the first colour has nothing to become, no share is told.
            known = np.ptp(table, axis=0) > 0
            self.assertTrue(known.any())
            np.testing.assert_allclose(table[:, known], np.repeat(facing[:, None], known.sum(), 1), atol=2e-3)
        second = textures[textures[told["base_color"]]["b"]]
        self.assertEqual((second["mapping"], second["encoding"]), ("own", "srgb"))
        pixels = self.pixels(str(self.folder / second["file"]))
        quarter, half = 0.5371, 0.7354  # as sRGB has them
        self.assertLess(np.abs(pixels[8:-8, 8:-8, :3] - [0, half, 1]).max(), 0.01)
        first = self.pixels(self.picture(model, model["materials"][0]))
        for color in ((1, quarter, 0), (half, half, 0)):
            share = (np.abs(first[..., :3] - color).max(-1) < 0.02).mean()
            self.assertGreater(share, 0.2, color)

    def test_materials_beside_one_that_is_mixed_keep_their_pictures(self):
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=2, y_subdivisions=2)
        shown = bpy.context.object
        for name in ("mixed", "plain"):
            made, tree, shader, weight, checker, mix = shader_tree(name, "LayerWeight", "TexChecker", "MixRGB")
            checker.inputs["Scale"].default_value = 3.0
            checker.inputs["Color1"].default_value, checker.inputs["Color2"].default_value = (1, 0, 0, 1), (0, 0, 1, 1)
            mix.inputs["Fac"].default_value, mix.inputs["Color2"].default_value = 0.0, (0, 1, 0, 1)
            if name == "mixed":
                tree.links.new(weight.outputs["Facing"], mix.inputs["Fac"])
            tree.links.new(checker.outputs["Color"], mix.inputs["Color1"])
            tree.links.new(mix.outputs[0], shader.inputs["Base Color"])
            shown.data.materials.append(made)
        shown.data.polygons.foreach_set("material_index", [0, 0, 1, 1])
        model, settings, answer = self.export("--bake", "64")
        self.assertEqual(answer["warnings"], [])
        ((name, told),) = settings["materials"].items()
        self.assertTrue(name.startswith("mixed"), name)
        second = settings["textures"][settings["textures"][told["base_color"]]["b"]]
        pictures = [self.pixels(path) for path in (self.picture(model, model["materials"][0]), str(self.folder / second["file"]))]
        share = lambda pixels, color: (np.abs(pixels[..., :3] - color).max(-1) < 0.02).mean()
        # Half of the mesh becomes green.
        self.assertEqual(share(pictures[0], (0, 1, 0)), 0)
        self.assertTrue(0.25 < share(pictures[1], (0, 1, 0)) < 0.6)
        self.assertGreater(share(pictures[0], (1, 0, 0)), 1.5 * share(pictures[1], (1, 0, 0)))
        self.assertGreater(share(pictures[1], (1, 0, 0)), 0.1)

    def test_the_cosine_of_view_and_normal_is_a_weight(self):
        material, tree, shader, geometry, dot = shader_tree("dotted", "NewGeometry", "VectorMath")
        dot.operation = "DOT_PRODUCT"
        tree.links.new(geometry.outputs["Normal"], dot.inputs[0])
        tree.links.new(geometry.outputs["Incoming"], dot.inputs[1])
        tree.links.new(dot.outputs["Value"], shader.inputs["Base Color"])
        self.add_plane(material)
        _, settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        table = settings["textures"][settings["materials"]["dotted"]["base_color"]]["colors"]
        np.testing.assert_allclose(table, np.linspace(0, 1, len(table)), atol=2e-5)

    def test_weights_with_normals_of_their_own_are_told(self):
        material, tree, shader, weight, bump = shader_tree("bumped", "LayerWeight", "Bump")
        tree.links.new(bump.outputs[0], weight.inputs["Normal"])
        tree.links.new(weight.outputs["Facing"], shader.inputs["Base Color"])
        self.add_plane(material)
        _, settings, answer = self.export()
        ((place, message),) = answer["warnings"]
        self.assertEqual((place, "normal of its own" in message), ("bumped", True))
        self.assertIn("base_color", settings["materials"]["bumped"])

    def test_transparency_of_trees_has_its_picture(self):
        material, tree, shader, checker = shader_tree("lace", "TexChecker")
        checker.inputs["Scale"].default_value = 2.0
        tree.links.new(checker.outputs["Fac"], shader.inputs["Alpha"])
        self.add_plane(material)
        model, _, _ = self.export("--bake", "64")
        alpha = self.pixels(self.picture(model, model["materials"][0]))[..., 3]
        for value in (0, 1):
            self.assertGreater((np.abs(alpha - value) < 0.02).mean(), 0.2, value)

    def test_pictures_of_files_may_be_links(self):
        material, tree, shader, node = shader_tree("label", "TexImage")
        picture = bpy.data.images.new("picture", 8, 8)
        picture.filepath_raw, picture.file_format = str(self.folder / "a picture.png"), "PNG"
        picture.save()
        node.image = bpy.data.images.load(picture.filepath_raw)
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        self.add_plane(material)
        (copied,) = self.export()[0]["images"]
        self.assertNotIn("uri", copied)
        (linked,) = self.export("--links")[0]["images"]
        self.assertEqual(linked, {"name": copied["name"], "uri": "picture.1.png"})
        self.assertEqual((self.folder / "picture.1.png").read_bytes(), (self.folder / "a picture.png").read_bytes())

    def test_light_of_trees_keeps_its_strength(self):
        material, tree, shader, checker, strength = shader_tree("screen", "TexChecker", "Math")
        checker.inputs["Color1"].default_value, checker.inputs["Color2"].default_value = (1, 1, 1, 1), (0, 0, 0, 1)
        strength.operation, strength.inputs[1].default_value = "MULTIPLY", 40.0
        shader.inputs["Emission Color"].default_value = (1, 0.5, 0.25, 1)
        tree.links.new(checker.outputs["Fac"], strength.inputs[0])
        tree.links.new(strength.outputs[0], shader.inputs["Emission Strength"])
        self.add_plane(material)
        model, _, _ = self.export("--bake", "64")
        (made,) = model["materials"]
        self.assertAlmostEqual(made["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 40, places=3)
        self.assertIn("emissiveTexture", made)

    def test_media_and_coats_reach_the_file_of_settings(self):
        haze, tree, shader, scatter = shader_tree("haze", "VolumeScatter")
        scatter.inputs["Color"].default_value, scatter.inputs["Density"].default_value = (0.5, 0.25, 1, 1), 2.0
        tree.links.new(scatter.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
        tree.nodes.remove(shader)
        wax, _, shader = shader_tree("wax")
        shader.inputs["Subsurface Weight"].default_value, shader.inputs["Subsurface Scale"].default_value = 1.0, 4 * np.pi
        shader.inputs["Subsurface Radius"].default_value = (0.5, 0.25, 0.125)
        leaf, tree, shader, through = shader_tree("leaf", "BsdfTranslucent")
        through.inputs["Color"].default_value = (0.25, 0.5, 0.125, 1)
        tree.links.new(through.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        for k, material in enumerate((haze, wax, leaf)):
            self.add_plane(material, location=(3 * k, 0, 0))
        model, settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        found = settings["materials"]
        self.assertEqual(found["haze"], {"type": "medium", "density": [1.0, 0.5, 2.0], "color": [1.0, 1.0, 1.0]})
        np.testing.assert_allclose(found["wax"]["subsurface"]["radius"], [0.5, 0.25, 0.125], rtol=1e-5)
        (leaf,) = (made for made in model["materials"] if made["name"] == "leaf")
        passing = leaf["extensions"]["KHR_materials_diffuse_transmission"]
        self.assertEqual(passing["diffuseTransmissionColorFactor"], [0.25, 0.5, 0.125])

    def test_displaced_vertices_stand_where_the_heights_say(self):
        material, tree, _, relief = shader_tree("relief", "Displacement")
        material.displacement_method = "DISPLACEMENT"
        for name, value in (("Height", 0.75), ("Midlevel", 0.5), ("Scale", 2.0)):
            relief.inputs[name].default_value = value
        tree.links.new(relief.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
        self.add_plane(material)
        model, _, _ = self.export()
        number = model["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
        self.assertAlmostEqual(model["accessors"][number]["max"][1], 0.5, places=6)

    def test_motion_of_objects_and_cameras_is_an_animation(self):
        moved = self.add_plane(None, "Moved")
        for thing, path in ((moved, (2, 0, 0)), (self.scene.camera, (0, 1, 8))):
            thing.keyframe_insert("location", frame=1)
            thing.location = path
            thing.keyframe_insert("location", frame=3)
        self.add_plane(None, "Still", (0, 4, 0))
        self.scene.frame_set(2)
        model, settings, answer = self.export()
        self.assertNotIn("animations", model)
        self.scene.render.use_motion_blur, self.scene.render.motion_blur_shutter = True, 0.25
        model, settings, answer = self.export()
        (animation,) = model["animations"]
        names = {model["nodes"][channel["target"]["node"]]["name"] for channel in animation["channels"]}
        self.assertEqual(names, {"Moved", "Eye"})
        self.assertEqual(settings["camera"][0]["shutter"], 0.25)
        times = model["accessors"][animation["samplers"][0]["input"]]
        self.assertEqual(times["count"], 3)
        self.assertAlmostEqual(times["max"][0] - answer["moment"], 0.125 / answer["fps"], places=6)
        self.assertNotIn("animations", self.export("--shutter", "0")[0])

    def test_settings_of_the_scene(self):
        view, render, cycles = self.scene.view_settings, self.scene.render, self.scene.cycles
        view.view_transform, view.exposure = "AgX", 1.5
        cycles.samples, cycles.use_adaptive_sampling, cycles.adaptive_threshold = 300, True, 0.02
        cycles.use_denoising, cycles.film_exposure = True, 2.0
        render.resolution_x, render.resolution_y, render.use_border = 200, 100, True
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.5, 0.1, 0.6
        layer = self.scene.view_layers[0]
        layer.use_pass_z = layer.use_pass_cryptomatte_object = layer.use_pass_mist = True
        lamp = bpy.data.lights.new("lamp", "POINT")
        lamp.energy = 10
        self.scene.collection.objects.link(bpy.data.objects.new("lamp", lamp))
        _, settings, answer = self.export()
        found = settings["render"]
        # What Blender shows of middle grey by AgX.
        self.assertAlmostEqual(self.shown(found["view"], 0.18), 0.4613, places=3)
        self.assertEqual((found["exposure"], found["samples"], found["denoise"]), (1.5, 300, True))
        self.assertAlmostEqual(found["noise"], 4.0, places=4)
        self.assertEqual(found["crop"], [50, 40, 100, 90])
        self.assertEqual(found["aovs"], ["depth", "crypto_object"])
        self.assertEqual(settings["lights"][0]["point"]["power"], 20.0)
        self.assertIn("Mist", answer["warnings"][0][1])


    def shown(self, table, grey):
        """What a table shows of a grey."""
        lines = (self.folder / table).read_text().split("\n")
        knots, values = ([float(word) for word in line.split()] for line in lines[8:10])
        nodes = int(lines[17].split()[0])
        place = np.interp(grey, knots, values) * (nodes - 1)
        greys = [float(lines[18 + k * (1 + nodes + nodes * nodes)].split()[1]) for k in range(nodes)]
        return np.interp(place, range(nodes), greys)

    def test_views_with_looks_and_curves_are_tables(self):
        view = self.scene.view_settings
        view.view_transform, view.look, view.exposure = "AgX", "AgX - Punchy", 1.0
        _, settings, answer = self.export()
        self.assertEqual(settings["render"]["exposure"], 1.0)
        self.assertAlmostEqual(self.shown(settings["render"]["view"], 0.18), 0.3463, places=3)
        self.assertFalse([message for _, message in answer["warnings"] + answer["notes"] if "view" in message])
        # Curves come before the exposure, so that both are part of the table: twice the half of white.
        view.view_transform, view.look, view.use_curve_mapping = "Standard", "None", True
        curve = view.curve_mapping.curves[3]
        curve.points[1].location = (1.0, 0.5)
        view.curve_mapping.update()
        found = self.export()[1]["render"]
        self.assertNotIn("exposure", found)
        self.assertAlmostEqual(self.shown(found["view"], 1.0), 1.0, places=2)
        self.assertAlmostEqual(self.shown(found["view"], 0.25), 0.5371, places=2)
        view.use_curve_mapping = False
        self.assertEqual(self.export()[1]["render"]["view"], "srgb")


    def strands(self, entry):
        """Points of a file of strands, how many each has, and their radii."""
        data = (self.folder / entry["file"]).read_bytes()
        count, points, arrays = np.frombuffer(data, "<u4", 3, 4)
        self.assertEqual((data[:4], arrays), (b"HAIR", 7))
        counts = np.frombuffer(data, "<u2", count, 128) + 1
        start = 128 + 2 * count
        placed = np.frombuffer(data, "<f4", 3 * points, start).reshape(-1, 3)
        radii = np.frombuffer(data, "<f4", points, start + 12 * points) / 2
        self.assertEqual((counts.sum(), len(data)), (points, start + 16 * points))
        return placed, counts, radii

    def test_hair_becomes_strands(self):
        made = bpy.data.hair_curves.new("Curves")
        made.add_curves([3, 2])
        points = [(0, 0, 0), (0, 0, 1), (0, 1, 1), (1, 0, 0), (1, 0, 2)]
        made.position_data.foreach_set("vector", np.array(points, np.float32).ravel())
        (made.attributes.get("radius") or made.attributes.new("radius", "FLOAT", "POINT")).data.foreach_set("value", [0.5, 0.25, 0, 1, 2])
        fibre, _, node, *_ = shader_tree("fibre", "BsdfHairPrincipled")
        node = fibre.node_tree.nodes["Principled Hair BSDF"]
        fibre.node_tree.links.new(node.outputs[0], fibre.node_tree.nodes["Material Output"].inputs["Surface"])
        node.parametrization = "MELANIN"
        node.inputs["Melanin"].default_value = 0.25
        made.materials.append(fibre)
        placed = bpy.data.objects.new("Reed", made)
        placed.location, placed.scale = (10, 0, 0), (2, 2, 2)
        placed.visible_shadow = False
        self.scene.collection.objects.link(placed)
        bpy.ops.mesh.primitive_uv_sphere_add(radius=1)
        body = bpy.context.object
        body.data.materials.append(bpy.data.materials.new("skin"))
        body.data.materials.append(fibre)
        system = body.modifiers.new("Fur", "PARTICLE_SYSTEM").particle_system
        system.settings.type, system.settings.count, system.settings.hair_length = "HAIR", 20, 0.5
        system.settings.render_step, system.settings.material = 2, 2
        system.settings.root_radius, system.settings.tip_radius, system.settings.radius_scale = 1, 0.5, 0.1
        model, settings, answer = self.export()
        by_name = {entry["name"]: entry for entry in settings["curves"]}
        reed, fur = by_name["Reed"], by_name["Sphere/Fur"]
        self.assertEqual(settings["materials"][reed["material"]]["melanin"], 0.25)
        self.assertEqual(fur["material"], reed["material"])
        self.assertNotIn("shadow", reed["visible_to"])
        points, counts, radii = self.strands(reed)
        np.testing.assert_allclose(points, [(10, 0, 0), (10, 2, 0), (10, 2, -2), (12, 0, 0), (12, 4, 0)], atol=1e-6)
        self.assertEqual((counts.tolist(), radii.tolist()), ([3, 2], [1, 0.5, 0, 2, 4]))
        points, counts, radii = self.strands(fur)
        self.assertEqual(counts.tolist(), [5] * 20)
        roots, tips = points[::5], points[4::5]
        np.testing.assert_allclose(np.linalg.norm(roots, axis=1), 1, atol=0.03)
        np.testing.assert_allclose(np.linalg.norm(tips - roots, axis=1), 0.5, rtol=0.05)
        np.testing.assert_allclose(radii[:5], [0.05, 0.04375, 0.0375, 0.03125, 0], rtol=1e-5)
        self.assertEqual([material["name"] for material in model["materials"]], ["skin"])
        self.assertFalse(answer["warnings"])

    def test_profiles_of_lamps_and_the_reach_of_cameras(self):
        profile = "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 2 1 1 2 0 0 0 1 1 10\n0 90\n0\n100 0\n"
        (self.folder / "lamp.ies").write_text(profile)
        lamp = bpy.data.lights.new("lamp", "POINT")
        lamp.energy, lamp.shadow_soft_size, lamp.use_nodes = 2.0, 0.1, True
        tree = lamp.node_tree
        node, factor = tree.nodes.new("ShaderNodeTexIES"), tree.nodes.new("ShaderNodeMath")
        node.mode, node.filepath = "EXTERNAL", "//lamp.ies"
        factor.operation, factor.inputs[1].default_value = "MULTIPLY", 3.0
        tree.links.new(node.outputs[0], factor.inputs[0])
        tree.links.new(factor.outputs[0], tree.nodes["Emission"].inputs["Strength"])
        self.scene.collection.objects.link(bpy.data.objects.new("lamp", lamp))
        bpy.ops.mesh.primitive_cube_add(size=1)
        eye = self.scene.camera
        eye.location, eye.rotation_euler = (0, 0, 5), (0, 0, 0)
        eye.data.clip_start, eye.data.clip_end = 0.1, 100
        _, settings, answer = self.export()
        (light,) = settings["lights"]
        self.assertEqual((self.folder / light["point"]["ies"]).read_text(), profile)
        # Cycles has 177.83 lumens to a watt.
        self.assertAlmostEqual(light["point"]["strength"], 2 * 3 * 683 / 177.83, places=4)
        self.assertEqual((light["point"]["clockwise"], light["point"]["turn"]), (True, 90))
        self.assertTrue(any("shadows are sharp" in message for _, message in answer["notes"]))
        self.assertNotIn("clip", settings["camera"][0])
        for start, end in ((4.0, 100.0), (0.1, 5.2)):
            eye.data.clip_start, eye.data.clip_end = start, end
            found = self.export()[1]["camera"][0]["clip"]
            np.testing.assert_allclose(found, [start, end], rtol=1e-5)


class SurfacesTest(SceneTest):
    """What meshes and materials become where glTF has something else."""

    def values(self, model, number):
        """The rows of an accessor of floats."""
        accessor = model.json["accessors"][number]
        view = model.json["bufferViews"][accessor["bufferView"]]
        width = {"VEC3": 3, "VEC4": 4}[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        data = bytes(model.binary[start : start + 4 * width * accessor["count"]])
        return np.frombuffer(data, "<f4").reshape(-1, width)

    def add(self, kind, material, **settings):
        getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**settings)
        made = bpy.context.object
        made.data.materials.append(material)
        return made

    def test_curves_texts_and_metaballs_come_once(self):
        text = bpy.data.curves.new("Text", "FONT")
        text.body, text.extrude = "o", 0.1
        ring = bpy.data.curves.new("Ring", "CURVE")
        ring.dimensions, ring.bevel_depth = "3D", 0.1
        ring.splines.new("POLY").points.add(2)
        for k, point in enumerate(ring.splines[0].points):
            point.co = (k, k * k, 0, 1)
        balls = bpy.data.metaballs.new("Balls")
        balls.elements.new()
        for name, data in (("Text", text), ("Ring", ring), ("Balls", balls)):
            self.scene.collection.objects.link(bpy.data.objects.new(name, data))
        model, _, _ = self.export()
        self.assertEqual(sorted(node["name"] for node in model["nodes"] if "mesh" in node), ["Balls", "Ring", "Text"])

    def test_upright_sheets_of_glass_are_panes_and_level_ones_are_not(self):
        glass, _, shader = shader_tree("glass")
        shader.inputs["Transmission Weight"].default_value = 1.0
        shader.inputs["Base Color"].default_value = (0.25, 0.25, 0.25, 1)
        self.add("plane", glass, rotation=(np.pi / 2, 0, 0.4))
        self.add("plane", glass, location=(0, 0, 3))
        self.add("cube", glass, location=(4, 0, 0))
        model, settings, answer = self.export()
        ((name, entries),) = settings["materials"].items()
        self.assertEqual(entries, {"volume": False})
        factors = {made["name"]: made["pbrMetallicRoughness"]["baseColorFactor"][0] for made in model["materials"]}
        self.assertEqual(len(factors), 2)
        self.assertAlmostEqual(factors.pop(name), 0.5, places=5)
        self.assertAlmostEqual(*factors.values(), 0.25, places=5)
        self.assertIn("thin panes", said := "".join(message for _, message in answer["notes"]))
        self.assertIn("Solidify", said)

    def test_brushed_metals_are_brushed_around_their_axis(self):
        brushed, _, shader = shader_tree("brushed")
        for name, value in (("Metallic", 1.0), ("Anisotropic", 0.6), ("Anisotropic Rotation", 0.125)):
            shader.inputs[name].default_value = value
        self.add("cylinder", brushed, location=(3, 0, 0), vertices=16)
        bpy.ops.object.shade_smooth()
        model, _, answer = self.export_glb()
        self.assertEqual(answer["warnings"], [])
        ((primitive,),) = [mesh["primitives"] for mesh in model.json["meshes"]]
        normals, places, tangents = (self.values(model, primitive["attributes"][key]) for key in ("NORMAL", "POSITION", "TANGENT"))
        np.testing.assert_allclose((normals * tangents[:, :3]).sum(1), 0, atol=1e-5)
        # Around the vertical axis, counter-clockwise seen from above; glTF's y is up and its z points to the viewer.
        around = np.stack([places[:, 2], 0 * places[:, 0], -places[:, 0]], 1)
        np.testing.assert_allclose(tangents[:, :3], around / np.linalg.norm(around, axis=1, keepdims=True), atol=1e-4)
        (made,) = model.json["materials"]
        self.assertAlmostEqual(made["extensions"]["KHR_materials_anisotropy"]["anisotropyRotation"], np.pi / 4, places=5)

    def test_smooth_faces_beside_flat_ones_have_the_normals_of_their_vertices(self):
        tin = self.add("cylinder", shader_tree("tin")[0])
        tin.data.polygons.foreach_set("use_smooth", [len(face.vertices) == 4 for face in tin.data.polygons])
        model, _, _ = self.export_glb()
        ((primitive,),) = [mesh["primitives"] for mesh in model.json["meshes"]]
        upward = np.abs(self.values(model, primitive["attributes"]["NORMAL"])[:, 1])
        self.assertTrue(((upward > 0.1) & (upward < 0.9)).any(), "the sides lean towards the lids, as in Cycles")
        self.assertTrue((upward > 0.999).any(), "the lids are flat")

    def test_bodies_of_varying_colours_are_painted_and_their_holes_closed(self):
        skin, tree, shader, checker = shader_tree("skin", "TexChecker")
        shader.inputs["Subsurface Weight"].default_value = 1.0
        checker.inputs["Color1"].default_value, checker.inputs["Color2"].default_value = (0.8, 0.4, 0.2, 1), (0.2, 0.4, 0.2, 1)
        tree.links.new(checker.outputs["Color"], shader.inputs["Base Color"])
        ball = self.add("uv_sphere", skin)
        work = bmesh.new()
        work.from_mesh(ball.data)
        work.faces.ensure_lookup_table()
        bmesh.ops.delete(work, geom=[work.faces[0]], context="FACES_ONLY")
        work.to_mesh(ball.data)
        work.free()
        model, settings, answer = self.export("--bake", "256")
        self.assertEqual(answer["warnings"], [])
        self.assertIn("1 holes, which are closed", "".join(message for _, message in answer["notes"]))
        ((_, entries),) = settings["materials"].items()
        np.testing.assert_allclose(entries["subsurface"]["color"], [0.8, 0.4, 0.2], atol=0.02)
        (made,) = model["materials"]
        through = made["extensions"]["KHR_materials_diffuse_transmission"]
        self.assertIn("diffuseTransmissionColorTexture", through)
        # Blender reads the paint: half as much red in half of the squares, for light that crosses it twice.
        paint = bpy.data.images.load(self.picture(model, made))
        red = np.array(paint.pixels[:]).reshape(-1, 4)[:, 0]
        code = lambda c: 1.055 * c ** (1 / 2.4) - 0.055
        for value in (1.0, code(0.5)):
            self.assertGreater((np.abs(red - value) < 0.02).mean(), 0.15, value)

    def test_of_what_varies_and_no_picture_holds_the_mean_is_taken_by_name(self):
        cloth, tree, shader, checker = shader_tree("cloth", "TexChecker")
        checker.inputs["Scale"].default_value = 2.0
        tree.links.new(checker.outputs["Fac"], shader.inputs["Sheen Weight"])
        self.add("plane", cloth)
        model, _, answer = self.export()
        ((place, message),) = answer["warnings"]
        self.assertEqual(place, "cloth")
        self.assertIn("Sheen Weight", message)
        (made,) = model["materials"]
        sheen = made["extensions"]["KHR_materials_sheen"]["sheenColorFactor"][0]
        self.assertTrue(0.3 < sheen < 0.7, sheen)

    def test_lights_and_objects_that_shine_are_linked_to_nodes(self):
        first, second, third = (self.add("plane", None, location=(3 * k, 0, 0)) for k in range(3))
        first.name, second.name, third.name = "First", "Second", "Third"
        glow = bpy.data.materials.new("glow")
        glow.use_nodes = True
        glow.node_tree.nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 2.0
        third.data.materials.append(glow)
        lamp, free = (bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT")) for name in ("Rim", "Free"))
        for obj in (lamp, free):
            obj.data.energy = 10
            self.scene.collection.objects.link(obj)
        free.data.use_shadow = False
        receivers, blockers, group = (bpy.data.collections.new(name) for name in ("Receivers", "Blockers", "Group"))
        group.objects.link(second)
        group.objects.link(third)
        receivers.objects.link(first)
        receivers.children.link(group)
        receivers.objects.link(third)
        receivers.collection_objects[-1].light_linking.link_state = "EXCLUDE"
        blockers.objects.link(second)
        blockers.collection_objects[0].light_linking.link_state = "EXCLUDE"
        lamp.light_linking.receiver_collection = receivers
        third.light_linking.blocker_collection = blockers
        model, settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        lights = {light["name"]: light for light in settings["lights"]}
        self.assertEqual(lights["Rim"]["light_link"], {"include": ["/First", "/Second"]})
        self.assertNotIn("shadow_link", lights["Rim"])
        self.assertEqual(lights["Free"]["shadow_link"], {"include": []})
        self.assertEqual(settings["objects"], {"/Third": {"shadow_link": {"exclude": ["/Second"]}}})
        self.assertLessEqual({"First", "Second", "Third"}, {node["name"] for node in model["nodes"]})


class KeptTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="oscura-test-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.cache = self.folder / "cache"

    def export(self, *more):
        """The model that comes of the scene's file."""
        out = Path(tempfile.mkdtemp(dir=self.folder))
        model = run_exporter(self.folder / "scene.blend", out, *more)
        self.assertIsNone(json.loads((out / "answer.json").read_text())["error"])
        return contents(model)

    def cached(self):
        return self.export("--cache", str(self.cache))

    def kept(self):
        """What is kept: times of the last change by name."""
        return {path.name: path.stat().st_ino for path in self.cache.iterdir()}

    def test_what_is_kept_is_what_is_exported(self):
        make_scene(self.folder / "scene.blend")
        expected = self.export()
        self.assertEqual(self.cached(), expected)
        first = self.kept()
        # Two meshes and one baking.
        self.assertEqual(len(first), 3)
        self.assertTrue(all(name.endswith(".oscura") and len(name) == 39 for name in first))
        self.assertEqual(self.cached(), expected)
        self.assertEqual(self.kept(), first, "nothing was made again")
        # The picture reaches the model as it is.
        self.assertIn((self.folder / "scene.png").read_bytes(), expected[1])

    def test_meshes_whose_stand_ins_are_alike_keep_their_own_values(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        material = bpy.data.materials.new("grey")
        for edges in (60, 70):
            bpy.ops.mesh.primitive_grid_add(x_subdivisions=edges, y_subdivisions=edges)
            bpy.context.object.data.materials.append(material)
        bpy.ops.wm.save_as_mainfile(filepath=str(self.folder / "scene.blend"))

        def values(found):
            model, data = found
            slots = [primitive for mesh in model["meshes"] for primitive in mesh["primitives"]]
            numbers = [sorted({**of["attributes"], "indices": of["indices"]}.items()) for of in slots]
            return [[(slot, data[model["accessors"][number]["bufferView"]]) for slot, number in of] for of in numbers]

        expected = values(self.export())
        for _ in range(2):
            self.assertEqual(values(self.cached()), expected)

    def test_what_changes_is_made_again(self):
        for change in ({}, {"grey": 0.25}, {"height": 0.5}):
            make_scene(self.folder / "scene.blend", **change)
            before = len(self.kept()) if self.cache.exists() else 0
            self.assertEqual(self.cached(), self.export())
            self.assertEqual(len(self.kept()), before + 3, change)

    def test_damaged_files_are_made_again(self):
        make_scene(self.folder / "scene.blend")
        expected = self.cached()
        for path in self.cache.iterdir():
            path.write_bytes(path.read_bytes()[:100])
        self.assertEqual(self.cached(), expected)
        self.assertTrue(all(path.stat().st_size > 100 for path in self.cache.iterdir()))

    def test_a_folder_that_takes_nothing_is_no_reason_to_end(self):
        make_scene(self.folder / "scene.blend")
        self.cache.write_text("no folder")
        self.assertEqual(self.cached(), self.export())


if __name__ == "__main__":
    done = unittest.main(exit=False, verbosity=2)
    sys.stdout.flush()
    sys.stderr.flush()
    # The module `bpy` may hang while it tidies up.
    os._exit(0 if done.result.wasSuccessful() else 1)
