"""What holds for all files: where the program is, and where it keeps what it made of scenes."""

import os
import shutil

import bpy


class MissingProgram(Exception):
    """The program was not found; the message says where to name it."""


class Preferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    program: bpy.props.StringProperty(
        name="Program",
        description="The program oscura; empty for the one that the environment variable OSCURA names, else that of the search path",
        subtype="FILE_PATH",
    )
    cache: bpy.props.StringProperty(
        name="Cache",
        description="Folder that keeps meshes and baked pictures for the next time; empty for the user's folder of caches",
        subtype="DIR_PATH",
    )
    use_cache: bpy.props.BoolProperty(
        name="Keep Meshes and Baked Pictures",
        description="Export and bake what did not change only once",
        default=True,
    )

    def draw(self, _context):
        column = self.layout.column()
        column.prop(self, "program")
        column.prop(self, "use_cache")
        row = column.row()
        row.active = self.use_cache
        row.prop(self, "cache")
        try:
            column.label(text=f"Found: {find_program()}", icon="CHECKMARK")
        except MissingProgram as missing:
            column.label(text=str(missing), icon="ERROR")


def current():
    """The user's preferences."""
    return bpy.context.preferences.addons[__package__].preferences


def find_program():
    """The path of the program."""
    named = bpy.path.abspath(current().program) or os.environ.get("OSCURA", "")
    found = shutil.which(named or "oscura")
    if found is None and named:
        raise MissingProgram(f"there is no program {named}: see the preferences of the add-on Oscura")
    if found is None:
        raise MissingProgram("the program oscura was not found: name it in the preferences of the add-on Oscura")
    return found


def register():
    bpy.utils.register_class(Preferences)


def unregister():
    bpy.utils.unregister_class(Preferences)
