"""The render engine: it contains no renderer, everything is done by the program."""

import tempfile
from pathlib import Path

import bpy
import numpy as np

from . import exr, mattes, passes, preferences, program

# Time between two looks at the child, seconds.
PAUSE = 0.1


class Engine(bpy.types.RenderEngine):
    bl_idname = "OSCURA"
    bl_label = "Oscura"
    bl_use_preview = False
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False
    bl_use_postprocess = True

    def update_render_passes(self, scene=None, renderlayer=None):
        """Tells Blender which passes a view layer has."""
        for entry in (passes.COMBINED, *passes.chosen(renderlayer)):
            self.register_pass(scene, renderlayer, entry.name, len(entry.letters), entry.letters, entry.kind)

    def render(self, depsgraph):
        """Renders a view layer."""
        try:
            with tempfile.TemporaryDirectory(prefix="oscura-") as folder:
                self._render(depsgraph, Path(folder))
        except (program.ProgramError, preferences.MissingProgram, exr.UnreadablePicture, OSError) as error:
            # The first shows it in the picture's window, the second ends an operator with it.
            self.error_set(str(error))
            self.report({"ERROR"}, str(error))

    def is_cancelled(self):
        """Does the user want it to stop?"""
        return self.test_break()

    def _render(self, depsgraph, folder):
        scene = depsgraph.scene.original
        # Named as what the user knows: messages begin with it.
        blend = folder / f"{Path(bpy.data.filepath).stem or 'untitled'}.blend"
        picture = folder / "picture.exr"
        self.update_stats("", "Handing over the scene")
        program.write_copy(blend, scene)
        child = program.Child(_command(blend, picture, scene, depsgraph.view_layer))
        try:
            result = self._follow(child, picture, scene, depsgraph.view_layer)
            report = child.answer()
        finally:
            child.stop()
        self._tell(report, folder)
        if picture.exists():
            _fill(result, exr.read(picture))
            # The whole result, not the part that is being filled, keeps texts.
            mattes.tell(self.get_result(), exr.texts(picture), depsgraph.view_layer)
        self.end_result(result)

    def _follow(self, child, picture, scene, layer):
        """Shows what the child does until it ends; gives the result to fill."""
        (left, right), (bottom, top) = region(scene, self.resolution_x, self.resolution_y)
        result = self.begin_result(0, 0, right - left, top - bottom, layer=layer.name)
        shown = None
        while not child.wait(PAUSE):
            if self.is_cancelled():
                child.stop()
                break
            self.update_progress(child.progress)
            self.update_stats("", child.status or "Exporting")
            changed = picture.stat().st_mtime_ns if picture.exists() else None
            if changed != shown:
                shown = changed
                _fill(result, exr.read(picture))
                self.update_result(result)
        return result

    def _tell(self, report, folder):
        """Hands on what the program found."""
        for kind, messages in (("WARNING", report.get("warnings", [])), ("INFO", report.get("notes", []))):
            for message in messages:
                self.report({kind}, message.replace(f"{folder}/", "").replace(f"{folder}\\", ""))


def _command(blend, picture, scene, layer):
    command = program.arguments("render", blend, picture, scene)
    command += ["--view-layer", layer.name, "--float", "--json", "--save-every", f"{scene.oscura.refresh:.3f}"]
    command += passes.arguments(layer)
    if scene.oscura.time_limit > 0:
        command += ["--time-limit", f"{scene.oscura.time_limit:.6g}"]
    if scene.render.threads_mode == "FIXED":
        command += ["--threads", str(scene.render.threads)]
    return command


def region(scene, width, height):
    """First and last but one pixel by axis of the part of the picture that Blender wants, as the exporter has it."""
    render = scene.render
    if not render.use_border:
        return (0, width), (0, height)
    sides = (render.border_min_x, render.border_max_x, width), (render.border_min_y, render.border_max_y, height)
    return tuple((int(low * size), max(int(high * size), int(low * size) + 1)) for low, high, size in sides)


def _fill(result, picture):
    """Puts a picture's channels into the passes of a result."""
    # A region is all that the picture holds.
    for target in result.layers[0].passes:
        entry = passes.by_name(target.name)
        if entry is not None:
            values = entry.values(picture)
            target.rect.foreach_set(np.ascontiguousarray(values).ravel())


def register():
    bpy.utils.register_class(Engine)


def unregister():
    bpy.utils.unregister_class(Engine)
