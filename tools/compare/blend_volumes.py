"""Blender scenes with volume objects: transformed .vdb files, fire, volumes by modifiers and nodes."""

import sys
from pathlib import Path

import bpy
import numpy as np

from blend_parts import add, ball, camera, floor, light, link, material, shader, world


def _vdb():
    """OpenVDB's module, included in Blender 4.4 and newer."""
    sys.path.extend(str(path) for path in Path(bpy.utils.resource_path("LOCAL")).glob("python/lib/python*/site-packages"))
    import openvdb

    return openvdb


def _places(size):
    """Coordinates in -1 to 1 of the voxels of a grid."""
    return np.meshgrid(*(np.linspace(-1, 1, n) for n in size), indexing="ij")


def _write(path, voxel, origin, **grids):
    vdb = _vdb()
    made = []
    for name, values in grids.items():
        grid = vdb.FloatGrid()
        grid.name = name
        grid.copyFromArray(np.ascontiguousarray(values, np.float32), tolerance=0.0)
        grid.transform = vdb.createLinearTransform([[voxel, 0, 0, 0], [0, voxel, 0, 0], [0, 0, voxel, 0], [*origin, 1]])
        made.append(grid)
    vdb.write(str(path), made)


def _cloud(size=(40, 30, 24)):
    """Noise, zero outside of a sphere."""
    x, y, z = _places(size)
    lumps = 0.5 + 0.5 * np.sin(7 * x + 2) * np.sin(5 * y + 1) * np.sin(6 * z)
    return np.maximum(1 - x**2 - y**2 - z**2, 0) * lumps * 2


def volume(path, of, name, *place):
    data = bpy.data.volumes.new(name)
    data.filepath = str(path)
    data.materials.append(of)
    return link(name, data, *place)


def of_volume(name, kind, **inputs):
    """A volume-only material; returns its tree and the volume node."""
    made, tree, node = shader(name, kind, **inputs)
    tree.links.remove(tree.nodes["Material Output"].inputs["Surface"].links[0])
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
    return made, tree, node


def _sunny():
    floor()
    world((0.3, 0.4, 0.5))
    light("SUN", "Sun", 3, (0, 0, 5), (0.7, 0.3, 0), angle=0.05)


def clouds(folder):
    """A rotated and scaled cloud, its mirror image, one with world-space density, and spheres between them."""
    _write(folder / "cloud.vdb", 0.05, (-1, -0.75, -0.6), density=_cloud())
    _sunny()
    white, _, _ = of_volume("white cloud", "VolumePrincipled", Density=4.0, Anisotropy=0.5, Color=(0.95, 0.9, 0.8, 1))
    volume(folder / "cloud.vdb", white, "Turned", (-1.6, 0, 1.3), (0.4, 0.6, 0.9), (1.2, 0.8, 1.5))
    volume(folder / "cloud.vdb", white, "Mirrored", (1.9, 1.2, 1.2), (0, 0.5, 0.2), (-1.1, 1.1, 1.1))
    bent = volume(folder / "cloud.vdb", white, "Bent", (0, 0, 0), (0, 0, 0.7), (0.8, 0.8, 0.8))
    bent.data.render.space = "WORLD"
    holder = link("Holder", None, (0.8, -2, 0.9), (0, 0, 0.3), (1.6, 0.7, 1))
    bent.parent = holder
    ball(material("red", Base_Color=(0.8, 0.1, 0.1, 1)), (-0.2, 0.9, 0.6), 0.6)
    camera()


def fire(folder):
    """A flame at some thousand kelvins with smoke above."""
    x, y, z = _places((32, 32, 48))
    ring = x**2 + y**2
    heat = np.maximum(1 - 1.6 * ring - (z + 0.2) ** 2, 0)
    smoke = np.maximum(1 - 1.2 * ring - (z - 0.3) ** 2 * 1.5, 0)
    _write(folder / "fire.vdb", 0.05, (-0.8, -0.8, 0), density=smoke, temperature=heat * 2200)
    floor()
    world((0.05, 0.06, 0.08))
    burning, _, node = of_volume("burning", "VolumePrincipled", Density=2.0, Color=(0.4, 0.4, 0.4, 1), Temperature=1.0)
    node.inputs["Blackbody Intensity"].default_value = 2.0
    volume(folder / "fire.vdb", burning, "Fire", (0, 0, 0.2), (0.2, 0, 0.4), (1, 1, 1.2))
    ball(material("grey", Base_Color=(0.7, 0.7, 0.7, 1)), (1.8, -0.6, 0.6), 0.6)
    camera()


def flames(folder):
    """Emission by its own grid, tinted, and coloured smoke by Attribute nodes."""
    x, y, z = _places((24, 24, 24))
    _write(folder / "flames.vdb", 0.06, (-0.7, -0.7, -0.7), density=_cloud((24, 24, 24)), flame=np.maximum(1 - x**2 - y**2 - z**2, 0))
    _sunny()
    smoke, tree, scatter = of_volume("colored", "VolumeScatter", Color=(0.9, 0.5, 0.2, 1), Anisotropy=0.3)
    asks, product = tree.nodes.new("ShaderNodeAttribute"), tree.nodes.new("ShaderNodeMath")
    asks.attribute_name, product.operation, product.inputs[1].default_value = "density", "MULTIPLY", 6.0
    tree.links.new(asks.outputs["Fac"], product.inputs[0])
    tree.links.new(product.outputs[0], scatter.inputs["Density"])
    volume(folder / "flames.vdb", smoke, "Smoke", (-1.4, 0, 1.1), (0.3, 0.2, 0.1), (1.3, 1.3, 1.3))
    lit, tree, node = of_volume("lit", "VolumePrincipled", Density=1.0, Color=(0.5, 0.5, 0.5, 1))
    info, product = tree.nodes.new("ShaderNodeVolumeInfo"), tree.nodes.new("ShaderNodeMath")
    product.operation, product.inputs[1].default_value = "MULTIPLY", 1.5
    tree.links.new(info.outputs["Flame"], product.inputs[0])
    tree.links.new(product.outputs[0], node.inputs["Emission Strength"])
    node.inputs["Emission Color"].default_value = (1, 0.4, 0.1, 1)
    volume(folder / "flames.vdb", lit, "Lit", (1.5, 0.3, 1.1), (0, 0.5, 0), (1.1, 1.1, 1.4))
    camera()


def made_volumes():
    """Volumes by geometry nodes, instanced twice, and one by the Mesh to Volume modifier."""
    _sunny()
    haze, _, _ = of_volume("haze", "VolumePrincipled", Density=3.0)
    tree = bpy.data.node_groups.new("Lumps", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    cube, noise, paint, end = (tree.nodes.new(kind) for kind in ("GeometryNodeVolumeCube", "ShaderNodeTexNoise", "GeometryNodeSetMaterial", "NodeGroupOutput"))
    noise.inputs["Scale"].default_value, paint.inputs["Material"].default_value = 2.0, haze
    tree.links.new(noise.outputs[0], cube.inputs["Density"])
    tree.links.new(cube.outputs[0], paint.inputs[0])
    tree.links.new(paint.outputs[0], end.inputs[0])
    for k, place in enumerate((((-1.8, 0.4, 1), (0, 0, 0.6), (0.9, 0.9, 0.9)), ((1.8, 1.4, 0.9), (0.6, 0, 0), (0.8, 0.8, 0.8)))):
        obj = link(f"Lump {k}", bpy.data.meshes.new("empty"), *place)
        obj.modifiers.new("Lumps", "NODES").node_group = tree
    shape = add("torus", material("hidden"), (0.2, -2.8, 0.9), "Shape", major_radius=0.8, minor_radius=0.35)
    shape.hide_render = True
    data = bpy.data.volumes.new("Ring")
    data.materials.append(haze)
    ring = link("Ring", data, (0.2, -2.8, 0.9), (0.5, 0.2, 0))
    made = ring.modifiers.new("Made", "MESH_TO_VOLUME")
    made.object, made.voxel_amount, made.density = shape, 48, 1.5
    camera()


def _puff(size, power, *shift):
    """A spherical puff."""
    x, y, z = _places(size)
    return np.maximum(1 - (x - shift[0]) ** 2 - (y - shift[1]) ** 2 - (z - shift[2]) ** 2, 0) ** power


def clouds_together(folder):
    """Three overlapping clouds of different colour and density, one of which scatters forward."""
    _write(folder / "together.vdb", 0.05, (-1, -0.75, -0.6), density=_cloud())
    _sunny()
    for k, (density, color, cosine, *place) in enumerate((
        (5.0, (0.9, 0.5, 0.3), 0.0, (-0.7, 0, 1.2), (0.4, 0.6, 0.9), (1.2, 0.9, 1.5)),
        (3.0, (0.3, 0.7, 0.9), 0.6, (0.5, -0.2, 1.3), (0, 0.5, 0.2), (1.2, 1.1, 1.1)),
        (2.0, (0.8, 0.8, 0.4), -0.3, (0.1, 0.5, 1.0), (0.9, 0, 0.4), (1.5, 1.4, 1.3)),
    )):
        of, _, _ = of_volume(f"cloud {k}", "VolumePrincipled", Density=density, Anisotropy=cosine, Color=(*color, 1))
        volume(folder / "together.vdb", of, f"Cloud {k}", *place)
    ball(material("red", Base_Color=(0.8, 0.1, 0.1, 1)), (0.2, 0.3, 0.9), 0.4)
    camera()


def fire_in_smoke(folder):
    """A flame in smoke that is a separate object, with the same box, both within a third cloud with coloured absorption."""
    size = (32, 32, 48)
    _write(folder / "flame.vdb", 0.05, (-0.8, -0.8, 0), density=_puff(size, 2, 0, 0, -0.2), temperature=_puff(size, 1, 0, 0, -0.3) * 2200)
    _write(folder / "smoke.vdb", 0.05, (-0.8, -0.8, 0), density=_puff(size, 1, 0.1, 0.1, 0.3))
    floor()
    world((0.05, 0.06, 0.08))
    burning, _, node = of_volume("burning", "VolumePrincipled", Density=1.0, Color=(0.4, 0.4, 0.4, 1), Temperature=1.0)
    node.inputs["Blackbody Intensity"].default_value = 2.0
    smoke, _, _ = of_volume("smoke", "VolumePrincipled", Density=3.0, Color=(0.5, 0.5, 0.5, 1))
    colored, tree, absorb = of_volume("colored", "VolumeAbsorption", Color=(0.9, 0.5, 0.2, 1))
    asks = tree.nodes.new("ShaderNodeVolumeInfo")
    tree.links.new(asks.outputs["Density"], absorb.inputs["Density"])
    for name, file, of in (("Flame", "flame", burning), ("Smoke", "smoke", smoke), ("Colored", "smoke", colored)):
        volume(folder / f"{file}.vdb", of, name, (0, 0, 0.2), (0.2, 0, 0.4), (1, 1, 1.2))
    ball(material("grey", Base_Color=(0.7, 0.7, 0.7, 1)), (1.8, -0.6, 0.6), 0.6)
    camera()


def foggy_room(folder):
    """A box of fog around everything, a smaller box of coloured fog, a cloud in both, thin fog of the world, and a lamp inside. (Boxes that
    stand on the floor lose their light there in Cycles: it meets both surfaces in one place.)"""
    _write(folder / "inner.vdb", 0.05, (-1, -0.75, -0.6), density=_cloud())
    floor()
    camera()
    world((0.1, 0.12, 0.15))
    tree = bpy.context.scene.world.node_tree
    haze = tree.nodes.new("ShaderNodeVolumeScatter")
    haze.inputs["Density"].default_value = 0.01
    tree.links.new(haze.outputs[0], tree.nodes["World Output"].inputs["Volume"])
    fog, _, _ = of_volume("fog", "VolumeScatter", Color=(0.9, 0.9, 0.9, 1), Density=0.06, Anisotropy=0.4)
    add("cube", fog, (0, 0, 2.9), "Fog", size=1, scale=(24, 24, 6.2))
    blue, _, _ = of_volume("blue", "VolumePrincipled", Color=(0.4, 0.6, 0.9, 1), Density=0.5)
    add("cube", blue, (0.3, 0.3, 0.7), "Blue", size=1, scale=(3, 3, 1.6))
    white, _, _ = of_volume("white", "VolumePrincipled", Density=4.0, Color=(0.95, 0.9, 0.8, 1))
    volume(folder / "inner.vdb", white, "Cloud", (-0.8, 0, 1.2), (0.4, 0.6, 0.9), (1.2, 0.8, 1.2))
    light("POINT", "Lamp", 120, (1.0, -1.2, 2.4), shadow_soft_size=0.2)
    ball(material("red", Base_Color=(0.8, 0.1, 0.1, 1)), (1.2, 0.9, 0.6), 0.6)


def made_densities():
    """Mesh volumes with procedural density: noise fog in a rotated, stretched box, and a cloud by a spherical gradient and
    noise."""
    floor()
    camera()
    world((0.3, 0.35, 0.4))
    light("SUN", "Sun", 2, rotation=(0.7, 0.3, 0), angle=0.05)
    fog, tree, shader_node = of_volume("fog", "VolumeScatter", Color=(0.7, 0.8, 0.9, 1), Anisotropy=0.3)
    noise, more, coordinates = (tree.nodes.new(f"ShaderNode{k}") for k in ("TexNoise", "Math", "TexCoord"))
    noise.inputs["Scale"].default_value = 4
    more.operation, more.inputs[1].default_value = "MULTIPLY", 1.2
    tree.links.new(coordinates.outputs["Generated"], noise.inputs[0])
    tree.links.new(noise.outputs[0], more.inputs[0])
    tree.links.new(more.outputs[0], shader_node.inputs["Density"])
    add("cube", fog, (-1.2, 0.5, 0.9), "Fog", size=1, scale=(2.4, 1.2, 1.4), rotation=(0.1, 0.2, 0.5))
    cloud, tree, shader_node = of_volume("cloud", "VolumePrincipled", Color=(0.9, 0.9, 0.9, 1))
    coordinates, gradient, noise, sum_, ramp = (
        tree.nodes.new(f"ShaderNode{k}") for k in ("TexCoord", "TexGradient", "TexNoise", "Math", "ValToRGB")
    )
    gradient.gradient_type, sum_.operation = "SPHERICAL", "MULTIPLY"
    noise.inputs["Scale"].default_value = 3
    tree.links.new(coordinates.outputs["Object"], gradient.inputs[0])
    tree.links.new(coordinates.outputs["Object"], noise.inputs[0])
    tree.links.new(gradient.outputs["Fac"], sum_.inputs[0])
    tree.links.new(noise.outputs[0], sum_.inputs[1])
    tree.links.new(sum_.outputs[0], ramp.inputs[0])
    ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.1, 0.4
    ramp.color_ramp.elements[1].color = (6, 6, 6, 1)
    tree.links.new(ramp.outputs["Color"], shader_node.inputs["Density"])
    add("uv_sphere", cloud, (1.2, -0.6, 1.1), "Cloud", radius=1)
