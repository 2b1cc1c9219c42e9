"""Multiple scattering between microfacets, which each shader of Cycles has (Multiscatter GGX) or not (GGX). Files from before Blender 4.0 have
GGX."""

from . import node_trees
from .node_links import constant

MICROFACET_NODES = (
    "ShaderNodeBsdfPrincipled", "ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction", "ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfMetallic",
)  # fmt: skip

# Smoother surfaces lose no visible energy.
MIN_ROUGHNESS = 0.15


def keeps_energy(node):
    """Does a shader conserve energy? None where it makes no difference."""
    if node.bl_idname not in MICROFACET_NODES or not _is_rough(node):
        return None
    return node.distribution == "MULTI_GGX"


def model(materials):
    """The value of `microfacet` in [render] that most shaders have; None for the default, multiple scattering."""
    single = multiple = 0
    for material in {material.name: material for material in materials}.values():
        tree = node_trees.tree_of(material)
        for _, node in node_trees.find_nodes(tree, MICROFACET_NODES) if tree is not None else ():
            if node.outputs[0].is_linked and not node.mute:
                keeps = keeps_energy(node)
                multiple, single = multiple + (keeps is True), single + (keeps is False)
    return "single" if single > multiple else None


def _is_rough(node):
    roughness = constant(node.inputs["Roughness"])
    if roughness is not None and roughness < MIN_ROUGHNESS:
        return False
    if node.bl_idname != "ShaderNodeBsdfPrincipled":
        return True
    return any(constant(node.inputs[name]) != 0 for name in ("Specular IOR Level", "Metallic", "Transmission Weight"))
