"""Tests meshes, shaders, worlds and light linking.

    python test_surfaces.py            with a Python that has bpy
"""

import bpy
import numpy as np
from testing import SceneTest, main, read_ply, shader_tree

import bmesh  # isort: skip (bpy puts it on the path)


def _points_of(radius, material):
    """Geometry nodes that turn vertices into points with radii by an attribute."""
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
    """Tests meshes and materials."""

    def add(self, kind, material, **settings):
        getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**settings)
        made = bpy.context.object
        made.data.materials.append(material)
        return made

    def test_curves_texts_and_metaballs(self):
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
        settings, _ = self.export()
        self.assertEqual([entry["name"] for entry in sorted(settings["objects"], key=lambda entry: entry["name"])], ["Balls", "Ring", "Text"])

    def test_point_clouds(self):
        """A point cloud by geometry nodes: 30 points of two radii, with colors."""
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
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        mesh = self.mesh(settings, "Cloud")
        places, shown = (np.stack([mesh[name] for name in names], 1) for names in (("x", "y", "z"), ("a0_0", "a0_1", "a0_2")))
        self.check_points(grid, given, places, shown)

    def check_points(self, grid, given, places, shown):
        """Checks radii and colors of spheres around all points."""
        away = np.linalg.norm(places[:, None] - grid, axis=2)
        nearest = away.argmin(1)
        self.assertEqual(set(nearest), set(range(30)))
        # Spheres have the silhouette's area: vertices are slightly outside.
        ratio = away.min(1) / np.tile([0.1, 0.05], 15)[nearest]
        self.assertTrue(((ratio > 1.0) & (ratio < 1.01)).all(), (ratio.min(), ratio.max()))
        np.testing.assert_allclose(shown, given[nearest, :3], atol=2e-5)

    def test_glass_sheets_and_solids(self):
        glass, _, shader = shader_tree("glass")
        shader.inputs["Transmission Weight"].default_value = 1.0
        shader.inputs["Base Color"].default_value = (0.25, 0.25, 0.25, 1)
        self.add("plane", glass, rotation=(np.pi / 2, 0, 0.4))
        self.add("plane", glass, location=(0, 0, 3))
        self.add("cube", glass, location=(4, 0, 0))
        settings, answer = self.export()
        solid, sheet = ({name for name, table in settings["materials"].items() if table.get("volume", False) == is_solid} for is_solid in (True, False))
        used = {entry["name"]: set(entry["materials"]) for entry in settings["objects"]}
        self.assertEqual((used, len(solid), len(sheet)), ({"Plane": sheet, "Plane.001": sheet, "Cube": solid}, 1, 1))
        self.check_notes(answer)

    def check_notes(self, answer):
        """Checks that there is one note on glass sheets."""
        ((about, said),) = [note for note in answer["notes"] if "Solidify" in note[1]]
        self.assertEqual(about, "glass")
        self.assertIn("refracts light", said)

    def test_glass_sheets_only(self):
        glass, _, shader = shader_tree("glass")
        shader.inputs["Transmission Weight"].default_value = 1.0
        self.add("grid", glass)
        metal, _, shader = shader_tree("metal")
        shader.inputs["Metallic"].default_value = 1.0
        self.add("plane", metal, location=(0, 0, 3))
        settings, answer = self.export()
        self.assertEqual({name: table.get("volume", False) for name, table in settings["materials"].items()}, {"glass": False, "metal": False})
        self.assertFalse([said for _, said in answer["notes"] if "Solidify" in said])

    def glass(self, name, kind="BsdfGlass", location=(0, 0, 0), **inputs):
        """A cube with a shader; returns material, tree and node."""
        made, tree, _, node = shader_tree(name, kind)
        for key, value in inputs.items():
            node.inputs[key].default_value = value
        tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.add("cube", made, location=location)
        return made, tree, node

    def test_multiple_scattering_between_microfacets(self):
        frosted, _, glass = self.glass("frosted", Roughness=0.5)
        metal, _, shader = shader_tree("metal")
        shader.inputs["Metallic"].default_value = 1.0
        self.add("cube", metal, location=(3, 0, 0))
        self.glass("smooth", location=(6, 0, 0), Roughness=0.0)
        self.add("cube", shader_tree("plastic")[0], location=(9, 0, 0))

        def exported():
            settings, answer = self.export()
            self.assertEqual(answer["warnings"], [])
            nodes = {name: table["nodes"][table["surface"]] for name, table in settings["materials"].items()}
            kept = {name: node.get("multiscatter") for name, node in nodes.items()}
            return settings["render"].get("microfacet"), kept

        self.assertEqual(exported(), (None, {"frosted": 1.0, "metal": 1.0, "smooth": None, "plastic": 1.0}))
        glass.distribution = "GGX"
        self.assertEqual(exported(), (None, {"frosted": 0.0, "metal": 1.0, "smooth": None, "plastic": 1.0}))
        # The model of most shaders is that of the picture.
        shader.distribution = "GGX"
        self.assertEqual(exported(), ("single", {"frosted": 0.0, "metal": 0.0, "smooth": None, "plastic": 1.0}))

    def test_microfacet_distributions(self):
        for name, kind, place in (("glass", "BsdfGlass", 0), ("refraction", "BsdfRefraction", 3), ("glossy", "BsdfAnisotropic", 6)):
            for distribution in ("BECKMANN", "GGX"):
                glass = self.glass(name + distribution, kind, location=(place, len(distribution), 0))[2]
                glass.distribution = distribution
        nodes = {name: table["nodes"][table["surface"]] for name, table in self.export()[0]["materials"].items()}
        told = {name: node.get("beckmann") for name, node in nodes.items()}
        kinds = ("glass", "refraction", "glossy")
        self.assertEqual(told, {kind + name: value for kind in kinds for name, value in (("BECKMANN", 1.0), ("GGX", None))})

    def test_toon_and_velvet(self):
        _, _, diffuse = self.glass("diffuse", "BsdfToon", Size=0.3, Smooth=0.1)
        _, _, glossy = self.glass("glossy", "BsdfToon", location=(3, 0, 0))
        glossy.component = "GLOSSY"
        _, _, velvet = self.glass("velvet", "BsdfSheen", location=(6, 0, 0), Roughness=0.4)
        velvet.distribution = "ASHIKHMIN"
        settings, answer = self.export()
        nodes = {name: table["nodes"][table["surface"]] for name, table in settings["materials"].items()}
        kinds = {name: node["type"] for name, node in nodes.items()}
        self.assertEqual(kinds, {"diffuse": "toon_bsdf", "glossy": "toon_highlight_bsdf", "velvet": "velvet_bsdf"})
        for found, truth in ((nodes["diffuse"]["size"], 0.3), (nodes["diffuse"]["smooth"], 0.1), (nodes["velvet"]["roughness"], 0.4)):
            self.assertAlmostEqual(found, truth, 5)
        self.assertEqual(answer["warnings"], [])

    def test_sampling_of_uniform_worlds(self):
        material, _, _ = shader_tree("plain")
        made = self.add("cube", material)
        world = bpy.data.worlds.new("World")
        self.scene.world, world.use_nodes = world, True
        made.visible_camera = False
        self.assertNotIn("sampled", self.export()[0]["environment"])
        made.visible_shadow = False
        found = self.export()[0]["environment"]
        self.assertIs(found["sampled"], False)
        self.assertNotIn("visible_to", found)
        # Cycles samples non-uniform worlds.
        tree = world.node_tree
        tree.links.new(tree.nodes.new("ShaderNodeTexSky").outputs[0], tree.nodes["Background"].inputs[0])
        self.assertNotIn("sampled", self.export()[0]["environment"])

    def test_ray_visibility_of_worlds(self):
        material, _, _ = shader_tree("plain")
        self.add("cube", material)
        world = bpy.data.worlds.new("World")
        self.scene.world = world
        world.cycles_visibility.glossy = world.cycles_visibility.scatter = False
        settings, answer = self.export()
        self.assertEqual(settings["environment"]["visible_to"], ["camera", "diffuse", "transmission", "shadow"])
        self.assertEqual(answer["warnings"], [])
        world.cycles_visibility.camera = False
        self.assertIs(self.export()[0]["environment"]["visible_to_camera"], False)

    def test_light_path_in_worlds(self):
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
        settings, answer = self.export()
        np.testing.assert_allclose(settings["environment"]["background"], [0.1, 0.2, 0.3], rtol=1e-5)
        np.testing.assert_allclose(settings["environment"]["seen"]["background"], [0.5, 0.6, 0.7], rtol=1e-5)
        self.assertEqual(answer["warnings"], [])
        tree.links.new(sky.outputs[0], other.inputs[0])
        settings = self.export()[0]
        self.assertIn(settings["environment"]["seen"]["texture"], settings["textures"])
        tree.links.new(path.outputs["Is Glossy Ray"], mix.inputs[0])
        settings, answer = self.export()
        self.assertEqual([about for about, message in answer["warnings"] if "kind of ray" in message], ["World"])
        np.testing.assert_allclose(settings["environment"]["background"], [0.1, 0.2, 0.3], rtol=1e-5)

    def test_shadow_catchers(self):
        material, _, _ = shader_tree("plain")
        made = self.add("plane", material)
        self.assertNotIn("caught", self.export()[0]["render"])
        made.is_shadow_catcher = True
        self.assertEqual(self.export()[0]["render"]["caught"], "shadows")

    def test_smooth_faces_beside_flat_ones(self):
        tin = self.add("cylinder", shader_tree("tin")[0])
        tin.data.polygons.foreach_set("use_smooth", [len(face.vertices) == 4 for face in tin.data.polygons])
        upward = np.abs(self.mesh(self.export()[0], "Cylinder")["nz"])
        self.assertTrue(((upward > 0.1) & (upward < 0.9)).any(), "the sides lean towards the lids, as in Cycles")
        self.assertTrue((upward > 0.999).any(), "the lids are flat")

    def with_hole(self, material):
        """A sphere without one of its faces."""
        ball, work = self.add("uv_sphere", material), bmesh.new()
        work.from_mesh(ball.data)
        work.faces.ensure_lookup_table()
        bmesh.ops.delete(work, geom=[work.faces[0]], context="FACES_ONLY")
        work.to_mesh(ball.data)
        work.free()
        return ball.data

    def test_hole_filling(self):
        self.closes_hole(lambda mesh: None)

    def test_hole_filling_with_inward_normals(self):
        self.closes_hole(lambda mesh: mesh.flip_normals())

    def closes_hole(self, change):
        """A hole is filled by faces with the orientation of their neighbors."""
        wax, _, shader = shader_tree("wax")
        shader.inputs["Subsurface Weight"].default_value = 1.0
        change(self.with_hole(wax))
        settings, answer = self.export()
        self.assertIn("1 holes are filled", "".join(message for _, message in answer["notes"]))
        self.assertIs(settings["materials"]["wax"]["volume"], True)
        (entry,) = settings["objects"]
        _, vertices, faces = read_ply(self.folder / entry["mesh"])
        places = np.stack([vertices[name] for name in "xyz"], 1)
        _, number = np.unique(places.round(5), axis=0, return_inverse=True)
        corners = number.ravel()[faces["corners"]]
        sides = np.concatenate([corners[:, [k, (k + 1) % 3]] for k in range(3)])
        self.assertEqual(set(np.unique(sides, axis=0, return_counts=True)[1].tolist()), {1})
        edges = np.sort(sides, axis=1)
        self.assertEqual(set(np.unique(edges, axis=0, return_counts=True)[1].tolist()), {2})

    def test_light_linking(self):
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
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        lights = {light["name"]: light for light in settings["lights"]}
        self.assertEqual(lights["Rim"]["light_link"], {"include": ["/First", "/Second"]})
        self.assertNotIn("shadow_link", lights["Rim"])
        self.assertEqual(lights["Free"]["shadow_link"], {"include": []})
        shown = self.placed(settings)
        self.assertEqual(set(shown), {"First", "Second", "Third"})
        links = {name: entry["shadow_link"] for name, entry in shown.items() if "shadow_link" in entry}
        self.assertEqual(links, {"Third": {"exclude": ["/Second"]}})

    def test_light_linking_of_instances(self):
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
        settings, _ = self.export()
        shining = [entry for entry in settings["objects"] if "glow" in entry["materials"]]
        self.assertEqual([entry["shadow_link"] for entry in shining], [{"include": ["/Floor"]}] * 4)


    def test_mean_of_varying_inputs(self):
        metal, tree, shader, checker = shader_tree("metal", "TexChecker")
        checker.inputs["Scale"].default_value = 2.0
        tree.links.new(checker.outputs["Fac"], shader.inputs["Anisotropic"])
        self.add("plane", metal)
        settings, answer = self.export()
        ((place, message),) = answer["warnings"]
        self.assertEqual((place, "Anisotropic" in message), ("metal", True))
        surface, _ = self.surface(settings["materials"]["metal"])
        self.assertTrue(0.3 < surface["anisotropic"] < 0.7, surface["anisotropic"])

    def test_radial_tangents(self):
        """Tangents of a cylinder are around its axis; isotropic shaders need none."""
        for name, strength in (("brushed", 0.5), ("plain", 0.0)):
            metal, _, shader = shader_tree(name)
            shader.inputs["Metallic"].default_value, shader.inputs["Anisotropic"].default_value = 1.0, strength
            bpy.ops.mesh.primitive_cylinder_add(vertices=64, end_fill_type="NOTHING")
            bpy.ops.object.shade_smooth()
            bpy.context.object.data.materials.append(metal)
            bpy.context.object.name = name
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        found = self.mesh(settings, "brushed")
        tangents = np.stack([found[f"a0_{k}"] for k in range(4)], 1)
        around = np.stack([-found["y"], found["x"], 0 * found["x"]], 1)
        np.testing.assert_allclose(tangents[:, :3], around / np.linalg.norm(around, axis=1)[:, None], atol=1e-2)
        self.assertEqual(set(tangents[:, 3]), {1.0})
        self.assertNotIn("a0_0", self.mesh(settings, "plain"))

    def test_normal_maps_without_uv_maps(self):
        """Tangents are around the z axis, as in Cycles."""
        material, tree, principled, mapped = shader_tree("mapped", "NormalMap")
        tree.links.new(mapped.outputs[0], principled.inputs["Normal"])
        bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32)
        shown = bpy.context.object
        shown.data.shade_smooth()
        shown.data.materials.append(material)
        self.assertNotIn("a0_0", self.mesh(self.export()[0], shown.name))
        shown.data.uv_layers.remove(shown.data.uv_layers[0])
        found = self.mesh(self.export()[0], shown.name)
        self.assertNotIn("s", found)
        away = np.hypot(found["x"], found["y"]) > 0.3
        tangents = np.stack([found[f"a0_{k}"] for k in range(3)], 1)[away]
        around = np.stack([-found["y"], found["x"], 0 * found["x"]], 1)[away]
        along = (tangents * around).sum(1) / np.linalg.norm(around, axis=1)
        self.assertGreater(np.median(along), 0.99)
        self.assertEqual(np.median(found["a0_3"][away]), 1.0)

    def test_subsurface_of_varying_color(self):
        wax, tree, shader, checker = shader_tree("wax", "TexChecker")
        checker.inputs["Color1"].default_value, checker.inputs["Color2"].default_value = (0.75, 0.25, 0.5, 1), (0.25, 0.5, 0.125, 1)
        checker.inputs["Scale"].default_value = 1.5
        shader.inputs["Subsurface Weight"].default_value = 0.75
        tree.links.new(checker.outputs["Color"], shader.inputs["Base Color"])
        self.add("cube", wax)
        faint, _, shader = shader_tree("faint")
        shader.inputs["Subsurface Weight"].default_value = 0.25
        self.add("cube", faint, location=(4, 0, 0))
        jade, _, shader = shader_tree("jade")
        for name, value in (("Subsurface Weight", 1.0), ("Metallic", 0.25), ("Transmission Weight", 0.5)):
            shader.inputs[name].default_value = value
        self.add("cube", jade, location=(8, 0, 0))
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        # The part with subsurface scattering has neither metal nor glass.
        nodes = settings["materials"]["jade"]["nodes"]
        mix = self.surface(settings["materials"]["jade"])[0]
        shares = [[nodes[mix[key]][name] for name in ("metallic", "transmission_weight", "subsurface_weight")] for key in ("a", "b")]
        self.assertAlmostEqual(mix["factor"], 0.375)
        np.testing.assert_allclose(shares, [(0.4, 1, 0), (0, 0, 1)], atol=1e-6)
        # A weight below 1 is a mix of two shaders.
        for name, share in (("wax", 0.75), ("faint", 0.25)):
            table = settings["materials"][name]
            mix = self.surface(table)[0]
            self.assertEqual((mix["type"], table["volume"]), ("mix_shader", True))
            self.assertAlmostEqual(mix["factor"], share)
            self.assertEqual([table["nodes"][mix[key]]["subsurface_weight"] for key in ("a", "b")], [0.0, 1.0])
        table = settings["materials"]["wax"]
        body = table["nodes"][self.surface(table)[0]["b"]]
        np.testing.assert_allclose(body["subsurface_body"], [0.75, 0.5, 0.5], atol=2e-3)


if __name__ == "__main__":
    main()
