"""The way from a .blend file to the files of an export."""

import argparse
import os
import sys
import traceback

import bpy
from mathutils import Matrix

import addon_utils  # isort: skip (bpy puts it on the path)

from . import adaptive, cache, camera, context, evaluated, geometry, hair, image_files, lights, motion, scene_file, settings, volumes, world
from .report import Report, Stop, listed

OLDEST = (4, 2, 0)

# What the program may say about an export, by type.
OPTIONS = {
    "frame": int, "time": float, "scene": str, "view-layer": str, "cache": str, "bake": int, "shutter": float, "shutter-position": str,
    "vectors": str,
}  # fmt: skip


def main(arguments):
    """Exports; what happened goes to the answer's file, and an error also to the exit code."""
    parser = argparse.ArgumentParser(prog="export.py")
    for name in ("file", "folder", "name", "answer"):
        parser.add_argument(name)
    for name, kind in OPTIONS.items():
        parser.add_argument(f"--{name}", type=kind)
    parser.add_argument("--links", action="store_true")
    options = parser.parse_args(arguments)
    report = Report()
    try:
        export(options, report)
    except Stop as stop:
        error = str(stop)
    except Exception as exception:  # said to the user in any case
        traceback.print_exc()
        place = traceback.extract_tb(exception.__traceback__)[-1]
        where = f"{os.path.basename(place.filename)}:{place.lineno}"
        error = f"{type(exception).__name__}: {str(exception).strip()} (in {where}, Blender {bpy.app.version_string})"
    else:
        error = None
    report.write(options.answer, error)
    sys.stdout.flush()
    sys.stderr.flush()
    # At once: all is written, and the module `bpy` may hang while it tidies up.
    os._exit(0 if error is None else 3)


def export(options, report):
    if bpy.app.version < OLDEST:
        raise Stop(f"Blender {bpy.app.version_string} is too old: 4.2 or newer is needed")
    scene, layer = _open(options, report)
    store = cache.Store(options.cache)
    with bpy.context.temp_override(scene=scene, view_layer=layer):
        volumes.unpack()
        _go_to_moment(scene, options)
        layer.update()
        grids = volumes.Store(options.folder, options.name)
        found, moves, boxes = _collected(scene, layer, grids, options, report)
        found.exposure = settings.film_exposure(scene)
        images = image_files.Images(options.folder, options.name, options.links)
        tables = _settings(scene, found, moves, boxes, store, images, options, report)
    made = evaluated.take(found, moves, (found, store, options, report), images)
    world.settle(dict(tables)["[environment]"], found)
    if moves is not None:
        motion.tell_of_volumes(found, moves, report)
    found.links.settle({entry["name"] for entry in made.objects})
    store.trim()
    comment = f"{os.path.basename(options.file)}; 'oscura help scene-file' explains each key."
    scene_file.write(os.path.join(options.folder, f"{options.name}.toml"), comment, tables + made.tables())


def _collected(scene, layer, grids, options, report):
    """What there is to render, how it moves, and the boxes around it."""

    def look(graph):
        found = geometry.collect(scene, layer, graph, grids, report)
        boxes = camera.boxes(graph)
        shutter = motion.shutter(scene, options, layer)
        return found, motion.record(scene, graph, found, shutter) if shutter is not None else None, boxes

    adaptive.settle(scene, report)
    return context.in_final_render(scene, layer, look)


def _open(options, report):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.utils.register_class(context.Engine)
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
            names = ", ".join(f"'{s.name}'" for s in bpy.data.scenes)
            raise Stop(f"there is no scene '{options.scene}', only {names}")
    for missing in _missing_libraries():
        report.warn("", f"the linked file {missing} is missing")
    missing = [image.name for image in bpy.data.images if image.users and image_files.is_missing(image)]
    if missing:
        report.warn("", f"images whose files are missing are magenta, as in Blender: {listed(missing)}")
    return scene, _layer(scene, options.view_layer, report)


def _layer(scene, name, report):
    """The view layer of a name, else the first that is rendered."""
    if name is not None:
        layer = scene.view_layers.get(name)
        if layer is None:
            names = ", ".join(f"'{layer.name}'" for layer in scene.view_layers)
            raise Stop(f"there is no view layer '{name}', only {names}")
        return layer
    used = [layer for layer in scene.view_layers if layer.use] or list(scene.view_layers)
    if len(used) > 1:
        report.note("", f"has {len(used)} view layers: '{used[0].name}' is rendered")
    return used[0]


def _missing_libraries():
    return [l.filepath for l in bpy.data.libraries if not os.path.isfile(bpy.path.abspath(l.filepath))]


def _go_to_moment(scene, options):
    frame = scene.frame_current_final
    if options.frame is not None:
        frame = options.frame
    elif options.time is not None:
        frame = options.time * scene.render.fps / scene.render.fps_base
    if any(volume.is_sequence for volume in bpy.data.volumes):
        # Blender 4.2 has looked for another file while it opened the scene, and takes it for missing until the frame changes.
        context.go(scene, frame + 1)
    context.go(scene, frame)


def _settings(scene, found, moves, boxes, store, images, options, report):
    """All tables but those of materials and objects."""
    tables = [("[render]", settings.read(scene, found, options.folder, options.name, report))]
    tables += world.tables(scene, found.questions.layer, options.folder, options.name, store, images, report)
    tables += [("[[camera]]", entries) for entries in _cameras(scene, found, moves, boxes, options, report)]
    tables += _lights(scene, found, moves, boxes, options, report)
    return tables + hair.entries(found, options.folder, options.name, report)


def _cameras(scene, found, moves, boxes, options, report):
    """The entries of all cameras, that of the picture first."""
    if scene.camera is None:
        report.warn("", "has no active camera")
    elif scene.camera not in found.cameras:
        report.warn(scene.camera.name, "is the active camera, but no camera: pictures are seen from the first camera")
    opened = motion.shutter(scene, options, found.questions.layer)
    for obj in found.cameras:
        matrix = obj.matrix_world.normalized()
        if scene_file.is_flat(matrix):
            if obj == scene.camera:
                raise Stop(f"the camera '{obj.name}' is scaled to nothing")
            report.warn(obj.name, "this camera is scaled to nothing: it is left out")
            continue
        matrices = moves.of(("camera", obj.name)) if moves is not None else None
        place = scene_file.placement(matrix, moves and moves.offsets, matrices)
        entries = {"name": obj.name, **place, **camera.entries(obj, obj.data, scene, boxes, report)}
        if opened is not None and opened.frames > 0:
            entries.update({"shutter": opened.frames, "shutter_position": opened.position})
        yield entries


def _lights(scene, found, moves, boxes, options, report):
    """The tables of lights and portals."""
    tables, exposure = [], settings.film_exposure(scene)
    for number, (obj, matrix, mark) in enumerate(found.lights):
        if scene_file.is_flat(matrix):
            if obj.data.type != "POINT":
                report.warn(obj.name, "its scale leaves it no extent: it is left out")
                continue
            matrix = Matrix.Translation(matrix.translation)
        window = lights.portal(obj, obj.data)
        if window is not None:
            tables.append(("[[portals]]", {**window, **scene_file.placement(matrix, None, None)}))
        placed = f"light {number}: {obj.name}", matrix
        made = lights.entries(obj, placed, obj.data, exposure, found.links, boxes, options.folder, report)
        if made:
            upright = lambda matrix: lights.upright(matrix, obj.data, obj.name, report)
            matrices = moves.of(mark) if moves is not None else None
            place = scene_file.placement(upright(matrix), moves and moves.offsets, matrices and [upright(then) for then in matrices])
            tables += [("[[lights]]", {**entry, **place}) for entry in made]
    return tables
