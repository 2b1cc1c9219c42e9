"""Tries what meshes and materials become where glTF has something else, and what lights are linked to.

    python test_surfaces.py            with a Python that has bpy
"""

import bpy
import numpy as np
from testing import SceneTest, baked, main, read_ply, shader_tree

import bmesh  # isort: skip (bpy puts it on the path)


def _points_of(radius, material):
    """Nodes that make points of vertices, of radii by an attribute."""
    group = bpy.data.node_groups.new("Points", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = ("NodeGroupInput", "NodeGroupOutput", "GeometryNodeMeshToPoints", "GeometryNodeInputNamedAttribute", "GeometryNodeSetMaterial")
    begin, end, points, width, paint = map(group.nodes.new, kinds)
    width.data_type, width.inputs["Name"].default_value = "FLOAT", radius
    paint.inputs["Material"].default_value = material
    group.links.new(begin.outputs[0], points.inputs["Mesh"])
    group.links.new(width.outputs["Attribute"], points.inputs["Radius"])
    group.links.new(points.outputs[0], paint.inputs["Geometry"])
    group.links.new(paint.outputs[0], end.inputs[0])
    return group


class SurfacesTest(SceneTest):
    """What meshes and materials become where glTF has something else."""

    def values(self, model, number):
        """The rows of an accessor of floats, or of whole numbers up to 1."""
        accessor = model.json["accessors"][number]
        view = model.json["bufferViews"][accessor["bufferView"]]
        width, (kind, one) = {"VEC3": 3, "VEC4": 4}[accessor["type"]], {5126: ("<f4", 1), 5123: ("<u2", 65535), 5121: ("<u1", 255)}[accessor["componentType"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        rows = np.frombuffer(bytes(model.binary[start:]), kind, width * accessor["count"])
        return rows.reshape(-1, width) / one

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
        _, settings, _ = self.export()
        self.assertEqual([entry["name"] for entry in sorted(settings["objects"], key=lambda entry: entry["name"])], ["Balls", "Ring", "Text"])

    def test_points_become_small_spheres_with_their_attributes(self):
        """A cloud by nodes: 30 corners of a grid, of two radii and with a colour of their own."""
        paint, tree, shader, attribute = shader_tree("paint", "Attribute")
        attribute.attribute_name = "shade"
        tree.links.new(attribute.outputs["Color"], shader.inputs["Base Color"])
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=5, y_subdivisions=4)
        cloud = bpy.context.object
        cloud.name, cloud.location = "Cloud", (0, 0, 2)
        shades = cloud.data.attributes.new("shade", "FLOAT_COLOR", "POINT")
        given = np.random.default_rng(1).uniform(size=(30, 4)).astype(np.float32)
        shades.data.foreach_set("color", given.ravel())
        radii = cloud.data.attributes.new("width", "FLOAT", "POINT")
        radii.data.foreach_set("value", np.tile(np.array([0.1, 0.05], np.float32), 15))
        cloud.modifiers.new("Points", "NODES").node_group = _points_of("width", paint)
        grid = np.array([vertex.co for vertex in cloud.data.vertices])
        _, settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        mesh = self.mesh(settings, "Cloud")
        places, shown = (np.stack([mesh[name] for name in names], 1) for names in (("x", "y", "z"), ("a0_0", "a0_1", "a0_2")))
        self.check_points(grid, given, places, shown)
        baked(paint)
        glb, _, answer = self.export_glb()
        self.assertEqual(answer["warnings"], [])
        (node,) = (node for node in glb.json["nodes"] if node["name"] == "Cloud")
        (primitive,) = glb.json["meshes"][node["mesh"]]["primitives"]
        places, shown = (self.values(glb, primitive["attributes"][name]) for name in ("POSITION", "COLOR_0"))
        self.check_points(grid[:, [0, 2, 1]] * (1, 1, -1), given, places, shown[:, :3])

    def check_points(self, grid, given, places, shown):
        """Are there spheres of two radii around all points, of their colours?"""
        away = np.linalg.norm(places[:, None] - grid, axis=2)
        nearest = away.argmin(1)
        self.assertEqual(set(nearest), set(range(30)))
        # As large as spheres when seen: corners lie a little outside.
        ratio = away.min(1) / np.tile([0.1, 0.05], 15)[nearest]
        self.assertTrue(((ratio > 1.0) & (ratio < 1.01)).all(), (ratio.min(), ratio.max()))
        np.testing.assert_allclose(shown, given[nearest, :3], atol=2e-5)

    def test_colors_of_vertices_need_no_picture(self):
        """Alone on a mesh, or with others of the same attribute; not beside a material without, there or elsewhere."""
        def painted(name, kind, attribute):
            material, tree, shader, node = shader_tree(name, kind)
            setattr(node, attribute, "paint")
            tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
            return baked(material)

        first, second, third = (
            painted("first", "VertexColor", "layer_name"),
            painted("second", "Attribute", "attribute_name"),
            painted("third", "VertexColor", "layer_name"),
        )
        leaf, tree, shader, node, let_through, mix = shader_tree("leaf", "VertexColor", "BsdfTranslucent", "MixShader")
        node.layer_name = "paint"
        tree.links.new(node.outputs[0], shader.inputs["Base Color"])
        for k, source in enumerate((shader, let_through), 1):
            tree.links.new(source.outputs[0], mix.inputs[k])
        tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        baked(leaf)
        plain = baked(shader_tree("plain")[0])
        given = np.random.default_rng(2).uniform(size=(4, 4)).astype(np.float32)
        for k, materials in enumerate(((first,), (first, second), (third,), (third, plain), (leaf,))):
            bpy.ops.mesh.primitive_grid_add(x_subdivisions=len(materials), y_subdivisions=1, location=(3 * k, 0, 0))
            grid = bpy.context.object
            grid.name = f"Grid{k}"
            colors = grid.data.color_attributes.new("paint", "FLOAT_COLOR", "POINT")
            colors.data.foreach_set("color", np.resize(given, (len(colors.data), 4)).ravel())
            for i, material in enumerate(materials):
                grid.data.materials.append(material)
                grid.data.polygons[i].material_index = i
        glb, _, answer = self.export_glb()
        self.assertEqual(answer["warnings"], [])
        textured = {m["name"].split(".")[0] for m in glb.json["materials"] if "baseColorTexture" in m["pbrMetallicRoughness"]}
        self.assertEqual(textured, {"third", "leaf"})
        for node in (node for node in glb.json["nodes"] if node["name"].startswith("Grid")):
            for primitive in glb.json["meshes"][node["mesh"]]["primitives"]:
                number = primitive["attributes"].get("COLOR_0")
                colors = np.ones((1, 3)) if number is None else self.values(glb, number)[:, :3]
                if node["name"] in ("Grid0", "Grid1"):
                    away = abs(colors[:, None] - given[:, :3]).max(2).min(1)
                    self.assertTrue(len(colors) == 4 and (away < 2e-5).all(), (node["name"], away))
                else:
                    self.assertTrue((colors == 1).all(), (node["name"], colors))

    def test_glass_without_an_inside_is_a_sheet(self):
        glass, _, shader = shader_tree("glass")
        shader.inputs["Transmission Weight"].default_value = 1.0
        shader.inputs["Base Color"].default_value = (0.25, 0.25, 0.25, 1)
        self.add("plane", glass, rotation=(np.pi / 2, 0, 0.4))
        self.add("plane", glass, location=(0, 0, 3))
        self.add("cube", glass, location=(4, 0, 0))
        _, settings, answer = self.export()
        solid, sheet = ({name for name, table in settings["materials"].items() if table.get("volume", False) == is_solid} for is_solid in (True, False))
        used = {entry["name"]: set(entry["materials"]) for entry in settings["objects"]}
        self.assertEqual((used, len(solid), len(sheet)), ({"Plane": sheet, "Plane.001": sheet, "Cube": solid}, 1, 1))
        self.check_notes(answer)
        baked(glass)
        model, settings, answer = self.export()
        bodies = [name for name, entries in settings["materials"].items() if entries == {"keeps_radiance": True}]
        sheets = [name for name, entries in settings["materials"].items() if entries == {"volume": False, "keeps_radiance": True}]
        self.assertEqual((len(bodies), len(sheets), len(settings["materials"])), (1, 1, 2))
        used = {model["materials"][mesh["primitives"][0]["material"]]["name"]: [] for mesh in model["meshes"]}
        for mesh in model["meshes"]:
            used[model["materials"][mesh["primitives"][0]["material"]]["name"]].append(mesh["name"].split(".")[0])
        self.assertEqual({name: sorted(meshes) for name, meshes in used.items()}, {bodies[0]: ["Cube"], sheets[0]: ["Plane", "Plane"]})
        for made in model["materials"]:
            self.assertAlmostEqual(made["pbrMetallicRoughness"]["baseColorFactor"][0], 0.25, places=5)
        self.check_notes(answer)

    def check_notes(self, answer):
        """Is what is told of upright sheets of glass told once?"""
        ((about, said),) = [note for note in answer["notes"] if "Solidify" in note[1]]
        self.assertEqual(about, "glass")
        self.assertIn("bends light", said)

    def test_glass_on_sheets_alone_is_not_copied(self):
        glass, _, shader = shader_tree("glass")
        shader.inputs["Transmission Weight"].default_value = 1.0
        self.add("grid", glass)
        metal, _, shader = shader_tree("metal")
        shader.inputs["Metallic"].default_value = 1.0
        self.add("plane", metal, location=(0, 0, 3))
        _, settings, answer = self.export()
        self.assertEqual({name: table.get("volume", False) for name, table in settings["materials"].items()}, {"glass": False, "metal": False})
        self.assertFalse([said for _, said in answer["notes"] if "Solidify" in said])
        baked(glass)
        baked(metal)
        model, settings, answer = self.export()
        self.assertEqual(settings["materials"], {"glass": {"volume": False, "keeps_radiance": True}})
        self.assertEqual(len(model["materials"]), 2)
        self.assertFalse([said for _, said in answer["notes"] if "Solidify" in said])

    def glass(self, name, kind="BsdfGlass", location=(0, 0, 0), **inputs):
        """A cube of one shader; gives its material, tree and node."""
        made, tree, _, node = shader_tree(name, kind)
        for key, value in inputs.items():
            node.inputs[key].default_value = value
        tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.add("cube", baked(made), location=location)
        return made, tree, node

    def test_glass_reflects_what_its_node_does(self):
        self.glass("white")
        self.glass("green", location=(3, 0, 0), Color=(0.5, 1, 0.25, 1))
        self.glass("bent", "BsdfRefraction", location=(6, 0, 0), Color=(0.5, 1, 0.25, 1))
        # Refraction under gloss by Fresnel is glass.
        made, tree, bent = self.glass("both", "BsdfRefraction", location=(9, 0, 0))
        gloss, fresnel, mix = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("BsdfGlossy", "Fresnel", "MixShader"))
        for k, source in enumerate((fresnel, bent, gloss)):
            tree.links.new(source.outputs[0], mix.inputs[k])
        tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        _, tree, painted = self.glass("painted", location=(12, 0, 0))
        checker = tree.nodes.new("ShaderNodeTexChecker")
        checker.inputs["Scale"].default_value = 2.0
        checker.inputs["Color1"].default_value, checker.inputs["Color2"].default_value = (1, 1, 1, 1), (0.5, 1, 1, 1)
        tree.links.new(checker.outputs["Color"], painted.inputs["Color"])
        model, settings, answer = self.export("--bake", "256")
        self.assertEqual(answer["warnings"], [])
        found = {name.split(".")[0]: entries.get("glass_reflection") for name, entries in settings["materials"].items()}
        self.assertEqual(found, {"white": None, "green": "tinted", "bent": "none", "both": None, "painted": "tinted"})
        materials = {m["name"].split(".")[0]: m for m in model["materials"]}
        for name in ("green", "bent"):
            color = materials[name]["pbrMetallicRoughness"]["baseColorFactor"][:3]
            np.testing.assert_allclose(color, [0.25, 1, 0.0625], atol=1e-6)
        # What both surfaces let through, as a file has it.
        pixels = self.pixels(self.picture(model, materials["painted"]))
        code = 1.055 * 0.25 ** (1 / 2.4) - 0.055
        for value in (1.0, code):
            self.assertGreater((np.abs(pixels[..., 0] - value) < 0.02).mean(), 0.15, value)

    @staticmethod
    def index_at(made, nanometres):
        """The index of refraction of a material at a wavelength, by KHR_materials_dispersion and Cauchy's law."""
        extensions = made["extensions"]
        ior, abbe = extensions["KHR_materials_ior"]["ior"], 20 / extensions["KHR_materials_dispersion"]["dispersion"]
        inverse = lambda nm: 1e6 / nm**2
        slope = (ior - 1) / abbe / (inverse(486.1) - inverse(656.3))
        return ior + slope * (inverse(nanometres) - inverse(587.6))

    def summed(self, tree, end, colors, iors):
        """A sum of glass, linked to a socket; gives its shaders."""
        last, made = None, []
        for color, ior in zip(colors, iors):
            node = tree.nodes.new("ShaderNodeBsdfGlass")
            node.inputs["Color"].default_value, node.inputs["IOR"].default_value = (*color, 1), ior
            node.inputs["Roughness"].default_value = 0.25
            made.append(node)
            if last is not None:
                both = tree.nodes.new("ShaderNodeAddShader")
                tree.links.new(last.outputs[0], both.inputs[0])
                tree.links.new(node.outputs[0], both.inputs[1])
                node = both
            last = node
        tree.links.new(last.outputs[0], end)
        return made

    def test_sums_of_glass_by_colours_split_light(self):
        rgb = np.eye(3).tolist()
        for k, (name, colors, iors) in enumerate((
            ("gem", rgb, (2.40, 2.42, 2.45)),
            ("even", (np.eye(3) * (0.5, 0.9, 0.25)).tolist(), (1.4,) * 3),
            ("odd", rgb, (1.6, 1.55, 1.5)),
            ("many", [*rgb, (1, 1, 1)], (1.5,) * 4),
        )):
            made, tree, _ = shader_tree(name)
            self.summed(tree, tree.nodes["Material Output"].inputs["Surface"], colors, iors)
            self.add("cube", baked(made), location=(3 * k, 0, 0))
        model, settings, answer = self.export()
        told = {about: message for about, message in answer["warnings"]}
        self.assertEqual(set(told), {"odd", "many"})
        self.assertIn("bends red more", told["odd"])
        self.assertIn("adds light", told["many"])
        gem, even, odd, many = (next(m for m in model["materials"] if m["name"] == name) for name in ("gem", "even", "odd", "many"))
        np.testing.assert_allclose([self.index_at(gem, 611.4), self.index_at(gem, 464.2)], [2.40, 2.45], atol=1e-5)
        for plain, ior in ((even, 1.4), (odd, 1.55)):
            self.assertNotIn("KHR_materials_dispersion", plain["extensions"])
            self.assertAlmostEqual(plain["extensions"]["KHR_materials_ior"]["ior"], ior, places=5)
        colors = [m["pbrMetallicRoughness"].get("baseColorFactor", [1, 1, 1])[:3] for m in (gem, even, many)]
        np.testing.assert_allclose(colors, [[1, 1, 1], [0.25, 0.81, 0.0625], [1, 1, 1]], atol=1e-5)
        reflections = {name: entries.get("glass_reflection") for name, entries in settings["materials"].items()}
        self.assertEqual(reflections, {"gem": None, "even": "tinted", "odd": None, "many": None})
        self.assertAlmostEqual(gem["pbrMetallicRoughness"]["roughnessFactor"], 0.25, places=5)

    def test_sums_of_glass_in_groups_know_what_is_given_to_them(self):
        inner = bpy.data.node_groups.new("splitting", "ShaderNodeTree")
        inner.interface.new_socket("IOR", in_out="INPUT", socket_type="NodeSocketFloat")
        inner.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        entries, ends = inner.nodes.new("NodeGroupInput"), inner.nodes.new("NodeGroupOutput")
        for node, step in zip(self.summed(inner, ends.inputs[0], np.eye(3).tolist(), (0, 0, 0)), (0.0, 0.02, 0.04)):
            added = inner.nodes.new("ShaderNodeMath")
            inner.links.new(entries.outputs[0], added.inputs[0])
            added.inputs[1].default_value = step
            inner.links.new(added.outputs[0], node.inputs["IOR"])
        made, tree, _, group = shader_tree("gem", "Group")
        group.node_tree = inner
        group.inputs[0].default_value = 1.5
        tree.links.new(group.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.add("cube", baked(made))
        model, _, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        (gem,) = model["materials"]
        np.testing.assert_allclose([self.index_at(gem, 611.4), self.index_at(gem, 464.2)], [1.5, 1.54], atol=1e-5)

    def test_facets_scatter_as_often_as_all_shaders_say(self):
        frosted, _, glass = self.glass("frosted", Roughness=0.5)
        metal, _, shader = shader_tree("metal")
        shader.inputs["Metallic"].default_value = 1.0
        self.add("cube", metal, location=(3, 0, 0))
        # What is smooth, or neither metal nor glass, loses little.
        self.glass("smooth", location=(6, 0, 0), Roughness=0.0)
        self.add("cube", shader_tree("plastic")[0], location=(9, 0, 0))
        self.assertNotIn("microfacet", self.export()[1]["render"])
        glass.distribution = "GGX"
        _, settings, answer = self.export()
        self.assertNotIn("microfacet", settings["render"])
        self.assertEqual([about for about, message in answer["warnings"] if "facet" in message], ["frosted"])
        shader.distribution = "GGX"
        _, settings, answer = self.export()
        self.assertEqual(settings["render"]["microfacet"], "single")
        self.assertEqual(answer["warnings"], [])

    def test_even_worlds_are_left_to_paths_where_rays_see_different_things(self):
        material, _, _ = shader_tree("plain")
        made = self.add("cube", material)
        world = bpy.data.worlds.new("World")
        self.scene.world, world.use_nodes = world, True
        made.visible_camera = False
        self.assertNotIn("sampled", self.export()[1]["environment"])
        made.visible_shadow = False
        found = self.export()[1]["environment"]
        self.assertIs(found["sampled"], False)
        self.assertNotIn("visible_to", found)
        # A world that differs is sampled by Cycles.
        tree = world.node_tree
        tree.links.new(tree.nodes.new("ShaderNodeTexSky").outputs[0], tree.nodes["Background"].inputs[0])
        self.assertNotIn("sampled", self.export()[1]["environment"])

    def test_worlds_are_hidden_from_kinds_of_rays(self):
        material, _, _ = shader_tree("plain")
        self.add("cube", material)
        world = bpy.data.worlds.new("World")
        self.scene.world = world
        world.cycles_visibility.glossy = world.cycles_visibility.scatter = False
        model, settings, answer = self.export()
        self.assertEqual(settings["environment"]["visible_to"], ["camera", "diffuse", "transmission", "shadow"])
        self.assertEqual(answer["warnings"], [])
        world.cycles_visibility.camera = False
        self.assertIs(self.export()[1]["environment"]["visible_to_camera"], False)

    def test_worlds_that_cameras_see_otherwise(self):
        self.add("cube", shader_tree("plain")[0])
        world = bpy.data.worlds.new("World")
        self.scene.world, world.use_nodes = world, True
        tree = world.node_tree
        path, mix, other, sky = (tree.nodes.new(f"ShaderNode{k}") for k in ("LightPath", "MixShader", "Background", "TexSky"))
        tree.nodes["Background"].inputs[0].default_value = (0.1, 0.2, 0.3, 1)
        other.inputs[0].default_value = (0.5, 0.6, 0.7, 1)
        for socket, shader in zip(mix.inputs[1:], (tree.nodes["Background"], other)):
            tree.links.new(shader.outputs[0], socket)
        tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
        tree.links.new(mix.outputs[0], tree.nodes["World Output"].inputs["Surface"])
        _, settings, answer = self.export()
        np.testing.assert_allclose(settings["environment"]["background"], [0.1, 0.2, 0.3], rtol=1e-5)
        np.testing.assert_allclose(settings["environment"]["seen"]["background"], [0.5, 0.6, 0.7], rtol=1e-5)
        self.assertEqual(answer["warnings"], [])
        tree.links.new(sky.outputs[0], other.inputs[0])
        self.assertTrue((self.folder / self.export()[1]["environment"]["seen"]["image"]).is_file())
        tree.links.new(path.outputs["Is Glossy Ray"], mix.inputs[0])
        _, settings, answer = self.export()
        self.assertEqual([about for about, message in answer["warnings"] if "kind of ray" in message], ["World"])
        np.testing.assert_allclose(settings["environment"]["background"], [0.1, 0.2, 0.3], rtol=1e-5)

    def test_shadow_catchers_show_what_cycles_shows(self):
        material, _, _ = shader_tree("plain")
        made = self.add("plane", material)
        self.assertNotIn("caught", self.export()[1]["render"])
        made.is_shadow_catcher = True
        self.assertEqual(self.export()[1]["render"]["caught"], "shadows")

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
        of_files = [np.abs(self.mesh(self.export()[1], "Cylinder")["nz"])]
        # What is brushed is baked.
        tin.data.materials[0].node_tree.nodes["Principled BSDF"].inputs["Anisotropic"].default_value = 0.5
        model, _, _ = self.export_glb()
        ((primitive,),) = [mesh["primitives"] for mesh in model.json["meshes"]]
        of_files.append(np.abs(self.values(model, primitive["attributes"]["NORMAL"])[:, 1]))
        for upward in of_files:
            self.assertTrue(((upward > 0.1) & (upward < 0.9)).any(), "the sides lean towards the lids, as in Cycles")
            self.assertTrue((upward > 0.999).any(), "the lids are flat")

    def test_bodies_of_varying_colours_are_painted_and_their_holes_closed(self):
        skin, tree, shader, checker = shader_tree("skin", "TexChecker")
        shader.inputs["Subsurface Weight"].default_value = 1.0
        checker.inputs["Color1"].default_value, checker.inputs["Color2"].default_value = (0.8, 0.4, 0.2, 1), (0.2, 0.4, 0.2, 1)
        tree.links.new(checker.outputs["Color"], shader.inputs["Base Color"])
        self.with_hole(skin)
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

    def with_hole(self, material):
        """A ball without one of its faces."""
        ball, work = self.add("uv_sphere", material), bmesh.new()
        work.from_mesh(ball.data)
        work.faces.ensure_lookup_table()
        bmesh.ops.delete(work, geom=[work.faces[0]], context="FACES_ONLY")
        work.to_mesh(ball.data)
        work.free()

    def test_holes_of_bodies_of_one_colour_are_closed(self):
        wax, _, shader = shader_tree("wax")
        shader.inputs["Subsurface Weight"].default_value = 1.0
        self.with_hole(wax)
        _, settings, answer = self.export()
        self.assertIn("1 holes, which are closed", "".join(message for _, message in answer["notes"]))
        self.assertIs(settings["materials"]["wax"]["volume"], True)
        (entry,) = settings["objects"]
        _, vertices, faces = read_ply(self.folder / entry["mesh"])
        places = np.stack([vertices[name] for name in "xyz"], 1)
        _, number = np.unique(places.round(5), axis=0, return_inverse=True)
        corners = number.ravel()[faces["corners"]]
        edges = np.sort(np.concatenate([corners[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
        self.assertEqual(set(np.unique(edges, axis=0, return_counts=True)[1].tolist()), {2})

    def test_of_what_varies_and_no_picture_holds_the_mean_is_taken_by_name(self):
        cloth, tree, shader, checker = shader_tree("cloth", "TexChecker")
        checker.inputs["Scale"].default_value = 2.0
        tree.links.new(checker.outputs["Fac"], shader.inputs["Sheen Weight"])
        self.add("plane", baked(cloth))
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
        shown = self.placed(settings)
        self.assertEqual(set(shown), {"First", "Second", "Third"})
        links = {name: entry["shadow_link"] for name, entry in shown.items() if "shadow_link" in entry}
        self.assertEqual(links, {"Third": {"exclude": ["/Second"]}})
        # Beside nodes of the model.
        for obj in (first, third):
            own = bpy.data.materials.new(obj.name) if obj == first else glow
            own.use_nodes = True
            obj.data.materials.clear()
            obj.data.materials.append(baked(own))
        model, settings, answer = self.export()
        self.assertEqual((answer["warnings"], set(self.placed(settings))), ([], {"Second"}))
        (rim,) = (light for light in settings["lights"] if light["name"] == "Rim")
        self.assertEqual(rim["light_link"], {"include": ["/First", "/Second"]})
        nodes = [entry for entry in settings["objects"] if "node" in entry]
        self.assertEqual(nodes, [{"node": "/Third", "shadow_link": {"exclude": ["/Second"]}}])
        self.assertLessEqual({"First", "Third"}, {node["name"] for node in model["nodes"]})

    def test_all_instances_of_what_shines_are_linked(self):
        glow, _, shader = shader_tree("glow")
        shader.inputs["Emission Strength"].default_value = 2.0
        self.add("plane", shader_tree("plain")[0]).name = "Floor"
        group, blockers = bpy.data.collections.new("Group"), bpy.data.collections.new("Blockers")
        bulb = self.add("plane", glow)
        self.scene.collection.objects.unlink(bulb)
        group.objects.link(bulb)
        blockers.objects.link(self.scene.objects["Floor"])
        string = self.add("plane", shader_tree("string")[0])
        string.name, string.instance_type = "String", "VERTS"
        child = bpy.data.objects.new("Bulb", None)
        child.instance_type, child.instance_collection, child.parent = "COLLECTION", group, string
        self.scene.collection.objects.link(child)
        for obj in (string, child):
            obj.light_linking.blocker_collection = blockers
        _, settings, _ = self.export()
        shining = [entry for entry in settings["objects"] if "glow" in entry["materials"]]
        self.assertEqual([entry["shadow_link"] for entry in shining], [{"include": ["/Floor"]}] * 4)


if __name__ == "__main__":
    main()
