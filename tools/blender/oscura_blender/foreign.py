"""Files of other programs that Blender imports: USD, FBX, Alembic and, in older versions, Collada. They become a .blend, which is exported
like any other."""

import os

import bpy

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
    for operator, options in IMPORTERS.get(extension, ()):
        if _is_there(operator):
            _call(operator, filepath=file, **options)
            break
    else:
        raise Stop(f"Blender {bpy.app.version_string} has no importer for files of type '.{extension}'")
    scene = bpy.context.scene
    if addon_utils.enable("cycles") is not None:
        scene.render.engine = "CYCLES"
    if extension.startswith("usd"):
        _mend_sizes(scene, report)
    _choose_camera(scene)
    _tell(scene, extension, report)


def _is_there(operator):
    module, name = operator.split(".")
    if operator == "import_scene.fbx" and addon_utils.enable("io_scene_fbx") is None:
        return False
    # Every name is an attribute; only those of operators that exist have a type.
    try:
        getattr(getattr(bpy.ops, module), name).get_rna_type()
    except (AttributeError, KeyError):
        return False
    return True


def _call(operator, **options):
    module, name = operator.split(".")
    getattr(getattr(bpy.ops, module), name)(**options)


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
