"""Building blocks of Blender scenes with `bpy`: objects, lights, worlds, materials, cameras."""

import bpy
import numpy as np


def scene():
    return bpy.context.scene


def link(name, data, location=(0, 0, 0), rotation=(0, 0, 0), scale=(1, 1, 1), into=None):
    obj = bpy.data.objects.new(name, data)
    obj.location, obj.rotation_euler, obj.scale = location, rotation, scale
    (into or scene().collection).objects.link(obj)
    return obj


def camera(location=(6, -7, 4), rotation=(1.15, 0, 0.7), **settings):
    data = bpy.data.cameras.new("Camera")
    for key, value in settings.items():
        setattr(data, key, value)
    scene().camera = link("Camera", data, location, rotation)
    return scene().camera


def light(kind, name, energy, location=(0, 0, 0), rotation=(0, 0, 0), scale=(1, 1, 1), **settings):
    data = bpy.data.lights.new(name, kind)
    data.energy = energy
    for key, value in settings.items():
        setattr(data, key, value)
    return link(name, data, location, rotation, scale)


def world(color=(0.1, 0.1, 0.1), strength=1.0):
    made = bpy.data.worlds.new("World")
    scene().world = made
    made.use_nodes = True
    background = made.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*color, 1)
    background.inputs["Strength"].default_value = strength
    return made.node_tree, background


def material(name, **inputs):
    """A Principled material; underscores in names stand for spaces."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    principled = made.node_tree.nodes["Principled BSDF"]
    for key, value in inputs.items():
        principled.inputs[key.replace("_", " ")].default_value = value
    return made


def shader(name, kind, **inputs):
    """A material of one other shader node; returns the material, its tree and the node."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    node = tree.nodes.new(f"ShaderNode{kind}")
    for key, value in inputs.items():
        node.inputs[key].default_value = value
    if node.outputs:
        tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return made, tree, node


def add(kind, of, location=(0, 0, 0), name=None, smooth=False, **settings):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(location=location, **settings)
    obj = bpy.context.object
    if of is not None:
        obj.data.materials.append(of)
    if name:
        obj.name = obj.data.name = name
    if smooth:
        bpy.ops.object.shade_smooth()
    return obj


def ball(of, location, radius=0.8, name=None):
    return add("uv_sphere", of, location, name, smooth=True, radius=radius, segments=48, ring_count=24)


def floor(of=None, size=14):
    return add("plane", of or material("floor", Base_Color=(0.6, 0.6, 0.6, 1), Roughness=0.9), size=size, name="Floor")


def still_life():
    floor()
    ball(material("red", Base_Color=(0.8, 0.1, 0.1, 1), Roughness=0.5), (0, 0, 0.8))
    grey = material("grey", Base_Color=(0.5, 0.5, 0.5, 1), Roughness=0.7)
    add("cube", grey, (2, 1, 0.7), "Box", size=1.4, rotation=(0, 0, 0.5))


def picture(name, pixels):
    """An image from rows of linear RGB, packed into the file."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, float_buffer=True)
    full = np.ones((height, width, 4), np.float32)
    full[..., :3] = pixels
    image.pixels[:] = full.ravel()
    image.pack()
    return image


def keyed(owner, path, values):
    """Keyframes a property path: its values by frame."""
    for frame, value in values.items():
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)


def lit():
    """A constant world and one area light."""
    world((0.3, 0.35, 0.4))
    light("AREA", "Key", 250, (-3, -4, 5), (0.6, -0.5, 0), size=2)


def new_nodes(made, *kinds):
    """A material's tree, its Principled shader, and new nodes."""
    tree = made.node_tree
    return (tree, tree.nodes.get("Principled BSDF"), *(tree.nodes.new(f"ShaderNode{kind}") for kind in kinds))


def by_ramp(tree, source, node, name="Base Color"):
    """Colours an input by a number through a ramp."""
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (0.8, 0.05, 0.05, 1), (0.05, 0.2, 0.9, 1)
    middle = ramp.color_ramp.elements.new(0.5)
    middle.color = (0.1, 0.7, 0.1, 1)
    tree.links.new(source, ramp.inputs[0])
    tree.links.new(ramp.outputs[0], node.inputs[name])
