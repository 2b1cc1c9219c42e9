"""Materials: brought into the form that Blender's glTF exporter reads, one Principled shader whose inputs are constants or
pictures, with a list of what that loses."""

import math

import bpy

from . import bake, closures, shaders, trees, uniform, variants, views
from .report import listed

# Inputs of the Principled shader that nothing here carries, with the value at which they do nothing.
LOST = {
    "Subsurface Weight": (0.0, "subsurface scattering"),
    "Diffuse Roughness": (0.0, "the roughness of diffuse reflection"),
    "Coat Tint": ((1.0, 1.0, 1.0), "the tint of the coat"),
}

# Of the inputs that pictures can fill, those that only matter with another one above 0.
DEPENDS = {
    "Subsurface Radius": "Subsurface Weight",
    "Emission Color": "Emission Strength",
    "Coat Tint": "Coat Weight",
}


def prepare(found, store, report):
    """Changes the materials of all collected meshes; gives what is to be added to them in glTF, by name."""
    holders = [holder for holder in found.objects.values() if holder is not None]
    _fill_empty_slots(holders)
    for material in trees.of_materials(holders):
        material.use_backface_culling = False
    variants.split(holders, report)
    materials = trees.of_materials(holders)
    lost_nodes = {}
    for material in materials:
        _normalize(material, report, lost_nodes)
        views.rewrite_cameras(material, found.cameras[0] if found.cameras else None)
        if principled(material) is not None:
            views.take_means(material, principled(material), report)
    uniform.fold(materials, bake.new_scene, principled)
    for what, names in lost_nodes.items():
        report.warn("", f"{what} not carried over: of {listed(names)}")
    bake.bake_all(holders, found, store, report)
    return {m.name: patch(m, report) for holder in holders for m in holder.data.materials}


def _fill_empty_slots(holders):
    """What has no material is grey in Blender, and white metal in glTF."""
    default = None
    for holder in holders:
        slots = holder.data.materials
        if len(slots) > 0 and None not in list(slots):
            continue
        if default is None:
            default = bpy.data.materials.new("default")
            default.use_nodes = True
        if not len(slots):
            slots.append(default)
        for i, material in enumerate(slots):
            if material is None:
                slots[i] = default


def _normalize(material, report, lost_nodes):
    """Makes the surface of a material one Principled shader."""
    if not material.use_nodes or material.node_tree is None:
        color = tuple(material.diffuse_color)[:3]
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        closures.build(tree, closures.diffuse(color))
        return
    tree = material.node_tree
    end = shaders.end(tree)
    if end is None:
        tree.nodes.clear()
        closures.build(tree, closures.invisible())
        return
    if shaders.source(end.inputs["Displacement"]) is not None:
        lost_nodes.setdefault("displacement is", []).append(material.name)
    has_volume = shaders.source(end.inputs["Volume"]) is not None
    surface = shaders.source(end.inputs["Surface"])
    if has_volume and _absorption(end) is None:
        lost_nodes.setdefault("volumes are", []).append(material.name)
    if surface is None:
        # Without a surface Blender shows nothing (but the volume).
        closures.build(tree, closures.invisible(), end)
        return
    if surface.node.bl_idname == "ShaderNodeBsdfPrincipled" and not surface.node.mute:
        closures.make_active(tree, end)
        return
    found = closures.Reader(tree, material.name, report).read(surface)
    closures.build(tree, found, end)


def _absorption(end):
    """The node of the one kind of volume that glTF has; None without it."""
    source = shaders.source(end.inputs["Volume"])
    return source.node if source is not None and source.node.bl_idname == "ShaderNodeVolumeAbsorption" else None


def principled(material):
    """The shader node of a material that has been prepared."""
    node = shaders.output(material.node_tree)
    return node if node is not None and node.bl_idname == "ShaderNodeBsdfPrincipled" else None


def patch(material, report):
    """The extensions of a material that Blender's exporter leaves out or has wrong, and a roughness to go with them."""
    node = principled(material)
    if node is None:
        return {}
    value = lambda name: shaders.constant(node.inputs[name]) if name in node.inputs else None
    for name, (idle, what) in LOST.items():
        needed = DEPENDS.get(name)
        is_used = needed is None or value(needed) != 0
        if name in node.inputs and is_used and not _is_close(value(name), idle):
            report.warn(material.name, f"{what} is not carried over")
    extensions = {}
    ior = value("IOR")
    if ior is not None and abs(ior - 1.5) > 1e-6:
        extensions["KHR_materials_ior"] = {"ior": max(ior, 1.0)}
    if value("Sheen Weight"):
        tint = value("Sheen Tint") or (1.0, 1.0, 1.0)
        color = [min(max(value("Sheen Weight") * c, 0.0), 1.0) for c in tint]
        roughness = value("Sheen Roughness")
        factors = {"sheenColorFactor": color, "sheenRoughnessFactor": 0.5 if roughness is None else roughness}
        extensions["KHR_materials_sheen"] = factors
    thickness = value("Thin Film Thickness")
    if thickness:
        film = {"iridescenceFactor": 1.0, "iridescenceIor": value("Thin Film IOR") or 1.33}
        extensions["KHR_materials_iridescence"] = {**film, "iridescenceThicknessMaximum": thickness}
    patched = {"extensions": extensions}
    _absorb(material, value, patched, report)
    anisotropic, roughness = value("Anisotropic"), value("Roughness")
    if anisotropic and roughness is not None:
        strength, across = _anisotropy(anisotropic, roughness)
        extensions["KHR_materials_anisotropy"] = {"anisotropyStrength": strength}
        patched["roughness"] = across
    return patched


def _absorb(material, value, patched, report):
    """The absorption within glass (Beer): a colour exp(color - 1) at a distance of 1 / density."""
    # A material with a shader has an output.
    node = _absorption(shaders.end(material.node_tree))
    if node is None or not value("Transmission Weight"):
        return
    color, density = (shaders.constant(node.inputs[name]) for name in ("Color", "Density"))
    if color is None or density is None:
        report.warn(material.name, "absorption that varies in its volume is not carried over")
        return
    if density <= 0:
        return
    attenuation = {"attenuationColor": [math.exp(min(c, 1.0) - 1) for c in color], "attenuationDistance": 1 / density}
    # Any thickness but 0 makes it a solid.
    patched["extensions"]["KHR_materials_volume"] = {"thicknessFactor": 1.0, **attenuation}
    base = value("Base Color")
    if base is not None:
        # glTF tints whole at each surface of a solid, Blender by the root.
        patched["base_color"] = [max(c, 0.0) ** 0.5 for c in base]


def _is_close(value, idle):
    if value is None:
        return False
    pairs = zip(value, idle) if isinstance(idle, tuple) else [(value, idle)]
    return all(abs(a - b) < 1e-6 for a, b in pairs)


def _anisotropy(anisotropic, roughness):
    """Strength and roughness in glTF that give the two alphas of Blender's shader: alpha over and times the aspect
    sqrt(1 - 0.9 anisotropic)."""
    aspect = (1 - 0.9 * min(abs(anisotropic), 1.0)) ** 0.5
    along, across = roughness**2 / aspect, roughness**2 * aspect
    strength = max((min(along, 1.0) - across) / max(1 - across, 1e-6), 0.0) ** 0.5
    return min(strength, 1.0), across**0.5
