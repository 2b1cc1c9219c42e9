"""Files of other programs that Blender imports: USD, FBX, Alembic and, in older versions, Collada. They become a .blend, which is exported
like any other."""

import math
import os

import bpy
import mathutils

import addon_utils  # isort: skip (bpy puts it on the path)

from .report import Report, Stop

# The importers of Blender by extension: operators in the order of preference (FBX has a newer one in C++), and their options.
IMPORTERS = {
    "usd": (("wm.usd_import", {}),),
    "usda": (("wm.usd_import", {}),),
    "usdc": (("wm.usd_import", {}),),
    "usdz": (("wm.usd_import", {}),),
    "fbx": (("wm.fbx_import", {}), ("import_scene.fbx", {})),
    "abc": (("wm.alembic_import", {"as_background_job": False}),),
    "dae": (("wm.collada_import", {}),),
}

# Radii below which a lamp is as good as a point, metres: scaling one further changes nothing.
SMALLEST = 1e-6

# Percent up to which the intensity of a lamp of FBX is no number of watts.
MOST_PERCENT = 1000


def as_blend(arguments):
    """Imports the file that the arguments of an export begin with; gives them with the .blend that it became. What is said about the import
    is beside that: the same as an answer. An error ends the process."""
    file, _, name, answer = arguments[:4]
    work, report, error = os.path.dirname(answer), Report(), None
    blend = os.path.join(work, f"{name}.blend")
    try:
        _import(file, report)
        bpy.ops.wm.save_as_mainfile(filepath=blend, check_existing=False, compress=False)
    except Stop as stop:
        error = str(stop)
    except RuntimeError as problem:  # what operators report
        error = str(problem).strip().removeprefix("Error: ")
    if error is not None:
        report.write(answer, error)
        os._exit(3)  # the module `bpy` may hang while it tidies up
    report.write(os.path.join(work, "imported.json"))
    return [blend, *arguments[1:]]


def _import(file, report):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    extension = os.path.splitext(file)[1].lower().removeprefix(".")
    known = ((_operator(path), options) for path, options in IMPORTERS.get(extension, ()))
    operator, options = next((found for found in known if found[0] is not None), (None, {}))
    if operator is None:
        raise Stop(f"Blender {bpy.app.version_string} has no importer for files of type '.{extension}'")
    operator(filepath=file, **options)
    scene = bpy.context.scene
    if addon_utils.enable("cycles") is not None:
        scene.render.engine = "CYCLES"
    if extension.startswith("usd"):
        _mend_sizes(scene, report)
    if extension == "fbx":
        _mend_lamps(scene, report)
    _mend_materials(report)
    _choose_camera(scene)
    _tell(scene, extension, report)


def _operator(path):
    """An operator by its module and name; None where there is none."""
    module, name = path.split(".")
    if path == "import_scene.fbx" and addon_utils.enable("io_scene_fbx") is None:
        return None
    # Every name is an attribute; only those of operators that exist have a type.
    operator = getattr(getattr(bpy.ops, module), name)
    try:
        operator.get_rna_type()
    except (AttributeError, KeyError):
        return None
    return operator


def _mend_sizes(scene, report):
    """Objects are scaled by the file's metres per unit, but the radii of points and spots are not: a bulb of 5 cm would be one of 5 m. The
    angle of USD's distant lights is their diameter (UsdLux, inputs:angle), which the importer takes for half of it."""
    done = set()
    for lamp in scene.objects:
        if lamp.type != "LIGHT" or lamp.data in done:
            continue
        done.add(lamp.data)
        if lamp.data.type == "SUN":
            lamp.data.angle /= 2
        if lamp.data.type not in ("POINT", "SPOT"):
            continue
        scale = sum(lamp.matrix_world.to_scale()) / 3
        if abs(scale - 1) > 1e-6 and lamp.data.shadow_soft_size > SMALLEST:
            lamp.data.shadow_soft_size *= scale
            report.note(lamp.name, f"its radius is {lamp.data.shadow_soft_size:.4g} m, scaled like the object")


def _mend_lamps(scene, report):
    """FBX gives the intensity of lamps in percent, of no unit and without a decay, which the importer takes for watts: nothing would be
    seen by 1 W. Suns of 100 % get 1 W/m2; a point or a spot that weak gets what gives as much in the middle of the meshes."""
    corners = [item.matrix_world @ mathutils.Vector(corner) for item in scene.objects if item.type == "MESH" for corner in item.bound_box]
    if not corners:
        return
    middle = mathutils.Vector([(min(c[k] for c in corners) + max(c[k] for c in corners)) / 2 for k in range(3)])
    for lamp in scene.objects:
        if lamp.type != "LIGHT" or lamp.data.type not in ("POINT", "SPOT") or lamp.data.users > 1:
            continue
        sphere = 4 * math.pi * (lamp.matrix_world.translation - middle).length_squared
        if 0 < lamp.data.energy <= MOST_PERCENT / 100 < sphere:
            percent = 100 * lamp.data.energy
            lamp.data.energy *= sphere
            report.note(lamp.name, f"its intensity of {percent:.4g} % is taken as {lamp.data.energy:.4g} W: FBX has no unit for it")


def _mend_materials(report):
    """Importers leave textures without an image where a file is missing, and materials without nodes where they know none of them (MaterialX):
    both would be black."""
    lost = empty = 0
    for material in bpy.data.materials:
        tree = material.node_tree
        if tree is None:
            continue
        for node in [node for node in tree.nodes if node.type == "TEX_IMAGE" and node.image is None]:
            _without(node)
            tree.nodes.remove(node)
            lost += 1
        if not any(node.type == "OUTPUT_MATERIAL" and any(socket.is_linked for socket in node.inputs) for node in tree.nodes):
            _diffuse(tree, material.diffuse_color)
            empty += 1
    if lost:
        report.warn("", f"{lost} textures whose images are missing are left out: the other values of their materials count")
    if empty:
        report.warn("", f"{empty} materials have nothing that Blender reads: they have one colour")


def _without(node):
    """What a lost texture was to make shine is dark."""
    for link in [link for output in node.outputs for link in output.links]:
        if link.to_socket.name.startswith("Emission") and link.to_socket.type == "RGBA":
            link.to_socket.default_value = (0, 0, 0, 1)


def _diffuse(tree, color):
    tree.nodes.clear()
    surface, output = tree.nodes.new("ShaderNodeBsdfPrincipled"), tree.nodes.new("ShaderNodeOutputMaterial")
    surface.inputs["Base Color"].default_value = color
    tree.links.new(surface.outputs["BSDF"], output.inputs["Surface"])


def _choose_camera(scene):
    """Files name no camera as the one of the picture: the first by its name is."""
    cameras = sorted((o for o in scene.objects if o.type == "CAMERA"), key=lambda o: o.name)
    if scene.camera is None and cameras:
        scene.camera = cameras[0]


def _tell(scene, extension, report):
    """Says what came along, and what such files hold that doesn't."""
    kinds = {}
    for item in scene.objects:
        kinds[item.type] = kinds.get(item.type, 0) + 1
    named = [("MESH", "meshes"), ("LIGHT", "lamps"), ("CAMERA", "cameras"), ("CURVES", "curves"), ("ARMATURE", "armatures"), ("VOLUME", "volumes")]
    found = ", ".join(f"{kinds[kind]} {word}" for kind, word in named if kind in kinds) or "nothing that is seen"
    report.note("", f"imported by Blender {bpy.app.version_string}: {found}")
    if not any(kind in kinds for kind, _ in named[:1] + named[3:]):
        raise Stop("Blender found nothing in it that could be seen")
    if extension.startswith("usd"):
        report.note("", "materials are those of UsdPreviewSurface; MaterialX and other render contexts are not imported")
    if extension == "abc":
        report.note("", "Alembic holds no materials: everything is grey")
