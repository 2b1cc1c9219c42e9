"""Blender scenes with point clouds and vertex colours."""

import bpy
import numpy as np

from blend_parts import add, camera, floor, light, lit, material, new_nodes, scene

KINDS = ("NodeGroupInput", "NodeGroupOutput", "GeometryNodeMeshToPoints", "GeometryNodeInputNamedAttribute", "GeometryNodeSetMaterial")


def _points_of(obj, paint):
    """Converts a mesh's vertices to points with the radius of an attribute."""
    tree = bpy.data.node_groups.new("Points", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    start, end, points, radius, painted = (tree.nodes.new(kind) for kind in KINDS)
    radius.data_type, radius.inputs["Name"].default_value = "FLOAT", "width"
    painted.inputs["Material"].default_value = paint
    tree.links.new(start.outputs[0], points.inputs["Mesh"])
    tree.links.new(radius.outputs["Attribute"], points.inputs["Radius"])
    tree.links.new(points.outputs[0], painted.inputs["Geometry"])
    tree.links.new(painted.outputs[0], end.inputs[0])
    obj.modifiers.new("Points", "NODES").node_group = tree


def _cloud(name, places, radii, paint, location=(0, 0, 0)):
    """Points at positions, with a colour by height."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(places.tolist(), [], [])
    data.attributes.new("width", "FLOAT", "POINT").data.foreach_set("value", radii.astype(np.float32))
    share = (places[:, 2:] - places[:, 2].min()) / np.ptp(places[:, 2])
    colors = np.concatenate([0.1 + 0.8 * share, 0.5 - 0.3 * share, 0.9 - 0.8 * share, np.ones_like(share)], 1)
    data.attributes.new("tint", "FLOAT_COLOR", "POINT").data.foreach_set("color", colors.astype(np.float32).ravel())
    made = bpy.data.objects.new(name, data)
    made.location = location
    scene().collection.objects.link(made)
    _points_of(made, paint)
    return made


def _by_attribute(name, attribute, **inputs):
    made = material(name, **inputs)
    tree, shader, node = new_nodes(made, "Attribute")
    node.attribute_name = attribute
    tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    return made


def points():
    """A coloured point scan, a few large emissive points, and a scanned mesh with vertex colours."""
    lit()
    floor()
    chance = np.random.default_rng(3)
    angles, heights = chance.uniform(0, 2 * np.pi, 4000), chance.uniform(0, 2.4, 4000)
    radius = 0.5 + 0.25 * np.sin(3 * heights)
    vase = np.stack([radius * np.cos(angles), radius * np.sin(angles), heights], 1)
    _cloud("Vase", vase, np.full(4000, 0.03), _by_attribute("scan", "tint", Roughness=0.7), (-1.2, 0.5, 0.05))
    grid = np.stack(np.meshgrid(np.arange(3), np.arange(3), np.arange(3)), -1).reshape(-1, 3) * 0.45
    steel = material("steel", Metallic=1.0, Roughness=0.2, Base_Color=(0.8, 0.8, 0.85, 1))
    _cloud("Balls", grid, 0.1 + 0.1 * (np.arange(27) % 3) / 2, steel, (1.2, -1.5, 0.25))
    scanned = add("monkey", _by_attribute("painted", "paint", Roughness=0.5), (1.6, 1.4, 0.9), "Monkey")
    scanned.rotation_euler.z = 0.7
    paint = scanned.data.color_attributes.new("paint", "BYTE_COLOR", "CORNER")
    paint.data.foreach_set("color", chance.uniform(0.05, 0.9, (len(paint.data), 4)).ravel())
    light("POINT", "Fill", 60, (2, -4, 3), shadow_soft_size=0.3)
    camera()
