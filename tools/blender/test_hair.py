"""Tests hair particles and Curves objects.

    python test_hair.py              with a Python that has bpy
"""

import struct

import bpy
import numpy as np
from testing import SceneTest, main, shader_tree

from oscura_blender import hair_colors


class HairTest(SceneTest):
    def strands(self, entry):
        """The points of a file, the counts of strands, radii, and colors or None."""
        data = (self.folder / entry["file"]).read_bytes()
        _, count, points, arrays = struct.unpack("<4sIII", data[:16])
        counts = np.frombuffer(data, "<u2", count, 128).astype(int) + 1
        at = 128 + 2 * count
        values = np.frombuffer(data, "<f4", (len(data) - at) // 4, at)
        places, thickness, rest = np.split(values, [3 * points, 4 * points])
        return places.reshape(-1, 3), counts, thickness / 2, rest.reshape(-1, 3) if arrays & 16 else None

    def grow(self, material, count=40):
        """Hair with 5 points on a plane of size 2 with a UV map."""
        bpy.ops.mesh.primitive_plane_add(size=2)
        body = bpy.context.object
        body.data.materials.append(bpy.data.materials.new("skin"))
        body.data.materials.append(material)
        system = body.modifiers.new("Fur", "PARTICLE_SYSTEM").particle_system
        system.settings.type, system.settings.count, system.settings.hair_length = "HAIR", count, 0.5
        system.settings.render_step, system.settings.material = 2, 2

    def painted(self, kind, paint):
        """Settings, points and colors of hair with a shader that `paint` changes."""
        material, tree, principled, shader = shader_tree("fibre", kind)
        tree.links.new(shader.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        paint(tree, shader)
        self.grow(material)
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        points, counts, _, colors = self.strands(settings["curves"][0])
        self.assertEqual(counts.tolist(), [5] * 40)
        return settings["materials"]["fibre (strands)"], points.reshape(40, 5, 3), colors.reshape(40, 5, 3)

    def test_colors_along_strands(self):
        def paint(tree, shader):
            shader.parametrization = "COLOR"
            tree.links.new(tree.nodes.new("ShaderNodeHairInfo").outputs["Intercept"], shader.inputs["Color"])

        settings, _, colors = self.painted("BsdfHairPrincipled", paint)
        self.assertEqual(settings["color"], [1.0] * 3)
        np.testing.assert_allclose(colors, np.broadcast_to(np.linspace(0, 1, 5)[:, None], colors.shape), atol=0.01)

    def test_colors_of_roots(self):
        for output in ("UV", "Generated"):
            with self.subTest(output):
                self.setUp()
                link = lambda tree, shader: tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs[output], shader.inputs["Color"])
                _, points, colors = self.painted("BsdfDiffuse", link)
                # The scene file's z axis is Blender's -y.
                roots = points[:, :1, [0, 2]] * (1, -1) * 0.5 + 0.5
                np.testing.assert_allclose(colors[..., :2], np.broadcast_to(roots, (40, 5, 2)), atol=2e-3)

    def test_random_melanin(self):
        def paint(_, shader):
            shader.parametrization = "MELANIN"
            shader.inputs["Melanin"].default_value, shader.inputs["Melanin Redness"].default_value = 0.4, 0.25
            shader.inputs["Random Color"].default_value = 0.5

        settings, _, colors = self.painted("BsdfHairPrincipled", paint)
        self.assertEqual(settings["color"], [1.0] * 3)
        amounts = np.log(colors[:, 0]) ** 2 / hair_colors._log_color_slope(0.3) ** 2
        units = 0.75 * np.array([0.506, 0.841, 1.653]) + 0.25 * np.array([0.343, 0.733, 1.924])
        melanin = 1 - np.exp(-amounts / units)
        expected = 0.4 * (1 + 0.5 * (2 * hair_colors.random(40) - 1))
        np.testing.assert_allclose(melanin, np.repeat(expected[:, None], 3, 1), atol=1e-4)
        self.assertGreater(np.ptp(expected), 0.3)

    def test_particle_hair(self):
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
        settings, answer = self.export()
        by_name = {entry["name"]: entry for entry in settings["curves"]}
        reed, fur = by_name["Reed"], by_name["Sphere/Fur"]
        self.assertEqual(settings["materials"][reed["material"]]["melanin"], 0.25)
        self.assertEqual(fur["material"], reed["material"])
        self.assertNotIn("shadow", reed["visible_to"])
        points, counts, radii, colors = self.strands(reed)
        self.assertIsNone(colors)
        np.testing.assert_allclose(points, [(10, 0, 0), (10, 2, 0), (10, 2, -2), (12, 0, 0), (12, 4, 0)], atol=1e-6)
        self.assertEqual((counts.tolist(), radii.tolist()), ([3, 2], [1, 0.5, 0, 2, 4]))
        points, counts, radii, _ = self.strands(fur)
        self.assertEqual(counts.tolist(), [5] * 20)
        roots, tips = points[::5], points[4::5]
        np.testing.assert_allclose(np.linalg.norm(roots, axis=1), 1, atol=0.03)
        np.testing.assert_allclose(np.linalg.norm(tips - roots, axis=1), 0.5, rtol=0.05)
        np.testing.assert_allclose(radii[:5], [0.05, 0.04375, 0.0375, 0.03125, 0], rtol=0.01)
        # The material of strands is on no face.
        (sphere,) = (entry for entry in settings["objects"] if entry["name"] == "Sphere")
        self.assertEqual(sphere["materials"], ["skin", "default"])
        self.assertEqual(set(settings["materials"]), {reed["material"], "skin", "default"})
        self.assertFalse(answer["warnings"])

    def test_cut_strands(self):
        """Cut strands have half the length and the radius of uncut tips; parents aren't rendered with children."""
        material, tree, _, shader = shader_tree("fibre", "BsdfDiffuse")
        tree.links.new(shader.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.grow(material)
        bpy.context.object.location = (1, 2, 3)
        settings = bpy.context.object.modifiers[0].particle_system.settings
        settings.child_type, settings.rendered_child_count, settings.child_length = "SIMPLE", 3, 0.5
        settings.use_parent_particles, settings.display_method = True, "NONE"
        settings.root_radius, settings.tip_radius, settings.radius_scale, settings.use_close_tip = 1, 0.5, 0.1, True
        found, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        points, counts, radii, _ = self.strands(found["curves"][0])
        self.assertEqual(len(counts), 120)
        self.assertTrue((counts == 3).all(), counts)
        lengths = np.linalg.norm(points[2::3] - points[::3], axis=1)
        np.testing.assert_allclose(lengths, 0.25, rtol=0.05)
        np.testing.assert_allclose(radii.reshape(-1, 3), np.broadcast_to((0.05, 0.0375, 0.025), (120, 3)), rtol=0.03)


if __name__ == "__main__":
    main()
