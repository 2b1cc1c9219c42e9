"""What the scene says about rendering."""

import bpy
import numpy as np

from . import facets, node_graph, view_table
from .context import ENGINE

# The working space of oscura, and of Blender's scenes unless they say otherwise.
REC709 = "Linear Rec.709"

# The view that is the same here, by Blender's name, and the one whose steps no table can hold. The others become tables.
VIEWS = {"Standard": "srgb", "False Color": "false-color"}

# Scattering beneath a surface after which Cycles ends a path.
SUBSURFACE_STEPS = 256

# Passes of view layers, with the channels that they stand for here.
PASSES = {
    "use_pass_z": "depth",
    "use_pass_position": "position",
    "use_pass_normal": "normal",
    "use_pass_vector": "motion",
    "use_pass_uv": "uv",
    "use_pass_object_index": "object_id",
    "use_pass_material_index": "material_id",
    **{
        f"use_pass_{kind}_{part}": f"{kind}_{part}"
        for kind in ("diffuse", "glossy", "transmission")
        for part in ("direct", "indirect", "color")
    },
    "use_pass_emit": "emission",
    "use_pass_environment": "environment",
    "use_pass_shadow": "shadow",
    "use_pass_cryptomatte_object": "crypto_object",
    "use_pass_cryptomatte_material": "crypto_material",
    "use_pass_cryptomatte_asset": "crypto_asset",
}
LOST_PASSES = {"use_pass_mist": "Mist", "use_pass_ambient_occlusion": "Ambient Occlusion"}


def film_exposure(scene):
    """The factor that Cycles' film puts on all light."""
    return scene.cycles.film_exposure if scene.render.engine == "CYCLES" else 1.0


def resolution(scene):
    """Width and height of the picture."""
    render = scene.render
    share = render.resolution_percentage / 100
    return tuple(max(1, int(n * share)) for n in (render.resolution_x, render.resolution_y))


def read(scene, found, folder, name, report):
    """The entries of [render]; a view that is a table goes to the folder."""
    layer = found.questions.layer
    width, height = resolution(scene)
    entries = {"width": width, "height": height}
    cycles = getattr(scene, "cycles", None)
    if scene.render.engine == ENGINE:
        entries.update(_chosen_for_us(scene))
        entries["aovs"] = _passes_for_us(layer) or None
    else:
        if scene.render.engine == "CYCLES" and cycles:
            _read_cycles(cycles, entries, report)
            entries["aovs"] = _passes(layer, report) or None
        else:
            report.note("", f"is set up for {scene.render.engine}; the exporter reads it as Cycles would")
        if cycles:
            entries.update(_limits(cycles, report))
        if any("is_shadow_catcher" in extras for extras in found.extras.values()):
            entries["caught"] = "shadows"
        entries["terminator"] = _terminator(scene)
        entries["microfacet"] = facets.model([h for h in found.objects.values() if h is not None])
    entries.update(view(scene, folder, name, report))
    entries["crop"] = _crop(scene.render, width, height)
    _tell_of_the_rest(scene, report)
    return entries


def _terminator(scene):
    """Whether shadow rays start at the surface that triangles stand for: unless no object has an offset for it."""
    offsets = [getattr(getattr(obj, "cycles", None), "shadow_terminator_geometry_offset", 0.1) for obj in scene.objects if obj.type == "MESH"]
    return "lifted" if any(offset > 0 for offset in offsets) else "off"


def view(scene, folder, name, report):
    """How pictures to look at are encoded."""
    view = scene.view_settings
    found = {"view": VIEWS.get(view.view_transform)}
    look = "" if view.look in ("None", "") else view.look
    if found["view"] == "false-color":
        report.note("", "is viewed by False Color; its steps here are others than Blender's")
        return {**found, **_light_of(view)}
    # Curves come before exposure; tints are Blender's own.
    is_balanced = getattr(view, "use_white_balance", False)
    with_light = view.use_curve_mapping or (is_balanced and abs(view.white_balance_tint - 10.0) > 1e-3)
    if found["view"] is None or look or with_light or abs(view.gamma - 1) > 1e-6:
        found["view"] = view_table.write(scene, folder, name, with_light)
    return found if with_light else {**found, **_light_of(view)}


def _light_of(view):
    """Exposure and white balance."""
    found = {}
    if view.exposure:
        found["exposure"] = max(-100.0, min(100.0, view.exposure))
    if getattr(view, "use_white_balance", False):
        found["white_balance"] = min(max(view.white_balance_temperature, 1667.0), 25000.0)
    return found


def _crop(render, width, height):
    """The region to render in pixels, rows from the top; None for the whole picture."""
    if not render.use_border:
        return None
    # Blender multiplies in single precision.
    edge = lambda part, size: int(np.float32(part) * np.float32(size))
    left, right = (edge(part, width) for part in (render.border_min_x, render.border_max_x))
    bottom, top = (edge(part, height) for part in (render.border_min_y, render.border_max_y))
    # Blender's regions have a pixel at least.
    return [left, height - max(top, bottom + 1), max(right, left + 1), height - bottom]


def _passes(layer, report):
    """The channels that the passes of a view layer stand for."""
    found = [aov for switch, aov in PASSES.items() if getattr(layer, switch, False)]
    if getattr(layer.cycles, "pass_debug_sample_count", False):
        found.append("samples")
    lost = [name for switch, name in LOST_PASSES.items() if getattr(layer, switch, False)]
    lost += [f"'{aov.name}' of shaders" for aov in layer.aovs]
    if lost:
        report.warn("", f"passes that can't be rendered: {', '.join(lost)}")
    return found


def _chosen_for_us(scene):
    """What the add-on's panels say."""
    chosen = _stored(scene)
    found = {name: chosen[name] for name in ("samples", "depth", "seed") if name in chosen}
    if chosen.get("noise", 0) > 0:
        found["noise"] = max(chosen["noise"], 0.001)
    if chosen.get("denoise"):
        found["denoise"] = True
    return found


def _passes_for_us(layer):
    """The passes that the add-on's panel has, and Blender's own switches of Cryptomattes."""
    found = [name.removeprefix("use_") for name, is_on in _stored(layer).items() if name.startswith("use_") and is_on]
    mattes = (switch for switch in PASSES if switch.startswith("use_pass_cryptomatte_"))
    return found + [PASSES[switch] for switch in mattes if getattr(layer, switch)]


def _stored(owner):
    """What the add-on keeps with a scene or a view layer. Without the add-on Blender has it as it was stored: what was
    changed."""
    stored = (owner.bl_system_properties_get() or {}) if hasattr(owner, "bl_system_properties_get") else owner
    return dict(stored.get("oscura") or {})


def _read_cycles(cycles, entries, report):
    entries["samples"] = cycles.samples
    if cycles.use_adaptive_sampling:
        # Cycles stops a pixel at an error of the threshold times the root of its brightness; middle grey lies near a quarter.
        threshold = cycles.adaptive_threshold or 0.01
        entries["noise"] = min(max(200 * threshold, 0.01), 1000.0)
        report.note("", f"Cycles' noise threshold {threshold:.3g} is taken as --noise {entries['noise']:.3g}; --spp chooses otherwise")
    if cycles.use_denoising:
        entries["denoise"] = True
    if cycles.seed:
        entries["seed"] = cycles.seed
    if cycles.pixel_filter_type == "BOX":
        entries["filter"] = "box"
    _tell_of_light_left_out(cycles, report)


def _limits(cycles, report):
    """The limits of paths. Cycles doesn't count the last bounce."""
    kinds = {kind: getattr(cycles, f"{kind}_bounces") for kind in ("diffuse", "glossy", "transmission", "volume")}
    bounces = {kind: limit + 1 for kind, limit in kinds.items() if limit < cycles.max_bounces}
    bounces["transparent"] = cycles.transparent_max_bounces + 1
    bounces["subsurface"] = SUBSURFACE_STEPS
    clamps = {"direct": cycles.sample_clamp_direct, "indirect": cycles.sample_clamp_indirect}
    clamp = {which: limit * cycles.film_exposure for which, limit in clamps.items() if limit > 0 and cycles.film_exposure > 0}
    words = [f"{kind} {limit}" for kind, limit in kinds.items() if limit < cycles.max_bounces]
    words.append(f"{cycles.transparent_max_bounces} transparent surfaces")
    limited = ", ".join([f"{cycles.max_bounces} in all", *words])
    clamped = "".join(f", {which} light clamped at {clamps[which]:.4g}" for which in clamp)
    filtered = f", glossy filter {cycles.blur_glossy:.4g}" if cycles.blur_glossy > 0 else ""
    skipped = {kind: True for kind in ("reflective", "refractive") if not getattr(cycles, f"caustics_{kind}")}
    without = f", no {' and no '.join(skipped)} caustics" if skipped else ""
    report.note("", f"light ends where Cycles ends it (bounces: {limited}{clamped}{filtered}{without}); --unbiased lifts the limits")
    limits = {"depth": cycles.max_bounces + 1, "bounces": bounces, "clamp": clamp or None}
    return {**limits, "filter_glossy": cycles.blur_glossy or None, "skip_caustics": skipped or None}


def _tell_of_light_left_out(cycles, report):
    """Tells which light Cycles leaves out or estimates; here all is followed."""
    if cycles.use_fast_gi:
        report.warn("", "Cycles' fast approximation of global illumination is not supported: light is followed through all bounces")


def _tell_of_the_rest(scene, report):
    render = scene.render
    # Blender 5 and newer.
    space = getattr(getattr(bpy.data, "colorspace", None), "working_space", REC709)
    if space != REC709:
        report.warn("", f"colours are numbers in {space} and taken for {REC709}")
    _tell_of_what_follows(scene, report)
    if getattr(render, "use_freestyle", False):
        report.warn("", "Freestyle lines are not supported")
    if getattr(render, "use_multiview", False):
        report.warn("", "stereo is not supported: one picture is rendered")


def _tell_of_what_follows(scene, report):
    """Blender changes the picture by nodes and strips after it was rendered. Of its own engines only: what our engine renders
    goes through them there."""
    tell = report.note if scene.render.engine == ENGINE else report.warn
    if scene.render.use_compositing and _is_composed(scene):
        tell("", "the nodes of its compositor are not run: the picture is what they would be given")
    editor = scene.sequence_editor
    # Blender 5 and newer, or older ones.
    strips = getattr(editor, "strips" if hasattr(editor, "strips") else "sequences", ())
    if scene.render.use_sequencer and any(not strip.mute for strip in strips):
        tell("", "strips of its sequencer are not shown: the picture is that of the scene")


def _is_composed(scene):
    """Do the compositor's nodes change the picture?"""
    if hasattr(scene, "compositing_node_group"):
        tree = scene.compositing_node_group
    else:
        tree = scene.node_tree if scene.use_nodes else None
    if tree is None:
        return False
    ends = [node for node in tree.nodes if node.type in ("COMPOSITE", "GROUP_OUTPUT") and node.inputs]
    end = next((node for node in ends if getattr(node, "is_active_output", True)), None)
    origin = node_graph.feed(end.inputs[0]).output if end is not None else None
    return origin is not None and (origin.node.type, origin.name) != ("R_LAYERS", "Image")
