"""Materials that differ by the kind of ray (Light Path) or by the side (Backfacing, Fresnel terms of what one can look through)
become several materials without such questions, and the faces that have them lie in one place as often: each is there for its own
kinds of rays, or from one side."""

import hashlib

import bmesh
import numpy as np

from . import fingerprint, limits, shaders, trees

LIGHT_PATH, GEOMETRY = "ShaderNodeLightPath", "ShaderNodeNewGeometry"
FRESNEL, WEIGHT = "ShaderNodeFresnel", "ShaderNodeLayerWeight"

# Kinds of rays as files of settings call them, with what Light Path nodes say to them.
RAYS = {
    "camera": {"Is Camera Ray": 1.0},
    "diffuse": {"Is Diffuse Ray": 1.0, "Is Reflection Ray": 1.0, "Ray Depth": 1.0, "Diffuse Depth": 1.0},
    "glossy": {"Is Glossy Ray": 1.0, "Is Reflection Ray": 1.0, "Ray Depth": 1.0, "Glossy Depth": 1.0},
    "transmission": {"Is Glossy Ray": 1.0, "Is Transmission Ray": 1.0, "Ray Depth": 1.0, "Transmission Depth": 1.0},
    "volume": {"Is Volume Scatter Ray": 1.0, "Ray Depth": 1.0},
    "shadow": {"Is Shadow Ray": 1.0, "Ray Depth": 1.0},
}

# Shaders that let shadow rays pass, wholly or in part.
CLEAR = ("ShaderNodeBsdfTransparent", "ShaderNodeHoldout")
REFRACTING = ("ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction")


class Variant:
    """A material without questions: the kinds of rays that see it, and from which side (0 in front, 1 behind)."""

    def __init__(self, material, rays, side):
        self.material, self.rays, self.side = material, rays, side


def split(holders, report):
    """Splits the materials of all meshes that need it."""
    found = {}
    for material in trees.of_materials(holders):
        tree = material.node_tree if material.use_nodes else None
        if tree is not None and (_asks(tree, LIGHT_PATH, None) or _has_sides(material)):
            found[material.name] = _variants(material, report)
    for holder in holders:
        if any(material.name in found for material in holder.data.materials):
            _divide(holder.data, found)


def _asks(tree, kind, output):
    nodes = trees.nodes_with_trees(tree, (kind,))
    return any(out.is_linked and output in (None, out.name) for _, node in nodes for out in node.outputs)


def _has_sides(material):
    """Does it ask for the side? Fresnel terms do: behind they are those of light that leaves the denser side. What is
    opaque is mostly closed, and seen in front alone."""
    tree = material.node_tree
    if _asks(tree, GEOMETRY, "Backfacing"):
        return True
    has_fresnel = _asks(tree, FRESNEL, None) or _asks(tree, WEIGHT, "Fresnel")
    return has_fresnel and _is_clear(material) and not _refracts(material)


def _variants(material, report):
    sides = (0, 1) if _has_sides(material) else (None,)
    rays = list(RAYS) if _asks(material.node_tree, LIGHT_PATH, None) else [None]
    copies, signatures = {}, {}
    for side in sides:
        for ray in rays:
            copy, mark = _specialised(material, ray, side)
            copies.setdefault(mark, copy)
            signatures[ray, side] = mark
    if len(sides) == 2 and any(_refracts(copy) for copy in copies.values()):
        report.warn(material.name, "lets light into a solid, and is taken on both sides (Backfacing) as it is in front")
        sides = (0,)
    same = len(sides) == 2 and all(signatures[ray, 0] == signatures[ray, 1] for ray in rays)
    found = []
    for side in sides[:1] if same or sides == (0,) else sides:
        groups = _by_rays({ray: signatures[ray, side] for ray in rays}, copies, material, report)
        of_both = same or len(sides) == 1
        found += [Variant(copies[mark], seen, None if of_both else side) for mark, seen in groups.items()]
    return _named(material, found)


def _by_rays(marks, copies, material, report):
    """The kinds of rays by what they see; what nobody sees is left out. Whatever is there for others casts the shadow."""
    if list(marks) == [None]:
        (mark,) = marks.values()
        return {} if _is_nothing(copies[mark]) else {mark: None}
    groups = {}
    for ray, mark in marks.items():
        if ray != "shadow" and not _is_nothing(copies[mark]):
            groups.setdefault(mark, []).append(ray)
    # Of surfaces at one place rays find two.
    others = [mark for mark in groups if mark not in (marks["camera"], marks["diffuse"])]
    for mark in others[max(2 - (len(groups) - len(others)), 0) :]:
        kept = marks["diffuse"] if marks["diffuse"] in groups else next(iter(groups))
        rays = groups.pop(mark)
        report.warn(material.name, f"Light Path: {' and '.join(rays)} rays see what {groups[kept][0]} rays see")
        groups[kept] += rays
    mark = marks["shadow"]
    if groups and not _is_nothing(copies[mark]):
        if mark not in groups:
            if _is_clear(copies[mark]):
                report.warn(material.name, "casts other shadows (Light Path) than it looks: they are those of what is seen")
            mark = marks["diffuse"] if marks["diffuse"] in groups else next(iter(groups))
        groups[mark].append("shadow")
    if _asks_of_length(material.node_tree):
        report.warn(material.name, "Light Path: lengths and depths of rays beyond the first are not told apart")
    return {mark: None if len(seen) == len(RAYS) else seen for mark, seen in groups.items()}


def _asks_of_length(tree):
    names = ("Ray Length", "Transparent Depth", "Ray Depth", "Diffuse Depth", "Glossy Depth", "Transmission Depth", "Portal Depth")
    return any(_asks(tree, LIGHT_PATH, name) for name in names)


def _named(material, found):
    """Tells the file of settings, and glTF, about variants."""
    for variant in found:
        # One-sided in glTF.
        variant.material.use_backface_culling = variant.side is not None
        if variant.rays is not None:
            trees.settle(variant.material, visible_to=variant.rays)
    return found or [Variant(_invisible(material), None, None)]


def _invisible(material):
    own = trees.copied(material)
    tree = own.node_tree
    tree.links.new(tree.nodes.new(CLEAR[0]).outputs[0], shaders.end(tree).inputs["Surface"])
    return own


def _specialised(material, ray, side):
    """A copy that holds for a kind of rays and a side, and a mark that tells it from others."""
    own = trees.copied(material)
    for tree, node in list(trees.nodes_with_trees(own.node_tree, (LIGHT_PATH, GEOMETRY))):
        for out in node.outputs:
            if node.bl_idname == LIGHT_PATH and ray is not None:
                trees.replace(tree, out, RAYS[ray].get(out.name, 0.0))
            elif node.bl_idname == GEOMETRY and out.name == "Backfacing" and side is not None:
                trees.replace(tree, out, float(side))
    if side == 1:
        _turn_fresnel(own.node_tree)
    _simplify(own.node_tree)
    end = shaders.end(own.node_tree)
    return own, _mark(end.inputs["Surface"], {}) if end is not None else ""


def _turn_fresnel(within):
    """Fresnel terms as they are behind: of the inverse of the index, if that is a constant."""
    for tree, node in list(trees.nodes_with_trees(within, (FRESNEL, WEIGHT))):
        if node.bl_idname == FRESNEL:
            index = shaders.constant(node.inputs["IOR"])
            if index is not None:
                _set(tree, node.inputs["IOR"], 1 / max(index, 1e-5))
            continue
        blend, out = shaders.constant(node.inputs["Blend"]), node.outputs["Fresnel"]
        if blend is None or not out.is_linked:
            continue
        turned = tree.nodes.new(FRESNEL)
        turned.inputs["IOR"].default_value = max(1 - blend, 1e-5)
        if (normal := shaders.source(node.inputs["Normal"])) is not None:
            tree.links.new(normal, turned.inputs["Normal"])
        for link in list(out.links):
            tree.links.new(turned.outputs[0], link.to_socket)


def _set(tree, socket, value):
    for link in list(socket.links):
        tree.links.remove(link)
    socket.default_value = value


def _simplify(tree):
    """Takes out mixes of which only one part counts."""
    for node in list(tree.nodes):
        if getattr(node, "node_tree", None):
            _simplify(node.node_tree)
        if node.bl_idname not in ("ShaderNodeMixShader", "ShaderNodeMix", "ShaderNodeMixRGB") or node.mute:
            continue
        if node.bl_idname != "ShaderNodeMixShader" and node.blend_type != "MIX":
            continue
        enabled = [socket for socket in node.inputs if socket.enabled]
        out = next(socket for socket in node.outputs if socket.enabled)
        if len(enabled) != 3:
            continue
        low, high = limits.of(enabled[0])
        if not getattr(node, "clamp_factor", True) and (low, high) not in ((0.0, 0.0), (1.0, 1.0)):
            continue
        if high <= 0.0 or low >= 1.0:
            _bypass(tree, out, enabled[1 if high <= 0.0 else 2])


def _bypass(tree, out, kept):
    source = shaders.source(kept)
    for link in list(out.links):
        target = link.to_socket
        if source is not None:
            tree.links.new(source, target)
        elif out.type == "SHADER":
            tree.links.remove(link)
        else:
            value = kept.default_value
            made = trees.constant_node(tree, value if isinstance(value, float) else tuple(value)[:3], out.type == "RGBA")
            tree.links.new(made, target)


def _mark(socket, known):
    """Tells apart what feeds inputs."""
    value = shaders.constant(socket) if socket.type != "SHADER" else None
    if value is not None:
        return repr(value)
    source = shaders.source(socket)
    if source is None:
        return "none"
    node = source.node
    if node not in known:
        digest = hashlib.blake2b(node.bl_idname.encode(), digest_size=16)
        known[node] = ""
        fingerprint.add_properties(digest, node)
        if getattr(node, "node_tree", None):
            fingerprint.add_tree(digest, node.node_tree)
        for entry in node.inputs:
            if entry.enabled:
                digest.update(f"|{entry.identifier}={_mark(entry, known)}".encode())
        known[node] = digest.hexdigest()
    return f"{known[node]}.{source.identifier}"


def _surface(material):
    end = shaders.end(material.node_tree)
    return shaders.source(end.inputs["Surface"]) if end is not None else None


def _is_nothing(material):
    """Is a surface one that all light passes?"""
    source = _surface(material)
    if source is None:
        return True
    return source.node.bl_idname == CLEAR[0] and shaders.constant(source.node.inputs["Color"]) == (1.0, 1.0, 1.0)


def _feeding(material):
    end = shaders.end(material.node_tree)
    return trees.upstream(end.inputs["Surface"]) if end is not None else set()


def _is_clear(material):
    return any(node.bl_idname in CLEAR for node in _feeding(material))


def _refracts(material):
    def does(node):
        if node.bl_idname == "ShaderNodeBsdfPrincipled":
            return shaders.constant(node.inputs["Transmission Weight"]) != 0
        return node.bl_idname in REFRACTING

    return any(does(node) for node in _feeding(material))


def _divide(mesh, found):
    """Gives a mesh the faces of all variants of its materials."""
    slots = list(mesh.materials)
    parts = []  # (slot of the faces, new slot, is turned)
    for i, material in enumerate(slots):
        for k, variant in enumerate(found.get(material.name, [])):
            if k == 0:
                mesh.materials[i] = variant.material
            else:
                mesh.materials.append(variant.material)
            parts.append((i, i if k == 0 else len(mesh.materials) - 1, variant.side == 1))
    if not any(to != slot or turned for slot, to, turned in parts):
        return
    normals = np.empty(len(mesh.loops) * 3, np.float32)
    mesh.corner_normals.foreach_get("vector", normals)
    normals = normals.reshape(-1, 3)
    numbers = mesh.attributes.new("oscura corner", "INT", "CORNER")
    numbers.data.foreach_set("value", np.arange(len(mesh.loops), dtype=np.int32))
    turned = _add_faces(mesh, parts)
    origin = np.empty(len(mesh.loops), np.int32)
    mesh.attributes["oscura corner"].data.foreach_get("value", origin)
    mesh.attributes.remove(mesh.attributes["oscura corner"])
    signs = np.ones(len(mesh.loops), np.float32)
    for polygon in mesh.polygons:
        if polygon.material_index in turned:
            signs[polygon.loop_start : polygon.loop_start + polygon.loop_total] = -1
    mesh.normals_split_custom_set((normals[origin] * signs[:, None]).tolist())


def _add_faces(mesh, parts):
    """Doubles faces and turns some; gives the slots whose faces are turned."""
    work = bmesh.new()
    work.from_mesh(mesh)
    by_slot = {}
    for face in work.faces:
        by_slot.setdefault(face.material_index, []).append(face)
    originals = {slot: list(by_slot.get(slot, [])) for slot, _, _ in parts}
    for slot, to, _ in parts:
        if to != slot and originals[slot]:
            made = bmesh.ops.duplicate(work, geom=originals[slot])
            for face in made["geom"]:
                if isinstance(face, bmesh.types.BMFace):
                    face.material_index = to
    turned = {to for _, to, is_turned in parts if is_turned}
    bmesh.ops.reverse_faces(work, faces=[face for face in work.faces if face.material_index in turned])
    work.to_mesh(mesh)
    work.free()
    return turned
