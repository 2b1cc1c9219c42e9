"""Properties of scenes and view layers. The exporter reads `samples`, `noise`, `denoise`, `depth` and `seed`, and the passes, from the saved copy
(`oscura_blender/settings.py`); defaults are those of the program, since files store only changed properties."""

import bpy

from . import passes


class SceneSettings(bpy.types.PropertyGroup):
    samples: bpy.props.IntProperty(
        name="Samples",
        description="Samples per pixel; with Noise the maximum",
        default=128,
        min=1,
        soft_max=4096,
    )
    noise: bpy.props.FloatProperty(
        name="Noise",
        description="Stop when the estimated relative error of the picture is below this; 0 to take all samples",
        default=0.0,
        min=0.0,
        max=1000.0,
        soft_max=20.0,
        subtype="PERCENTAGE",
    )
    denoise: bpy.props.BoolProperty(
        name="Denoise",
        description="Denoise the finished picture and its light passes",
        default=False,
    )
    depth: bpy.props.IntProperty(
        name="Depth",
        description="Maximum number of bounces; 0 for emission only",
        default=100,
        min=0,
    )
    seed: bpy.props.IntProperty(name="Seed", description="Seed of random numbers", default=0, min=0)
    time_limit: bpy.props.FloatProperty(
        name="Time Limit",
        description="Maximum time for a picture in seconds; 0 for no limit",
        default=0.0,
        min=0.0,
    )
    refresh: bpy.props.FloatProperty(
        name="Refresh",
        description="Seconds between updates of the picture while it is rendered",
        default=2.0,
        min=0.1,
        soft_max=60.0,
    )


class LayerSettings(bpy.types.PropertyGroup):
    """A switch for each pass, named after the program's option."""

    __annotations__ = {
        f"use_{entry.option}": bpy.props.BoolProperty(name=entry.title, description=entry.about)
        for entry in passes.TABLE
    }

    def chosen(self):
        """The passes that are on."""
        return [entry for entry in passes.TABLE if getattr(self, f"use_{entry.option}")]


def register():
    bpy.utils.register_class(SceneSettings)
    bpy.utils.register_class(LayerSettings)
    bpy.types.Scene.oscura = bpy.props.PointerProperty(type=SceneSettings)
    bpy.types.ViewLayer.oscura = bpy.props.PointerProperty(type=LayerSettings)


def unregister():
    del bpy.types.ViewLayer.oscura
    del bpy.types.Scene.oscura
    bpy.utils.unregister_class(LayerSettings)
    bpy.utils.unregister_class(SceneSettings)
