"""Tests cameras, meshes of final renders, generated coordinates and view layers.

    python test_shapes.py            with a Python that has bpy
"""

import math
import unittest
from types import SimpleNamespace

import bpy
import numpy as np
from testing import SceneTest, main, shader_tree

from oscura_blender import camera, final_render, generated_coordinates


class ShapesTest(SceneTest):
    def add(self, kind, name, material, **settings):
        getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**settings)
        made = bpy.context.object
        made.name = name
        made.data.materials.append(material)
        return made

    def stretch(self, obj, axis, factor, share):
        """Adds a shape key that stretches a mesh along an axis, with a value."""
        obj.shape_key_add(name="Basis")
        key = obj.shape_key_add(name="Stretched")
        for point in key.data:
            point.co[axis] *= factor
        key.value = share

    def patterned(self):
        """A material with a noise texture without a linked vector."""
        material, tree, shader, line, noise = shader_tree("pattern", "TexNoise", "TexNoise")
        # The mesh has no UV map.
        line.noise_dimensions = "1D"
        tree.links.new(line.outputs[0], shader.inputs["Roughness"])
        tree.links.new(noise.outputs[0], shader.inputs["Base Color"])
        return material

    def test_extreme_focal_lengths(self):
        lens = SimpleNamespace(type="PERSP", sensor_fit="AUTO", sensor_width=36.0, sensor_height=24.0, clip_start=0.1, clip_end=100.0)
        for focal_length in (50.0, 1e30, math.inf):
            lens.lens = focal_length
            self.assertTrue(0 < camera._projection(lens, 160, 120)["vfov"] < 180, focal_length)

    def test_fisheye_sensor(self):
        """Also with a pixel aspect."""
        render, data = self.scene.render, self.scene.camera.data
        render.resolution_x, render.resolution_y, render.pixel_aspect_x = 200, 100, 1.5
        data.type, data.sensor_fit, data.sensor_height = "PANO", "VERTICAL", 20
        settings = data if hasattr(data, "panorama_type") else data.cycles
        settings.panorama_type = "FISHEYE_EQUISOLID"
        self.assertEqual(self.export()[0]["camera"][0]["sensor"], [60, 20])

    def test_shape_keys_and_subdivision(self):
        """The exported mesh is the evaluated one, with the shape key applied once."""
        cube = self.add("cube", "Cube", self.patterned(), size=2)
        self.stretch(cube, 0, 3, 0.5)
        cube.modifiers.new("Fine", "SUBSURF").render_levels = 2
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        cube.modifiers["Fine"].levels = 2
        evaluated = cube.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        wide = max(vertex.co.x for vertex in evaluated.vertices)
        self.assertGreater(wide, 1.2)
        places = self.mesh(settings, "Cube")["x"]
        np.testing.assert_allclose((places.max(), places.min()), (wide, -wide), rtol=1e-5)

    def test_undeformed_generated_coordinates(self):
        pattern = self.patterned()
        row = self.add("cube", "Row", pattern, size=2)
        array = row.modifiers.new("Array", "ARRAY")
        array.count, array.relative_offset_displace = 2, (1.5, 0, 0)
        bent = self.add("cube", "Bent", pattern, size=2)
        self.stretch(bent, 2, 5, 1.0)
        bent.modifiers.new("Bend", "SIMPLE_DEFORM").angle = 1
        half = self.add("cube", "Half", pattern, size=2)
        for vertex in half.data.vertices:
            vertex.co.x += 3
        half.modifiers.new("Mirror", "MIRROR")
        plain, other = self.add("cube", "Plain", pattern), self.add("cube", "Other", bpy.data.materials.new("other"))
        other.modifiers.new("Array", "ARRAY")
        made, tree = self.add("cube", "Made", pattern), bpy.data.node_groups.new("made", "GeometryNodeTree")
        tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        ball, paint, end = (tree.nodes.new(kind) for kind in ("GeometryNodeMeshUVSphere", "GeometryNodeSetMaterial", "NodeGroupOutput"))
        ball.inputs["Radius"].default_value, paint.inputs["Material"].default_value = 3.0, pattern
        tree.links.new(ball.outputs[0], paint.inputs[0])
        tree.links.new(paint.outputs[0], end.inputs[0])
        made.modifiers.new("Nodes", "NODES").node_group = tree
        found = {}

        def look(graph):
            for instance in graph.object_instances:
                if instance.object.type == "MESH":
                    mesh = instance.object.data.copy()
                    generated_coordinates.add_undeformed(mesh, instance.object)
                    if (layer := mesh.attributes.get(generated_coordinates.ATTRIBUTE)) is not None:
                        values = np.empty(3 * len(mesh.vertices), np.float32)
                        layer.data.foreach_get("vector", values)
                        found[instance.object.name] = values.reshape(-1, 3)

        bpy.utils.register_class(final_render.Engine)
        self.addCleanup(bpy.utils.unregister_class, final_render.Engine)
        final_render.run(self.scene, self.scene.view_layers[0], look)
        self.assertEqual(set(found), {"Row", "Bent", "Half", "Made"})
        # A mesh by geometry nodes has its own texture space.
        np.testing.assert_allclose((found["Made"].min(0), found["Made"].max(0)), [(0, 0, 0), (1, 1, 1)], atol=1e-5)
        corners = np.array([vertex.co for vertex in plain.data.vertices]) * 0.5 + 0.5
        # The second is one and a half lengths away; the mirrored half is three lengths away from the other.
        np.testing.assert_allclose(found["Row"], np.concatenate([corners, corners + (1.5, 0, 0)]), atol=1e-6)
        np.testing.assert_allclose(found["Bent"], corners, atol=1e-6)
        extent = (found["Half"].min(0), found["Half"].max(0))
        np.testing.assert_allclose(extent, [(-3, 0, 0), (1, 1, 1)], atol=1e-6)
        self.assertEqual([scene.name for scene in bpy.data.scenes], [self.scene.name])
        self.assertEqual(len(bpy.data.objects), 7)

    def test_shader_to_rgb(self):
        material, tree, shader, made = shader_tree("toon", "ShaderToRGB")
        glow = tree.nodes.new("ShaderNodeEmission")
        tree.links.new(glow.outputs[0], made.inputs[0])
        tree.links.new(made.outputs[0], shader.inputs["Base Color"])
        shader.inputs["Base Color"].default_value = (0.25, 0.5, 0.75, 1)
        self.add("cube", "Cube", material)
        settings, answer = self.export()
        found = next(node for node in settings["materials"]["toon"]["nodes"].values() if node["type"] == "principled_bsdf")
        self.assertEqual(found["base_color"], [0.25, 0.5, 0.75])
        self.assertTrue(any("Shader to RGB" in str(warning) for warning in answer["warnings"]), answer)

    def test_generated_coordinates_of_deformed_meshes(self):
        """The left half is red and the right one green, of two faces whose right edge is moved."""
        material, tree, shader, place, parts, ramp = shader_tree("halves", "TexCoord", "SeparateXYZ", "ValToRGB")
        ramp.color_ramp.interpolation = "CONSTANT"
        for element, position, color in zip(ramp.color_ramp.elements, (0, 0.5), ((1, 0, 0, 1), (0, 1, 0, 1))):
            element.position, element.color = position, color
        tree.links.new(place.outputs["Generated"], parts.inputs[0])
        tree.links.new(parts.outputs["X"], ramp.inputs[0])
        tree.links.new(ramp.outputs[0], shader.inputs["Base Color"])
        self.scene.camera.location.z = 40
        grid = self.add("grid", "Grid", material, x_subdivisions=2, y_subdivisions=1, size=2)
        group = grid.vertex_groups.new(name="right")
        group.add([i for i, vertex in enumerate(grid.data.vertices) if vertex.co.x > 0.5], 1.0, "REPLACE")
        moved = grid.modifiers.new("Moved", "DISPLACE")
        moved.direction, moved.mid_level, moved.strength, moved.vertex_group = "X", 0, 6, "right"
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        mesh = self.mesh(settings, "Grid")
        # By where vertices were before, of which the last were at 1.
        np.testing.assert_allclose(mesh["a0_0"], np.where(mesh["x"] > 1, 1, mesh["x"] / 2 + 0.5), atol=1e-6)
        self.assertEqual(mesh["x"].max(), 7)

    def test_render_settings_of_modifiers(self):
        """Ocean, Screw and Subdivision have render levels; the Is Viewport node is false."""
        sea, spring, asking = (self.add("plane", name, None) for name in ("Sea", "Spring", "Asking"))
        ocean = sea.modifiers.new("Ocean", "OCEAN")
        ocean.resolution, ocean.viewport_resolution = 4, 2
        screw = spring.modifiers.new("Screw", "SCREW")
        screw.render_steps, screw.steps, screw.use_smooth_shade = 20, 3, True
        bpy.ops.surface.primitive_nurbs_surface_surface_add()
        bpy.context.object.name, data = "Sheet", bpy.context.object.data
        data.resolution_u = data.resolution_v = 1
        data.render_resolution_u, data.render_resolution_v = 2, 6
        tree = bpy.data.node_groups.new("asking", "GeometryNodeTree")
        for kind in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=kind, socket_type="NodeSocketGeometry")
        ends = [tree.nodes.new(f"NodeGroup{kind}") for kind in ("Input", "Output")]
        switch, is_viewport, ball = (tree.nodes.new(f"GeometryNode{kind}") for kind in ("Switch", "IsViewport", "MeshIcoSphere"))
        switch.input_type = "GEOMETRY"
        by_name = {socket.name: socket for socket in switch.inputs if socket.enabled}
        for output, target in (
            (is_viewport.outputs[0], by_name["Switch"]),
            (ends[0].outputs[0], by_name["True"]),
            (ball.outputs[0], by_name["False"]),
            (next(socket for socket in switch.outputs if socket.enabled), ends[1].inputs[0]),
        ):
            tree.links.new(output, target)
        asking.modifiers.new("Nodes", "NODES").node_group = tree
        settings, _ = self.export()
        count = {name: len(self.mesh(settings, name)["x"]) for name in ("Sea", "Spring", "Sheet", "Asking")}
        self.assertGreaterEqual(count["Sea"], 17 * 17)
        self.assertGreaterEqual(count["Spring"], 4 * 20)
        self.assertGreaterEqual(count["Sheet"], 2 * 6 * 9)
        self.assertGreater(count["Asking"], 4)

    @unittest.skipIf(bpy.app.version < (4, 5), "Blender has no normals that are free of their edges")
    def test_custom_normals(self):
        """Cycles has one normal for each vertex between sharp edges: that of the last corner."""
        leaning = [(0, 0, 1)] * 4 + [(0.6, 0, 0.8)] * 4
        for is_sharp in (True, False):
            mesh = bpy.data.meshes.new("fold")
            mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0)], [], [(0, 1, 2, 3), (1, 4, 5, 2)])
            mesh.shade_smooth()
            mesh.edges[mesh.edge_keys.index((1, 2))].use_edge_sharp = is_sharp
            normals = mesh.attributes.new("custom_normal", "FLOAT_VECTOR", "CORNER")
            normals.data.foreach_set("vector", np.array(leaning, np.float32).ravel())
            obj = bpy.data.objects.new("Fold", mesh)
            self.scene.collection.objects.link(obj)
            columns = self.mesh(self.export()[0], "Fold")
            found = sorted((round(float(x)), round(float(nx), 2)) for x, nx in zip(columns["x"], columns["nx"]))
            outer = [(0, 0.0)] * 2, [(2, 0.6)] * 2
            middle = [(1, 0.0)] * 2 + [(1, 0.6)] * 2 if is_sharp else [(1, 0.6)] * 2
            self.assertEqual(found, outer[0] + middle + outer[1])
            bpy.data.objects.remove(obj)

    def test_instancing_on_vertices_and_faces(self):
        base = self.add("plane", "Base", None, size=4)
        self.add("cube", "Leaf", None, size=0.1).parent = base
        for kind, count in (("VERTS", 4), ("FACES", 1), ("NONE", 1)):
            base.instance_type = kind
            names = [entry["name"] for entry in self.export()[0]["objects"]]
            of_leaves = [name for name in names if "Leaf" in name]
            self.assertEqual(len(of_leaves), count, names)
            self.assertEqual("Leaf" in of_leaves, kind == "NONE", names)

    def test_indirect_only(self):
        """Also for objects in several collections, and for instances."""
        for name in ("Seen", "Unseen", "Inside"):
            collection = bpy.data.collections.new(name)
            if name != "Inside":
                self.scene.collection.children.link(collection)
        seen, unseen, inside = (bpy.data.collections[name] for name in ("Seen", "Unseen", "Inside"))
        for name, homes in (("a", [seen]), ("b", [unseen]), ("c", [seen, unseen]), ("d", [inside])):
            obj = self.add_plane(None, name, data=bpy.data.meshes.new_from_object(self.add_plane(None, "Source")))
            bpy.data.objects.remove(bpy.data.objects["Source"])
            self.scene.collection.objects.unlink(obj)
            for home in homes:
                home.objects.link(obj)
        for home in (seen, unseen):
            empty = bpy.data.objects.new(f"of {home.name}", None)
            empty.instance_type, empty.instance_collection = "COLLECTION", inside
            home.objects.link(empty)
        self.scene.view_layers[0].layer_collection.children["Unseen"].indirect_only = True
        settings, _ = self.export()
        shown = self.placed(settings)
        rays = {name: entry["visible_to"] for name, entry in shown.items() if "visible_to" in entry}
        self.assertEqual(len(shown), 5)
        self.assertEqual(rays, {name: ["diffuse", "glossy", "transmission", "volume", "shadow"] for name in ("b", "c", "of Unseen/d")})

    def test_view_layers(self):
        """Also one that isn't used for rendering, without changes of the others."""
        aside = bpy.data.collections.new("Aside")
        self.scene.collection.children.link(aside)
        ball = self.add_plane(None, "Ball")
        self.scene.collection.objects.unlink(ball)
        aside.objects.link(ball)
        self.add_plane(None, "Floor")
        second = self.scene.view_layers.new("Second")
        second.layer_collection.children["Aside"].exclude, second.use = True, False
        for more, expected in (((), {"Ball", "Floor"}), (("--view-layer", "Second"), {"Floor"})):
            self.assertEqual(set(self.placed(self.export(*more)[0])), expected, more)
        bpy.utils.register_class(final_render.Engine)
        self.addCleanup(bpy.utils.unregister_class, final_render.Engine)
        shown = final_render.run(self.scene, second, lambda graph: [obj.name for obj in graph.objects if obj.type == "MESH"])
        self.assertEqual((shown, [layer.use for layer in self.scene.view_layers]), (["Floor"], [True, False]))

    def test_missing_uv_maps(self):
        material, tree, shader, picture, place = shader_tree("label", "TexImage", "UVMap")
        picture.image, place.uv_map = bpy.data.images.new("picture", 4, 4), "nowhere"
        picture.image.pack()
        tree.links.new(place.outputs[0], picture.inputs["Vector"])
        tree.links.new(picture.outputs["Color"], shader.inputs["Base Color"])
        self.add("plane", "Plane", material)
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        mesh = self.mesh(settings, "Plane")
        np.testing.assert_array_equal([mesh["a0_0"], mesh["a0_1"]], np.zeros((2, 4)))

if __name__ == "__main__":
    main()
