"""Tests nodes that read properties of objects, and linked images.

    python test_object_info.py            with a Python that has bpy
"""

import bpy
import numpy as np
from testing import SceneTest, main, shader_tree


class ObjectInfoTest(SceneTest):
    def test_object_color(self):
        material, tree, shader, info = shader_tree("own", "ObjectInfo")
        tree.links.new(info.outputs["Color"], shader.inputs["Base Color"])
        colors = [(0.25, 0.5, 0.75), (0.5, 0.125, 0.0)]
        data = None
        for k, color in enumerate(colors):
            made = self.add_plane(material, f"Plane {k}", (3 * k, 0, 0), data)
            data, made.color = made.data, (*color, 1)
        settings, answer = self.export()
        surface, feeding = self.surface(settings["materials"]["own"])
        self.assertEqual((feeding(surface, "base_color")["type"], surface["base_color"].split(".")[1]), ("object_info", "color"))
        found = self.placed(settings)
        self.assertEqual(found["Plane 0"]["mesh"], found["Plane 1"]["mesh"])
        np.testing.assert_allclose([found[f"Plane {k}"]["color"] for k in range(2)], [(*color, 1) for color in colors], atol=1e-6)
        self.assertEqual(answer["warnings"], [])

    def test_object_attributes(self):
        """Attributes are replaced by constants, in a material for each value."""
        material, tree, shader, own = shader_tree("own", "Attribute")
        own.attribute_type, own.attribute_name = "OBJECT", "polish"
        tree.links.new(next(out for out in own.outputs if out.identifier == "Fac"), shader.inputs["Roughness"])
        data = None
        for name, polish in (("First", 0.375), ("Second", 0.75)):
            made = self.add_plane(material, name, data=data)
            data, made["polish"] = made.data, polish
        settings, _ = self.export()
        (first,), (second,) = (self.placed(settings)[name]["materials"] for name in ("First", "Second"))
        roughnesses = [self.surface(settings["materials"][name])[0]["roughness"] for name in (first, second)]
        np.testing.assert_allclose(roughnesses, [0.375, 0.75], atol=1e-6)

    def test_linked_images(self):
        material, tree, shader, node = shader_tree("label", "TexImage")
        picture = bpy.data.images.new("picture", 8, 8)
        picture.filepath_raw, picture.file_format = str(self.folder / "a picture.png"), "PNG"
        picture.save()
        node.image = bpy.data.images.load(picture.filepath_raw)
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        self.add_plane(material)
        shown = lambda *more: self.surface(self.export(*more)[0]["materials"]["label"])
        for more, expected in (((), "scene.image0.png"), (("--links",), str(self.folder / "a picture.png"))):
            surface, feeding = shown(*more)
            self.assertEqual(feeding(surface, "base_color")["file"], expected)
        self.assertEqual((self.folder / "scene.image0.png").read_bytes(), (self.folder / "a picture.png").read_bytes())

    def test_non_ascii_names(self):
        material, tree, shader, noise = shader_tree("wood", "TexNoise")
        shader.name, noise.name = "プリンシプルBSDF", "ノイズテクスチャ"
        tree.links.new(noise.outputs["Color"], shader.inputs["Base Color"])
        self.add_plane(material)
        settings, answer = self.export()
        surface, feeding = self.surface(settings["materials"]["wood"])
        self.assertEqual((answer["warnings"], feeding(surface, "base_color")["type"]), ([], "noise_texture"))


if __name__ == "__main__":
    main()
