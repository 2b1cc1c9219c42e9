"""Tests corrections after Blender's importers.

    python test_importers.py           with a Python that has bpy
"""

import bpy
from testing import SceneTest, main

from oscura_blender import importers
from oscura_blender.report import Report


class ImporterTest(SceneTest):
    def material(self, name):
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        tree = material.node_tree
        return material, tree, next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")

    def test_missing_textures_and_materials(self):
        whole, tree, _ = self.material("whole")
        nodes = len(tree.nodes)
        _, lost, principled = self.material("lost")
        for socket in ("Base Color", "Emission Color"):
            lost.links.new(lost.nodes.new("ShaderNodeTexImage").outputs["Color"], principled.inputs[socket])
        principled.inputs["Emission Color"].default_value = (1, 1, 1, 1)
        empty, empty_tree, _ = self.material("empty")
        empty_tree.nodes.clear()
        empty.diffuse_color = (0.5, 0.25, 0.125, 1)
        report = Report()
        importers._correct_materials(report)
        self.assertEqual(len(tree.nodes), nodes)
        self.assertFalse(any(node.type == "TEX_IMAGE" for node in lost.nodes))
        self.assertEqual(tuple(principled.inputs["Emission Color"].default_value), (0, 0, 0, 1))
        surface = next(node for node in empty_tree.nodes if node.type == "BSDF_PRINCIPLED")
        self.assertEqual(tuple(surface.inputs["Base Color"].default_value), (0.5, 0.25, 0.125, 1))
        said = " ".join(message for _, message in report.warnings)
        self.assertIn("2 textures whose images are missing", said)
        self.assertIn("1 materials that Blender can", said)

    def test_fbx_light_intensity(self):
        bpy.ops.mesh.primitive_cube_add(size=2)
        for name, energy in (("dim", 1), ("bright", 500)):
            lamp = bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT"))
            lamp.data.energy, lamp.location = energy, (0, 0, 10)
            bpy.context.collection.objects.link(lamp)
        bpy.context.view_layer.update()
        importers._correct_fbx_lights(bpy.context.scene, Report())
        # 1 W/m2 at 10 m: 4 pi 100.
        self.assertAlmostEqual(bpy.data.lights["dim"].energy, 1256.637, places=2)
        self.assertEqual(bpy.data.lights["bright"].energy, 500)


if __name__ == "__main__":
    main()
