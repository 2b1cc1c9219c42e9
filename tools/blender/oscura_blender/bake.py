"""Inputs of shaders that no picture holds are made pictures by Cycles' baking, on texture coordinates made for it."""

import bpy
import numpy as np

from . import cache, fingerprint, flat, glow, mixes, pictures, shaders, skins, trees
from .context import choose, opened
from .report import listed
from .sizes import MOST_FACES

UV = "oscura bake"

# A factor that changes nothing.
HARDLY = 1e-30

AMBIENT = "ShaderNodeAmbientOcclusion"


def bake_all(holders, found, store, report):
    """Bakes what needs it of all meshes and is not in the store."""
    wanted = [(holder, needs) for holder in holders if (needs := _needs(holder))]
    if not wanted:
        return
    names = sorted({m.name for _, needs in wanted for m, inputs in needs.items() if inputs})
    report.note("", f"node trees were baked to pictures: of {listed(names)}")
    for material in dict.fromkeys(material for _, needs in wanted for material in needs):
        _straighten(material)
    kitchen = glow.new_scene()
    try:
        with opened(kitchen):
            _bake_flat([m for _, needs in wanted for m in needs], kitchen, found.sight.most, store)
            for holder, _ in wanted:
                _bake_mesh(holder, found, kitchen, store, report)
    finally:
        bpy.data.scenes.remove(kitchen)


def _bake_mesh(holder, found, kitchen, store, report):
    if not _needs(holder):
        return
    if len(holder.data.polygons) > MOST_FACES:
        report.warn(holder.data.name, "has too many faces to bake its node trees, which are left out")
        return
    _own_materials(holder)
    # Where the object stands: trees may ask for it.
    holder.matrix_world = found.placements[holder.name][0][1]
    places = [matrix for _, matrix in found.placements[holder.name]]
    around = _surroundings(holder, found, kitchen) if _sees_others(holder) else []
    try:
        size = found.sight.edge(holder.data, places)
        Baking(holder, kitchen, UV, size, store, around).run(_needs(holder), lays_out=True)
    finally:
        for obj in around:
            bpy.data.objects.remove(obj)
    holder.matrix_world.identity()


def _sees_others(holder):
    """Do trees ask how much of what is around them other objects hide?"""
    nodes = (node for m in holder.data.materials for _, node in trees.nodes_with_trees(m.node_tree, (AMBIENT,)))
    return any(not node.only_local and any(out.is_linked for out in node.outputs) for node in nodes)


def _surroundings(holder, found, kitchen):
    """Everything else at its places."""
    made = []
    for other in found.objects.values():
        for k, (_, matrix) in enumerate(found.placements[other.name] if other is not None else []):
            if other == holder and k == 0:
                continue
            obj = bpy.data.objects.new("oscura neighbour", other.data)
            obj.matrix_world = matrix
            kitchen.collection.objects.link(obj)
            made.append(obj)
    return made


def _bake_flat(materials, kitchen, most, store):
    """Bakes what repeats."""
    for material in dict.fromkeys(materials):
        node = shaders.principled(material)
        names = [name for name in pictures.INPUTS if _is_needed(node, name) or skins.is_wanted(material, name)]
        found = flat.tiles(node, names) if names else None
        if found is not None:
            square = flat.square(material, found.uv)
            Baking(square, kitchen, found.uv, min(found.size, most), store).run({material: names}, lays_out=False)
            bpy.data.meshes.remove(square.data)


def _needs(holder):
    """By material, the inputs that have to be baked; empty if none has any."""
    needs = {}
    for material in holder.data.materials:
        node = shaders.principled(material)
        if node is not None:
            needs[material] = [n for n in pictures.INPUTS if _is_needed(node, n) or skins.is_wanted(material, n)]
    return needs if any(needs.values()) else {}


def _is_needed(node, name):
    if name == "Emission Color":
        strength = shaders.constant(node.inputs["Emission Strength"])
        if strength is None or strength == 0:
            return strength is None
    if name not in node.inputs or not node.inputs[name].is_linked:
        return False
    return not pictures.is_carried(name, node.inputs[name])


def _straighten(material):
    """Colours of pictures whose alpha is used are not multiplied by it. Cycles does so where only their colour is looked up, which is what
    baking does: their alpha has to count a little."""
    node = shaders.principled(material)
    for tree, image in list(trees.nodes_with_trees(material.node_tree, ("ShaderNodeTexImage",))):
        color, alpha = image.outputs["Color"], image.outputs["Alpha"]
        is_left = lambda link: link.to_node == node and pictures.is_carried(link.to_socket.name, link.to_socket)
        targets = [link.to_socket for link in color.links if not is_left(link)] if alpha.is_linked else []
        if not targets:
            continue
        straight = tree.nodes.new("ShaderNodeVectorMath")
        straight.operation, straight.inputs[1].default_value = "MULTIPLY_ADD", (HARDLY,) * 3
        tree.links.new(alpha, straight.inputs[0])
        tree.links.new(color, straight.inputs[2])
        for target in targets:
            tree.links.new(straight.outputs[0], target)


def _own_materials(holder):
    """Baked pictures belong to one mesh."""
    for material in dict.fromkeys(holder.data.materials):
        trees.own(holder, material)


class Baking:
    """The baking of one mesh to pictures of an edge, by texture coordinates of a name (empty: the active ones)."""

    def __init__(self, holder, kitchen, uv, size, store, around=()):
        self.holder, self.kitchen, self.uv, self.size, self.store = holder, kitchen, uv, size, store
        self.around = around  # what else the trees see
        self.peak = 1.0  # what white means in the picture of the emission
        self.seconds = {}  # the pictures that the angle of view mixes in
        self.materials = [m for m in dict.fromkeys(holder.data.materials) if shaders.principled(m) is not None]

    def run(self, needs, lays_out):
        inputs = [name for name in pictures.INPUTS if any(name in n for n in needs.values())]
        key = self._key(inputs)
        kept = self.store.get(key)
        baked = self._from(kept, inputs) if kept else self._bake_all(inputs, lays_out, key)
        for material, names in needs.items():
            self._use(material, {name: baked[name] for name in names})

    def _key(self, inputs):
        """The hash of all that the results depend on."""
        digest = cache.digest()
        digest.update(repr((inputs, self.uv, self.size, [tuple(row) for row in self.holder.matrix_world])).encode())
        digest.update(repr([[(name, of["rows"]) for name, of in mixes.wanted(m).items()] for m in self.materials]).encode())
        fingerprint.add_mesh(digest, self.holder.data)
        for obj in self.around:
            digest.update(repr([tuple(row) for row in obj.matrix_world]).encode())
            fingerprint.add_mesh(digest, obj.data)
        for material in self.holder.data.materials:
            fingerprint.add_tree(digest, material.node_tree)
            digest.update(b"|")
        return digest.hexdigest()

    def _from(self, kept, inputs):
        """The results that were kept."""
        if "uv" in kept:
            self._add_layer().uv.foreach_set("vector", kept["uv"])
        baked = {}
        self.peak = float(kept["peak"])
        for name in inputs:
            baked[name] = self._packed(name, kept[name])
            if f"{name} second" in kept:
                self.seconds[name] = self._packed(name, kept[f"{name} second"])
        return baked

    def _packed(self, name, kept):
        image, data = self._new(name), kept.tobytes()
        image.pack(data=data, data_len=len(data))
        image.source = "FILE"
        return image

    def _bake_all(self, inputs, lays_out, key):
        self.kitchen.collection.objects.link(self.holder)
        self.kitchen.cycles.samples = 32 if _sees_nooks(self.materials) else 1
        try:
            self.select()
            if lays_out:
                self.lay_out()
            baked = {name: self._bake(name) for name in inputs}
        finally:
            self.kitchen.collection.objects.unlink(self.holder)
        kept = {"peak": np.array(self.peak)}
        if lays_out:
            kept["uv"] = np.empty(2 * len(self.holder.data.loops), np.float32)
            self.holder.data.uv_layers[self.uv].uv.foreach_get("vector", kept["uv"])
        for name, image in [*baked.items(), *((f"{name} second", image) for name, image in self.seconds.items())]:
            image.pack()
            kept[name] = np.frombuffer(image.packed_file.data, np.uint8)
        self.store.put(key, kept)
        return baked

    def select(self):
        choose(self.holder, self.kitchen)

    def _add_layer(self):
        """A layer of texture coordinates. What is there goes on looking up its own."""
        layers = self.holder.data.uv_layers
        rendered = next((layer.name for layer in layers if layer.active_render), None)
        layers.new(name=self.uv)
        layers.active = layers[self.uv]
        if rendered is not None:
            layers[rendered].active_render = True
        return layers[self.uv]

    def lay_out(self):
        """Texture coordinates that use no point of the picture twice."""
        self._add_layer()
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.reveal()
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.uv.smart_project(angle_limit=1.15, island_margin=0.004)
        bpy.ops.object.mode_set(mode="OBJECT")

    def _new(self, name, is_light=False):
        """The picture of an input; of light without a bound."""
        image = bpy.data.images.new(f"{self.holder.data.name} {name}", self.size, self.size, float_buffer=is_light)
        if is_light:
            image.colorspace_settings.name = "Non-Color"
            return image
        image.colorspace_settings.name = "sRGB" if pictures.INPUTS[name] == pictures.COLOR else "Non-Color"
        return image

    def _bake(self, name):
        """Bakes an input of all materials to one picture, and to a second one where the angle of view mixes two."""
        is_mixed = any(name in mixes.wanted(material) for material in self.materials)
        images = self._bake_mixed(name) if is_mixed else [self._bake_seen(name)]
        if name == "Emission Color":
            images = self._coded(images)
        if is_mixed:
            self.seconds[name] = images[1]
        return images[0]

    def _bake_mixed(self, name):
        """The two pictures, each channel as it is seen at its angle."""
        seen, images = {}, []
        for which in (0, 1):
            channels = [mixes.rows_of(self.materials, name, which, channel) for channel in range(3)]
            for rows in channels:
                if rows not in seen:
                    mixes.see(self.materials, rows)
                    seen[rows] = self._pixels(self._bake_seen(name))
            pixels = seen[channels[0]].copy()
            for channel in (1, 2):
                pixels[:, channel] = seen[channels[channel]][:, channel]
            images.append(self._new(name, is_light=name == "Emission Color"))
            images[-1].pixels.foreach_set(pixels.ravel())
            images[-1].update()
        mixes.see(self.materials, [mixes.MEAN] * len(self.materials))
        return images

    @staticmethod
    def _pixels(image):
        """The pixels of a picture, which is not needed any more."""
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
        return pixels.reshape(-1, 4)

    def _bake_seen(self, name):
        kind, image = pictures.INPUTS[name], self._new(name, is_light=name == "Emission Color")
        undo = [self._aim(material, name, kind, image) for material in self.materials]
        is_normal = kind == pictures.NORMAL
        bpy.ops.object.bake(
            type="NORMAL" if is_normal else "EMIT",
            normal_space="TANGENT",
            target="IMAGE_TEXTURES",
            uv_layer=self.uv or self.holder.data.uv_layers[0].name,
            margin=8,
            use_clear=True,
        )
        for restore in undo:
            restore()
        return image

    def _coded(self, lights):
        """Pictures of light as ones of eight bits, in which white means the peak of all."""
        linear = []
        for light in lights:
            pixels = self._pixels(light)
            pixels[:, :3] = np.nan_to_num(np.maximum(pixels[:, :3], 0), posinf=0)
            linear.append(pixels)
        self.peak = max(*(float(pixels[:, :3].max()) for pixels in linear), 1.0)
        return [self._coded_by_peak(pixels) for pixels in linear]

    def _coded_by_peak(self, pixels):
        linear = pixels[:, :3] / self.peak
        pixels[:, :3] = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        image = self._new("Emission Color")
        image.pixels.foreach_set(pixels.ravel())
        image.update()
        return image

    @staticmethod
    def _aim(material, name, kind, image):
        """Makes a material's picture the target of baking and lets it shine with the input; gives what undoes it."""
        tree = material.node_tree
        if kind == pictures.NORMAL:
            target = glow.aim(tree, image)
            return lambda: tree.nodes.remove(target)
        node = shaders.principled(material)

        def feed(inputs):
            shaders.feed(tree, node.inputs[name], inputs["Color"])
            if name == "Emission Color" and shaders.constant(node.inputs["Emission Strength"]) is None:
                shaders.feed(tree, node.inputs["Emission Strength"], inputs["Strength"])

        return glow.shine(tree, tree.get_output_node("CYCLES"), node, image, feed)

    def _use(self, material, baked):
        """Feeds the inputs from the pictures."""
        tree, node = material.node_tree, shaders.principled(material)
        for name in baked.keys() & mixes.wanted(material).keys():
            mixes.settle(material, name, self.seconds[name])
        if skins.is_wanted(material, "Base Color"):
            baked = {**baked, "Base Color": skins.paint(material, baked["Base Color"])}
        for name in ("Base Color", "Alpha"):
            # glTF has both in one picture.
            if "Alpha" in baked and name not in baked and node.inputs[name].is_linked is False:
                baked = {name: self._even(node.inputs[name].default_value), **baked}
        if "Alpha" in baked:
            baked["Base Color"] = _with_alpha(baked["Base Color"], baked.pop("Alpha"))
            texture = self._texture(tree, baked.pop("Base Color"))
            tree.links.new(texture.outputs["Color"], node.inputs["Base Color"])
            tree.links.new(texture.outputs["Alpha"], node.inputs["Alpha"])
        if "Emission Color" in baked:
            strength = node.inputs["Emission Strength"]
            known = shaders.constant(strength)
            for link in list(strength.links):
                tree.links.remove(link)
            # What was not the same everywhere is in the picture.
            strength.default_value = self.peak * (1.0 if known is None else known)
        for name, image in baked.items():
            texture = self._texture(tree, image)
            output = texture.outputs["Color"]
            if pictures.INPUTS[name] == pictures.NORMAL:
                bump = tree.nodes.new("ShaderNodeNormalMap")
                bump.uv_map = self.uv
                tree.links.new(output, bump.inputs["Color"])
                output = bump.outputs[0]
            tree.links.new(output, node.inputs[name])
        for image in baked.values():
            if not image.packed_file:
                image.pack()

    def _texture(self, tree, image):
        texture = tree.nodes.new("ShaderNodeTexImage")
        texture.image = image
        if self.uv:
            coordinates = tree.nodes.new("ShaderNodeUVMap")
            coordinates.uv_map = self.uv
            tree.links.new(coordinates.outputs[0], texture.inputs["Vector"])
        return texture

    def _even(self, color):
        image = bpy.data.images.new(f"{self.holder.data.name} Base Color", self.size, self.size)
        code = lambda c: 12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055
        image.generated_color = (*(code(min(max(c, 0.0), 1.0)) for c in tuple(color)[:3]), 1.0)
        return image


def _sees_nooks(materials):
    return any(trees.has(material.node_tree, (AMBIENT,)) for material in materials)


def _with_alpha(image, alpha):
    """A picture like another with a grey one as its alpha: one that was made without alpha loses it when it is packed."""
    made = bpy.data.images.new(f"{image.name} with alpha", *image.size, alpha=True)
    made.colorspace_settings.name = image.colorspace_settings.name
    both = [np.empty(image.size[0] * image.size[1] * 4, np.float32) for _ in range(2)]
    image.pixels.foreach_get(both[0])
    alpha.pixels.foreach_get(both[1])
    both[0][3::4] = both[1][0::4]
    made.alpha_mode = "CHANNEL_PACKED"
    made.pixels.foreach_set(both[0])
    made.update()
    made.pack()
    return made
