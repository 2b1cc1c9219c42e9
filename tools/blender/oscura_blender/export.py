"""The way from a .blend file to the files of an export."""

import argparse
import os
import sys
import traceback

import bpy

import addon_utils  # isort: skip (bpy puts it on the path)

from . import cache, camera, context, evaluated, geometry, glb, hair, kept_meshes, lights, materials, mixes, motion, node_graph, originals, settings, sidecar, sizes, trees, volumes, world
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
        images = node_graph.Images(options.folder, options.name, options.links)
        known = evaluated.Materials(images, settings.film_exposure(scene))
        found, moves, boxes = _collected(scene, layer, grids, known, options, report)
        found.exposure, found.grids = settings.film_exposure(scene), grids
        found.sight = sizes.Sight(scene.camera, scene, options.bake)
        found.window = camera.window(found.cameras[0].data, scene) if found.cameras else None
        tables, cameras, empties = _settings(scene, found, boxes, store, options, report)
    direct = evaluated.take(found, known, moves, options, report)
    patches = materials.prepare(found, store, report)
    world.settle(dict(tables)["[environment]"], found)
    if moves is not None:
        motion.tell_of_volumes(found, moves, report)
        moves.tell_of_baked(found, report)
        if moves.matrices or moves.shapes:
            report.tell(moment=moves.moment, fps=moves.fps)
    model = os.path.join(options.folder, f"{options.name}.glb")
    holders = [holder for holder in found.objects.values() if holder is not None]
    kept, images = kept_meshes.KeptMeshes(store), originals.Originals()
    kept.replace(holders)
    images.replace(material for holder in holders for material in holder.data.materials)
    _open_alone(holders)
    _write_model(model)
    written = glb.Glb(model)
    if not images.exchange(written, options.folder if options.links else None):
        images.restore()
        _write_model(model)
        written = glb.Glb(model)
    glb.compose(written, found, (cameras, empties), patches, kept, moves)
    written.write(model)
    names = {node["name"] for node in written.json.get("nodes", []) if "mesh" in node}
    shining = found.links.settle(names, {entry["name"] for entry in direct.objects})
    store.trim()
    comment = f"What glTF can't carry of {os.path.basename(options.file)}; 'oscura help sidecar' explains it."
    if moves is not None and (moves.matrices or moves.shapes):
        comment += f" What moves: --time {moves.moment!r} --fps {moves.fps:g}."
    names = {material["name"] for material in written.json.get("materials", [])}
    known = sorted((name, entries) for name, entries in trees.SETTINGS.items() if name in names and entries)
    tables += [(f"[materials.{sidecar.value(name)}]", entries) for name, entries in known]
    tables += [("[[objects]]", {"node": name, **entries}) for name, entries in shining]
    tables += direct.tables()
    tables += _textures(known, options)
    sidecar.write(os.path.join(options.folder, f"{options.name}.oscura.toml"), comment, tables)


def _collected(scene, layer, grids, known, options, report):
    """What there is to render, how it moves, and the boxes around it."""

    def look(graph):
        found = geometry.collect(scene, layer, graph, grids, known, report)
        boxes = camera.boxes(graph)
        shutter = motion.shutter(scene, options, layer)
        return found, motion.record(scene, graph, found, shutter) if shutter is not None else None, boxes

    return context.in_final_render(scene, layer, look)


def _textures(materials, options):
    """The tables of the textures that materials ask for; those that are files are written."""
    names = lambda entries: {entry for entry in entries.values() if isinstance(entry, str) and entry in trees.TEXTURES}
    pending, used = set().union(*(names(entries) for _, entries in materials)), set()
    while pending:
        used |= pending
        pending = set().union(*(names(trees.TEXTURES[name]) for name in pending)) - used
    tables, number = [], 0
    for name, entries in trees.TEXTURES.items():
        if name in used and name in mixes.PICTURES:
            number += 1
            entries["file"] = f"{options.name}.mixed.{number}.png"
            with open(os.path.join(options.folder, entries["file"]), "wb") as file:
                file.write(mixes.PICTURES[name])
        if name in used:
            tables.append((f"[textures.{sidecar.value(name)}]", entries))
    return tables


def _open(options, report):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.utils.register_class(context.Engine)
    for addon in ("io_scene_gltf2", "cycles"):
        if addon_utils.enable(addon) is None:
            raise Stop(f"this Blender comes without its add-on {addon}")
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
    missing = [image.name for image in bpy.data.images if image.users and node_graph.is_missing(image)]
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


def _settings(scene, found, boxes, store, options, report):
    """The tables of the file of settings, and the nodes of cameras and lights."""
    tables = [("[render]", settings.read(scene, found, options.folder, options.name, report))]
    tables.append(("[environment]", world.entries(scene, options.folder, options.name, store, report)))
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


def _open_alone(holders):
    """Opens a scene of these objects: Blender's exporter looks at what is open."""
    model = context.new_scene("oscura")
    for holder in holders:
        model.collection.objects.link(holder)
    for other in list(bpy.data.scenes):
        if other != model:
            bpy.data.scenes.remove(other)


def _write_model(path):
    """Lets Blender's exporter write the meshes with their materials."""
    bpy.ops.export_scene.gltf(
        filepath=path,
        check_existing=False,
        export_format="GLB",
        export_yup=True,
        export_apply=False,
        export_texcoords=True,
        export_normals=True,
        export_tangents=False,
        export_materials="EXPORT",
        export_image_format="AUTO",
        export_vertex_color="MATERIAL",
        export_all_vertex_colors=False,
        export_attributes=False,
        export_cameras=False,
        export_lights=False,
        export_extras=True,
        export_animations=False,
        export_current_frame=True,
        export_skins=False,
        export_morph=False,
        export_gpu_instances=False,
        export_gn_mesh=False,
        use_selection=False,
        use_visible=False,
        use_renderable=False,
    )
