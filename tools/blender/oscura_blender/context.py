"""Which scene is open, and at which moment: operators look at it."""

from contextlib import contextmanager

import bpy


# The frame of the moment that scenes are at, and its fraction.
_moment = (1, 0.0)


def go(scene, frame):
    """Goes to a moment, in frames."""
    global _moment
    whole = int(frame // 1)
    _moment = (whole, frame - whole)
    scene.frame_set(whole, subframe=frame - whole)


def new_scene(name):
    """An empty scene at the same moment: what is animated, node trees as well, has the values of the scene that is evaluated."""
    made = bpy.data.scenes.new(name)
    made.frame_set(_moment[0], subframe=_moment[1])
    return made


@contextmanager
def opened(scene):
    """Opens a scene, and again the one before."""
    window = bpy.context.window
    before = window.scene if window is not None else None
    if window is not None:
        window.scene = scene
    try:
        # What is opened around this may override the context, too.
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            yield
    finally:
        if window is not None:
            window.scene = before


def choose(obj, scene):
    """Makes an object of a scene the one that operators work on."""
    layer = scene.view_layers[0]
    layer.update()
    layer.objects.active = obj
    obj.select_set(True, view_layer=layer)
