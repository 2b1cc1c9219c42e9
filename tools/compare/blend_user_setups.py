"""Blender scenes with common user setups: lampshades, images with alpha, trimmed hair, scaled lights, indirect-only
collections."""

import bpy
import numpy as np

from blend_parts import add, ball, camera, floor, light, link, lit, material, scene, shader, world


def _daylight():
    floor()
    camera()
    lit()


def _waves(size=32, seed=0.0, alpha=False):
    """Pixel values of a colourful image, optionally with alpha."""
    u, v = np.meshgrid(np.arange(size) / size, np.arange(size) / size)
    parts = [0.5 + 0.45 * np.sin(2 * np.pi * (a * u + b * v) + seed + a) for a, b in ((1, 2), (3, -1), (-2, 2))]
    clear = np.clip(0.5 + np.sin(2 * np.pi * (2 * u + v) + seed), 0, 1) if alpha else np.ones_like(u)
    return np.stack([*parts, clear], -1).astype(np.float32)


def _stored(name, codes):
    """An 8-bit image packed into the file."""
    image = bpy.data.images.new(name, codes.shape[1], codes.shape[0], alpha=True)
    image.pixels[:] = codes.ravel()
    image.file_format = "PNG"
    image.pack()
    return image


def _by_picture(tree, image, target):
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs["Color"], target)
    return node


def lampshades():
    """Lampshades: sums and mixes of Diffuse and Translucent, with constant and textured colours."""
    floor()
    camera()
    world((0.05, 0.05, 0.05))
    for k, (kind, has_picture) in enumerate((("AddShader", False), ("AddShader", True), ("MixShader", True))):
        shade, tree, passing = shader(f"shade {k}", "BsdfTranslucent", Color=(0.75, 0.7, 0.6, 1))
        diffuse, both = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new(f"ShaderNode{kind}")
        diffuse.inputs[0].default_value = (0.2, 0.2, 0.2, 1)
        if has_picture:
            _by_picture(tree, _stored(f"paper {k}", 0.4 + 0.45 * _waves(seed=k)), passing.inputs[0])
        shaders = [entry for entry in both.inputs if entry.type == "SHADER"]
        for node, entry in zip((passing, diffuse), shaders):
            tree.links.new(node.outputs[0], entry)
        tree.links.new(both.outputs[0], tree.nodes["Material Output"].inputs[0])
        place = (-2 + 2 * k, 0.6 * k - 0.4, 1)
        add("cone", shade, place, radius1=0.8, radius2=0.5, depth=1.0, end_fill_type="NOTHING", smooth=True)
        light("POINT", f"Bulb {k}", 40, place, shadow_soft_size=0.05)


def clear_pictures():
    """Images with alpha of which only the colour is used, of which alpha is used too, and one with channel-packed alpha."""
    _daylight()
    for k, mode in enumerate(("STRAIGHT", "STRAIGHT", "CHANNEL_PACKED")):
        image = _stored(f"leaf {k}", _waves(seed=k, alpha=True))
        image.alpha_mode = mode
        paper = material(f"paper {k}", Roughness=0.8)
        principled = paper.node_tree.nodes["Principled BSDF"]
        node = _by_picture(paper.node_tree, image, principled.inputs["Base Color"])
        if k == 1:
            paper.node_tree.links.new(node.outputs["Alpha"], principled.inputs["Alpha"])
        add("plane", paper, (-2 + 2 * k, 0.4 * k, 0.9), size=1.7, rotation=(1.0, 0, 0.6))


def stretched_lamps():
    """Spot lights with non-uniform scale, one in a collection that is instanced twice, and a scaled area light."""
    floor()
    camera()
    world((0.03, 0.03, 0.03))
    ball(material("grey", Base_Color=(0.7, 0.7, 0.7, 1)), (1, -0.8, 0.5), 0.5)
    light("SPOT", "Flat", 60, (-1.5, 0, 1.5), (0.3, 0.2, 0), scale=(1, 2, 0.5), spot_size=1.2, spot_blend=0.4)
    light("SPOT", "Deep", 60, (1.5, 1, 1.8), (0.1, -0.2, 0), scale=(1, 1, 2), spot_size=2.8, spot_blend=0.4)
    group = bpy.data.collections.new("lamps")
    lamp = light("AREA", "Panel", 40, (0, 0, 0.8), shape="ELLIPSE", size=0.6, size_y=0.3)
    scene().collection.objects.unlink(lamp)
    group.objects.link(lamp)
    for k, scale in enumerate(((1, 1, 1), (1.5, 0.8, 1))):
        holder = link(f"Holder {k}", None, (-2 + 4 * k, 2, 0.3), (0, 0.1, k), scale)
        holder.instance_type, holder.instance_collection = "COLLECTION", group


def indirect_things():
    """An indirect-only collection, visible in mirrors, and instancing on vertices and faces."""
    _daylight()
    ball(material("mirror", Metallic=1, Roughness=0.05), (0, 0, 1), 1)
    glow = ball(material("glow", Emission_Color=(1, 0.1, 0.1, 1), Emission_Strength=6), (2, -0.5, 0.6), 0.5)
    hidden = bpy.data.collections.new("hidden")
    scene().collection.children.link(hidden)
    scene().collection.objects.unlink(glow)
    hidden.objects.link(glow)
    bpy.context.view_layer.layer_collection.children["hidden"].indirect_only = True
    holder = add("grid", material("leaf", Base_Color=(0.2, 0.5, 0.2, 1)), (-2, 1, 0.4), x_subdivisions=3, y_subdivisions=3, size=2)
    holder.instance_type, holder.use_instance_faces_scale = "FACES", True
    add("cone", material("thorn", Base_Color=(0.8, 0.3, 0.1, 1)), (0, 0, 0), radius1=0.3, depth=0.8).parent = holder


def cut_hair():
    """Hair particles with trimmed children, and of random length."""
    _daylight()
    for k, (length, chance) in enumerate(((0.6, 0.0), (1.0, 0.5))):
        head = ball(material(f"skin {k}", Base_Color=(0.5, 0.3, 0.2, 1)), (-1.4 + 2.8 * k, 0.4, 0.9), 0.8)
        made = head.modifiers.new("hair", "PARTICLE_SYSTEM").particle_system
        made.settings.type, made.settings.count, made.settings.hair_length = "HAIR", 150, 0.5
        made.settings.child_type, made.settings.rendered_child_count = "INTERPOLATED", 20
        made.settings.child_length, made.settings.length_random = length, chance
        made.settings.root_radius, made.settings.radius_scale = 1.0, 0.02
