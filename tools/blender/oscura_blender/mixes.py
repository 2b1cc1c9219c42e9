"""Inputs of shaders that differ with the angle of view and from place to place. Where the two can be told apart, an input is
A(x) + f(cosine) (B(x) - A(x)): two pictures, baked as they are seen at two angles, that a table over the cosine mixes. The file of
settings has the second picture and the table; the first is the model's."""

from functools import partial

import bmesh
import bpy
import numpy as np

from . import facing, glow, pictures, shaders, trees, views
from .context import choose, opened
from .facing import LIGHT
from .sizes import MOST_FACES
from .views import ROWS

# Inputs that may be mixed, by the keys of the file of settings. Light is the product of two.
INPUTS = {name: key for name, key in facing.INPUTS.items() if name in pictures.INPUTS} | {"Emission Color": "emission"}

# What is noted of materials until they are baked: by inputs the rows of A and B for each channel, and the shares of B by rows and
# channels.
WANTED = "oscura mixes"
# Of base colours whose second picture is of light that passes diffusely: its share, in the place of the shares of B.
PASSES = "oscura passes"

# The second pictures, as their files are, by the names of their textures.
PICTURES = {}

# So many places of a material are looked at, on meshes that are cut until they have so many faces.
PLACES, FEWEST_FACES = 64, 256
# Pixels from place to place, and the largest distance of corners from its middle.
CELL, AROUND = 4, 1.6
# Most of the range that may remain, as RMS.
TOLERANCE = 0.01
# Angles serve all channels if each is so far apart there, as a share of the most in squares.
COMMON = 0.5

UV, COSINE = "oscura places", "oscura cosine"


def fit(material, holders):
    """Finds the inputs of a material that can be mixed, from what they are at places of its meshes; gives their names."""
    shader = shaders.principled(material)
    wanted = [[name] for name in INPUTS if name not in LIGHT and _is_mixed(shader.inputs[name])]
    if any(_is_mixed(shader.inputs[name]) for name in LIGHT):
        wanted.append(list(LIGHT))
    if any(shaders.constant(shader.inputs[name]) != 0 for name in ("Subsurface Weight", "Transmission Weight")):
        wanted = [names for names in wanted if names != ["Base Color"]]
    known = trees.SETTINGS.get(material.name, {}).get(WANTED, {})
    wanted = [names for names in wanted if names[0] not in known]
    if not wanted or any(len(holder.data.polygons) > MOST_FACES for holder in holders):
        return []
    found = _fit(material, holders[:2], wanted)
    if found:
        trees.own_groups(material.node_tree)
        trees.settle(material, **{WANTED: {**known, **found}})
    return [name for names in wanted if names[0] in found for name in names]


def _is_mixed(socket):
    """Does an input differ with the angle of view, in a way that is known? That it does so alone was looked for before."""
    outputs = [(node, out) for node in _within(trees.upstream(socket)) for out in _directed(node)]
    return bool(outputs) and all(is_by_cosine(node, out) for node, out in outputs)


def _within(nodes):
    for node in nodes:
        yield node
        if getattr(node, "node_tree", None):
            yield from (inner for _, inner in trees.nodes_with_trees(node.node_tree, views.DIRECTED))


def _directed(node):
    return [out for out in node.outputs if out.is_linked and out.name in views.DIRECTED.get(node.bl_idname, ())]


def is_by_cosine(node, out):
    """Does an output follow from the cosine of the angle of view?"""
    return views.is_known(node) and out.name in views.DIRECTED[node.bl_idname]


def _fit(material, holders, wanted):
    """By the first names of inputs, those that can be told apart."""
    seen = [_seen(material, holder, wanted) for holder in holders]
    fits = {names[0]: told_apart(np.concatenate([of[k] for of in seen])) for k, names in enumerate(wanted)}
    return {name: found for name, found in fits.items() if found is not None}


def told_apart(values):
    """The rows of A and B and the shares of B (rows, channels) for what is seen (places, rows, channels); None where places and
    angles can't be told apart."""
    values = values.astype(np.float64)
    extent = np.ptp(values)
    inner = np.einsum("pac,pbc->cab", values, values)
    square = np.einsum("caa->ca", inner)
    apart = np.maximum(square[:, :, None] + square[:, None] - 2 * inner, 0)
    most = apart.max((1, 2))
    varies = most > len(values) * (TOLERANCE * extent) ** 2
    if not varies.any():
        return None
    # The angles that are furthest apart, in the channel where they are the least so, or for each channel its own.
    farthest = lambda of: sorted((int(row) for row in np.unravel_index(of.argmax(), of.shape)), reverse=True)
    common = farthest((apart[varies] / most[varies, None, None]).min(0))
    far = [not varies[c] or apart[c][*common] > COMMON * most[c] for c in range(3)]
    rows = np.array([common if all(far) else farthest(apart[c]) for c in range(3)]).T
    a, b = (np.stack([values[:, of[c], c] for c in range(3)], 1) for of in rows)
    way = b - a
    shares = np.einsum("pc,prc->rc", way, values - a[:, None]) / np.maximum((way * way).sum(0), 1e-12)
    shares = np.where(varies, np.clip(shares, 0, 1), 0)
    left = values - a[:, None] - way[:, None] * shares
    if (np.sqrt((left**2).mean((0, 1))) > TOLERANCE * extent).any():
        return None
    return {"rows": rows.tolist(), "shares": shares}


def _seen(material, holder, wanted):
    """What inputs of a material are at places of a mesh by the cosine: for each of them (places, rows, channels)."""
    own = trees.copied(material)
    images = _put_tables(own.node_tree)
    mesh = _spread(holder.data, list(holder.data.materials).index(material), own)
    kitchen, shown = glow.new_scene(), bpy.data.objects.new("oscura places", mesh)
    shown.matrix_world = holder.matrix_world
    kitchen.collection.objects.link(shown)
    try:
        with opened(kitchen):
            choose(shown, kitchen)
            count = len(mesh.polygons) // ROWS
            return [_shone(own, names, count) for names in wanted]
    finally:
        bpy.data.scenes.remove(kitchen)
        bpy.data.meshes.remove(mesh)
        bpy.data.materials.remove(own)
        for image in images:
            bpy.data.images.remove(image)


def _put_tables(tree):
    """Pictures over the cosine of each face in the place of what differs with the angle of view."""
    images = []
    for inner, node in list(trees.nodes_with_trees(tree, views.DIRECTED)):
        for out in _directed(node):
            if is_by_cosine(node, out):
                place = inner.nodes.new("ShaderNodeCombineXYZ")
                trees.feed_attribute(inner, [place.inputs[0]], COSINE, "Fac")
                images.append(facing.put(inner, out, views.rows(node, out.name), place.outputs[0]))
    return images


def _spread(mesh, slot, material):
    """Some faces of a slot, once for each row: all lie apart in the picture."""
    made = mesh.copy()
    made.use_auto_texspace = False
    made.texspace_location, made.texspace_size = mesh.texspace_location, mesh.texspace_size
    work = bmesh.new()
    work.from_mesh(made)
    bmesh.ops.delete(work, geom=[face for face in work.faces if face.material_index != slot], context="FACES")
    while 0 < len(work.faces) < FEWEST_FACES:
        bmesh.ops.triangulate(work, faces=work.faces)
        bmesh.ops.subdivide_edges(work, edges=work.edges, cuts=3, use_grid_fill=True)
    work.faces.ensure_lookup_table()
    chosen = np.random.default_rng(0).permutation(len(work.faces))[:PLACES]
    kept = {work.faces[i] for i in chosen}
    bmesh.ops.delete(work, geom=[face for face in work.faces if face not in kept], context="FACES")
    row, column = work.faces.layers.float.new(COSINE), work.faces.layers.int.new("oscura place")
    uv = work.loops.layers.uv.new(UV)
    originals = list(work.faces)
    for k, face in enumerate(originals):
        face[column] = k
    source = originals + list(work.edges) + list(work.verts)
    for i in range(ROWS):
        # The last row has the originals.
        faces = originals
        if i < ROWS - 1:
            faces = [part for part in bmesh.ops.duplicate(work, geom=source)["geom"] if isinstance(part, bmesh.types.BMFace)]
        for face in faces:
            face[row], face.material_index = (i + 0.5) / ROWS, 0
            _lay(face, uv, i, face[column], len(originals))
    work.to_mesh(made)
    work.free()
    made.materials.clear()
    made.materials.append(material)
    return made


def _lay(face, uv, row, column, columns):
    """Lays a face around the middle of its place."""
    for k, loop in enumerate(face.loops):
        angle = 2 * np.pi * k / len(face.loops)
        x, y = CELL * column + 2.5 + AROUND * np.cos(angle), CELL * row + 2.5 + AROUND * np.sin(angle)
        loop[uv].uv = (x / (CELL * columns), y / (CELL * ROWS))


def _shone(material, names, count):
    pixels = glow.baked(CELL * count, CELL * ROWS, [partial(_shine, material, names)], uv_layer=UV)
    found = pixels.reshape(ROWS, CELL, count, CELL, 4)[:, 2, :, 2, :3].swapaxes(0, 1)
    return np.clip(np.nan_to_num(found), 0, None if names == list(LIGHT) else 1)


def _shine(material, names, image):
    tree, shader = material.node_tree, shaders.principled(material)

    def feed(inputs):
        for name, target in zip(names, ("Color", "Strength")):
            shaders.feed(tree, shader.inputs[name], inputs[target])

    return glow.shine(tree, shaders.end(tree), shader, image, feed)


def wanted(material):
    """By inputs what is known of those that are to be mixed."""
    return trees.SETTINGS.get(material.name, {}).get(WANTED, {})


def rows_of(materials, name, which, channel):
    """The rows at which an input of materials is to be seen for a channel of A (0) or B (1); MEAN where it is not mixed."""
    found = (wanted(material).get(name) for material in materials)
    return tuple(of["rows"][which][channel] if of else MEAN for of in found)


def see(materials, rows):
    """Lets each material be as it is seen at the angle of a row."""
    for material, row in zip(materials, rows):
        for _, node in trees.nodes_with_trees(material.node_tree, ("ShaderNodeValue",)):
            if shaders.BY_COSINE in node:
                node.outputs[0].default_value = node[shaders.BY_COSINE][row]


# Beyond the last row is the mean.
MEAN = ROWS


def settle(material, name, image):
    """Notes a mix of the model's picture of an input with another one, for the file of settings."""
    key, noted = INPUTS[name], wanted(material)[name]
    passed = noted.get(PASSES)
    second, table, mix = (f"{material.name} {key} {part}" for part in ("second picture", "by the angle", "mixed"))
    if name == "Alpha":
        image = _as_alpha(image)
    if not image.packed_file:
        image.pack()
    PICTURES[second] = bytes(image.packed_file.data)
    is_data = pictures.INPUTS[name] == pictures.DATA
    trees.TEXTURES[OWN] = {"type": "own"}
    trees.TEXTURES[second] = {"type": "image", "file": None, "mapping": "own", "encoding": "linear" if is_data else "srgb"}
    if passed is not None:
        trees.settle(material, diffuse_transmission=passed, diffuse_transmission_color=second)
        return
    trees.TEXTURES[table] = {"type": "facing", "colors": [facing.entry(row, is_data) for row in noted["shares"]]}
    trees.TEXTURES[mix] = {"type": "mix", "a": OWN, "b": second, "factor": table}
    trees.settle(material, **{key: mix})


OWN = "the model's own"


def _as_alpha(image):
    """A picture of numbers in the alpha channel, where the model has them."""
    made = bpy.data.images.new(f"{image.name} alpha", *image.size, alpha=True)
    made.colorspace_settings.name, made.alpha_mode = "Non-Color", "CHANNEL_PACKED"
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    pixels[3::4] = pixels[0::4]
    made.pixels.foreach_set(pixels)
    made.update()
    made.pack()
    return made


def forget(material):
    """Drops what is noted for baking."""
    trees.SETTINGS.get(material.name, {}).pop(WANTED, None)
