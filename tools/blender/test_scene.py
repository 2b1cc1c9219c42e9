"""Tests displacement, motion blur, lights, render settings and color management.

    python test_scene.py            with a Python that has bpy
"""

import struct

import bpy
import numpy as np
from testing import SceneTest, main, read_ply, shader_tree

from oscura_blender import final_render


class SettingsTest(SceneTest):
    def test_media_subsurface_and_translucency(self):
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
        # A surface that does nothing besides bounding its volume.
        veil, tree, shader, clear, scatter = shader_tree("veil", "BsdfTransparent", "VolumeScatter")
        scatter.inputs["Color"].default_value, scatter.inputs["Density"].default_value = (0.5, 0.25, 1, 1), 2.0
        clear.inputs["Color"].default_value = (1, 1, 1, 1)
        for shader, name in ((clear, "Surface"), (scatter, "Volume")):
            tree.links.new(shader.outputs[0], tree.nodes["Material Output"].inputs[name])
        for k, material in enumerate((haze, wax, leaf, veil)):
            self.add_plane(material, location=(3 * k, 0, 0))
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        found = settings["materials"]
        for name in ("haze", "veil"):
            self.assertEqual(found[name], {"type": "medium", "density": [1.0, 0.5, 2.0], "color": [1.0, 1.0, 1.0]})
        surface, _ = self.surface(found["wax"])
        np.testing.assert_allclose([surface["subsurface_weight"], surface["subsurface_scale"]], [1.0, 4 * np.pi], rtol=1e-5)
        self.assertEqual((surface["subsurface_radius"], surface["subsurface_anisotropy"]), ([0.5, 0.25, 0.125], 0.0))
        surface, _ = self.surface(found["leaf"])
        self.assertEqual(surface, {"type": "translucent_bsdf", "color": [0.25, 0.5, 0.125]})

    def test_subsurface_methods(self):
        material, _, principled = shader_tree("skin")
        for method, skin, ior in (("RANDOM_WALK", None, None), ("RANDOM_WALK_SKIN", 1.4, None), ("BURLEY", None, 0.0)):
            principled.subsurface_method = method
            principled.inputs["Subsurface Weight"].default_value = 1.0
            self.add_plane(material)
            surface = self.surface(self.export()[0]["materials"]["skin"])[0]
            self.assertEqual([surface.get("subsurface_skin_ior"), surface.get("subsurface_ior")], [skin, ior])

    def relief(self, method):
        """The displacement and the bump mapping of a plane that becomes a slope."""
        material, tree, _, height, relief = shader_tree("relief", "TexCoord", "Displacement")
        material.displacement_method = method
        tree.links.new(height.outputs["UV"], relief.inputs["Height"])
        relief.inputs["Midlevel"].default_value, relief.inputs["Scale"].default_value = 0.5, 2.0
        tree.links.new(relief.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
        self.add_plane(material)
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        table = settings["materials"]["relief"]
        surface, feeding = self.surface(table)
        return table.get("displacement"), feeding(surface, "normal") if "normal" in surface else None

    def test_displacement_moves_vertices(self):
        displacement, bump = self.relief("DISPLACEMENT")
        self.assertIsNone(bump)
        self.assertFalse(displacement["keep_normals"])
        # The middle of u and v as a number is their mean over three: 0 to 2/3.
        np.testing.assert_allclose(self.extent("Plane"), [[-1, -1, -1], [1, 1, 1 / 3]], atol=1e-5)

    def moved(self, kind, feed):
        """The displacement of a rotated plane in world space by a type of node."""
        material, tree, _, vector, relief = shader_tree("moved", "CombineXYZ", kind)
        material.displacement_method = "DISPLACEMENT"
        for socket, value in zip(vector.inputs, (0.1, -0.2, 0.3)):
            socket.default_value = value
        feed(tree, vector, relief)
        tree.links.new(relief.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
        shown = self.add_plane(material)
        shown.rotation_euler = (0, 0, np.pi / 2)
        self.assertEqual(self.export()[1]["warnings"], [])
        return self.extent("Plane").mean(0)

    def test_displacement_along_a_normal(self):
        def feed(tree, vector, relief):
            tree.links.new(vector.outputs[0], relief.inputs["Normal"])
            relief.inputs["Height"].default_value, relief.inputs["Midlevel"].default_value = 2.0, 0.5
            relief.inputs["Scale"].default_value = 1.0

        # In object space Cycles takes the direction alone.
        expected = 1.5 * np.array([0.1, -0.2, 0.3]) / np.linalg.norm([0.1, 0.2, 0.3])
        np.testing.assert_allclose(self.moved("Displacement", feed), expected, atol=1e-5)

    def displaced_by_vectors(self, space):
        def feed(tree, vector, relief):
            tree.links.new(vector.outputs[0], relief.inputs["Vector"])
            relief.inputs["Midlevel"].default_value, relief.inputs["Scale"].default_value = 0.0, 2.0
            relief.space = space

        return self.moved("VectorDisplacement", feed)

    def test_vector_displacement(self):
        # A quarter turn about the vertical takes x to y. Tangents are along x and y, and the second component is along the normal.
        for space, expected in (("WORLD", (0.2, -0.4, 0.6)), ("OBJECT", (0.4, 0.2, 0.6)), ("TANGENT", (-0.6, 0.2, -0.4))):
            np.testing.assert_allclose(self.displaced_by_vectors(space), expected, atol=1e-5, err_msg=space)
            bpy.data.objects.remove(bpy.data.objects["Plane"])

    def test_displacement_and_bump_keeps_normals(self):
        displacement, bump = self.relief("BOTH")
        self.assertEqual((bump["type"], bump["distance"], bump["object_scale"]), ("bump", 2.0, 2.0))
        self.assertTrue(displacement["keep_normals"])

    def test_bump_only_keeps_vertices(self):
        displacement, bump = self.relief("BUMP")
        self.assertEqual((bump["type"], bump["object_scale"], displacement), ("bump", 1.0, None))

    def test_bumps_of_displacement_without_its_node(self):
        # The part of the vector along the normal, also within groups.
        material, tree, _, group = shader_tree("rough", "Group")
        group.node_tree = inner = bpy.data.node_groups.new("inner", "ShaderNodeTree")
        inner.interface.new_socket("Result", in_out="OUTPUT", socket_type="NodeSocketFloat")
        noise, end = inner.nodes.new("ShaderNodeTexNoise"), inner.nodes.new("NodeGroupOutput")
        inner.links.new(noise.outputs[0], end.inputs[0])
        material.displacement_method = "BUMP"
        tree.links.new(group.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
        self.add_plane(material)
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        surface, feeding = self.surface(settings["materials"]["rough"])
        bump = feeding(surface, "normal")
        self.assertEqual((bump["type"], bump["distance"], bump["object_scale"]), ("bump", 1.0, 0.0))
        along = feeding(bump, "height")
        self.assertEqual((along["operation"], feeding(along, "a")["type"], along["b"]), ("dot_product", "noise_texture", "surface_geometry.normal"))

    def test_normal_maps_have_no_displacement_bumps(self):
        material, tree, principled, height, relief, mapped = shader_tree("mapped", "TexCoord", "Displacement", "NormalMap")
        material.displacement_method = "BUMP"
        tree.links.new(height.outputs["UV"], relief.inputs["Height"])
        tree.links.new(relief.outputs[0], tree.nodes["Material Output"].inputs["Displacement"])
        tree.links.new(mapped.outputs[0], principled.inputs["Normal"])
        self.add_plane(material)
        surface, feeding = self.surface(self.export()[0]["materials"]["mapped"])
        self.assertEqual(feeding(surface, "normal")["type"], "normal_map")

    def test_motion_keys_of_objects_cameras_and_lights(self):
        moved = self.add_plane(None, "Moved")
        for kind in ("POINT", "AREA"):
            self.lamp(kind)
        for thing, path in ((moved, (2, 0, 0)), (self.scene.camera, (0, 1, 8)), (self.scene.objects["area"], (0, 0, 6))):
            thing.keyframe_insert("location", frame=1)
            thing.location = path
            thing.keyframe_insert("location", frame=3)
        self.add_plane(None, "Still", (0, 4, 0))
        self.scene.frame_set(2)
        settings, answer = self.export()
        self.assertFalse([entry for kind in ("camera", "lights", "objects") for entry in settings[kind] if "motion" in entry])
        self.scene.render.use_motion_blur, self.scene.render.motion_blur_shutter = True, 0.25
        settings, answer = self.export()
        (camera,), lights = settings["camera"], {light["name"]: light for light in settings["lights"]}
        self.assertEqual((camera["transform"], lights["area"]["transform"]), ([], []))
        self.assertEqual((len(lights["point"]["transform"]), lights["point"].get("motion")), (1, None))
        placed = self.placed(settings)
        self.assertEqual((len(placed["Still"]["transform"]), placed["Still"].get("motion")), (1, None))
        # Positions in the coordinates of scene files.
        for entry, axis, now in ((placed["Moved"], 0, 1), (camera, 2, -0.5), (lights["area"], 1, 3)):
            keys = entry["motion"]["keys"]
            self.assertEqual([key["frame"] for key in keys], [-0.125, 0, 0.125])
            first, second, third = (key["transform"][0]["matrix"][3 + 4 * axis] for key in keys)
            self.assertTrue(first < second < third or first > second > third, (first, second, third))
            self.assertAlmostEqual(second, now, places=6)
        self.assertEqual(camera["shutter"], 0.25)
        self.assertFalse([entry for entry in self.export("--shutter", "0")[0]["camera"] if "motion" in entry])

    def test_deformation_motion_blur(self):
        """A shape key that grows has a file for each frame, with its normals."""
        shown = self.add_plane(None, "Bent")
        shown.data.shade_smooth()
        shown.shape_key_add(name="Basis")
        key = shown.shape_key_add(name="Up")
        key.data[0].co.z = 2.0
        for frame, value in ((1, 0.0), (3, 1.0)):
            key.value = value
            key.keyframe_insert("value", frame=frame)
        self.scene.frame_set(2)
        self.scene.render.use_motion_blur, self.scene.render.motion_blur_shutter = True, 1.0
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        (entry,) = self.placed(settings).values()
        keys = entry["mesh_keys"]
        self.assertEqual([k["frame"] for k in keys], [-0.5, 0, 0.5])
        files = [read_ply(self.folder / k["mesh"]) for k in keys]
        heights = [columns["z"].max() for _, columns, _ in files]
        self.assertTrue(heights[0] < heights[1] < heights[2] and abs(heights[1] - 1) < 1e-6, heights)
        slopes = [columns["nz"].min() for _, columns, _ in files]
        self.assertTrue(slopes[0] > slopes[1] > slopes[2], slopes)
        self.assertEqual({len(columns["x"]) for _, columns, _ in files}, {4})

    def test_animated_node_trees(self):
        """Colors by keyframes and drivers, and that of the world."""
        def fade(socket):
            for frame, color in ((1, (1, 0, 0, 1)), (11, (0, 1, 0, 1))):
                socket.default_value = color
                socket.keyframe_insert("default_value", frame=frame)

        plain, _, shader = shader_tree("plain")
        fade(shader.inputs["Base Color"])
        driven, _, shader = shader_tree("driven")
        driver = shader.inputs["Roughness"].driver_add("default_value").driver
        driver.expression = "frame / 20"
        squares, tree, shader, checker = shader_tree("squares", "TexChecker")
        fade(checker.inputs["Color1"])
        checker.inputs["Color2"].default_value = (0, 0, 1, 1)
        tree.links.new(checker.outputs[0], shader.inputs["Base Color"])
        for i, material in enumerate((plain, driven, squares)):
            self.add_plane(material, material.name, (3 * i, 0, 0))
        sky = bpy.data.worlds.new("Sky")
        sky.use_nodes = True
        background, checker = sky.node_tree.nodes["Background"], sky.node_tree.nodes.new("ShaderNodeTexChecker")
        fade(checker.inputs["Color1"])
        checker.inputs["Color2"].default_value = (0, 0, 1, 1)
        sky.node_tree.links.new(checker.outputs[0], background.inputs["Color"])
        self.scene.world = sky
        self.scene.frame_set(1)
        for options, expected in (((), 0.0), (("--frame", "11"), 1.0), (("--time", "0.25"), 0.5)):
            settings, answer = self.export(*options)
            self.assertEqual(answer["warnings"], [])
            red = np.array([1 - expected, expected, 0])
            (plain, _), (driven, _), (squares, feeding) = (self.surface(settings["materials"][name]) for name in ("plain", "driven", "squares"))
            np.testing.assert_allclose([plain["base_color"], feeding(squares, "base_color")["color1"]], [red, red], atol=1e-6)
            self.assertAlmostEqual(driven["roughness"], (1 + 10 * expected) / 20, places=6)
            around = settings["textures"][settings["environment"]["texture"]]["nodes"]
            (color,) = [node["color1"] for node in around.values() if node["type"] == "checker_texture"]
            np.testing.assert_allclose(color, red, atol=1e-6)

    def test_render_settings(self):
        view, render, cycles = self.scene.view_settings, self.scene.render, self.scene.cycles
        view.view_transform, view.exposure = "AgX", 1.5
        cycles.samples, cycles.use_adaptive_sampling, cycles.adaptive_threshold = 300, True, 0.02
        cycles.use_denoising, cycles.film_exposure = True, 2.0
        render.resolution_x, render.resolution_y, render.use_border = 200, 100, True
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.5, 0.1, 0.9
        layer = self.scene.view_layers[0]
        layer.use_pass_z = layer.use_pass_cryptomatte_object = layer.use_pass_mist = True
        lamp = bpy.data.lights.new("lamp", "POINT")
        lamp.energy = 10
        self.scene.collection.objects.link(bpy.data.objects.new("lamp", lamp))
        settings, answer = self.export()
        found = settings["render"]
        # Middle gray by AgX in Blender.
        self.assertAlmostEqual(self.shown(found["view"], 0.18), 0.4613, places=3)
        self.assertEqual((found["exposure"], found["samples"], found["denoise"]), (1.5, 300, True))
        self.assertAlmostEqual(found["noise"], 4.0, places=4)
        # 0.9 is less in single precision, but 0.9 * 100 isn't.
        self.assertEqual(found["crop"], [50, 10, 100, 90])
        self.assertEqual(found["aovs"], ["depth", "crypto_object"])
        self.assertEqual(settings["lights"][0]["point"]["power"], 20.0)
        self.assertIn("Mist", answer["warnings"][0][1])


    def shown(self, table, grey):
        """The display value of a gray by a table."""
        content = (self.folder / table).read_bytes()
        self.assertEqual(content[:8], b"OSCVIEW1")
        (count,) = struct.unpack_from("<I", content, 8)
        knots, values = np.frombuffer(content, "<f4", 2 * count, 12).reshape(2, count)
        (nodes,) = struct.unpack_from("<I", content, 12 + 8 * count)
        lattice = np.frombuffer(content, "<u2", 3 * nodes**3, 16 + 8 * count).reshape(nodes, nodes, nodes, 3)
        place = np.interp(grey, knots, values) * (nodes - 1)
        greys = [lattice[k, k, k, 1] / 65535.0 for k in range(nodes)]
        return np.interp(place, range(nodes), greys)

    def test_view_tables(self):
        view = self.scene.view_settings
        view.view_transform, view.look, view.exposure = "AgX", "AgX - Punchy", 1.0
        settings, answer = self.export()
        self.assertEqual(settings["render"]["exposure"], 1.0)
        self.assertAlmostEqual(self.shown(settings["render"]["view"], 0.18), 0.3463, places=3)
        self.assertFalse([message for _, message in answer["warnings"] + answer["notes"] if "view" in message])
        # Curves come before the exposure, so that both are part of the table: twice the half of white.
        view.view_transform, view.look, view.use_curve_mapping = "Standard", "None", True
        curve = view.curve_mapping.curves[3]
        curve.points[1].location = (1.0, 0.5)
        view.curve_mapping.update()
        found = self.export()[0]["render"]
        self.assertNotIn("exposure", found)
        self.assertAlmostEqual(self.shown(found["view"], 1.0), 1.0, places=2)
        self.assertAlmostEqual(self.shown(found["view"], 0.25), 0.5371, places=2)
        view.use_curve_mapping = False
        self.assertEqual(self.export()[0]["render"]["view"], "srgb")


    def test_ies_profiles_and_clipping(self):
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
        settings, answer = self.export()
        (light,) = settings["lights"]
        self.assertEqual((self.folder / light["point"]["ies"]).read_text(), profile)
        # Cycles' luminous efficacy is 177.83 lm/W.
        self.assertAlmostEqual(light["point"]["strength"], 2 * 3 * 683 / 177.83, places=4)
        self.assertEqual((light["point"]["clockwise"], light["point"]["turn"]), (True, 90))
        self.assertAlmostEqual(light["point"]["radius"], 0.1, places=6)
        self.assertNotIn("clip", settings["camera"][0])
        for start, end in ((4.0, 100.0), (0.1, 5.2)):
            eye.data.clip_start, eye.data.clip_end = start, end
            found = self.export()[0]["camera"][0]["clip"]
            np.testing.assert_allclose(found, [start, end], rtol=1e-5)


    def lamp(self, kind, *kinds, **settings):
        """The tree of a new light, its Emission, and new nodes."""
        data = bpy.data.lights.new(kind.lower(), kind)
        for key, value in {"energy": 10.0, "use_nodes": True, **settings}.items():
            setattr(data, key, value)
        self.scene.collection.objects.link(bpy.data.objects.new(kind.lower(), data))
        tree = data.node_tree
        return (tree, tree.nodes["Emission"], *(tree.nodes.new(f"ShaderNode{kind}") for kind in kinds))

    def test_soft_falloff(self):
        for kind in ("POINT", "SPOT"):
            for radius, soft in ((0.3, True), (0.3, False), (0.0, True)):
                self.lamp(kind, name=f"{kind} {radius} {soft}", shadow_soft_size=radius, use_soft_falloff=soft)
        bpy.ops.mesh.primitive_cube_add(size=1)
        for light in self.export()[0]["lights"]:
            kind, radius, soft = self.scene.objects[light["name"]].data.name.split()
            shape = light[kind.lower()]
            self.assertEqual(shape.get("soft_falloff", False), soft == "True" and radius == "0.3", light)
            self.assertAlmostEqual(shape["radius"], float(radius), places=6)

    def test_scaled_spot_cones(self):
        """Scales of 4 and 1 act on the tangent of the half angle."""
        self.lamp("SPOT", name="elliptic", spot_size=np.pi / 4, spot_blend=0.0)
        self.lamp("SPOT", name="narrow", spot_size=np.pi / 2, spot_blend=0.0)
        self.lamp("SPOT", name="even", spot_size=np.pi / 4, spot_blend=0.5)
        scales = {"elliptic": (2, 0.5, 0.5), "narrow": (1, -1, 2), "even": (3, 3, 3)}
        for obj in self.scene.objects:
            if obj.type == "LIGHT":
                obj.scale = scales[obj.data.name]
        bpy.ops.mesh.primitive_cube_add(size=1)
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        spots = {self.scene.objects[light["name"]].data.name: light["spot"] for light in settings["lights"]}
        self.assertEqual({name for name, spot in spots.items() if "ies" in spot}, {"elliptic"})
        self.assertAlmostEqual(spots["narrow"]["angle"], 2 * np.degrees(np.arctan(0.5)), places=3)
        self.assertAlmostEqual(spots["even"]["angle"], 45, places=3)
        self.assertEqual((spots["narrow"]["power"], spots["even"]["blend"]), (10.0, 0.5))
        elliptic, tangent = spots["elliptic"], np.tan(np.pi / 8)
        self.assertAlmostEqual(elliptic["angle"], 2 * np.degrees(np.arctan(4 * tangent)), places=3)
        self.assertAlmostEqual(elliptic["intensity"], 10 / (4 * np.pi), places=5)
        down, around, values = self.profile(elliptic["ies"])
        for longitude, factor in ((0, 4), (90, 1), (180, 4), (270, 1)):
            (row,) = values[around == longitude]
            edge = np.interp(0.5, row[::-1], down[::-1])
            self.assertAlmostEqual(edge, np.degrees(np.arctan(factor * tangent)), delta=0.4, msg=f"{longitude}")

    def test_skewed_area_lights(self):
        self.lamp("AREA", shape="RECTANGLE", size=0.5, size_y=2.0)
        (lamp,) = (obj for obj in self.scene.objects if obj.type == "LIGHT")
        lamp.parent = bpy.data.objects.new("stretched", None)
        self.scene.collection.objects.link(lamp.parent)
        lamp.parent.scale, lamp.location, lamp.rotation_euler = (2, 1, 1), (0.5, 0, 3), (0, 0, np.pi / 4)
        bpy.ops.mesh.primitive_cube_add(size=1)
        settings, answer = self.export()
        self.assertEqual([text for _, text in answer["warnings"]], ["this light is skewed by the scale of its parent: it is replaced by a rectangle"])
        # Edges that are as long as before, along the diagonals of the axes: y is Blender's z.
        u, v, w, place = np.array(settings["lights"][0]["transform"][0]["matrix"]).reshape(4, 4).T[:, :3]
        np.testing.assert_allclose(place, (1, 3, 0), atol=1e-6)
        np.testing.assert_allclose(w, (0, 1, 0), atol=1e-6)
        np.testing.assert_allclose(u, (1.25**0.5, 0, -(1.25**0.5)), rtol=1e-5)
        np.testing.assert_allclose(v, (-(1.25**0.5), 0, -(1.25**0.5)), rtol=1e-5)

    def test_lights_with_a_scale_of_zero(self):
        for kind in ("POINT", "AREA"):
            self.lamp(kind)
            self.scene.objects[kind.lower()].scale = (0, 0, 0)
        settings, answer = self.export()
        self.assertEqual([light["name"] for light in settings["lights"]], ["point"])
        self.assertEqual([place for place, _ in answer["warnings"]], ["area"])

    def profile(self, file):
        """Polar angles and intensities of a profile, by azimuth."""
        lines = (self.folder / file).read_text().splitlines()[2:]
        rows, columns = (int(word) for word in lines[0].split()[3:5])
        down, around, *values = ([float(word) for word in line.split()] for line in lines[2:])
        self.assertEqual((len(down), len(around), len(values)), (rows, columns, columns))
        return np.array(down), np.array(around), np.array(values)

    def test_node_trees_of_lights(self):
        # An area light that is red for positive x in its own space.
        tree, emission, place, parts, half = self.lamp("AREA", "NewGeometry", "SeparateXYZ", "Math", size=2.0)
        half.operation, half.inputs[1].default_value = "GREATER_THAN", 0.5
        tree.links.new(place.outputs["Parametric"], parts.inputs[0])
        tree.links.new(parts.outputs[0], half.inputs[0])
        tree.links.new(half.outputs[0], emission.inputs["Strength"])
        # A point light that emits towards its own +x only, with 3 times the strength.
        tree, emission, place, parts, half, strength = self.lamp("POINT", "TexCoord", "SeparateXYZ", "Math", "Math")
        half.operation, half.inputs[1].default_value = "GREATER_THAN", 0.0
        strength.operation, strength.inputs[1].default_value = "MULTIPLY", 3.0
        tree.links.new(place.outputs["Normal"], parts.inputs[0])
        tree.links.new(parts.outputs[0], half.inputs[0])
        tree.links.new(half.outputs[0], strength.inputs[0])
        tree.links.new(strength.outputs[0], emission.inputs["Strength"])
        bpy.ops.mesh.primitive_cube_add(size=1)
        settings, answer = self.export()
        self.assertFalse(answer["warnings"])
        screen, point = settings["lights"]
        image = bpy.data.images.load(str(self.folder / screen["area"]["image"]))
        image.colorspace_settings.name = "Non-Color"
        width, height = image.size
        pixels = np.array(image.pixels[:]).reshape(height, width, -1)[..., 0]
        halves = sorted((pixels[:, : width // 2 - 1].mean(), pixels[:, width // 2 + 1 :].mean()))
        np.testing.assert_allclose(halves, [0, 1], atol=1e-3)
        self.assertEqual(screen["area"]["power"], 10.0)
        self.assertAlmostEqual(point["point"]["intensity"], 3 * 10 / (4 * np.pi), places=2)
        down, around, values = self.profile(point["point"]["ies"])
        self.assertEqual((down[0], down[-1], around[0], around[-1]), (0, 180, 0, 360))
        beside = values[:, len(down) // 2]
        turned = np.minimum(around, 360 - around)
        np.testing.assert_allclose(beside[turned < 89], 1, atol=0.01)
        np.testing.assert_allclose(beside[turned > 91], 0, atol=0.01)

    def test_light_falloff_nodes(self):
        tree, emission, falloff = self.lamp("POINT", "LightFalloff")
        falloff.inputs["Strength"].default_value = 2.0
        tree.links.new(falloff.outputs["Constant"], emission.inputs["Strength"])
        bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 3, 4))
        settings, answer = self.export()
        (light,) = settings["lights"]
        self.assertAlmostEqual(light["point"]["power"], 10 * 2 * 5**2, delta=2)
        self.assertIn("right at a distance of 5 m", answer["warnings"][0][1])

    def composed(self):
        """A new compositing tree, its Render Layers and its output node."""
        if hasattr(self.scene, "compositing_node_group"):
            tree = bpy.data.node_groups.new("composed", "CompositorNodeTree")
            tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
            self.scene.compositing_node_group = tree
            end = tree.nodes.new("NodeGroupOutput")
        else:
            self.scene.use_nodes = True
            tree = self.scene.node_tree
            tree.nodes.clear()
            end = tree.nodes.new("CompositorNodeComposite")
        return tree, tree.nodes.new("CompositorNodeRLayers"), end

    def test_warnings_of_fast_gi_and_adaptive_subdivision(self):
        messages = lambda kind: " ".join(message for _, message in self.export()[1][kind])
        plane, cycles = self.add_plane(None, "Sea"), self.scene.cycles
        fine = plane.modifiers.new("Fine", "SUBSURF")
        for kind in ("warnings", "notes"):
            for word in ("Fast GI", "adaptive subdivision"):
                self.assertNotIn(word, messages(kind))
        cycles.use_fast_gi = True
        self.scene.render.resolution_x = self.scene.render.resolution_y = 64
        # Since Blender 5.0, and before.
        if hasattr(fine, "use_adaptive_subdivision"):
            fine.use_adaptive_subdivision = True
        else:
            cycles.feature_set, plane.cycles.use_adaptive_subdivision = "EXPERIMENTAL", True
        answer = self.export()[1]
        self.assertEqual([place for place, _ in answer["warnings"]], [""])
        self.assertEqual([place for place, text in answer["notes"] if "adaptive subdivision" in text], ["Sea"])

    def test_adaptive_subdivision_levels(self):
        plane, cycles, eye = self.add_plane(None, "Sea"), self.scene.cycles, self.scene.camera
        fine = plane.modifiers.new("Fine", "SUBSURF")
        fine.subdivision_type = "SIMPLE"
        if not hasattr(fine, "use_adaptive_subdivision"):
            self.skipTest("older Blender has the switch elsewhere")
        fine.use_adaptive_subdivision = True
        self.scene.render.resolution_x = self.scene.render.resolution_y = 64
        eye.data.type, eye.data.ortho_scale = "ORTHO", 4.0
        faces = lambda: len(read_ply(self.folder / self.export()[0]["objects"][0]["mesh"])[2])
        # Edges of two metres have 32 pixels.
        for size, levels in ((1.0, 5), (8.0, 2)):
            fine.adaptive_pixel_size = size
            self.assertEqual(faces(), 2 * 4**levels, size)

    def test_view_layers_without_environment(self):
        self.scene.world = bpy.data.worlds.new("grey")
        self.scene.world.use_nodes = True
        found = lambda: self.export()[0]["environment"]["background"]
        self.assertGreater(min(found()), 0.0)
        self.scene.view_layers[0].use_sky = False
        self.assertEqual(found(), [0.0] * 3)

    def test_last_row_of_matrices(self):
        plane = self.add_plane(None, "Tilted")
        plane.parent = bpy.data.objects.new("holder", None)
        self.scene.collection.objects.link(plane.parent)
        plane.matrix_parent_inverse[3][3] = 0.9999999
        self.assertEqual(self.export()[0]["objects"][0]["transform"][0]["matrix"][12:], [0.0, 0.0, 0.0, 1.0])

    def test_warnings_of_compositing_and_sequencer(self):
        def messages():
            answer = self.export()[1]
            return [" ".join(m for _, m in answer[kind]) for kind in ("warnings", "notes")]

        tree, layers, end = self.composed()
        tree.links.new(layers.outputs["Image"], end.inputs[0])
        self.assertNotIn("compositing", messages()[0])
        glare = tree.nodes.new("CompositorNodeGlare")
        tree.links.new(layers.outputs["Image"], glare.inputs["Image"])
        tree.links.new(glare.outputs["Image"], end.inputs[0])
        editor = self.scene.sequence_editor_create()
        strips = editor.strips if hasattr(editor, "strips") else editor.sequences
        last = {"length": 10} if bpy.app.version >= (5, 0, 0) else {"frame_end": 10}
        strip = strips.new_effect(name="card", type="COLOR", channel=1, frame_start=1, **last)
        self.scene.view_layers[0].aovs.add().name = "wear"
        warnings = messages()[0]
        for lost in ("compositing", "sequencer", "AOV 'wear'"):
            self.assertIn(lost, warnings)
        glare.mute = strip.mute = True
        for kept in ("compositing", "sequencer"):
            self.assertNotIn(kept, messages()[0])

    def test_limits_of_bounces_and_clamping(self):
        names = ("depth", "bounces", "clamp", "filter_glossy", "skip_caustics", "microfacet", "caught")
        cycles = self.scene.cycles
        found = lambda: {name: value for name, value in self.export()[0]["render"].items() if name in names}
        for kind, limit in (("", 12), ("diffuse_", 4), ("glossy_", 4), ("transmission_", 12), ("volume_", 0), ("transparent_max_", 8)):
            self.assertEqual(cycles.bl_rna.properties[f"{kind or 'max_'}bounces"].default, limit)
            setattr(cycles, f"{kind or 'max_'}bounces", limit)
        self.assertEqual((cycles.sample_clamp_direct, cycles.sample_clamp_indirect, cycles.blur_glossy), (0, 10, 1))
        # Cycles doesn't count the last bounce.
        bounces = {"diffuse": 5, "glossy": 5, "volume": 1, "transparent": 9, "subsurface": 256}
        usual = {"depth": 13, "bounces": bounces, "clamp": {"indirect": 10.0}, "filter_glossy": 1.0}
        self.assertEqual(found(), usual)
        self.scene.render.engine = "BLENDER_WORKBENCH"
        self.assertEqual(found(), usual)
        self.scene.render.engine = "CYCLES"
        # Cycles clamps before the film's exposure.
        cycles.film_exposure, cycles.sample_clamp_direct = 2.0, 3.0
        cycles.max_bounces, cycles.blur_glossy = 4, 0.0
        few = {"depth": 5, "bounces": {"volume": 1, "transparent": 9, "subsurface": 256}, "clamp": {"direct": 6.0, "indirect": 20.0}}
        self.assertEqual(found(), few)
        cycles.caustics_refractive = False
        self.assertEqual(found(), {**few, "skip_caustics": {"refractive": True}})

    def test_settings_of_the_add_on(self):
        """Settings that imitate Cycles are missing."""
        rough, _, shader = shader_tree("rough")
        shader.distribution, shader.inputs["Metallic"].default_value = "GGX", 1.0
        self.add_plane(rough).is_shadow_catcher = True
        names = {"depth", "bounces", "clamp", "filter_glossy", "microfacet", "caught", "terminator"}
        found = self.export()[0]["render"]
        self.assertLessEqual(names, set(found))
        self.assertEqual((found["microfacet"], found["caught"], found["terminator"]), ("single", "shadows", "lifted"))
        for obj in self.scene.objects:
            obj.cycles.shadow_terminator_geometry_offset = 0.0
        self.assertEqual(self.export()[0]["render"]["terminator"], "off")
        # As the add-on registers it, so that Blender keeps its name.
        bpy.utils.register_class(final_render.Engine)
        self.addCleanup(bpy.utils.unregister_class, final_render.Engine)
        self.scene.render.engine = final_render.ENGINE
        self.assertFalse(names & set(self.export()[0]["render"]))

    def test_pixel_aspect(self):
        render, eye = self.scene.render, self.scene.camera
        render.resolution_x, render.resolution_y = 120, 160
        eye.data.shift_x = 0.1
        for aspect, heights in (((1, 1), 1), ((1.5, 1), 120 * 1.5 / 160), ((1, 2), 1)):
            render.pixel_aspect_x, render.pixel_aspect_y = aspect
            settings, answer = self.export()
            found = settings["camera"][0]
            self.assertEqual(found.get("pixel_aspect", 1), aspect[0] / aspect[1])
            # Blender fits the sensor to the longer side of the picture as it is shown.
            self.assertAlmostEqual(found["shift"][0], 0.1 * heights, places=6)
            self.assertAlmostEqual(found["aspect_ratio"], 120 * aspect[0] / (160 * aspect[1]), places=6)
            longer = max(found["aspect_ratio"], 1)
            self.assertAlmostEqual(np.tan(np.radians(found["vfov"]) / 2) * longer, 36 / 2 / eye.data.lens, places=6)
            self.assertFalse(answer["warnings"])

    def test_active_cameras_of_other_types(self):
        spot = bpy.data.objects.new("spot", bpy.data.lights.new("spot", "SPOT"))
        spot.data.spot_size, spot.location = np.pi / 2, (1, 2, 3)
        empty = bpy.data.objects.new("empty", None)
        for active, focal_length in ((empty, 50), (spot, 16)):
            self.scene.collection.objects.link(active)
            self.scene.camera = active
            settings, answer = self.export()
            cameras = settings["camera"]
            self.assertEqual(([found["name"] for found in cameras], answer["warnings"]), ([active.name, "Eye"], []))
            across = np.tan(np.radians(cameras[0]["vfov"]) / 2) * cameras[0]["aspect_ratio"]
            self.assertAlmostEqual(across, 36 / 2 / focal_length, places=6)


if __name__ == "__main__":
    main()
