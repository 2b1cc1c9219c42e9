"""The world: a constant, an environment image, or a texture of nodes. Other worlds are rendered to an image by Cycles."""

import math
import os
import shutil

import bpy

from . import cache, cycles, fingerprint, media, node_trees, objects, scene_file, sky, world_nodes
from .image_files import path_of
from .node_links import constant, follow, linked, output_node
from .node_types import Unsupported

# Color spaces without a conversion to linear Rec. 709.
LINEAR = ("Linear Rec.709", "Linear", "Linear BT.709", "Non-Color", "Raw", "Generic Data")

# Rays besides those of the camera to which a world is visible, by their names in Cycles.
RAYS = {"diffuse": "diffuse", "glossy": "glossy", "transmission": "transmission", "scatter": "volume"}

# Width of rendered images: at least, and at most with image textures.
WIDTH, MAX_WIDTH = 2048, 8192

LIGHT_PATH = "ShaderNodeLightPath"

# Outputs of Light Path that are 1 for rays of a kind; all others are 0.
CAMERA_RAY = {"Is Camera Ray"}
DIFFUSE_RAY = {"Is Diffuse Ray", "Ray Depth"}


def tables(export):
    """The table [environment], and those of its textures."""
    writer = _Writer(export)
    return [("[environment]", writer.entries()), *writer.textures]


def disable_sampling(entries, export):
    """Cycles takes no light samples of a uniform world: whether objects hide it depends on scattered rays. It matters where shadow rays see
    other objects than those."""
    has_hidden = any(name in entry.traits for entry in export.mesh_entries() for name in objects.VISIBILITY if name != "visible_camera")
    if "background" in entries and has_hidden:
        entries["sampled"] = False


class _Writer:
    """Writes the world of a view layer, and its images."""

    def __init__(self, export):
        self.export, self.report = export, export.report
        self.world = export.scene.world if export.layer.use_sky else None
        self.tree = node_trees.tree_of(self.world) if self.world is not None else None
        self.textures = []  # tables
        self._images = self._skies = 0

    def entries(self):
        world, exposure = self.world, self.export.exposure
        is_hidden = self.export.scene.render.film_transparent or (world is not None and not world.cycles_visibility.camera)
        seen, lit = self._by_rays(is_hidden)
        entries = _exposed(lit, exposure)
        if seen is not None:
            entries["seen"] = _exposed(seen, exposure)
        entries.update(self._fog())
        if world is not None:
            hidden = [kind for name, kind in RAYS.items() if not getattr(world.cycles_visibility, name)]
            if hidden:
                entries["visible_to"] = [kind for kind in ("camera", *RAYS.values(), "shadow") if kind not in hidden]
            if group := objects.light_group(world):
                entries["group"] = group
        if is_hidden:
            entries["visible_to_camera"] = False
        return entries

    def _fog(self):
        """The volume of the world, which is infinite, as in Cycles."""
        end = output_node(self.tree)
        if end is None or linked(end.inputs["Volume"]) is None:
            return {}
        try:
            medium = media.read(end.inputs["Volume"], self.export)
            if medium.is_varying():
                raise Unsupported("nodes")
        except Unsupported as reason:
            self.report.warn(self.world.name, f"the volume of the world is left out, since it varies in space ({reason})")
            return {}
        return {} if medium.is_empty() else {"fog": medium.entries()}

    def _by_rays(self, is_hidden):
        """The entries for camera rays, None if they are the same or the world is hidden from cameras, and for all other rays."""
        if self.tree is None:
            return None, self._radiance(self.world)
        coordinates = (node for _, node in node_trees.find_nodes(self.tree, ("ShaderNodeTexCoord",)))
        if any(node.outputs[name].is_linked for node in coordinates for name in ("Window", "Camera")):
            self.report.warn(self.world.name, "Window and Camera coordinates of the world are those of a panorama")
        light_paths = node_trees.find_nodes(self.tree, (LIGHT_PATH,))
        used = {out.name for _, node in light_paths for out in node.outputs if out.is_linked}
        if not used:
            return None, self._radiance(self.world)
        if used != CAMERA_RAY:
            self.report.warn(self.world.name, "the world depends on the kind of ray: rays other than the camera's see what diffuse rays do")
        return None if is_hidden else self._seen_by(CAMERA_RAY), self._seen_by(DIFFUSE_RAY)

    def _seen_by(self, rays):
        """The entries of the world for a kind of rays, with constants instead of Light Path."""
        world = self.world.copy()
        try:
            node_trees.copy_groups(world.node_tree)
            for tree, node in list(node_trees.find_nodes(world.node_tree, (LIGHT_PATH,))):
                for output in node.outputs:
                    node_trees.replace_output(tree, output, float(output.name in rays))
            return self._radiance(world)
        finally:
            bpy.data.worlds.remove(world)

    def _radiance(self, world):
        if world is None:
            return {"background": [0, 0, 0]}
        if self.tree is None:
            return {"background": list(world.color)}
        image = self._environment_image(world.node_tree)
        if image is not None:
            return image
        sky_nodes = []

        def sky_file(node):
            sky_nodes.append(node)
            self._skies += 1
            file = f"{self.export.name}.sky{self._skies}.exr"
            sky.render(node, self.export, os.path.join(self.export.folder, file))
            return file

        try:
            radiance = world_nodes.read(world, self.export.images, sky_file)
            sun = self._sun(world, [node for node in sky_nodes if sky.has_sun(node)])
        except Unsupported:
            return {"image": self._rendered(world)}
        return {"background": radiance} if isinstance(radiance, list) else {"texture": self._texture(radiance), **sun}

    def _sun(self, world, sky_nodes):
        """The entry of the sun of sky textures."""
        if not sky_nodes:
            return {}
        sun = sky.sun(world, sky_nodes[0], self.export) if len(sky_nodes) == 1 and not sky_nodes[0].inputs[0].is_linked else None
        if sun is None:
            raise Unsupported("a sun that is no light")
        (x, y, z), angle, irradiance = sun
        return {"sun": {"direction": [-x, -z, y], "angle": math.degrees(angle), "irradiance": irradiance}}

    def _environment_image(self, tree):
        """The entries of a Background by an environment texture alone, rotated about the vertical or not; None for others."""
        end = output_node(tree)
        node = follow(end.inputs["Surface"]).node if end is not None else None
        if node is None or node.bl_idname != "ShaderNodeBackground":
            return None
        strength, source = constant(node.inputs["Strength"]), linked(node.inputs["Color"])
        node = source.node if source is not None else None
        if strength is None or node is None or node.bl_idname != "ShaderNodeTexEnvironment" or node.mute:
            return None
        image = node.image
        is_plain = node.projection == "EQUIRECTANGULAR" and image is not None and image.source == "FILE"
        rotation = _rotation(node.inputs["Vector"]) if is_plain else None
        if rotation is None or image.colorspace_settings.name not in LINEAR:
            return None
        extension = os.path.splitext(image.filepath_raw or image.name)[1].lower()
        if extension not in (".exr", ".hdr") or not (image.packed_file or os.path.isfile(path_of(image))):
            return None
        file = self._new_image(extension)
        path = os.path.join(self.export.folder, file)
        if image.packed_file:
            with open(path, "wb") as out:
                out.write(image.packed_file.data)
        else:
            shutil.copyfile(path_of(image), path)
        return {"image": file, **({"rotation": math.degrees(rotation)} if rotation else {}), "strength": max(strength, 0.0)}

    def _texture(self, entries):
        """Adds a texture; returns its name."""
        name = f"world {len(self.textures) + 1}" if self.textures else "world"
        self.textures.append((f"[textures.{scene_file.value(name)}]", entries))
        return name

    def _new_image(self, extension):
        self._images += 1
        return f"{self.export.name}.world{self._images if self._images > 1 else ''}{extension}"

    def _rendered(self, world):
        """Renders the world to an image; returns its file."""
        file = self._new_image(".exr")
        path = os.path.join(self.export.folder, file)

        def make():
            copy = world.copy()
            copy.cycles_visibility.camera = True
            images = (node.image for _, node in node_trees.find_nodes(copy.node_tree, ("ShaderNodeTexEnvironment",)))
            width = min(max([WIDTH, *(image.size[0] for image in images if image)]), MAX_WIDTH)
            has_sky = any(True for _ in node_trees.find_nodes(copy.node_tree, ("ShaderNodeTexSky",)))
            with cycles.world_scene(copy) as scene:
                cycles.add_panoramic_camera(scene)
                cycles.set_up(scene, (width, width // 2), 16 if has_sky else 4)
                return cycles.render_to(scene, path)

        digest = cache.new_digest("world")
        fingerprint.add_tree(digest, world.node_tree)
        self.export.cache.get(digest, make).tofile(path)
        return file


def _exposed(entries, factor):
    """Entries times the film's exposure."""
    if factor == 1:
        return entries
    if "background" in entries:
        return {"background": [factor * c for c in entries["background"]]}
    exposed = {**entries, "strength": factor * entries.get("strength", 1.0)}
    if "sun" in entries:
        exposed["sun"] = {**entries["sun"], "irradiance": [factor * c for c in entries["sun"]["irradiance"]]}
    return exposed


def _rotation(vector):
    """The rotation of an environment image by a Mapping node, counter-clockwise seen from above, in radians; None for any other mapping."""
    source = linked(vector)
    if source is None:
        return None if vector.is_linked else 0.0
    if source.node.bl_idname == "ShaderNodeTexCoord":
        return 0.0 if source.name == "Generated" else None
    mapping = source.node
    if mapping.bl_idname != "ShaderNodeMapping" or mapping.mute:
        return None
    before = linked(mapping.inputs["Vector"])
    if before is None or before.node.bl_idname != "ShaderNodeTexCoord" or before.name != "Generated":
        return None
    zero, one = [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]
    values = {"Location": zero, "Rotation": zero, "Scale": one}
    values.update({socket.name: constant(socket) for socket in mapping.inputs if socket.name != "Vector" and socket.enabled})
    if None in values.values():
        return None
    rotation = values["Rotation"]
    if values["Location"] != zero or values["Scale"] != one or rotation[:2] != zero[:2]:
        return None
    # Mapping rotates the direction that is looked up, so that the image rotates the other way.
    return rotation[2] if mapping.vector_type == "TEXTURE" else -rotation[2]
