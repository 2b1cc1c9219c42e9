"""Tests volume objects and volume shaders.

    python test_volumes.py           with a Python that has bpy
"""

import shutil
import sys
import unittest
from pathlib import Path

import bpy
import numpy as np
from testing import HERE, SceneTest, main, shader_tree

# Grids 'temperature' and 'density', and others of 'density' and 'mask'.
SMOKE, OTHER = (HERE.parents[1] / "src/load/vdb/tests" / name for name in ("blosc.vdb", "half.vdb"))


def openvdb():
    """OpenVDB's module; None where Blender comes without it."""
    sys.path.extend(str(path) for path in Path(bpy.utils.resource_path("LOCAL")).glob("python/lib/python*/site-packages"))
    try:
        import openvdb as module
    except ImportError:
        return None
    return module


class VolumesTest(SceneTest):
    def medium(self, name, kind, **inputs):
        """A material with a volume shader; returns it, its tree and the node."""
        material, tree, shader, node = shader_tree(name, kind)
        tree.nodes.remove(shader)
        for key, value in inputs.items():
            node.inputs[key].default_value = value
        tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
        return material, tree, node

    def add_volume(self, path, material, name="Cloud"):
        data = bpy.data.volumes.new(name)
        data.filepath = str(path)
        if material is not None:
            data.materials.append(material)
        made = bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(made)
        return made

    def box(self, settings, name):
        """The bounds of an object in the coordinates of scene files."""
        matrix = np.array(self.placed(settings)[name]["transform"][0]["matrix"]).reshape(4, 4)
        found = self.mesh(settings, name)
        places = np.stack([found[key] for key in "xyz"], 1) @ matrix[:3, :3].T + matrix[:3, 3]
        return places.min(0), places.max(0)

    def test_placement_of_volumes(self):
        material, _, _ = self.medium("white", "VolumePrincipled", Density=2.0, Anisotropy=0.25)
        cloud = self.add_volume(OTHER, material)
        cloud.location, cloud.scale = (1, 2, 3), (2, 2, 2)
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        (found,) = settings["materials"].values()
        matrix = np.array(found["transform"][0]["matrix"]).reshape(4, 4)
        np.testing.assert_allclose(matrix, [[2, 0, 0, 1], [0, 2, 0, 3], [0, 0, 2, -2], [0, 0, 0, 1]], atol=1e-6)
        # The optical thickness is that at a scale of one.
        expected = {"type": "medium", "grid": "scene.0.vdb", "up": "z", "grid_name": "density", "anisotropy": 0.25}
        self.assertEqual({key: found[key] for key in expected}, expected)
        self.assertEqual((found["density"], found["color"]), ([1.0] * 3, [0.5] * 3))
        self.assertIn(b"density", (self.folder / "scene.0.vdb").read_bytes())
        # The densities fill a box from (-1.125, 1.875, 2.75) to (2.875, 5.875, 6.75) or less, the mask one to (7.5, 7.5, 7.5).
        low, high = self.box(settings, "Cloud")
        self.assertTrue((low < [-1.25, 8.5, -13.75]).all() and (high > [6.75, 16.5, -5.75]).all(), (low, high))
        self.assertLess((high - low).max(), 2 * (7.5 + 1.125) + 4 * 2 * 0.5)

    def test_volume_bounces(self):
        material, _, _ = self.medium("white", "VolumePrincipled", Density=2.0)
        self.add_volume(SMOKE, material)
        for limit, expected in ((12, None), (13, None), (3, 4), (0, 1)):
            self.scene.cycles.volume_bounces = limit
            settings, answer = self.export()
            self.assertEqual((settings["render"]["bounces"].get("volume"), answer["warnings"]), (expected, []), limit)

    def test_density_space(self):
        material, _, _ = self.medium("white", "VolumePrincipled", Density=2.0)
        cloud = self.add_volume(SMOKE, material)
        cloud.scale, cloud.data.render.space = (2, 2, 2), "WORLD"
        settings, _ = self.export()
        self.assertEqual(settings["materials"]["white (Cloud)"]["density"], [2.0] * 3)

    def test_blackbody_and_emission_grids(self):
        fire, _, node = self.medium("fire", "VolumePrincipled", Density=1.0, Temperature=3.0)
        node.inputs["Blackbody Intensity"].default_value = 2.0
        node.inputs["Blackbody Tint"].default_value = (1, 0.5, 0.25, 1)
        glow, tree, node = self.medium("glow", "Emission")
        asks, product = tree.nodes.new("ShaderNodeAttribute"), tree.nodes.new("ShaderNodeMath")
        asks.attribute_name, product.operation, product.inputs[1].default_value = "temperature", "MULTIPLY", 4.0
        tree.links.new(asks.outputs["Fac"], product.inputs[0])
        tree.links.new(product.outputs[0], node.inputs["Strength"])
        node.inputs["Color"].default_value = (1, 0.5, 0, 1)
        self.add_volume(SMOKE, fire, "Fire")
        self.add_volume(SMOKE, glow, "Glow").location = (50, 0, 0)
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        found = settings["materials"]["fire (Fire)"]
        expected = {"grid_name": "density", "temperature_grid": "temperature", "temperature": 3.0, "temperature_law": "stefan-boltzmann"}
        self.assertEqual({key: found[key] for key in expected}, expected)
        np.testing.assert_allclose(found["emission"], np.array([2, 1, 0.5]) * 0.0913741, rtol=1e-4)
        found = settings["materials"]["glow (Glow)"]
        self.assertEqual((found["grid_name"], found["density"], found["emission"]), ("temperature", [0.0] * 3, [4.0, 2.0, 0.0]))
        self.assertNotIn("emission_grid", found)

    def test_scattering_and_absorption_of_one_grid_add_up(self):
        material, tree, scatter = self.medium("both", "VolumeScatter", Color=(0.5, 0.25, 0, 1))
        absorb, add, info = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("VolumeAbsorption", "AddShader", "VolumeInfo"))
        absorb.inputs["Color"].default_value = (0.5, 0.75, 0, 1)
        for k, node in enumerate((scatter, absorb)):
            tree.links.new(info.outputs["Density"], node.inputs["Density"])
            tree.links.new(node.outputs[0], add.inputs[k])
        tree.links.new(add.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
        self.add_volume(SMOKE, material)
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        found = settings["materials"]["both (Cloud)"]
        self.assertEqual((found["density"], found["color"]), ([1.0, 0.5, 1.0], [0.5, 0.5, 0.0]))

    def test_density_by_nodes(self):
        material, tree, node = self.medium("fog", "VolumeScatter", Color=(0.5, 0.25, 1, 1))
        place, parts, times = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "SeparateXYZ", "Math"))
        times.operation, times.inputs[1].default_value = "MULTIPLY", 3.0
        tree.links.new(place.outputs["Generated"], parts.inputs[0])
        tree.links.new(parts.outputs["Z"], times.inputs[0])
        tree.links.new(times.outputs[0], node.inputs["Density"])
        bpy.ops.mesh.primitive_cube_add(size=2, location=(1, 2, 3))
        box = bpy.context.object
        box.scale = (1, 0.5, 2)
        box.data.materials.append(material)
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        (found,) = (entries for entries in settings["materials"].values() if "nodes" in entries and entries["type"] == "medium")
        node, output = found["density"].split(".")
        self.assertEqual((found["color"], found["up"], found["nodes"][node]["operation"]), ([1.0] * 3, "z", "multiply"))
        np.testing.assert_allclose(found["nodes"][node]["b"], [0.5, 0.25, 1.0], rtol=1e-6)
        # Colors may vary as well.
        tree.links.new(place.outputs["Generated"], next(own for own in tree.nodes if own.bl_idname == "ShaderNodeVolumeScatter").inputs["Color"])
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])

    def test_density_by_image_textures(self):
        material, tree, node = self.medium("slices", "VolumeScatter")
        texture, image = tree.nodes.new("ShaderNodeTexImage"), bpy.data.images.new("slices", 4, 4)
        image.pack()
        texture.image = image
        tree.links.new(texture.outputs["Color"], node.inputs["Density"])
        bpy.ops.mesh.primitive_cube_add(size=2)
        bpy.context.object.data.materials.append(material)
        settings, answer = self.export()
        (file,) = (entry["file"] for entry in settings["materials"]["slices"]["nodes"].values() if entry["type"] == "image_texture")
        self.assertEqual((answer["warnings"], (self.folder / file).exists()), ([], True))

    def test_mixed_volume_shaders(self):
        material, tree, scatter = self.medium("mist", "VolumeScatter", Density=2.0, Color=(0.5, 0.5, 0.5, 1))
        absorb, light, add, mix, noise = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("VolumeAbsorption", "Emission", "AddShader", "MixShader", "TexNoise"))
        absorb.inputs["Density"].default_value, absorb.inputs["Color"].default_value = 4.0, (0.75, 0.5, 1, 1)
        tree.links.new(scatter.outputs[0], add.inputs[0])
        tree.links.new(absorb.outputs[0], add.inputs[1])
        tree.links.new(add.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
        bpy.ops.mesh.primitive_cube_add(size=2)
        bpy.context.object.data.materials.append(material)
        settings, _ = self.export()
        found = settings["materials"]["mist"]
        np.testing.assert_allclose((found["density"], found["color"]), ([2.0, 3.0, 1.0], [0.5, 1 / 3, 1.0]), rtol=1e-6)
        # A varying mix factor makes all values vary.
        for k, part in enumerate((add, light)):
            tree.links.new(part.outputs[0], mix.inputs[1 + k])
        tree.links.new(noise.outputs[0], mix.inputs[0])
        tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
        settings, answer = self.export()
        found = settings["materials"]["mist"]
        self.assertEqual((answer["warnings"], [type(found[key]) for key in ("density", "color", "emission")]), ([], [str] * 3))

    def test_warnings(self):
        material, _, _ = self.medium("white", "VolumePrincipled")
        other, _, node = self.medium("other", "VolumePrincipled")
        node.inputs["Density Attribute"].default_value = "mask"
        self.add_volume(self.folder / "nowhere.vdb", material, "Gone")
        self.add_volume(SMOKE, None, "Bare")
        self.add_volume(OTHER, other, "Masked")
        settings, answer = self.export()
        warnings = dict(answer["warnings"])
        for name, words in (("Gone", "nowhere.vdb"), ("Bare", "no material")):
            self.assertIn(words, warnings[name])
        told = [message for place, message in answer["warnings"] if place == "Masked"]
        self.assertTrue(any("'mask'" in message for message in told), told)
        self.assertEqual({name for name in settings["materials"]}, {"other (Masked)"})

    def test_overlapping_volumes(self):
        material, _, _ = self.medium("white", "VolumePrincipled")
        for k in range(2):
            self.add_volume(SMOKE, material, f"Cloud {k}").location = (k, 0, 0)
        settings, answer = self.export()
        self.assertEqual((answer["warnings"], len(settings["materials"])), ([], 2))

    def test_warnings_of_moving_volumes(self):
        material, _, _ = self.medium("white", "VolumePrincipled")
        parent = bpy.data.objects.new("Parent", None)
        self.scene.collection.objects.link(parent)
        own, carried, sharp, _ = (self.add_volume(SMOKE, material, name) for name in ("Own", "Carried", "Sharp", "Still"))
        carried.parent = parent
        sharp.cycles.use_motion_blur = False
        for thing in (own, parent, sharp):
            for frame, place in ((1, 0.0), (3, 2.0)):
                thing.location = (place, 0, 0)
                thing.keyframe_insert("location", frame=frame)
        self.scene.frame_set(2)
        told = [place for place, message in self.export()[1]["warnings"] if "motion blur" in message]
        self.assertEqual(told, [])
        self.scene.render.use_motion_blur = True
        told = [place for place, message in self.export()[1]["warnings"] if "motion blur" in message]
        self.assertEqual(sorted(told), ["Carried", "Own"])
        # Nothing moves outside the keyframes.
        told = [place for place, message in self.export("--frame", "9")[1]["warnings"] if "motion blur" in message]
        self.assertEqual(told, [])
        told = [place for place, message in self.export("--shutter", "0", "--vectors", "yes")[1]["warnings"] if "motion blur" in message]
        self.assertEqual(told, [])

    def test_sequences_and_packed_files(self):
        for number, path in ((1, SMOKE), (2, OTHER)):
            shutil.copyfile(path, self.folder / f"smoke_{number:04}.vdb")
        material, _, _ = self.medium("white", "VolumePrincipled")
        sequence = self.add_volume(self.folder / "smoke_0001.vdb", material, "Sequence").data
        sequence.is_sequence, sequence.frame_start, sequence.frame_duration = True, 1, 2
        for frame, has_temperature in ((1, True), (2, False)):
            _, answer = self.export("--frame", str(frame))
            self.assertEqual(answer["warnings"], [])
            written = (self.folder / "scene.0.vdb").read_bytes()
            self.assertEqual(b"temperature" in written, has_temperature)
        sequence.is_sequence = False
        bpy.ops.file.pack_all()
        (self.folder / "smoke_0001.vdb").unlink()
        settings, answer = self.export()
        self.assertEqual((answer["warnings"], list(settings["materials"])), ([], ["white (Sequence)"]))

    def test_volumes_by_geometry_nodes(self):
        material, _, _ = self.medium("white", "VolumePrincipled")
        tree = bpy.data.node_groups.new("Lumps", "GeometryNodeTree")
        tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        cube, paint, end = (tree.nodes.new(kind) for kind in ("GeometryNodeVolumeCube", "GeometryNodeSetMaterial", "NodeGroupOutput"))
        paint.inputs["Material"].default_value = material
        tree.links.new(cube.outputs[0], paint.inputs[0])
        tree.links.new(paint.outputs[0], end.inputs[0])
        for k in range(2):
            made = bpy.data.objects.new(f"Lump {k}", bpy.data.meshes.new("empty"))
            made.location = (0, 0, 9 * k)
            made.modifiers.new("Lumps", "NODES").node_group = tree
            self.scene.collection.objects.link(made)
        settings, answer = self.export()
        self.assertEqual(answer["warnings"], [])
        heights = [found["transform"][0]["matrix"][7] for found in settings["materials"].values()]
        self.assertEqual(sorted(heights), [0.0, 9.0])

    @unittest.skipIf(openvdb() is None, "this Blender comes without OpenVDB's module")
    def test_level_sets(self):
        module = openvdb()
        module.write(str(self.folder / "ball.vdb"), [module.createLevelSetSphere(radius=2.0)])
        material, _, _ = self.medium("white", "VolumePrincipled")
        self.add_volume(self.folder / "ball.vdb", material)
        settings, answer = self.export()
        self.assertIn("level set", dict(answer["warnings"])["Cloud"])
        self.assertNotIn("materials", settings)


if __name__ == "__main__":
    main()
