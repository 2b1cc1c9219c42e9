"""The way from a .blend file to the files of an export."""

import argparse
import os
import sys
import traceback

import bpy

import addon_utils  # isort: skip (bpy puts it on the path)

from . import adaptive, cache, camera, context, evaluated, geometry, glb, hair, image_files, lights, motion, settings, sidecar, volumes, world
from .report import Report, Stop, listed

OLDEST = (4, 2, 0)


def main(arguments):
    """Exports; what happened goes to the answer's file, and an error also to the exit code."""
    parser = argparse.ArgumentParser(prog="export.py")
    parser.add_argument("file")
    parser.add_argument("folder")
    parser.add_argument("name")
    parser.add_argument("answer")
    parser.add_argument("--frame", type=int)
    parser.add_argument("--time", type=float)
    parser.add_argument("--scene")
    parser.add_argument("--view-layer")
    parser.add_argument("--cache")
    parser.add_argument("--bake", type=int)
    parser.add_argument("--shutter", type=float)
    parser.add_argument("--shutter-position")
    parser.add_argument("--vectors")
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
        grids = volumes.Store(options.folder, options.name, glb.Y_UP)
        found, moves, boxes = _collected(scene, layer, grids, options, report)
        found.exposure, found.grids = settings.film_exposure(scene), grids
        images = image_files.Images(options.folder, options.name, options.links)
        tables, cameras, empties = _settings(scene, found, boxes, store, images, options, report)
    made = evaluated.take(found, moves, (found, store, options, report), images)
    world.settle(dict(tables)["[environment]"], found)
    comment = f"What glTF can't carry of {os.path.basename(options.file)}; 'oscura help sidecar' explains it."
    if moves is not None:
        motion.tell_of_volumes(found, moves, report)
        if moves.matrices or moves.shapes:
            report.tell(moment=moves.moment, fps=moves.fps)
            comment += f" What moves: --time {moves.moment!r} --fps {moves.fps:g}."
    glb.write(os.path.join(options.folder, f"{options.name}.glb"), found, cameras, empties, moves)
    found.links.settle({entry["name"] for entry in made.objects})
    store.trim()
    sidecar.write(os.path.join(options.folder, f"{options.name}.oscura.toml"), comment, tables + made.tables())


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


def _settings(scene, found, boxes, store, images, options, report):
    """The tables of the file of settings, and the nodes of cameras and lights."""
    tables = [("[render]", settings.read(scene, found, options.folder, options.name, report))]
    tables += world.tables(scene, found.questions.layer, options.folder, options.name, store, images, report)
    cameras, named = [], []
    opened = motion.shutter(scene, options, found.questions.layer)
    for obj in found.cameras:
        data = obj.data
        cameras.append((obj.name, obj.matrix_world.normalized(), camera.gltf(data, scene)))
        entries = camera.entries(obj, data, scene, boxes, report)
        if opened is not None and opened.frames > 0:
            entries.update({"shutter": opened.frames, "shutter_position": opened.position})
        named.append(("[[camera]]", entries))
    if scene.camera is None:
        report.warn("", "has no active camera")
    elif scene.camera not in found.cameras:
        report.warn(scene.camera.name, "is the active camera, but no camera: pictures are seen from the first camera")
    empties, shining = [], []
    for number, (obj, matrix) in enumerate(found.lights):
        name = f"light {number}: {obj.name}"
        window = lights.portal(obj, name, obj.data)
        if window is not None:
            empties.append((name, matrix))
            shining.append(("[[portals]]", window))
        exposure = settings.film_exposure(scene)
        entries = lights.entries(obj, (name, matrix), obj.data, exposure, found.links, boxes, options.folder, report)
        if entries:
            empties.append((name, lights.upright(matrix, obj.data, obj.name, report)))
            shining += [("[[lights]]", entry) for entry in entries]
    strands = hair.entries(found, glb.Y_UP, options.folder, options.name, report)
    return tables + named + shining + strands, cameras, empties
