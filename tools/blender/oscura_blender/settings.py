"""Render settings: resolution, samples, limits of bounces, passes, color management."""

import bpy
import numpy as np

from . import multiscatter, view_table
from .final_render import ENGINE
from .node_links import follow

# The working space of oscura, and of Blender by default.
REC709 = "Linear Rec.709"

# Views that scene files name, by Blender's names. False Color has steps that no table can hold; others become tables.
VIEWS = {"Standard": "srgb", "False Color": "false-color"}

# Cycles' limit of scattering events below a surface.
SUBSURFACE_STEPS = 256

# Passes of view layers, by Blender's switches without "use_pass_", and their names in scene files where these differ.
PASSES = (
    "z", "position", "normal", "vector", "uv", "object_index", "material_index", "diffuse_direct", "diffuse_indirect", "diffuse_color",
    "glossy_direct", "glossy_indirect", "glossy_color", "transmission_direct", "transmission_indirect", "transmission_color", "emit",
    "environment", "shadow",
)  # fmt: skip
CRYPTOMATTES = ("cryptomatte_object", "cryptomatte_material", "cryptomatte_asset")
PASS_NAMES = {
    "z": "depth", "vector": "motion", "object_index": "object_id", "material_index": "material_id", "emit": "emission",
    "cryptomatte_object": "crypto_object", "cryptomatte_material": "crypto_material", "cryptomatte_asset": "crypto_asset",
}  # fmt: skip
UNSUPPORTED_PASSES = {"mist": "Mist", "ambient_occlusion": "Ambient Occlusion"}


def resolution(scene):
    """Width and height of the picture in pixels."""
    render = scene.render
    share = render.resolution_percentage / 100
    return tuple(max(1, int(n * share)) for n in (render.resolution_x, render.resolution_y))


def read(export):
    scene, layer, report = export.scene, export.layer, export.report
    width, height = resolution(scene)
    entries = {"width": width, "height": height}
    if scene.render.engine == ENGINE:
        entries.update(_addon_settings(scene))
        entries["aovs"] = _addon_passes(layer) or None
    else:
        if scene.render.engine == "CYCLES":
            entries.update(_cycles_settings(scene.cycles, report))
            entries["aovs"] = _passes(layer, report) or None
        else:
            report.note("", f"the render engine is {scene.render.engine}: it is rendered as by Cycles")
        entries.update(_limits(scene.cycles, report))
        mesh_entries = export.mesh_entries()
        if any("is_shadow_catcher" in entry.traits for entry in mesh_entries):
            entries["caught"] = "shadows"
        entries["terminator"] = _terminator(scene)
        materials = (material for entry in mesh_entries for material in entry.object.data.materials if material is not None)
        entries["microfacet"] = multiscatter.model(materials)
    entries.update(view(scene, export.folder, export.name, report))
    entries["crop"] = _crop(scene.render, width, height)
    _warn_of_losses(scene, report)
    return entries


def _terminator(scene):
    """Whether shadow rays start at the smooth surface: unless all objects have a geometry offset of 0."""
    has_offset = any(getattr(obj.cycles, "shadow_terminator_geometry_offset", 0.1) > 0 for obj in scene.objects if obj.type == "MESH")
    return "lifted" if has_offset else "off"


def view(scene, folder, name, report):
    """The view transform; a table is written to the folder."""
    settings = scene.view_settings
    entries = {"view": VIEWS.get(settings.view_transform)}
    if entries["view"] == "false-color":
        report.note("", "the view is False Color, whose steps differ from Blender's")
        return {**entries, **_exposure(settings)}
    # Curves act before the exposure, and only Blender has tints: tables with them have exposure and white balance as well.
    is_balanced = getattr(settings, "use_white_balance", False)  # since Blender 4.3
    with_exposure = settings.use_curve_mapping or (is_balanced and abs(settings.white_balance_tint - 10.0) > 1e-3)
    has_look = settings.look not in ("None", "")
    if entries["view"] is None or has_look or with_exposure or abs(settings.gamma - 1) > 1e-6:
        entries["view"] = view_table.write(scene, folder, name, with_exposure)
    return entries if with_exposure else {**entries, **_exposure(settings)}


def _exposure(settings):
    entries = {}
    if settings.exposure:
        entries["exposure"] = max(-100.0, min(100.0, settings.exposure))
    if getattr(settings, "use_white_balance", False):
        entries["white_balance"] = min(max(settings.white_balance_temperature, 1667.0), 25000.0)
    return entries


def _crop(render, width, height):
    """The render region in pixels, rows from the top; None without one."""
    if not render.use_border:
        return None
    # Blender multiplies in single precision.
    edge = lambda part, size: int(np.float32(part) * np.float32(size))
    left, right = (edge(part, width) for part in (render.border_min_x, render.border_max_x))
    bottom, top = (edge(part, height) for part in (render.border_min_y, render.border_max_y))
    # Regions have at least one pixel.
    return [left, height - max(top, bottom + 1), max(right, left + 1), height - bottom]


def _switched_on(layer, passes):
    return [PASS_NAMES.get(name, name) for name in passes if getattr(layer, f"use_pass_{name}", False)]


def _passes(layer, report):
    """The passes of a view layer."""
    passes = _switched_on(layer, (*PASSES, *CRYPTOMATTES))
    if layer.cycles.pass_debug_sample_count:
        passes.append("samples")
    lost = [UNSUPPORTED_PASSES[name] for name in _switched_on(layer, UNSUPPORTED_PASSES)]
    lost += [f"shader AOV '{aov.name}'" for aov in layer.aovs]
    if lost:
        report.warn("", f"passes are not supported: {', '.join(lost)}")
    return passes


def _addon_settings(scene):
    """The settings of the add-on's panels."""
    stored = _addon_properties(scene)
    entries = {name: stored[name] for name in ("samples", "depth", "seed") if name in stored}
    if stored.get("noise", 0) > 0:
        entries["noise"] = max(stored["noise"], 0.001)
    if stored.get("denoise"):
        entries["denoise"] = True
    return entries


def _addon_passes(layer):
    """The passes of the add-on's panel, and Cryptomattes."""
    passes = [name.removeprefix("use_") for name, is_on in _addon_properties(layer).items() if name.startswith("use_") and is_on]
    return passes + _switched_on(layer, CRYPTOMATTES)


def _addon_properties(owner):
    """The add-on's properties of a scene or view layer as stored in the file, since the add-on is not installed: only changed ones."""
    has_getter = hasattr(owner, "bl_system_properties_get")  # since Blender 5.0
    stored = (owner.bl_system_properties_get() or {}) if has_getter else owner
    return dict(stored.get("oscura") or {})


def _cycles_settings(cycles, report):
    """Samples, noise threshold, denoising, seed and pixel filter."""
    entries = {"samples": cycles.samples}
    if cycles.use_adaptive_sampling:
        # Cycles' threshold is the error of a pixel relative to the square root of its brightness, which is near 1/4 for middle gray.
        threshold = cycles.adaptive_threshold or 0.01
        entries["noise"] = min(max(200 * threshold, 0.01), 1000.0)
        report.note("", f"Cycles' noise threshold {threshold:.3g} is taken as --noise {entries['noise']:.3g}; --spp chooses otherwise")
    if cycles.use_denoising:
        entries["denoise"] = True
    if cycles.seed:
        entries["seed"] = cycles.seed
    entries |= _pixel_filter(cycles)
    if cycles.use_fast_gi:
        report.warn("", "Cycles' Fast GI Approximation is not supported: paths have all their bounces")
    return entries


def _pixel_filter(cycles):
    """Only the width of a box is fixed in Cycles; a Gaussian's standard deviation is a quarter of the width."""
    if cycles.pixel_filter_type == "BOX":
        return {"filter": "box"}
    is_gaussian = cycles.pixel_filter_type == "GAUSSIAN"
    radius = cycles.filter_width * (0.75 if is_gaussian else 1)
    return {"filter": "gaussian" if is_gaussian else None, "filter_radius": radius if is_gaussian or abs(radius - 1.5) > 1e-6 else None}


def _limits(cycles, report):
    """Limits of bounces, clamping, and caustics. Cycles doesn't count the last bounce."""
    kinds = {kind: getattr(cycles, f"{kind}_bounces") for kind in ("diffuse", "glossy", "transmission", "volume")}
    bounces = {kind: limit + 1 for kind, limit in kinds.items() if limit < cycles.max_bounces}
    bounces["transparent"] = cycles.transparent_max_bounces + 1
    bounces["subsurface"] = SUBSURFACE_STEPS
    clamps = {"direct": cycles.sample_clamp_direct, "indirect": cycles.sample_clamp_indirect}
    clamp = {which: limit * cycles.film_exposure for which, limit in clamps.items() if limit > 0 and cycles.film_exposure > 0}
    skipped = {kind: True for kind in ("reflective", "refractive") if not getattr(cycles, f"caustics_{kind}")}
    report.note("", "bounces, clamping, Filter Glossy and caustics are limited as in Cycles; --unbiased lifts the limits")
    if "direct" in clamp:
        most = f"direct light is clamped to {cycles.sample_clamp_direct:g} a sample"
        report.note("", f"{most}: this takes more light in Cycles, whose samples vary more, so that pictures are brighter here")
    limits = {"depth": cycles.max_bounces + 1, "bounces": bounces, "clamp": clamp or None}
    return {**limits, "filter_glossy": cycles.blur_glossy or None, "skip_caustics": skipped or None}


def _warn_of_losses(scene, report):
    """Settings that the export can't have, and post-processing, which Blender runs itself for its render engines."""
    render = scene.render
    space = bpy.data.colorspace.working_space if hasattr(bpy.data, "colorspace") else REC709  # since Blender 5.0
    if space != REC709:
        report.warn("", f"the working space {space} is not supported: colors are taken as {REC709}")
    tell = report.note if render.engine == ENGINE else report.warn
    if render.use_compositing and _has_compositing(scene):
        tell("", "compositing nodes are not run")
    editor = scene.sequence_editor
    # `sequences` before Blender 5.0.
    strips = getattr(editor, "strips" if hasattr(editor, "strips") else "sequences", ())
    if render.use_sequencer and any(not strip.mute for strip in strips):
        tell("", "strips of the sequencer are not rendered: the picture is that of the scene")
    if getattr(render, "use_freestyle", False):  # not in all builds
        report.warn("", "Freestyle is not supported")
    if render.use_multiview:
        report.warn("", "stereoscopy is not supported: one picture is rendered")


def _has_compositing(scene):
    """Do compositing nodes change the picture?"""
    if hasattr(scene, "compositing_node_group"):  # since Blender 5.0
        tree = scene.compositing_node_group
    else:
        tree = scene.node_tree if scene.use_nodes else None
    nodes = [node for node in tree.nodes if node.type in ("COMPOSITE", "GROUP_OUTPUT") and node.inputs] if tree is not None else []
    end = next((node for node in nodes if getattr(node, "is_active_output", True)), None)
    output = follow(end.inputs[0]).output if end is not None else None
    return output is not None and (output.node.type, output.name) != ("R_LAYERS", "Image")
