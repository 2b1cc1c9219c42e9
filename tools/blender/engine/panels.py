"""The add-on's panels, and those of Blender and of Cycles that the exporter reads."""

import bpy

from . import passes
from .engine import Engine

# Common panels of Blender whose settings are not read.
HIDDEN_PANELS = {"RENDER_PT_simplify", "RENDER_PT_freestyle", "VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes"}

# Panels of Cycles whose settings are read.
CYCLES_PANELS = (
    "CYCLES_CAMERA_PT_dof",
    "CYCLES_CAMERA_PT_dof_aperture",
    "CYCLES_LIGHT_PT_light",
    "CYCLES_LIGHT_PT_nodes",
    "CYCLES_LIGHT_PT_beam_shape",
    "CYCLES_MATERIAL_PT_surface",
    "CYCLES_OBJECT_PT_visibility",
    "CYCLES_OBJECT_PT_visibility_ray_visibility",
    "CYCLES_PT_context_material",
    "CYCLES_RENDER_PT_film_transparency",
    "CYCLES_WORLD_PT_ray_visibility",
    "CYCLES_WORLD_PT_surface",
)

_extended = []


class OscuraPanel:
    """A panel for this render engine only."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    COMPAT_ENGINES = {Engine.bl_idname}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def column(self):
        """A column of properties with labels on the left."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        return self.layout.column()


class SamplingPanel(OscuraPanel, bpy.types.Panel):
    bl_idname = "OSCURA_RENDER_PT_sampling"
    bl_label = "Sampling"
    bl_context = "render"

    def draw(self, context):
        column = self.column()
        for name in ("samples", "noise", "time_limit", "denoise", "depth", "seed", "refresh"):
            column.prop(context.scene.oscura, name)


class PassesPanel(OscuraPanel, bpy.types.Panel):
    bl_idname = "OSCURA_VIEWLAYER_PT_passes"
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        column = self.column()
        for entry in passes.TABLE:
            column.prop(context.view_layer.oscura, f"use_{entry.option}")
        for switch, _ in passes.MATTES.values():
            column.prop(context.view_layer, switch)
        column.prop(context.view_layer, "pass_cryptomatte_depth", text="Levels")


def _panels():
    """Panels of Blender and Cycles that are shown with this render engine."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", ())
        if "BLENDER_RENDER" in engines and panel.__name__ not in HIDDEN_PANELS or panel.__name__ in CYCLES_PANELS:
            yield panel


def register():
    bpy.utils.register_class(SamplingPanel)
    bpy.utils.register_class(PassesPanel)
    for panel in _panels():
        # The set is replaced, not changed: some panels share one.
        _extended.append((panel, panel.__dict__.get("COMPAT_ENGINES")))
        panel.COMPAT_ENGINES = {*panel.COMPAT_ENGINES, Engine.bl_idname}


def unregister():
    while _extended:
        panel, own = _extended.pop()
        if own is None:
            del panel.COMPAT_ENGINES
        else:
            panel.COMPAT_ENGINES = own
    bpy.utils.unregister_class(PassesPanel)
    bpy.utils.unregister_class(SamplingPanel)
