"""Multiple scattering between the facets of rough surfaces: each shader of Cycles keeps that light or loses it. It is lost in files from before
Blender 4.0, and in files made from such."""

from . import shaders, trees

KINDS = (
    "ShaderNodeBsdfPrincipled", "ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction", "ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfGlossy",
    "ShaderNodeBsdfMetallic",
)  # fmt: skip

# Smoother surfaces lose no visible amount.
LEAST_ROUGHNESS = 0.15


def keeps_all(node):
    """Does a shader lose nothing? None where it doesn't matter."""
    if node.bl_idname not in KINDS or not _loses(node):
        return None
    return node.distribution == "MULTI_GGX"


def model(holders):
    """The value of `microfacet` of [render] for most shaders; None for multiple scattering, the default."""
    kept = lost = 0
    materials = {material.name: material for holder in holders for material in holder.data.materials if material is not None}
    for material in materials.values():
        if not material.use_nodes or material.node_tree is None:
            continue
        for _, node in trees.nodes_with_trees(material.node_tree, KINDS):
            if node.outputs[0].is_linked and not node.mute:
                keeps = keeps_all(node)
                kept, lost = kept + (keeps is True), lost + (keeps is False)
    return "single" if lost > kept else None


def _loses(node):
    """Does the shader have rough facets?"""
    roughness = shaders.constant(node.inputs["Roughness"])
    if roughness is not None and roughness < LEAST_ROUGHNESS:
        return False
    if node.bl_idname != "ShaderNodeBsdfPrincipled":
        return True
    return any(shaders.constant(node.inputs[name]) != 0 for name in ("Specular IOR Level", "Metallic", "Transmission Weight"))
