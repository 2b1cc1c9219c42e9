"""File > Export > Oscura: writes a scene file with its meshes and images to a folder."""

import tempfile
from pathlib import Path

import bpy

from . import preferences, program


class ExportFolder(bpy.types.Operator):
    """Export the scene as a scene file with its meshes and images, for the path tracer oscura"""

    bl_idname = "export_scene.oscura"
    bl_label = "Export for Oscura"

    directory: bpy.props.StringProperty(subtype="DIR_PATH")
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})
    use_replace: bpy.props.BoolProperty(name="Replace Files", description="Replace files of the same names")

    def invoke(self, context, _event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        """Runs `oscura export`."""
        with tempfile.TemporaryDirectory(prefix="oscura-") as folder:
            blend = Path(folder) / f"{Path(bpy.data.filepath).stem or 'untitled'}.blend"
            program.write_copy(blend, context.scene)
            try:
                command = program.arguments("export", blend, bpy.path.abspath(self.directory), context.scene)
                process = program.Process(command + (["--force"] if self.use_replace else []))
                process.wait(None)
                process.result()
            except (program.ProgramError, preferences.MissingProgram) as error:
                self.report({"ERROR"}, str(error))
                return {"CANCELLED"}
        for line in process.lines:
            if line.startswith("warning: "):
                self.report({"WARNING"}, line.removeprefix("warning: ").replace(f"{folder}/", ""))
        return {"FINISHED"}


def _menu(self, _context):
    self.layout.operator(ExportFolder.bl_idname, text="Oscura (folder)")


def register():
    bpy.utils.register_class(ExportFolder)
    bpy.types.TOPBAR_MT_file_export.append(_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(_menu)
    bpy.utils.unregister_class(ExportFolder)
