"""What the scene says about rendering."""

import bpy

# The working space of oscura, and of Blender's scenes unless they say otherwise.
REC709 = "Linear Rec.709"

# The engine of the add-on (`engine/`).
ENGINE = "OSCURA"


def resolution(scene):
    """Width and height of the picture."""
    render = scene.render
    share = render.resolution_percentage / 100
    return tuple(max(1, int(n * share)) for n in (render.resolution_x, render.resolution_y))


def read(scene, report):
    """The entries of [render]."""
    width, height = resolution(scene)
    entries = {"width": width, "height": height}
    cycles = getattr(scene, "cycles", None)
    if scene.render.engine == "CYCLES" and cycles:
        _read_cycles(cycles, entries, report)
    elif scene.render.engine == ENGINE:
        entries.update(_chosen_for_us(scene))
    else:
        report.note("", f"is set up for {scene.render.engine}; the exporter reads it as Cycles would")
    exposure = scene.view_settings.exposure
    if exposure:
        entries["exposure"] = max(-100.0, min(100.0, exposure))
    view = scene.view_settings
    if view.view_transform not in ("Standard", "Raw") or view.look not in ("None", ""):
        look = "" if view.look in ("None", "") else f" with the look {view.look}"
        report.note("", f"is viewed by {view.view_transform}{look} in Blender; PNGs are plain sRGB unless --view is given")
    _tell_of_the_rest(scene, report)
    return entries


def _chosen_for_us(scene):
    """What the add-on's panels say. Without the add-on Blender keeps it as it was stored: what was changed."""
    if hasattr(scene, "bl_system_properties_get"):
        stored = scene.bl_system_properties_get() or {}
    else:
        stored = scene
    chosen = stored.get("oscura") or {}
    return {name: chosen[name] for name in ("samples", "depth", "seed") if name in chosen}


def _read_cycles(cycles, entries, report):
    if cycles.use_adaptive_sampling:
        report.note(
            "",
            f"its {cycles.samples} samples are the most of adaptive sampling and not carried over: --spp chooses",
        )
    else:
        entries["samples"] = cycles.samples
    if cycles.pixel_filter_type == "BOX":
        entries["filter"] = "box"
    exposure = cycles.film_exposure
    if exposure != 1:
        report.warn("", f"the film's exposure of {exposure:.4g} is not carried over")
    bounces = min(cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces)
    clamps = [c for c in (cycles.sample_clamp_direct, cycles.sample_clamp_indirect) if c > 0]
    clamped = f", and clamps light at {min(clamps):.4g}" if clamps else ""
    report.note("", f"Cycles ends paths after {bounces} bounces{clamped}; neither is carried over (--depth)")


def _tell_of_the_rest(scene, report):
    render = scene.render
    # Blender 5 and newer.
    space = getattr(getattr(bpy.data, "colorspace", None), "working_space", REC709)
    if space != REC709:
        report.warn("", f"colours are numbers in {space} and taken for {REC709}")
    if render.pixel_aspect_x != render.pixel_aspect_y:
        report.warn("", "pixels that are not square are rendered as squares")
    if render.use_border:
        report.warn("", "the region to render is not carried over: the whole picture is rendered")
    if render.use_motion_blur:
        report.warn("", "motion blur is not supported: the picture shows one moment")
    if getattr(render, "use_freestyle", False):
        report.warn("", "Freestyle lines are not supported")
    if getattr(render, "use_multiview", False):
        report.warn("", "stereo is not supported: one picture is rendered")
