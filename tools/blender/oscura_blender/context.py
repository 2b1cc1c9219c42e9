"""Which scene is open, and at which moment: operators look at it."""

from contextlib import contextmanager

import bpy


# The engine of the add-on (`engine/`), without which Blender forgets that a file is set up for it.
ENGINE = "OSCURA"

# What Blender does with a picture once it is rendered, or with several: nothing of it is asked for.
SWITCHES = ("use_border", "use_compositing", "use_sequencer", "use_multiview", "use_single_layer", "use_freestyle")

# Blender renders no scene without a camera: it gets one of this name for the time of a render.
NO_CAMERA = "oscura no camera"

# The frame of the moment that scenes are at, and its fraction.
_moment = (1, 0.0)
# The engine whose render is going on.
_rendering = None


def go(scene, frame):
    """Goes to a moment, in frames: within a render that of its own graph."""
    global _moment
    whole = int(frame // 1)
    _moment = (whole, frame - whole)
    if _rendering is not None:
        _rendering.frame_set(whole, frame - whole)
    else:
        scene.frame_set(whole, subframe=frame - whole)


class Engine(bpy.types.RenderEngine):
    """Gives a job the dependency graph of a final render."""

    bl_idname = ENGINE
    bl_label = "Oscura"
    job = None

    def render(self, graph):
        global _rendering
        _rendering = self
        try:
            Engine.job(graph)
        finally:
            _rendering = None


def in_final_render(scene, layer, job):
    """What a job gives that gets the dependency graph of a final render of a view layer: with modifiers, objects and instances as they are
    rendered."""
    render, outcome = scene.render, []
    # No picture is made: a small one takes no memory.
    kept = {"engine": ENGINE, "resolution_x": 32, "resolution_y": 32, "resolution_percentage": 100}
    kept |= {key: False for key in SWITCHES}
    before = {key: getattr(render, key) for key in kept}
    camera = None

    def run(graph):
        for key, value in before.items():
            # The job reads the scene's settings.
            if key != "engine":
                setattr(render, key, value)
        try:
            outcome.append((job(graph), None))
        except BaseException as error:
            outcome.append((None, error))

    for key, value in kept.items():
        setattr(render, key, value)
    # Blender 5 renders all view layers that are in use, whichever it is asked for.
    used = {other.name: other.use for other in scene.view_layers}
    for other in scene.view_layers:
        other.use = other == layer
    if scene.camera is None:
        camera = bpy.data.objects.new(NO_CAMERA, bpy.data.cameras.new(NO_CAMERA))
        scene.collection.objects.link(camera)
        scene.camera = camera
    Engine.job = staticmethod(run)
    try:
        bpy.ops.render.render(scene=scene.name, layer=layer.name)
    finally:
        for key, value in before.items():
            setattr(render, key, value)
        for other in scene.view_layers:
            other.use = used[other.name]
        if camera is not None:
            bpy.data.cameras.remove(camera.data)
    if not outcome:
        raise RuntimeError("Blender did not render the scene")
    found, error = outcome[0]
    if error is not None:
        raise error
    return found


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
