"""What a file says about rendering with Oscura, by scene and by view layer. The program reads `samples`, `noise`,
`denoise`, `depth` and `seed` of the scene, and the passes of the view layer, from the file itself (`oscura_blender/settings.py`); their defaults are those of the program."""

import bpy

from . import passes


class SceneSettings(bpy.types.PropertyGroup):
    samples: bpy.props.IntProperty(
        name="Samples",
        description="Samples a pixel; with a noise that is promised, the most of them",
        default=128,
        min=1,
        soft_max=4096,
    )
    noise: bpy.props.FloatProperty(
        name="Noise",
        description="Stop when the picture's relative error is about so many percent; 0 takes all samples",
        default=0.0,
        min=0.0,
        max=1000.0,
        soft_max=20.0,
        subtype="PERCENTAGE",
    )
    denoise: bpy.props.BoolProperty(
        name="Denoise",
        description="Take the noise out of the finished picture and its light passes",
        default=False,
    )
    depth: bpy.props.IntProperty(
        name="Depth",
        description="Most scattering events of a path; 0 shows what shines and nothing else",
        default=100,
        min=0,
    )
    seed: bpy.props.IntProperty(name="Seed", description="Seed of all randomness", default=0, min=0)
    time_limit: bpy.props.FloatProperty(
        name="Time Limit",
        description="Most time to render a picture, seconds; 0 for no limit",
        default=0.0,
        min=0.0,
    )
    refresh: bpy.props.FloatProperty(
        name="Refresh",
        description="Time between two looks at the picture while it is rendered, seconds",
        default=2.0,
        min=0.1,
        soft_max=60.0,
    )


class LayerSettings(bpy.types.PropertyGroup):
    """One switch for each pass, named `use_` and the option of the program."""

    __annotations__ = {
        f"use_{entry.option}": bpy.props.BoolProperty(name=entry.title, description=entry.about)
        for entry in passes.TABLE
    }

    def chosen(self):
        """The passes that are switched on."""
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
