"""Which scene is open: operators look at it."""

from contextlib import contextmanager

import bpy


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
