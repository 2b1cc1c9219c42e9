"""Preferences: the paths of the program and of its cache."""

import os
import shutil

import bpy


class MissingProgram(Exception):
    """The program was not found."""


class Preferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    program: bpy.props.StringProperty(
        name="Program",
        description="Path of the program oscura; if empty, the environment variable OSCURA, and then the search path",
        subtype="FILE_PATH",
    )
    cache: bpy.props.StringProperty(
        name="Cache",
        description="Folder for baked images; if empty, the user's cache folder",
        subtype="DIR_PATH",
    )
    use_cache: bpy.props.BoolProperty(
        name="Cache Baked Images",
        description="Bake unchanged meshes and materials only once",
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
