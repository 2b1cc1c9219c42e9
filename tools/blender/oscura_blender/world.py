"""The world: a constant, a picture, or a texture of its nodes; what oscura can't evaluate, Cycles renders to a picture."""

import math
import os
import shutil

import bpy
import numpy as np

from . import cache, fingerprint, geometry, media, scene_file, shaders, skies, stills, trees, world_graph
from .node_graph import Unsupported, feed
from .settings import film_exposure

# Colour spaces whose values are light as oscura has it.
LINEAR = ("Linear Rec.709", "Linear", "Linear BT.709", "Non-Color", "Raw", "Generic Data")

# Kinds of rays that a world may be hidden from besides those of the camera, and what Cycles calls them.
RAYS = {"diffuse": "diffuse", "glossy": "glossy", "transmission": "transmission", "volume": "scatter"}

# Outputs of coordinates that go by the camera of the scene.
OF_CAMERAS = ("Window", "Camera")

# Width of pictures made of node trees, and the width of the largest made of a picture.
WIDTH = 2048
WIDEST = 8192


# The name of its texture in the scene file.
TEXTURE = "world"


class _Target:
    """Where pictures go, and where those that take long are kept."""

    def __init__(self, folder, name, store, images):
        self.folder, self.name, self.store, self.images = folder, name, store, images
        self.textures, self.skies, self.pictures = [], 0, 0

    def texture(self, entries):
        """The name of a texture, which is a table of its own."""
        name = TEXTURE if not self.textures else f"{TEXTURE} {len(self.textures) + 1}"
        self.textures.append((f"[textures.{scene_file.value(name)}]", entries))
        return name

    def picture(self, ending):
        """The name of another picture: what the camera sees and what lights the scene may be two."""
        self.pictures += 1
        return f"{self.name}.world{self.pictures if self.pictures > 1 else ''}{ending}"

    def sky(self, node):
        self.skies += 1
        return skies.file(node, self, self.skies)


def tables(scene, layer, folder, name, store, images, report):
    """The table [environment], and those of its textures; pictures go to the folder."""
    target = _Target(folder, name, store, images)
    found = _entries(scene, layer, target, report)
    return [("[environment]", found), *target.textures]


def _entries(scene, layer, target, report):
    world = scene.world if layer.use_sky else None
    factor = film_exposure(scene)
    hidden = scene.render.film_transparent or (world is not None and not world.cycles_visibility.camera)
    seen, found = _parts(world, target, hidden, report)
    found = _exposed(found, factor)
    if seen is not None:
        found["seen"] = _exposed(seen, factor)
    found.update(_fog(world, factor, report))
    if world is not None:
        visible = world.cycles_visibility
        unseen = [kind for kind in RAYS if not getattr(visible, RAYS[kind], True)]
        if unseen:
            found["visible_to"] = [kind for kind in ("camera", *RAYS, "shadow") if kind not in unseen]
        if group := geometry.light_group(world):
            found["group"] = group
    if hidden:
        found["visible_to_camera"] = False
    return found


def _exposed(entries, factor):
    if factor == 1:
        return entries
    if "background" in entries:
        return {"background": [factor * c for c in entries["background"]]}
    exposed = {**entries, "strength": factor * entries.get("strength", 1.0)}
    if "sun" in entries:
        exposed["sun"] = {**entries["sun"], "irradiance": [factor * c for c in entries["sun"]["irradiance"]]}
    return exposed


def settle(entries, objects):
    """Cycles takes no light samples of an even world: what hides it is what scattered rays see. That is told where shadow rays see
    something else."""
    hidden = any(key in extras for extras in objects.extras.values() for key in geometry.VISIBILITY if key != "visible_camera")
    if "background" in entries and hidden:
        entries["sampled"] = False


def _fog(world, factor, report):
    """The volume of the world, which has no end, as in Cycles."""
    end = shaders.end(world.node_tree) if world is not None and world.use_nodes and world.node_tree else None
    if end is None or shaders.source(end.inputs["Volume"]) is None:
        return {}
    try:
        filling = media.read(end.inputs["Volume"], factor)
        if filling.is_varying():
            raise media.Varying("nodes")
    except media.Varying as varying:
        report.warn(world.name, f"the volume of the world differs from place to place ({varying}) and is left out")
        return {}
    return {} if filling.is_nothing() else {"fog": filling.entries()}


def _parts(world, target, is_hidden, report):
    """The entries of what cameras see, if that is something else and not hidden from them, and of what lights the scene."""
    tree = world.node_tree if world is not None and world.use_nodes else None
    asked = _light_path_outputs(tree) if tree else set()
    if tree and any(node.outputs[name].is_linked for _, node in trees.nodes_with_trees(tree, ("ShaderNodeTexCoord",)) for name in OF_CAMERAS):
        report.warn(world.name, "coordinates of the window or the camera are those of a panorama in the world")
    if not asked:
        return None, _light(world, target)
    if asked != {"Is Camera Ray"}:
        report.warn(world.name, "the world differs by the kind of ray: others than the camera's see what diffuse ones do")
    seen = None if is_hidden else _as_seen_by(world, _CAMERA, target)
    return seen, _as_seen_by(world, _DIFFUSE, target)


def _as_seen_by(world, rays, target):
    """The entries of a world as rays of a kind see it."""
    world = world.copy()
    try:
        _settle_light_paths(world.node_tree, rays)
        return _light(world, target)
    finally:
        bpy.data.worlds.remove(world)


def _light(world, target):
    if world is None:
        return {"background": [0, 0, 0]}
    if not world.use_nodes or world.node_tree is None:
        return {"background": list(world.color)}
    end = shaders.end(world.node_tree)
    shown = feed(end.inputs["Surface"]) if end is not None else None
    node = shown.node if shown is not None else None
    if node is not None and node.bl_idname == "ShaderNodeBackground":
        strength = shaders.constant(node.inputs["Strength"])
        picture = _picture(shaders.source(node.inputs["Color"]), target) if strength is not None else None
        if picture:
            return {**picture, "strength": max(strength, 0.0)}
    shown_skies = []

    def sky(node):
        shown_skies.append(node)
        return target.sky(node)

    try:
        radiance = world_graph.read(world, target.images, sky)
        sun = _sun(world, shown_skies, target)
    except Unsupported:
        return {"image": _rendered(world, target)}
    if isinstance(radiance, list):
        return {"background": radiance}
    return {"texture": target.texture(radiance), **sun}


def _sun(world, shown_skies, target):
    """The entry for the sun of the sky nodes of a world, none without one."""
    found = [sky for sky in shown_skies if skies.has_sun(sky)]
    if not found:
        return {}
    sun = skies.sun(world, found[0], target) if len(found) == 1 and not found[0].inputs[0].is_linked else None
    if sun is None:
        raise Unsupported("a sun that is no light")
    (x, y, z), angle, irradiance = sun
    return {"sun": {"direction": [-x, -z, y], "angle": math.degrees(angle), "irradiance": irradiance}}


def _picture(feeding, target):
    """The entries for a picture that the world shows as it is, but turned about the vertical; else None."""
    if feeding is None or feeding.node.bl_idname != "ShaderNodeTexEnvironment" or feeding.node.mute:
        return None
    node = feeding.node
    image = node.image
    is_plain = node.projection == "EQUIRECTANGULAR" and image is not None and image.source == "FILE"
    turn = _turn(node.inputs["Vector"]) if is_plain else None
    if turn is None or image.colorspace_settings.name not in LINEAR:
        return None
    ending = os.path.splitext(image.filepath_raw or image.name)[1].lower()
    if ending not in (".exr", ".hdr"):
        return None
    path = bpy.path.abspath(image.filepath_raw, library=image.library)
    if not image.packed_file and not os.path.isfile(path):
        return None
    file = target.picture(ending)
    destination = os.path.join(target.folder, file)
    if image.packed_file:
        with open(destination, "wb") as out:
            out.write(image.packed_file.data)
    else:
        shutil.copyfile(path, destination)
    return {"image": file, "rotation": math.degrees(turn)} if turn else {"image": file}


def _turn(vector):
    """How far a mapping turns a picture counter-clockwise seen from above, radians; None for any other mapping."""
    feeding = shaders.source(vector)
    if feeding is None:
        return None if vector.is_linked else 0.0
    if feeding.node.bl_idname == "ShaderNodeTexCoord":
        return 0.0 if feeding.name == "Generated" else None
    mapping = feeding.node
    if mapping.bl_idname != "ShaderNodeMapping" or mapping.mute:
        return None
    before = shaders.source(mapping.inputs["Vector"])
    if before is None or before.node.bl_idname != "ShaderNodeTexCoord" or before.name != "Generated":
        return None
    values = {i.name: shaders.constant(i) for i in mapping.inputs if i.name != "Vector" and i.enabled}
    if None in values.values():
        return None
    still = (0.0, 0.0, 0.0)
    rotation, scale = values.get("Rotation", still), values.get("Scale", (1.0, 1.0, 1.0))
    if values.get("Location", still) != still or scale != (1.0, 1.0, 1.0) or rotation[:2] != (0.0, 0.0):
        return None
    # A point is turned before it is looked up, so the picture turns the other way.
    return rotation[2] if mapping.vector_type == "TEXTURE" else -rotation[2]


def _rendered(world, target):
    """Renders what the world shows to a picture around the origin, unless it is kept; gives its name."""
    file = target.picture(".exr")
    path = os.path.join(target.folder, file)

    def make():
        own = world.copy()
        own.cycles_visibility.camera = True
        sizes = [node.image.size[0] for _, node in trees.nodes_with_trees(own.node_tree, ("ShaderNodeTexEnvironment",)) if node.image]
        width = min(max([WIDTH, *sizes]), WIDEST)
        has_sky = any(True for _ in trees.nodes_with_trees(own.node_tree, ("ShaderNodeTexSky",)))
        with stills.around(own) as scene:
            stills.look_around(scene)
            stills.prepare(scene, (width, width // 2), 16 if has_sky else 4)
            scene.render.filepath = path
            bpy.ops.render.render(write_still=True, scene=scene.name)
        return np.fromfile(path, np.uint8)

    digest = cache.digest()
    digest.update(b"world")
    fingerprint.add_tree(digest, world.node_tree)
    target.store.kept(digest, make).tofile(path)
    return file


LIGHT_PATH = "ShaderNodeLightPath"

# The outputs of Light Path nodes that are 1 for rays of a kind; all others are 0.
_CAMERA = {"Is Camera Ray"}
_DIFFUSE = {"Is Diffuse Ray", "Ray Depth"}


def _light_path_outputs(tree):
    """The names of the outputs of Light Path nodes that a tree uses."""
    return {out.name for _, node in trees.nodes_with_trees(tree, (LIGHT_PATH,)) for out in node.outputs if out.is_linked}


def _settle_light_paths(tree, rays):
    """Puts the answers of Light Path nodes for rays of a kind in their place."""
    trees.own_groups(tree)
    for inner, node in list(trees.nodes_with_trees(tree, (LIGHT_PATH,))):
        for out in node.outputs:
            trees.replace(inner, out, float(out.name in rays))
