"""Exports a .blend file: reads the command line, opens the scene, and writes the scene file."""

import argparse
import os
import sys
import traceback

import bpy

import addon_utils  # isort: skip (bpy puts it on the path)

from . import (
    camera, final_render, hair, image_files, lights, mesh_objects, motion, objects, scene_file, settings, state, subdivision, volumes, world,
)  # fmt: skip
from .report import Report, Stop, listed

MIN_VERSION = (4, 2, 0)

# Options, by type.
OPTIONS = {
    "frame": int, "time": float, "scene": str, "view-layer": str, "cache": str, "bake": int, "shutter": float, "shutter-position": str,
    "vectors": str,
}  # fmt: skip


def main(arguments):
    """Exports. Messages go to the answer's file; the exit code is 3 with an error."""
    parser = argparse.ArgumentParser(prog="export.py")
    for name in ("file", "folder", "name", "answer"):
        parser.add_argument(name)
    for name, kind in OPTIONS.items():
        parser.add_argument(f"--{name}", type=kind)
    parser.add_argument("--links", action="store_true")
    options, report, error = parser.parse_args(arguments), Report(), None
    try:
        _export(options, report)
    except Stop as stop:
        error = str(stop)
    except Exception as exception:
        traceback.print_exc()
        place = traceback.extract_tb(exception.__traceback__)[-1]
        where = f"{os.path.basename(place.filename)}:{place.lineno}"
        error = f"{type(exception).__name__}: {str(exception).strip()} (in {where}, Blender {bpy.app.version_string})"
    report.write(options.answer, error)
    sys.stdout.flush()
    sys.stderr.flush()
    # The module `bpy` may hang when the interpreter exits.
    os._exit(0 if error is None else 3)


def _export(options, report):
    if bpy.app.version < MIN_VERSION:
        raise Stop(f"Blender {bpy.app.version_string} is too old: 4.2 or newer is needed")
    scene, layer = _open(options, report)
    with bpy.context.temp_override(scene=scene, view_layer=layer):
        volumes.unpack()
        _set_frame(scene, options)
        layer.update()
        export = state.Export(options, scene, layer, report)
        subdivision.set_levels(scene, report)
        final_render.run(scene, layer, lambda depsgraph: _evaluate(export, depsgraph))
        render = [("[render]", settings.read(export))]
        tables = [*render, *world.tables(export), *camera.tables(export), *lights.tables(export), *hair.tables(export)]
    writer = mesh_objects.Writer(export)
    writer.write_all()
    world.disable_sampling(dict(tables)["[environment]"], export)
    motion.warn_of_volumes(export)
    export.links.fill({entry["name"] for entry in writer.objects})
    export.cache.trim()
    comment = f"{os.path.basename(options.file)}; 'oscura help scene-file' explains each key."
    scene_file.write(os.path.join(options.folder, f"{options.name}.toml"), comment, tables + writer.tables())


def _evaluate(export, depsgraph):
    objects.collect(export, depsgraph)
    export.boxes = camera.bounding_boxes(depsgraph)
    export.moves = motion.record(export)


def _open(options, report):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.utils.register_class(final_render.Engine)
    if addon_utils.enable("cycles") is None:
        raise Stop("this Blender comes without its add-on cycles")
    try:
        bpy.ops.wm.open_mainfile(filepath=options.file, load_ui=False, use_scripts=False)
    except RuntimeError as error:
        raise Stop(str(error).strip().removeprefix("Error: ")) from error
    if bpy.app.autoexec_fail:
        report.warn("", "scripts and drivers with scripts in the file were not run, for safety")
    scene = bpy.context.scene
    if options.scene is not None:
        scene = bpy.data.scenes.get(options.scene)
        if scene is None:
            raise Stop(f"there is no scene '{options.scene}', only {_names(bpy.data.scenes)}")
    for library in bpy.data.libraries:
        if not os.path.isfile(bpy.path.abspath(library.filepath)):
            report.warn("", f"the linked file {library.filepath} is missing")
    missing = [image.name for image in bpy.data.images if image.users and image_files.is_missing(image)]
    if missing:
        report.warn("", f"images whose files are missing are magenta, as in Blender: {listed(missing)}")
    return scene, _view_layer(scene, options.view_layer, report)


def _view_layer(scene, name, report):
    """The view layer of a name, else the first that is rendered."""
    if name is not None:
        layer = scene.view_layers.get(name)
        if layer is None:
            raise Stop(f"there is no view layer '{name}', only {_names(scene.view_layers)}")
        return layer
    used = [layer for layer in scene.view_layers if layer.use] or list(scene.view_layers)
    if len(used) > 1:
        report.note("", f"has {len(used)} view layers: '{used[0].name}' is rendered")
    return used[0]


def _names(items):
    return ", ".join(f"'{item.name}'" for item in items)


def _set_frame(scene, options):
    frame = scene.frame_current_final
    if options.frame is not None:
        frame = options.frame
    elif options.time is not None:
        frame = options.time * scene.render.fps / scene.render.fps_base
    if any(volume.is_sequence for volume in bpy.data.volumes):
        # Blender 4.2 looks for the file of another frame when it opens the scene, until the frame changes.
        final_render.set_frame(scene, frame + 1)
    final_render.set_frame(scene, frame)
