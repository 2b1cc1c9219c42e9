"""Tries what the exporter makes of trees that ask about objects, sides, rays and the angle of view.

    python test_trees.py            with a Python that has bpy
"""

import bpy
import numpy as np
from testing import SceneTest, baked, main, shader_tree


class TreesTest(SceneTest):
    def test_objects_of_one_mesh_have_their_own_colours_without_pictures(self):
        material, tree, shader, info = shader_tree("own", "ObjectInfo")
        tree.links.new(info.outputs["Color"], shader.inputs["Base Color"])
        colors = [(0.25, 0.5, 0.75), (0.5, 0.125, 0.0)]
        data = None
        for k, color in enumerate(colors):
            made = self.add_plane(material, f"Plane {k}", (3 * k, 0, 0), data)
            data, made.color = made.data, (*color, 1)
        _, settings, answer = self.export()
        surface, feeding = self.surface(settings["materials"]["own"])
        self.assertEqual((feeding(surface, "base_color")["type"], surface["base_color"].split(".")[1]), ("object_info", "color"))
        found = self.placed(settings)
        self.assertEqual(found["Plane 0"]["mesh"], found["Plane 1"]["mesh"])
        np.testing.assert_allclose([found[f"Plane {k}"]["color"] for k in range(2)], [(*color, 1) for color in colors], atol=1e-6)
        self.assertEqual(answer["warnings"], [])
        baked(material)
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
        """Constants stand in their place, in a material of its own for each answer."""
        material, tree, shader, own = shader_tree("own", "Attribute")
        own.attribute_type, own.attribute_name = "OBJECT", "polish"
        tree.links.new(next(out for out in own.outputs if out.identifier == "Fac"), shader.inputs["Roughness"])
        data = None
        for name, polish in (("First", 0.375), ("Second", 0.75)):
            made = self.add_plane(material, name, data=data)
            data, made["polish"] = made.data, polish
        _, settings, _ = self.export()
        (first,), (second,) = (self.placed(settings)[name]["materials"] for name in ("First", "Second"))
        roughnesses = [self.surface(settings["materials"][name])[0]["roughness"] for name in (first, second)]
        np.testing.assert_allclose(roughnesses, [0.375, 0.75], atol=1e-6)
        baked(material)
        model, _, _ = self.export()
        roughnesses = sorted(made["pbrMetallicRoughness"]["roughnessFactor"] for made in model["materials"])
        np.testing.assert_allclose(roughnesses, [0.375, 0.75], atol=1e-6)

    def glassy(self, *kinds):
        """A sheet that mirrors by Fresnel and else lets light pass: its tree, the mix and new nodes."""
        material, tree, shader, mix, fresnel, clear, mirror, *others = shader_tree(
            "window", "MixShader", "Fresnel", "BsdfTransparent", "BsdfGlossy", *kinds
        )
        mirror.inputs["Roughness"].default_value, fresnel.inputs["IOR"].default_value = 0.0, 1.5
        tree.links.new(fresnel.outputs[0], mix.inputs[0])
        tree.links.new(clear.outputs[0], mix.inputs[1])
        tree.links.new(mirror.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.add_plane(baked(material))
        return (tree, mix, fresnel, *others)

    def test_sheets_that_mirror_by_fresnel_mirror_wholly_from_behind(self):
        self.glassy()
        model, settings, answer = self.export()
        self.assertFalse(answer["warnings"])
        self.assertEqual(len(model["materials"]), 2)
        tables = [np.array(settings["textures"][entry["opacity"]]["colors"]) for entry in settings["materials"].values()]
        # Seen straight both mirror alike, at a cosine of 32 / 63 one does wholly.
        np.testing.assert_allclose([table[-1] for table in tables], 0.04, atol=1e-3)
        np.testing.assert_allclose(sorted(table[len(table) // 2] for table in tables), [0.0866, 1], atol=1e-3)

    def test_factors_that_can_only_be_one_choose_a_shader(self):
        tree, mix, fresnel, path, rest, most = self.glassy("LightPath", "Math", "Math")
        rest.operation, rest.inputs[0].default_value, most.operation = "SUBTRACT", 1.0, "MAXIMUM"
        clear, mirror = (link.from_socket for entry in mix.inputs[1:3] for link in entry.links)
        tree.links.new(fresnel.outputs[0], rest.inputs[1])
        tree.links.new(rest.outputs[0], most.inputs[0])
        tree.links.new(path.outputs["Is Shadow Ray"], most.inputs[1])
        tree.links.new(most.outputs[0], mix.inputs[0])
        tree.links.new(mirror, mix.inputs[1])
        tree.links.new(clear, mix.inputs[2])
        _, settings, answer = self.export()
        self.assertFalse(answer["warnings"])
        for entry in settings["materials"].values():
            self.assertNotIn("shadow", entry["visible_to"])

    def test_sides_become_faces_that_lie_back_to_back(self):
        material, tree, shader, side, mix = shader_tree("sides", "NewGeometry", "Mix")
        mix.data_type = "RGBA"
        mix.inputs[6].default_value, mix.inputs[7].default_value = (1, 0, 0, 1), (0, 0, 1, 1)
        tree.links.new(side.outputs["Backfacing"], mix.inputs[0])
        tree.links.new(mix.outputs[2], shader.inputs["Base Color"])
        self.add_plane(baked(material))
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
        self.add_plane(baked(material))
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
        self.add_plane(baked(material))
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
        self.add_plane(baked(material))
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
        self.add_plane(baked(material))
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
        self.add_plane(baked(material))
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

    def let_through(self, name, kind, factor=None, passed=(0.5, 0.4, 0.25), reflected=(0.2, 0.1, 0.1)):
        """A material of translucent and diffuse shaders, its tree, both, and what joins them."""
        material, tree, shader, through, front, joined = shader_tree(name, "BsdfTranslucent", "BsdfDiffuse", kind)
        tree.nodes.remove(shader)
        through.inputs["Color"].default_value, front.inputs["Color"].default_value = (*passed, 1), (*reflected, 1)
        for entry, source in zip(list(joined.inputs)[-2:], (front, through)):
            tree.links.new(source.outputs[0], entry)
        if factor is not None:
            joined.inputs[0].default_value = factor
        tree.links.new(joined.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        return material, tree, through, front, joined

    def passed(self, model, name):
        """Share and colour of what passes a material of the model, and its base colour."""
        (found,) = (material for material in model["materials"] if material["name"] == name)
        told = found["extensions"]["KHR_materials_diffuse_transmission"]
        return told["diffuseTransmissionFactor"], told["diffuseTransmissionColorFactor"], found["pbrMetallicRoughness"].get("baseColorFactor")

    def test_sums_of_diffuse_and_translucent_keep_both_colours(self):
        for k, (name, passed, reflected) in enumerate((("paper", (0.6, 0.5, 0.25), (0.2, 0.1, 0.1)), ("bright", (1, 1, 0.5), (1, 0.5, 1)))):
            self.add_plane(baked(self.let_through(name, "AddShader", None, passed, reflected)[0]), name, (3 * k, 0, 0))
        model, _, answer = self.export()
        self.assertEqual([name for name, _ in answer["warnings"]], ["bright"])
        share, color, base = self.passed(model, "paper")
        self.assertAlmostEqual(share, 0.75, places=5)
        np.testing.assert_allclose(share * np.array(color), (0.6, 0.5, 0.25), rtol=1e-5)
        np.testing.assert_allclose((1 - share) * np.array(base[:3]), (0.2, 0.1, 0.1), rtol=1e-5)
        self.assertEqual(self.passed(model, "bright"), (0.5, [1, 1, 1], None))

    def test_colours_and_shares_of_what_passes_may_be_pictures(self):
        """A picture of light that passes, on two meshes, and one of how much of it does."""
        leaf, tree, through, front, _ = self.let_through("leaf", "MixShader", 0.25)
        image = tree.nodes.new("ShaderNodeTexImage")
        image.image = bpy.data.images.new("green", 32, 32)
        image.image.generated_color = (0, 0.7354, 0, 1)  # 0.5
        image.image.pack()
        tree.links.new(image.outputs[0], through.inputs["Color"])
        worn, tree, _, _, joined = self.let_through("worn", "MixShader", None, (0.5, 0.25, 0.25), (0.25, 0.125, 0))
        checker = tree.nodes.new("ShaderNodeTexChecker")
        checker.inputs["Color1"].default_value, checker.inputs["Color2"].default_value = (1, 1, 1, 1), (0.25,) * 3 + (1,)
        checker.inputs["Scale"].default_value = 1.5
        tree.links.new(checker.outputs["Color"], joined.inputs[0])
        for k, material in enumerate((baked(leaf), leaf, baked(worn))):
            self.add_plane(material, f"Plane{k}", (3 * k, 0, 0))
        model, settings, answer = self.export("--bake", "64")
        self.assertEqual(answer["warnings"], [])
        self.assertEqual(self.passed(model, "leaf")[0], 0.25)
        for name, share, front, back in (
            ("leaf", 0.25, {(0.2, 0.1, 0.1)}, {(0, 0.5, 0)}),
            ("worn", 2 / 3, {(0, 0, 0), (0.5625, 0.28125, 0)}, {(0.75, 0.375, 0.375), (0.1875, 0.09375, 0.09375)}),
        ):
            # What is baked by mesh has a number after its name.
            (told,), (material,) = (
                [of for known, of in found if known.startswith(name)]
                for found in (settings["materials"].items(), ((made["name"], made) for made in model["materials"]))
            )
            self.assertAlmostEqual(told["diffuse_transmission"], share, places=5)
            texture = settings["textures"][told["diffuse_transmission_color"]]
            self.assertEqual((texture["mapping"], texture["encoding"]), ("own", "srgb"))
            for path, colors in ((self.picture(model, material), front), (str(self.folder / texture["file"]), back)):
                pixels = self.pixels(path)[4:-4, 4:-4, :3]
                linear = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)
                for color in colors:
                    self.assertGreater((np.abs(linear - color).max(-1) < 0.02).mean(), 0.9 / len(colors) - 0.1, (name, color))

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
            shown.data.materials.append(baked(made))
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

    def test_places_in_the_window_and_the_space_of_the_camera_are_baked(self):
        """Seen from 8 m above a plane of 2 m, which is as wide as half of the picture."""
        eye = self.scene.camera
        eye.rotation_euler, eye.scale = (0, 0, np.pi / 2), (2, 2, 2)
        eye.data.sensor_width, eye.data.lens = 36.0, 72.0
        self.scene.render.resolution_x = self.scene.render.resolution_y = 64
        window, tree, shader, place = shader_tree("window", "TexCoord")
        tree.links.new(place.outputs["Window"], shader.inputs["Base Color"])
        turned, tree, shader, place, there, again = shader_tree("turned", "TexCoord", "VectorTransform", "VectorTransform")
        for node, ends in ((there, ("OBJECT", "CAMERA")), (again, ("CAMERA", "WORLD"))):
            node.vector_type, (node.convert_from, node.convert_to) = "POINT", ends
        tree.links.new(place.outputs["Object"], there.inputs[0])
        for node, key in ((there, "Base Color"), (again, "Emission Color")):
            tree.links.new(node.outputs[0], shader.inputs[key])
        tree.links.new(there.outputs[0], again.inputs[0])
        shader.inputs["Emission Strength"].default_value = 1.0
        self.add_plane(baked(window), "window")
        self.add_plane(baked(turned), "turned", (0, 0, 7.5))
        glb, _, answer = self.export_glb("--bake", "64")
        self.assertEqual(answer["warnings"], [])
        found = {}
        for material in glb.json["materials"]:
            pixels = self.pixels(self.picture(glb.json, material))[..., :3]
            linear = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)
            found[material["name"]] = np.quantile(linear.reshape(-1, 3), (0.02, 0.98), axis=0)
        np.testing.assert_allclose(found["window"], [(0.25, 0.25, 0), (0.75, 0.75, 0)], atol=0.03)
        # The depth, and halves of the plane that have other signs are 0.
        np.testing.assert_allclose(found["turned"], [(0, 0, 0.5), (1, 1, 0.5)], atol=0.06)

    def test_the_cosine_of_view_and_normal_is_a_weight(self):
        material, tree, shader, geometry, dot = shader_tree("dotted", "NewGeometry", "VectorMath")
        dot.operation = "DOT_PRODUCT"
        tree.links.new(geometry.outputs["Normal"], dot.inputs[0])
        tree.links.new(geometry.outputs["Incoming"], dot.inputs[1])
        tree.links.new(dot.outputs["Value"], shader.inputs["Base Color"])
        self.add_plane(baked(material))
        _, settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        table = settings["textures"][settings["materials"]["dotted"]["base_color"]]["colors"]
        np.testing.assert_allclose(table, np.linspace(0, 1, len(table)), atol=2e-5)

    def test_weights_with_normals_of_their_own_are_told(self):
        material, tree, shader, weight, bump = shader_tree("bumped", "LayerWeight", "Bump")
        tree.links.new(bump.outputs[0], weight.inputs["Normal"])
        tree.links.new(weight.outputs["Facing"], shader.inputs["Base Color"])
        self.add_plane(baked(material))
        _, settings, answer = self.export()
        ((place, message),) = answer["warnings"]
        self.assertEqual((place, "normal of its own" in message), ("bumped", True))
        self.assertIn("base_color", settings["materials"]["bumped"])

    def test_transparency_of_trees_has_its_picture(self):
        material, tree, shader, checker = shader_tree("lace", "TexChecker")
        checker.inputs["Scale"].default_value = 2.0
        tree.links.new(checker.outputs["Fac"], shader.inputs["Alpha"])
        self.add_plane(baked(material))
        model, _, _ = self.export("--bake", "64")
        alpha = self.pixels(self.picture(model, model["materials"][0]))[..., 3]
        for value in (0, 1):
            self.assertGreater((np.abs(alpha - value) < 0.02).mean(), 0.2, value)

    def test_baked_colors_are_not_multiplied_by_alpha(self):
        """A picture of one colour whose alpha is a ramp, and which is no plain one, since it ends at its edge."""
        image = bpy.data.images.new("faint", 32, 32, alpha=True)
        pixels = np.ones((32, 32, 4), np.float32)
        pixels[..., :3], pixels[..., 3] = (0.25, 0.5, 0.75), np.linspace(0.5, 1, 32)
        image.pixels[:] = pixels.ravel()
        image.pack()
        material, tree, shader, node = shader_tree("decal", "TexImage")
        node.image, node.extension, node.interpolation = image, "CLIP", "Closest"
        for name, output in (("Base Color", "Color"), ("Alpha", "Alpha")):
            tree.links.new(node.outputs[output], shader.inputs[name])
        self.add_plane(baked(material))
        model, _, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        shown = self.pixels(self.picture(model, model["materials"][0]))
        np.testing.assert_allclose(shown[..., :3], np.broadcast_to((0.25, 0.5, 0.75), shown[..., :3].shape), atol=0.012)
        self.assertLess(shown[..., 3].min(), 0.55)

    def test_colors_are_multiplied_by_alpha_that_nothing_uses(self):
        """A picture file of one colour whose alpha is a half, and one of the same that is opaque: that is written as it is."""
        for alpha, mode, expected in ((0.5, "STRAIGHT", 0.25), (0.5, "CHANNEL_PACKED", 0.5), (1.0, "STRAIGHT", 0.5)):
            with self.subTest(alpha=alpha, mode=mode):
                self.setUp()
                image = bpy.data.images.new("faint", 8, 8, alpha=True)
                image.pixels[:] = np.tile((0.5, 0.5, 0.5, alpha), 64)
                image.filepath_raw, image.file_format = str(self.folder / "faint.png"), "PNG"
                image.save()
                material, tree, shader, node = shader_tree("label", "TexImage")
                node.image = bpy.data.images.load(image.filepath_raw)
                node.image.alpha_mode = mode
                tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
                self.add_plane(material)
                surface, feeding = self.surface(self.export()[1]["materials"]["label"])
                self.assertEqual(feeding(surface, "base_color")["alpha_mode"], mode.lower())
                baked(material)
                model, _, answer = self.export()
                self.assertEqual(any("baked to pictures" in message for _, message in answer["notes"]), expected < 0.5)
                shown = self.pixels(self.picture(model, model["materials"][0]))[..., :3]
                np.testing.assert_allclose(shown, np.full(shown.shape, expected), atol=0.01)

    def test_pictures_of_files_may_be_links(self):
        material, tree, shader, node = shader_tree("label", "TexImage")
        picture = bpy.data.images.new("picture", 8, 8)
        picture.filepath_raw, picture.file_format = str(self.folder / "a picture.png"), "PNG"
        picture.save()
        node.image = bpy.data.images.load(picture.filepath_raw)
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        self.add_plane(material)
        shown = lambda *more: self.surface(self.export(*more)[1]["materials"]["label"])
        for more, expected in (((), "scene.image0.png"), (("--links",), str(self.folder / "a picture.png"))):
            surface, feeding = shown(*more)
            self.assertEqual(feeding(surface, "base_color")["file"], expected)
        self.assertEqual((self.folder / "scene.image0.png").read_bytes(), (self.folder / "a picture.png").read_bytes())
        baked(material)
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
        self.add_plane(baked(material))
        model, _, _ = self.export("--bake", "64")
        (made,) = model["materials"]
        self.assertAlmostEqual(made["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 40, places=3)
        self.assertIn("emissiveTexture", made)


if __name__ == "__main__":
    main()
