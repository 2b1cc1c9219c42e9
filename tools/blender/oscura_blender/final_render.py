"""The dependency graph of a final render, and temporary scenes for operators."""

from contextlib import contextmanager

import bpy

# Identifier of the add-on's render engine (`engine/`). It must be registered, or Blender replaces it in scenes that use it.
ENGINE = "OSCURA"

# Steps after rendering, and renders of several pictures, which the export doesn't need.
POST_PROCESSING = ("use_border", "use_compositing", "use_sequencer", "use_multiview", "use_single_layer", "use_freestyle")

# Blender renders only scenes with a camera: scenes without one get one of this name during the render.
PLACEHOLDER_CAMERA = "oscura no camera"

# The current frame and subframe.
_time = (1, 0.0)
# The engine that is rendering.
_engine = None


def set_frame(scene, frame):
    """Changes the frame, also within a render."""
    global _time
    whole = int(frame // 1)
    _time = (whole, frame - whole)
    if _engine is not None:
        _engine.frame_set(whole, frame - whole)
    else:
        scene.frame_set(whole, subframe=frame - whole)


class Engine(bpy.types.RenderEngine):
    """A render engine that passes the dependency graph to a function."""

    bl_idname = ENGINE
    bl_label = "Oscura"
    job = None

    def render(self, depsgraph):
        global _engine
        _engine = self
        try:
            Engine.job(depsgraph)
        finally:
            _engine = None


@contextmanager
def overridden(owner, **values):
    """Sets attributes, and restores them at the end; yields the previous values."""
    before = {key: getattr(owner, key) for key in values}
    try:
        for key, value in values.items():
            setattr(owner, key, value)
        yield before
    finally:
        for key, value in before.items():
            setattr(owner, key, value)


def run(scene, layer, job):
    """Calls a function with the dependency graph of a final render of a view layer: modifiers, objects and instances as rendered, not as in
    the viewport. Returns its result."""
    results, errors = [], []
    used = {other.name: other.use for other in scene.view_layers}
    # A small picture, which needs little memory.
    render_settings = {"engine": ENGINE, "resolution_x": 32, "resolution_y": 32, "resolution_percentage": 100}
    with overridden(scene.render, **render_settings, **dict.fromkeys(POST_PROCESSING, False)) as before, _with_camera(scene):

        def call(depsgraph):
            # The job reads the scene's own settings.
            for key, value in before.items():
                if key != "engine":
                    setattr(scene.render, key, value)
            try:
                results.append(job(depsgraph))
            except BaseException as error:
                errors.append(error)

        Engine.job = staticmethod(call)
        try:
            # Blender 5 renders all view layers in use, whatever the operator's `layer`.
            for other in scene.view_layers:
                other.use = other == layer
            bpy.ops.render.render(scene=scene.name, layer=layer.name)
        finally:
            for other in scene.view_layers:
                other.use = used[other.name]
    if errors:
        raise errors[0]
    if not results:
        raise RuntimeError("Blender did not render the scene")
    return results[0]


@contextmanager
def _with_camera(scene):
    if scene.camera is not None:
        yield
        return
    camera = bpy.data.objects.new(PLACEHOLDER_CAMERA, bpy.data.cameras.new(PLACEHOLDER_CAMERA))
    scene.collection.objects.link(camera)
    scene.camera = camera
    try:
        yield
    finally:
        bpy.data.cameras.remove(camera.data)


def new_scene(name):
    """An empty scene at the same frame, so that animated node trees have the same values."""
    made = bpy.data.scenes.new(name)
    made.frame_set(_time[0], subframe=_time[1])
    return made


@contextmanager
def active_scene(scene):
    """Makes a scene the one that operators use."""
    window = bpy.context.window
    before = window.scene if window is not None else None
    if window is not None:
        window.scene = scene
    try:
        # The context may be overridden already, so the window alone isn't enough.
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            yield
    finally:
        if window is not None:
            window.scene = before
