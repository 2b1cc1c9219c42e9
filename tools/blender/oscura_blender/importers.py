"""Files of other programs (USD, FBX, Alembic, Collada until Blender 4.5): Blender imports them to a .blend file, which is exported."""

import math
import os

import bpy
import mathutils

import addon_utils  # isort: skip (bpy puts it on the path)

from .report import Report, Stop

# Import operators by file name extension, in the order of preference.
IMPORTERS = {
    **dict.fromkeys(("usd", "usda", "usdc", "usdz"), ("wm.usd_import",)),
    "fbx": ("wm.fbx_import", "import_scene.fbx"),  # the former since Blender 4.5
    "abc": ("wm.alembic_import",),
    "dae": ("wm.collada_import",),
}

# Radius in metres up to which a light is a point light that needs no scale.
MIN_RADIUS = 1e-6

# Intensity of FBX lights in percent up to which it can't be watts.
MAX_PERCENT = 1000


def as_blend(arguments):
    """Imports the first argument of an export; returns the arguments with the .blend file instead. Messages go to imported.json beside the answer;
    an error ends the process."""
    file, _, name, answer = arguments[:4]
    folder, report, error = os.path.dirname(answer), Report(), None
    blend = os.path.join(folder, f"{name}.blend")
    try:
        _import(file, report)
        bpy.ops.wm.save_as_mainfile(filepath=blend, check_existing=False, compress=False)
    except Stop as stop:
        error = str(stop)
    except RuntimeError as problem:  # by operators
        error = str(problem).strip().removeprefix("Error: ")
    if error is not None:
        report.write(answer, error)
        os._exit(3)  # the module `bpy` may hang when the interpreter exits
    report.write(os.path.join(folder, "imported.json"))
    return [blend, *arguments[1:]]


def _import(file, report):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    extension = os.path.splitext(file)[1].lower().removeprefix(".")
    operator = next(filter(None, map(_operator, IMPORTERS.get(extension, ()))), None)
    if operator is None:
        raise Stop(f"Blender {bpy.app.version_string} has no importer for files of type '.{extension}'")
    operator(filepath=file, **({"as_background_job": False} if extension == "abc" else {}))
    scene = bpy.context.scene
    if addon_utils.enable("cycles") is not None:
        scene.render.engine = "CYCLES"
    if extension.startswith("usd"):
        _correct_usd_lights(scene, report)
        report.note("", "materials are those of UsdPreviewSurface; MaterialX and other render contexts are not imported")
    if extension == "fbx":
        _correct_fbx_lights(scene, report)
    if extension == "abc":
        report.note("", "Alembic files have no materials: everything is gray")
    _correct_materials(report)
    cameras = sorted((obj for obj in scene.objects if obj.type == "CAMERA"), key=lambda obj: obj.name)
    scene.camera = scene.camera or next(iter(cameras), None)
    _note_content(scene, report)


def _operator(path):
    """An operator by its name; None if it doesn't exist."""
    module, name = path.split(".")
    if path == "import_scene.fbx" and addon_utils.enable("io_scene_fbx") is None:
        return None
    # Any name is an attribute, but only operators have a type.
    operator = getattr(getattr(bpy.ops, module), name)
    try:
        operator.get_rna_type()
    except (AttributeError, KeyError):
        return None
    return operator


def _correct_usd_lights(scene, report):
    """Blender's importer scales objects by the file's metres per unit, but not the radii of lights, and takes the angle of distant lights for half of
    the sun's, while both are diameters (UsdLux, inputs:angle)."""
    done = set()
    for obj in scene.objects:
        light = obj.data
        if obj.type != "LIGHT" or light in done:
            continue
        done.add(light)
        if light.type == "SUN":
            light.angle /= 2
        if light.type in ("POINT", "SPOT"):
            scale = sum(obj.matrix_world.to_scale()) / 3
            if abs(scale - 1) > 1e-6 and light.shadow_soft_size > MIN_RADIUS:
                light.shadow_soft_size *= scale
                report.note(obj.name, f"its radius is {light.shadow_soft_size:.4g} m, scaled as the object")


def _correct_fbx_lights(scene, report):
    """FBX has intensities in percent without a unit, which Blender's importer takes for watts. A sun of 100 % has 1 W/m2; point and spot lights get
    the power that gives as much at the center of all meshes."""
    corners = [obj.matrix_world @ mathutils.Vector(corner) for obj in scene.objects if obj.type == "MESH" for corner in obj.bound_box]
    if not corners:
        return
    center = mathutils.Vector([(min(c[k] for c in corners) + max(c[k] for c in corners)) / 2 for k in range(3)])
    for obj in scene.objects:
        light = obj.data
        if obj.type != "LIGHT" or light.type not in ("POINT", "SPOT") or light.users > 1:
            continue
        area = 4 * math.pi * (obj.matrix_world.translation - center).length_squared
        if 0 < light.energy <= MAX_PERCENT / 100 < area:
            percent = 100 * light.energy
            light.energy *= area
            report.note(obj.name, f"its intensity of {percent:.4g} % is taken as {light.energy:.4g} W, since FBX has no unit for it")


def _correct_materials(report):
    """Importers leave image textures without an image where a file is missing, and materials without nodes where they can't read them
    (MaterialX): both would be black."""
    missing = empty = 0
    for material in bpy.data.materials:
        tree = material.node_tree
        if tree is None:
            continue
        for node in [node for node in tree.nodes if node.type == "TEX_IMAGE" and node.image is None]:
            for socket in [link.to_socket for output in node.outputs for link in output.links]:
                if socket.name.startswith("Emission") and socket.type == "RGBA":
                    socket.default_value = (0, 0, 0, 1)
            tree.nodes.remove(node)
            missing += 1
        outputs = (node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
        if not any(socket.is_linked for node in outputs for socket in node.inputs):
            tree.nodes.clear()
            surface, output = tree.nodes.new("ShaderNodeBsdfPrincipled"), tree.nodes.new("ShaderNodeOutputMaterial")
            surface.inputs["Base Color"].default_value = material.diffuse_color
            tree.links.new(surface.outputs["BSDF"], output.inputs["Surface"])
            empty += 1
    if missing:
        report.warn("", f"{missing} textures whose images are missing are left out: their materials have the other values")
    if empty:
        report.warn("", f"{empty} materials that Blender can't read have one color")


def _note_content(scene, report):
    """Notes what was imported; an error if nothing of it is visible."""
    types = [obj.type for obj in scene.objects]
    names = {"MESH": "meshes", "LIGHT": "lamps", "CAMERA": "cameras", "CURVES": "curves", "ARMATURE": "armatures", "VOLUME": "volumes"}
    found = ", ".join(f"{types.count(kind)} {word}" for kind, word in names.items() if kind in types) or "nothing visible"
    report.note("", f"imported by Blender {bpy.app.version_string}: {found}")
    if not any(kind in types for kind in ("MESH", "CURVES", "ARMATURE", "VOLUME")):
        raise Stop("Blender found nothing visible in it")
