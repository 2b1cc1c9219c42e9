"""Materials: brought into the form that Blender's glTF exporter reads, one Principled shader whose inputs are constants or
pictures, with a list of what that loses."""

import math

import bpy

from . import bake, brushed, closures, densities, facing, glasses, means, media, mixes, panes, passing, pictures, relief, shaders, skins, trees, undeformed, uniform, variants, vertex_colors, views

WHITE = closures.WHITE

# How much longer than the layer is thick the ways through a coat are, about.
COAT_WAY = 1.1


def prepare(found, store, report):
    """Changes the materials of all collected meshes; gives what is to be added to them in glTF, by name."""
    holders = [holder for holder in found.objects.values() if holder is not None]
    _fill_empty_slots(holders)
    for material in trees.of_materials(holders):
        material.use_backface_culling = False
    undeformed.use(holders, [holder for holder in holders if relief.is_displaced(holder)])
    relief.displace(holders, found, report)
    variants.split(holders, report)
    densities.settle(holders, found, store, report)
    materials = trees.of_materials(holders)
    users = {m: [holder for holder in holders if m in list(holder.data.materials)] for m in materials}
    for material in materials:
        views.simplify(material, report)
        _normalize(material, report)
        relief.bumps(material, shaders.principled(material), report)
        views.rewrite_cameras(material, found.cameras[0] if found.cameras else None, found.window)
        if shaders.principled(material) is not None:
            facing.take(material, shaders.principled(material), found.exposure)
            mixed = mixes.fit(material, users[material])
            views.take_means(material, shaders.principled(material), report, mixed)
        _expose(material, found.exposure)
    uniform.fold(materials)
    vertex_colors.settle(holders)
    means.take(holders, report)
    panes.settle(holders, found, report)
    skins.settle(holders, report)
    bake.bake_all(holders, found, store, report)
    relief.finish(holders)
    found.brushed = brushed.read(holders, report)
    return {material.name: patch(material, report) for material in trees.of_materials(holders)}


def _expose(material, factor):
    """Multiplies what a material emits."""
    node = shaders.principled(material)
    settings = trees.SETTINGS.get(material.name, {})
    if isinstance(settings.get("emission"), list):
        settings["emission"] = [factor * c for c in settings["emission"]]
    if node is None or factor == 1 or shaders.constant(node.inputs["Emission Strength"]) == 0:
        return
    tree, socket = material.node_tree, node.inputs["Emission Strength"]
    value = shaders.constant(socket)
    if value is not None:
        for link in list(socket.links):
            tree.links.remove(link)
        socket.default_value = factor * value
        return
    product = tree.nodes.new("ShaderNodeMath")
    product.operation, product.inputs[1].default_value = "MULTIPLY", factor
    tree.links.new(shaders.source(socket), product.inputs[0])
    tree.links.new(product.outputs[0], socket)


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


def _normalize(material, report):
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
    surface = shaders.source(end.inputs["Surface"])
    if surface is None:
        # Without a surface Blender shows nothing but the volume.
        filling = _filling(material, report)
        if not filling.is_nothing():
            trees.settle(material, type="medium", **filling.entries())
        closures.build(tree, closures.invisible(), end)
        return
    if surface.node.bl_idname == "ShaderNodeBsdfPrincipled" and not surface.node.mute:
        closures.make_active(tree, end)
        _tint_by_coat(tree, surface.node, material, report)
        return
    found = closures.Reader(tree, material, report).read(surface)
    closures.build(tree, found, end)
    passing.settle(material, shaders.principled(material), found, report)
    if found.get("Transmission Weight", 0.0) != 0.0:
        known = {"glass_reflection": found.get(glasses.REFLECTION), "dispersion": found.get(glasses.DISPERSION)}
        trees.settle(material, **{key: value for key, value in known.items() if value is not None})


def _filling(material, report):
    """What fills solids of a material."""
    end = shaders.end(material.node_tree)
    try:
        return media.read(end.inputs["Volume"]) if end is not None else media.Filling()
    except media.Varying as varying:
        report.warn(material.name, f"its volume differs from place to place ({varying}) and is left out")
        return media.Filling()


def _tint_by_coat(tree, node, material, report):
    """What lies under a coloured coat has its colour: light crosses it on its way out."""
    if "Coat Tint" not in node.inputs or shaders.constant(node.inputs["Coat Weight"]) == 0:
        return
    weight, tint = (shaders.constant(node.inputs[name]) for name in ("Coat Weight", "Coat Tint"))
    if tint == WHITE:
        return
    if weight is None or tint is None:
        report.warn(material.name, "a tint of the coat that varies is not carried over")
        return
    factor = tuple(1 + (max(t, 0.0) ** COAT_WAY - 1) * weight for t in tint)
    for name in ("Base Color", "Emission Color"):
        socket = node.inputs[name]
        value = shaders.constant(socket)
        if value is not None:
            for link in list(socket.links):
                tree.links.remove(link)
            socket.default_value = (*(v * f for v, f in zip(value, factor)), 1.0)
            continue
        mixed = tree.nodes.new("ShaderNodeVectorMath")
        mixed.operation, mixed.inputs[1].default_value = "MULTIPLY", factor
        tree.links.new(shaders.source(socket), mixed.inputs[0])
        tree.links.new(mixed.outputs[0], socket)
    node.inputs["Coat Tint"].default_value = (1, 1, 1, 1)


def patch(material, report):
    """The extensions of a material that Blender's exporter leaves out or has wrong, and a roughness to go with them."""
    mixes.forget(material)
    node = shaders.principled(material)
    if node is None:
        return {}
    value = lambda name: shaders.constant(node.inputs[name]) if name in node.inputs else None
    extensions = {}
    _diffuse(material, value, extensions, report)
    ior = value("IOR")
    if trees.SETTINGS.get(material.name, {}).pop("mirror", False):
        extensions["KHR_materials_ior"] = {"ior": 0.0}
    elif ior is not None and abs(ior - 1.5) > 1e-6:
        extensions["KHR_materials_ior"] = {"ior": max(ior, 1.0)}
    if dispersion := trees.SETTINGS.get(material.name, {}).pop("dispersion", None):
        extensions["KHR_materials_dispersion"] = {"dispersion": dispersion}
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
    _fill(material, value, patched, report)
    _tint_edge(material, value, patched, report)
    if value("Anisotropic"):
        _brush(node, value("Anisotropic"), value("Roughness"), patched)
    return patched


def _brush(node, anisotropic, roughness, patched):
    """Anisotropy; that of a picture of roughness is right at its mean."""
    source = shaders.source(node.inputs["Roughness"])
    mean = roughness if roughness is not None else pictures.mean_of(source)
    strength, across = _anisotropy(anisotropic, mean)
    found = {"anisotropyStrength": strength}
    if turned := brushed.rotation(node):
        found["anisotropyRotation"] = turned
    patched["extensions"]["KHR_materials_anisotropy"] = found
    patched["roughness"] = across if roughness is not None else across / max(mean, 1e-3)


def _diffuse(material, value, extensions, report):
    """What diffuse light does other than to be reflected by Lambert's law."""
    rough = value("Diffuse Roughness")
    if rough is None and "Diffuse Roughness" in shaders.principled(material).inputs:
        report.warn(material.name, "a roughness of diffuse reflection that varies is not carried over")
    if rough:
        # The extension of glTF is a draft.
        trees.settle(material, diffuse_roughness=min(max(rough, 0.0), 1.0))
    translucency = trees.SETTINGS.get(material.name, {}).pop("translucency", None)
    if translucency is not None:
        share, color = translucency
        # Without a colour the picture of the base colour is taken.
        tint = {"diffuseTransmissionColorFactor": [min(max(c, 0.0), 1.0) for c in color]} if color else {"tinted": True}
        extensions["KHR_materials_diffuse_transmission"] = {"diffuseTransmissionFactor": share, **tint}
    body = skins.body_of(material)
    if value("Subsurface Weight") != 0:
        _scatter(material, value, body, report)
        if body is not None:
            extensions["KHR_materials_diffuse_transmission"] = {"diffuseTransmissionFactor": 1.0, "tinted": True}


def _scatter(material, value, body, report):
    """Subsurface scattering, for the file of settings: in place of diffuse reflection."""
    names = ("Subsurface Weight", "Base Color", "Subsurface Radius", "Subsurface Scale", "Subsurface Anisotropy")
    weight, color, radius, scale, cosine = (value(name) for name in names)
    if weight is None or radius is None or scale is None:
        report.warn(material.name, "subsurface scattering that varies is not carried over: it reflects as diffuse surfaces do")
        return
    color = body if body is not None else color
    if color is None:
        message = "subsurface scattering of a varying colour needs a closed mesh: it reflects as diffuse surfaces do"
        report.warn(material.name, message)
        return
    if weight < skins.LEAST_SUBSURFACE or scale <= 0 or value("Metallic") or value("Transmission Weight"):
        report.warn(material.name, f"subsurface scattering of weight {weight:.3g} is taken for diffuse reflection")
        return
    cosine = min(max(cosine or 0.0, -0.99), 0.99)
    radius = [max(r * scale * (1 - cosine) / (4 * math.pi), 1e-6) for r in radius]
    color = [min(max(c, 0.0), 1.0) for c in color]
    trees.settle(material, subsurface={"color": color, "radius": radius, "anisotropy": cosine})


def _fill(material, value, patched, report):
    """What fills glass: absorption by glTF's own means (Beer), more by the file of settings."""
    filling = _filling(material, report) if value("Transmission Weight") else media.Filling()
    if filling.is_nothing():
        return
    base = value("Base Color")
    if base is not None:
        # glTF tints whole at each surface of a solid, Blender by the root.
        patched["base_color"] = [max(c, 0.0) ** 0.5 for c in base]
    if any(filling.scattered) or any(filling.glow):
        trees.settle(material, volume=True, medium=filling.entries())
        patched["extensions"]["KHR_materials_volume"] = {"thicknessFactor": 1.0}
        return
    # Any thickness but 0 makes it a solid.
    distance = 1 / max(filling.absorbed)
    attenuation = {"attenuationColor": [math.exp(-a * distance) for a in filling.absorbed], "attenuationDistance": distance}
    patched["extensions"]["KHR_materials_volume"] = {"thicknessFactor": 1.0, **attenuation}


def _tint_edge(material, value, patched, report):
    """A metal whose edge has another colour (F82 of Kutz and others, 2021): glTF has it white, so that the mean is kept."""
    tint, base = value("Specular Tint"), value("Base Color")
    if not value("Metallic") or tint is None or _is_close(tint, WHITE):
        return
    if base is None:
        report.warn(material.name, "the colour of a metal's edge (Specular Tint) is not carried over")
        return
    metallic = value("Metallic")
    patched["base_color"] = [max(b + metallic * (edged_metal(b, t) - b), 0.0) for b, t in zip(base, tint)]
    report.warn(material.name, "the colour of a metal's edge (Specular Tint) is not carried over: its mean reflectance is")


def edged_metal(base, tint):
    """The reflectance of a metal by Schlick that reflects on the whole as one of this reflectance with a tint at 82 degrees."""
    cosine = 1 / 7
    at_edge = base + (1 - base) * (1 - cosine) ** 5
    lost = at_edge * (1 - tint) / (cosine * (1 - cosine) ** 6)
    # 2 int cos * cos (1 - cos)^6 is 1 / 126; Schlick's mean is base + (1 - base) / 21.
    return base - lost / 126 * 21 / 20


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
