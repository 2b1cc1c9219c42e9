"""Tries what the exporter knows of meshes before they change their shape.

    python test_shapes.py            with a Python that has bpy
"""

import bpy
import numpy as np
from testing import SceneTest, main, shader_tree

from oscura_blender import undeformed


class ShapesTest(SceneTest):
    def add(self, kind, name, material, **settings):
        getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**settings)
        made = bpy.context.object
        made.name = name
        made.data.materials.append(material)
        return made

    def stretch(self, obj, axis, factor, share):
        """Gives an object a key that stretches its mesh along an axis, in force by a share."""
        obj.shape_key_add(name="Basis")
        key = obj.shape_key_add(name="Stretched")
        for point in key.data:
            point.co[axis] *= factor
        key.value = share

    def patterned(self):
        """A material of noise by generated coordinates, which are looked up where nothing is linked."""
        material, tree, shader, noise = shader_tree("pattern", "TexNoise")
        tree.links.new(noise.outputs[0], shader.inputs["Base Color"])
        return material

    def test_keys_and_modifiers_that_make_vertices(self):
        """A key that widens a cube, then a subdivision: the model is as wide as the evaluated mesh, once."""
        cube = self.add("cube", "Cube", self.patterned(), size=2)
        self.stretch(cube, 0, 3, 0.5)
        cube.modifiers.new("Fine", "SUBSURF").render_levels = 2
        model, _, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        cube.modifiers["Fine"].levels = 2
        evaluated = cube.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        wide = max(vertex.co.x for vertex in evaluated.vertices)
        self.assertGreater(wide, 1.2)
        (mesh,) = model["meshes"]
        box = model["accessors"][mesh["primitives"][0]["attributes"]["POSITION"]]
        np.testing.assert_allclose((box["max"][0], box["min"][0]), (wide, -wide), rtol=1e-5)
        self.assertNotIn("targets", mesh["primitives"][0])

    def test_generated_coordinates_are_those_before_the_shape(self):
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
        found = undeformed.evaluate(bpy.data.objects)
        self.assertEqual(set(found), {"Row", "Bent", "Half"})
        corners = np.array([vertex.co for vertex in plain.data.vertices]) * 0.5 + 0.5
        # The second is one and a half lengths away; the mirrored half is three lengths away from the other.
        np.testing.assert_allclose(found["Row"], np.concatenate([corners, corners + (1.5, 0, 0)]), atol=1e-6)
        np.testing.assert_allclose(found["Bent"], corners, atol=1e-6)
        extent = (found["Half"].min(0), found["Half"].max(0))
        np.testing.assert_allclose(extent, [(-3, 0, 0), (1, 1, 1)], atol=1e-6)
        self.assertEqual([scene.name for scene in bpy.data.scenes], [self.scene.name])
        self.assertEqual(len(bpy.data.objects), 6)

    def test_baked_patterns_do_not_follow_what_deforms(self):
        """The left half is red, the right one green, of a mesh of two faces whose right edge is moved away."""
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
        model, _, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        shown = self.pixels(self.picture(model, model["materials"][0]))
        red, green = ((shown[..., channel] > 0.9).mean() for channel in (0, 1))
        # The right face is seven times as large as the left one. By where its vertices are, three sevenths of it would be red.
        self.assertGreater(green, 5 * red)
        self.assertGreater(red, 0.01)


if __name__ == "__main__":
    main()
