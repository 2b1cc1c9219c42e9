"""Which scene is open: operators look at it."""

from contextlib import contextmanager

import bpy


@contextmanager
def opened(scene):
    """Opens a scene, and again the one before."""
    window = bpy.context.window
    if window is None:
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            yield
        return
    before = window.scene
    window.scene = scene
    try:
        yield
    finally:
        window.scene = before
