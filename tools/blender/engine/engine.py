"""The render engine. The program renders a copy of the scene, and its picture is read while it is written."""

import tempfile
from pathlib import Path

import bpy
import numpy as np

from . import exr, mattes, passes, preferences, program

# Seconds between checks of the process.
INTERVAL = 0.1


class Engine(bpy.types.RenderEngine):
    bl_idname = "OSCURA"
    bl_label = "Oscura"
    bl_use_preview = False
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False
    bl_use_postprocess = True

    def update_render_passes(self, scene=None, renderlayer=None):
        """Registers the passes of a view layer."""
        for entry in (passes.COMBINED, *passes.chosen(renderlayer)):
            self.register_pass(scene, renderlayer, entry.name, len(entry.letters), entry.letters, entry.kind)

    def render(self, depsgraph):
        """Renders a view layer."""
        try:
            with tempfile.TemporaryDirectory(prefix="oscura-") as folder:
                self._render(depsgraph, Path(folder))
        except (program.ProgramError, preferences.MissingProgram, exr.UnreadablePicture, OSError) as error:
            # The first shows the error in the image editor, the second lets the operator fail.
            self.error_set(str(error))
            self.report({"ERROR"}, str(error))

    def is_cancelled(self):
        """Did the user cancel the render?"""
        return self.test_break()

    def _render(self, depsgraph, folder):
        scene = depsgraph.scene.original
        # Messages begin with the name of the file.
        blend = folder / f"{Path(bpy.data.filepath).stem or 'untitled'}.blend"
        picture = folder / "picture.exr"
        self.update_stats("", "Saving the scene")
        program.write_copy(blend, scene)
        process = program.Process(_command(blend, picture, scene, depsgraph.view_layer))
        try:
            result = self._show_progress(process, picture, scene, depsgraph.view_layer)
            report = process.result()
        finally:
            process.stop()
        self._report(report, folder)
        if picture.exists():
            _fill(result, exr.read(picture))
            # Metadata is kept by the whole result, not by the region.
            mattes.add_metadata(self.get_result(), exr.header_strings(picture), depsgraph.view_layer)
        self.end_result(result)

    def _show_progress(self, process, picture, scene, layer):
        """Shows progress and pictures until the process ends; returns the render result."""
        (left, right), (bottom, top) = region(scene, self.resolution_x, self.resolution_y)
        result = self.begin_result(0, 0, right - left, top - bottom, layer=layer.name)
        shown = None
        while not process.wait(INTERVAL):
            if self.is_cancelled():
                process.stop()
                break
            self.update_progress(process.progress)
            self.update_stats("", process.status or "Exporting")
            changed = picture.stat().st_mtime_ns if picture.exists() else None
            if changed != shown:
                shown = changed
                _fill(result, exr.read(picture))
                self.update_result(result)
        return result

    def _report(self, report, folder):
        """Shows warnings and notes."""
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
    """The render region, or the whole picture, in pixels: first and last + 1 by axis, with the rounding of the exporter."""
    render = scene.render
    if not render.use_border:
        return (0, width), (0, height)
    sides = (render.border_min_x, render.border_max_x, width), (render.border_min_y, render.border_max_y, height)
    return tuple((int(low * size), max(int(high * size), int(low * size) + 1)) for low, high, size in sides)


def _fill(result, picture):
    """Copies the channels of a picture, which is that of the region, to the passes of a result."""
    for target in result.layers[0].passes:
        entry = passes.by_name(target.name)
        if entry is not None:
            values = entry.values(picture)
            target.rect.foreach_set(np.ascontiguousarray(values).ravel())


def register():
    bpy.utils.register_class(Engine)


def unregister():
    bpy.utils.unregister_class(Engine)
