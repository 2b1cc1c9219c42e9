"""Tests node trees of materials and worlds, attributes and baking.

    python test_nodes.py        with a Python that has bpy
"""

import json
import math
import unittest

import bpy
import numpy as np

from testing import SceneTest, read_ply, shader_tree


class NodesTest(SceneTest):
    def export(self, *more):
        """The scene file."""
        return super().export(*more)[0]

    def vertices(self, settings, number):
        """The header of a mesh file and its vertices."""
        return read_ply(self.folder / settings["objects"][number]["mesh"])[:2]

    def test_node_trees(self):
        material, tree, shader, noise, ramp, place = shader_tree("rust", "TexNoise", "ValToRGB", "TexCoord")
        tree.links.new(place.outputs["Object"], noise.inputs["Vector"])
        tree.links.new(noise.outputs[0], ramp.inputs[0])
        tree.links.new(ramp.outputs[0], shader.inputs["Base Color"])
        self.add_plane(material)
        settings = self.export()
        table = settings["materials"]["rust"]
        nodes = table["nodes"]
        base = nodes[table["surface"]]["base_color"]
        self.assertEqual((table["type"], table["up"], nodes[table["surface"]]["type"]), ("nodes", "z", "principled_bsdf"))
        ramp = nodes[base.split(".")[0]]
        self.assertEqual((ramp["type"], len(ramp["stops"])), ("color_ramp", 2))
        noise = nodes[ramp["factor"].split(".")[0]]
        self.assertEqual((noise["type"], noise["dimensions"]), ("noise_texture", "3d"))
        self.assertTrue(noise["vector"].endswith(".object"))
        self.assertEqual(settings["objects"][0]["materials"], ["rust"])

    def test_texture_mappings(self):
        material, tree, shader, noise, place = shader_tree("old", "TexNoise", "TexCoord")
        tree.links.new(place.outputs["Object"], noise.inputs["Vector"])
        tree.links.new(noise.outputs[0], shader.inputs["Base Color"])
        noise.texture_mapping.vector_type, noise.texture_mapping.scale = "TEXTURE", (10, 10, 5)
        noise.texture_mapping.mapping_y, noise.texture_mapping.mapping_z = "X", "NONE"
        self.add_plane(material)
        table = self.export()["materials"]["old"]
        nodes = table["nodes"]
        fed = lambda node, key: nodes[node[key].split(".")[0]]
        mapping = fed(fed(nodes[table["surface"]], "base_color"), "vector")
        self.assertEqual((mapping["type"], mapping["vector_type"], mapping["scale"]), ("mapping", "texture", [10.0, 10.0, 5.0]))
        axes = fed(mapping, "vector")
        self.assertEqual([axes[axis] for axis in "xyz"], [axes["x"], axes["x"], 0.0])
        self.assertTrue(fed({"x": axes["x"]}, "x")["vector"].endswith(".object"))

    def test_conversion_of_constants(self):
        material, tree, shader, color = shader_tree("one", "RGB")
        color.outputs[0].default_value = (1.0, 0.5, 0.0, 1.0)
        tree.links.new(color.outputs[0], shader.inputs["Roughness"])
        tree.links.new(color.outputs[0], shader.inputs["Base Color"])
        self.add_plane(material)
        table = self.export()["materials"]["one"]
        surface = table["nodes"][table["surface"]]
        self.assertEqual(surface["base_color"], [1.0, 0.5, 0.0])
        self.assertAlmostEqual(surface["roughness"], 0.2126729 + 0.5 * 0.7151522, places=5)

    def test_cached_worlds(self):
        world = bpy.data.worlds.new("sky")
        bpy.context.scene.world = world
        world.use_nodes = True
        tree = world.node_tree
        place = tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(place.outputs["Window"], tree.nodes["Background"].inputs["Color"])
        self.add_plane(bpy.data.materials.new("plain"))
        cache = self.folder / "cache"
        self.export("--cache", str(cache))
        picture = self.folder / "scene.world.exr"
        first = picture.read_bytes()
        (kept,) = cache.glob("*.oscura")
        before = kept.stat().st_mtime_ns
        picture.unlink()
        self.export("--cache", str(cache))
        self.assertEqual(picture.read_bytes(), first)
        self.assertEqual([path.name for path in cache.glob("*.oscura")], [kept.name])
        self.assertGreaterEqual(kept.stat().st_mtime_ns, before)
        tree.nodes["Background"].inputs["Strength"].default_value = 2.0
        self.export("--cache", str(cache))
        self.assertNotEqual(picture.read_bytes(), first)

    def test_light_path_in_rendered_worlds(self):
        world = bpy.data.worlds.new("paper")
        bpy.context.scene.world = world
        world.use_nodes = True
        tree = world.node_tree
        place, path, mix = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "LightPath", "MixShader"))
        shown = tree.nodes["Background"]
        tree.links.new(place.outputs["Window"], shown.inputs["Color"])
        tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
        dim = tree.nodes.new("ShaderNodeBackground")
        tree.links.new(place.outputs["Window"], dim.inputs["Color"])
        dim.inputs["Strength"].default_value = 0.1
        tree.links.new(dim.outputs[0], mix.inputs[1])
        tree.links.new(shown.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], tree.nodes["World Output"].inputs["Surface"])
        self.add_plane(bpy.data.materials.new("plain"))
        environment = self.export()["environment"]
        self.assertNotEqual(environment["image"], environment["seen"]["image"])
        files = [self.folder / name for name in (environment["image"], environment["seen"]["image"])]
        lit, seen = (bpy.data.images.load(str(file)) for file in files)
        self.assertAlmostEqual(np.mean(lit.pixels[:][0::4]) / np.mean(seen.pixels[:][0::4]), 0.1, places=2)

    def test_world_textures(self):
        world = bpy.data.worlds.new("sky")
        bpy.context.scene.world = world
        world.use_nodes = True
        tree = world.node_tree
        place, voronoi, mix, other = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "TexVoronoi", "MixShader", "Emission"))
        background, end = tree.nodes["Background"], tree.nodes["World Output"]
        tree.links.new(place.outputs["Normal"], voronoi.inputs["Vector"])
        tree.links.new(voronoi.outputs["Color"], background.inputs["Color"])
        background.inputs["Strength"].default_value = 2.0
        for socket, shader in zip(mix.inputs[1:], (background, other)):
            tree.links.new(shader.outputs[0], socket)
        tree.links.new(mix.outputs[0], end.inputs["Surface"])
        self.add_plane(bpy.data.materials.new("plain"))
        settings = self.export()
        self.assertEqual(settings["environment"]["texture"], "world")
        table = settings["textures"]["world"]
        found = lambda value: table["nodes"][value.rpartition(".")[0]]
        total = found(table["result"])
        self.assertEqual(total["type"], "vector_math")
        shares = [found(total[key]) for key in "ab" if isinstance(total[key], str)]
        # Half of strength 2.
        (first,) = [found(share["a"]) for share in shares]
        seen = found(first["a"]) if first["type"] == "vector_math" else first
        self.assertEqual(seen["type"], "voronoi_texture")
        back = found(seen["vector"])
        self.assertEqual((back["operation"], back["scale"], found(back["a"])["type"]), ("scale", -1.0, "geometry"))
        self.assertEqual(total["b"], 0.5)
        tree.links.new(tree.nodes.new("ShaderNodeRGB").outputs[0], background.inputs["Color"])
        self.assertEqual(len(self.export()["environment"]["background"]), 3)

    def test_sun_of_sky_textures(self):
        world = bpy.data.worlds.new("sky")
        bpy.context.scene.world = world
        world.use_nodes = True
        tree = world.node_tree
        sky, tint = tree.nodes.new("ShaderNodeTexSky"), tree.nodes.new("ShaderNodeHueSaturation")
        sky.sun_elevation, sky.sun_rotation = math.radians(30), math.radians(90)
        background = tree.nodes["Background"]
        tree.links.new(sky.outputs[0], background.inputs["Color"])
        self.add_plane(bpy.data.materials.new("plain"))
        plain = self.export()["environment"]["sun"]
        # Towards +x of Blender, light travels down and towards -x.
        np.testing.assert_allclose(plain["direction"], [-math.cos(math.radians(30)), -0.5, 0], atol=1e-6)
        self.assertAlmostEqual(plain["angle"], math.degrees(sky.sun_size), places=4)
        tint.inputs["Saturation"].default_value = 0.0
        tree.links.new(sky.outputs[0], tint.inputs["Color"])
        tree.links.new(tint.outputs[0], background.inputs["Color"])
        background.inputs["Strength"].default_value = 0.5
        grey = self.export()["environment"]["sun"]["irradiance"]
        np.testing.assert_allclose(grey, [max(plain["irradiance"]) / 2] * 3, rtol=1e-3)
        # A sun at the horizon is no light.
        sky.sun_elevation = 0.0
        self.assertNotIn("sun", self.export()["environment"])
        sky.sun_elevation, sky.sun_disc = math.radians(30), False
        self.assertNotIn("sun", self.export()["environment"])

    def test_groups_reroutes_and_muted_nodes(self):
        inner = bpy.data.node_groups.new("inner", "ShaderNodeTree")
        inner.interface.new_socket("Amount", in_out="INPUT", socket_type="NodeSocketFloat").default_value = 0.25
        inner.interface.new_socket("Result", in_out="OUTPUT", socket_type="NodeSocketFloat")
        begin, end = inner.nodes.new("NodeGroupInput"), inner.nodes.new("NodeGroupOutput")
        double, muted = inner.nodes.new("ShaderNodeMath"), inner.nodes.new("ShaderNodeMath")
        double.operation, muted.operation, muted.mute = "MULTIPLY", "SINE", True
        double.inputs[1].default_value = 2
        inner.links.new(begin.outputs[0], double.inputs[0])
        inner.links.new(double.outputs[0], muted.inputs[0])
        inner.links.new(muted.outputs[0], end.inputs[0])
        material, tree, shader, group, other, reroute = shader_tree("grouped", "Group", "Group", "Value")
        group.node_tree = other.node_tree = inner
        other.inputs[0].default_value = 0.4
        reroute = tree.nodes.new("NodeReroute")
        tree.links.new(group.outputs[0], reroute.inputs[0])
        tree.links.new(reroute.outputs[0], shader.inputs["Roughness"])
        tree.links.new(other.outputs[0], shader.inputs["Metallic"])
        self.add_plane(material)
        table = self.export()["materials"]["grouped"]
        end = table["nodes"][table["surface"]]
        values = [table["nodes"][end[name].split(".")[0]] for name in ("roughness", "metallic")]
        self.assertEqual([value["operation"] for value in values], ["multiply", "multiply"])
        np.testing.assert_allclose([value["a"] for value in values], [0.25, 0.4], atol=1e-6)

    def test_inputs_without_a_source(self):
        """Muted nodes and hidden inputs: values are those of the last input."""
        material, tree, shader, color, value, group = shader_tree("silent", "RGB", "Value", "Group")
        group.node_tree = inner = bpy.data.node_groups.new("inner", "ShaderNodeTree")
        for way in ("INPUT", "OUTPUT"):
            inner.interface.new_socket("Color", in_out=way, socket_type="NodeSocketColor")
        ends = inner.nodes.new("NodeGroupInput"), inner.nodes.new("NodeGroupOutput")
        inner.links.new(ends[0].outputs[0], ends[1].inputs[0])
        gamma, noise = tree.nodes.new("ShaderNodeGamma"), tree.nodes.new("ShaderNodeTexNoise")
        shader.inputs["Roughness"].default_value = 0.375
        group.inputs[0].default_value, gamma.inputs["Gamma"].default_value = (0.125, 0.25, 0.5, 1), 2.0
        gamma.inputs["Color"].hide_value = True
        tree.links.new(value.outputs[0], shader.inputs["Roughness"])
        tree.links.new(color.outputs[0], noise.inputs["Vector"])
        tree.links.new(group.outputs[0], gamma.inputs["Color"])
        tree.links.new(gamma.outputs[0], shader.inputs["Base Color"])
        tree.links.new(noise.outputs[0], shader.inputs["Metallic"])
        color.mute = value.mute = group.mute = True
        self.add_plane(material)
        table = self.export()["materials"]["silent"]
        surface = table["nodes"][table["surface"]]
        fed = lambda name: table["nodes"][surface[name].split(".")[0]]
        self.assertEqual((surface["roughness"], fed("base_color")["color"]), (0.375, [0.125, 0.25, 0.5]))
        self.assertEqual(fed("metallic")["vector"], "coordinates.generated")

    def test_materials_without_surface_and_color_as_surface(self):
        bare = bpy.data.materials.new("bare")
        bare.use_nodes = True
        bare.node_tree.nodes.clear()
        lit, tree, _, color = shader_tree("lit", "RGB")
        color.outputs[0].default_value = (0.1, 0.5, 0.9, 1)
        tree.links.new(color.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        read, read_tree, shader, noise, mix = shader_tree("read", "TexNoise", "MixShader")
        read_tree.links.new(noise.outputs["Color"], shader.inputs["Base Color"])
        read_tree.links.new(noise.outputs["Color"], mix.inputs[2])
        read_tree.links.new(shader.outputs[0], mix.inputs[1])
        read_tree.links.new(mix.outputs[0], read_tree.nodes["Material Output"].inputs["Surface"])
        self.add_plane(bare, "Bare")
        self.add_plane(lit, "Lit")
        self.add_plane(read, "Read")
        materials = self.export()["materials"]
        nodes = materials["read"]["nodes"]
        self.assertEqual(nodes[nodes[materials["read"]["surface"]]["b"]]["type"], "emission")
        self.assertEqual(materials["bare"], {"type": "lambert", "color": [0.0, 0.0, 0.0]})
        shown = materials["lit"]["nodes"][materials["lit"]["surface"]]
        self.assertEqual(shown["type"], "emission")
        np.testing.assert_allclose(shown["color"], [0.1, 0.5, 0.9], atol=1e-6)

    def test_attributes(self):
        material, tree, shader, first, second = shader_tree("painted", "UVMap", "VertexColor")
        first.uv_map, second.layer_name = "other", "paint"
        tree.links.new(first.outputs[0], shader.inputs["Emission Color"])
        tree.links.new(second.outputs[0], shader.inputs["Base Color"])
        plane = self.add_plane(material)
        mesh = plane.data
        mesh.uv_layers.new(name="other")
        mesh.color_attributes.new("paint", "FLOAT_COLOR", "POINT")
        mesh.attributes.new("unread", "FLOAT", "POINT")
        settings = self.export()
        lines, values = self.vertices(settings, 0)
        named = [line.split(" ", 5)[5] for line in lines if line.startswith("comment oscura attribute")]
        self.assertEqual(sorted(named), ["other", "paint"])
        self.assertEqual(len(values["x"]), 4)

    def test_hidden_originals_and_edit_mode(self):
        material, *_ = shader_tree("grey")
        hidden = bpy.data.collections.new("originals")
        hidden.hide_render = hidden.hide_viewport = True
        self.scene.collection.children.link(hidden)
        ball = self.add_plane(material, "Ball")
        self.scene.collection.objects.unlink(ball)
        hidden.objects.link(ball)
        group = bpy.data.collections.new("group")
        group.objects.link(ball)
        empty = bpy.data.objects.new("Empty", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", group
        self.scene.collection.objects.link(empty)
        bpy.ops.mesh.primitive_cube_add()
        bpy.context.object.name = "Edited"
        # As in Cycles, it has no effect in Edit Mode.
        bpy.context.object.modifiers.new("rounded", "SUBSURF").show_in_editmode = False
        bpy.ops.object.mode_set(mode="EDIT")
        settings = self.export()
        self.assertEqual(sorted(entry["name"] for entry in settings["objects"]), ["Edited", "Empty/Ball"])
        number = next(i for i, entry in enumerate(settings["objects"]) if entry["name"] == "Edited")
        _, values = self.vertices(settings, number)
        self.assertEqual((values["z"].min(), values["z"].max()), (-1, 1))

    def test_instances_of_an_edited_object(self):
        """Meshes that geometry nodes of an object in Edit Mode instance are not that object's mesh."""
        bpy.ops.mesh.primitive_cube_add()
        edited = bpy.context.object
        edited.name = "Edited"
        tree = bpy.data.node_groups.new("copies", "GeometryNodeTree")
        for way in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
        types = ("NodeGroupInput", "NodeGroupOutput", "GeometryNodeExtrudeMesh", "GeometryNodeMeshLine", "GeometryNodeInstanceOnPoints", "GeometryNodeJoinGeometry")
        start, end, extrude, line, copies, both = (tree.nodes.new(name) for name in types)
        tree.links.new(start.outputs[0], extrude.inputs["Mesh"])
        tree.links.new(line.outputs["Mesh"], copies.inputs["Points"])
        tree.links.new(extrude.outputs["Mesh"], copies.inputs["Instance"])
        tree.links.new(start.outputs[0], both.inputs[0])
        tree.links.new(copies.outputs["Instances"], both.inputs[0])
        tree.links.new(both.outputs[0], end.inputs[0])
        edited.modifiers.new("copies", "NODES").node_group = tree
        bpy.ops.object.mode_set(mode="EDIT")
        settings = self.export()
        counts = sorted(len(self.vertices(settings, i)[1]["x"]) for i in range(len(settings["objects"])))
        self.assertTrue(len(counts) > 1 and counts[0] < counts[-1], counts)

    def test_missing_images(self):
        material, tree, shader, node, alpha = shader_tree("lost", "TexImage", "TexImage")
        picture = bpy.data.images.new("picture", 8, 8)
        picture.filepath_raw, picture.file_format = str(self.folder / "picture.png"), "PNG"
        picture.save()
        node.image = alpha.image = bpy.data.images.load(picture.filepath_raw)
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        tree.links.new(alpha.outputs["Alpha"], shader.inputs["Alpha"])
        tree.links.new(node.outputs["Color"], shader.inputs["Normal"])
        empty, tree, shader, node = shader_tree("empty", "TexImage")
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        self.add_plane(material, "Lost")
        self.add_plane(empty, "Empty")
        base = lambda found, name: found[name]["nodes"][found[name]["surface"]]["base_color"]
        warnings = lambda: [message for _, message in json.loads((self.folder / "answer.json").read_text())["warnings"]]
        found = self.export()["materials"]
        self.assertEqual((type(base(found, "lost")), base(found, "empty"), warnings()), (str, [1.0, 0.0, 1.0], []))
        (self.folder / "picture.png").unlink()
        found = self.export()["materials"]
        self.assertEqual((base(found, "lost"), base(found, "empty")), ([1.0, 0.0, 1.0], [1.0, 0.0, 1.0]))
        lost = found["lost"]["nodes"][found["lost"]["surface"]]
        self.assertEqual((lost["alpha"], lost["normal"]), (1.0, [1.0, 0.0, 1.0]))
        self.assertNotIn("normal", found["empty"]["nodes"][found["empty"]["surface"]])
        self.assertEqual(warnings(), ["images whose files are missing are magenta, as in Blender: 'picture.png'"])

    def test_missing_images_with_clip(self):
        """A file that is missing, and a node without an image."""
        empty, empty_tree, empty_shader, empty_node = shader_tree("empty", "TexImage")
        empty_node.extension = "CLIP"
        for output, name in (("Color", "Base Color"), ("Alpha", "Alpha")):
            empty_tree.links.new(empty_node.outputs[output], empty_shader.inputs[name])
        self.add_plane(empty, "Empty")
        material, tree, shader, node = shader_tree("lost", "TexImage")
        picture = bpy.data.images.new("picture", 8, 8)
        picture.filepath_raw, picture.file_format = str(self.folder / "picture.png"), "PNG"
        picture.save()
        node.image, node.extension = bpy.data.images.load(picture.filepath_raw), "CLIP"
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        (self.folder / "picture.png").unlink()
        self.add_plane(material, "Lost")
        tables = self.export()["materials"]
        for name in ("lost", "empty"):
            image = next(node for node in tables[name]["nodes"].values() if node["type"] == "image_texture")
            self.assertEqual(image["extension"], "clip")
            found = bpy.data.images.load(str(self.folder / image["file"]))
            self.assertEqual((tuple(found.size), list(found.pixels)), ((1, 1), [1.0, 0.0, 1.0, 1.0]))
        self.assertTrue(tables["empty"]["nodes"]["principled_bsdf"]["alpha"].endswith(".alpha"))

    def test_constant_folding(self):
        material, tree, shader, half = shader_tree("wax", "Math")
        half.operation, half.inputs[0].default_value, half.inputs[1].default_value = "MULTIPLY", 1.5, 0.5
        tree.links.new(half.outputs[0], shader.inputs["Subsurface Weight"])
        self.add_plane(material)
        table = self.export()["materials"]["wax"]
        mix = table["nodes"][table["surface"]]
        self.assertEqual((mix["type"], mix["factor"]), ("mix_shader", 0.75))

    def test_nodes_that_trace_rays(self):
        """Ambient Occlusion in a group, and Bevel; nothing is baked."""
        inner = bpy.data.node_groups.new("nooks", "ShaderNodeTree")
        inner.interface.new_socket("Shade", in_out="OUTPUT", socket_type="NodeSocketFloat")
        occlusion, end = inner.nodes.new("ShaderNodeAmbientOcclusion"), inner.nodes.new("NodeGroupOutput")
        occlusion.samples, occlusion.inside, occlusion.inputs["Distance"].default_value = 8, True, 0.0
        inner.links.new(occlusion.outputs["AO"], end.inputs[0])
        material, tree, shader, group, bevel = shader_tree("dirty", "Group", "Bevel")
        group.node_tree = inner
        bevel.samples, bevel.inputs["Radius"].default_value = 3, 0.25
        tree.links.new(group.outputs[0], shader.inputs["Roughness"])
        tree.links.new(bevel.outputs[0], shader.inputs["Normal"])
        bpy.context.scene.world = bpy.data.worlds.new("far")
        bpy.context.scene.world.light_settings.distance = 3.0
        self.add_plane(material)
        table = self.export()["materials"]["dirty"]
        answer = json.loads((self.folder / "answer.json").read_text())
        self.assertEqual([message for _, message in answer["notes"] if "is baked" in message], [])
        nodes = table["nodes"]
        surface = nodes[table["surface"]]
        shade, normal = (nodes[surface[key].split(".")[0]] for key in ("roughness", "normal"))
        self.assertEqual(surface["roughness"].split(".")[1], "ao")
        self.assertEqual({key: shade[key] for key in ("type", "samples", "inside", "only_local")}, {"type": "ambient_occlusion", "samples": 8, "inside": True, "only_local": False})
        # A distance of 0 is that of the world.
        self.assertEqual((shade["distance"], normal), (3.0, {"type": "bevel", "samples": 3, "radius": 0.25}))

    def test_geometry_attributes(self):
        """Pointiness and a random number per island, of two cubes in one mesh."""
        material, tree, shader, geometry = shader_tree("worn", "NewGeometry")
        tree.links.new(geometry.outputs["Pointiness"], shader.inputs["Roughness"])
        tree.links.new(geometry.outputs["Random Per Island"], shader.inputs["Metallic"])
        for x in (0, 5):
            bpy.ops.mesh.primitive_cube_add(location=(x, 0, 0))
        for cube in bpy.data.objects:
            cube.select_set(True)
        bpy.ops.object.join()
        bpy.context.object.data.materials.append(material)
        head, rows = self.vertices(self.export(), 0)
        labels = [line.split() for line in head if line.startswith("comment oscura attribute")]
        columns = {name: f"a{index}_0" for _, _, _, index, _, name in labels}
        self.assertEqual(sorted(columns), ["pointiness", "random_per_island"])
        # The edges of a corner are at an angle of acos(-1 / sqrt 3) to its normal.
        np.testing.assert_allclose(rows[columns["pointiness"]], math.acos(-1 / math.sqrt(3)) / math.pi, atol=1e-5)
        numbers = {round(float(x)): set(rows[columns["random_per_island"]][np.abs(rows["x"] - x) < 1.5].tolist()) for x in (0, -5)}
        self.assertTrue(len(numbers[0]) == len(numbers[-5]) == 1 and numbers[0] != numbers[-5], numbers)

    def test_baked_nodes(self):
        """A sky texture on a surface, in a group."""
        inner = bpy.data.node_groups.new("nooks", "ShaderNodeTree")
        inner.interface.new_socket("Shade", in_out="OUTPUT", socket_type="NodeSocketColor")
        sky, end = inner.nodes.new("ShaderNodeTexSky"), inner.nodes.new("NodeGroupOutput")
        inner.links.new(sky.outputs["Color"], end.inputs[0])
        material, tree, shader, group = shader_tree("dirty", "Group")
        group.node_tree = inner
        tree.links.new(group.outputs[0], shader.inputs["Emission Color"])
        self.add_plane(material)
        table = self.export("--bake", "32")["materials"]["dirty"]
        answer = json.loads((self.folder / "answer.json").read_text())
        self.assertEqual([about for about, message in answer["notes"] if "is baked" in message], ["dirty"])
        nodes = table["nodes"]
        baked = next(node for node in nodes.values() if node["type"] == "image_texture")
        self.assertEqual(nodes[baked["vector"].split(".")[0]]["name"], "oscura bake")
        self.assertGreater(self.pixels(str(self.folder / baked["file"]))[4:-4, 4:-4, :3].mean(), 0.0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
