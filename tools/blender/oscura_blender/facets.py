"""How often light is scattered among the facets of rough surfaces: a choice of each shader of Cycles, and of a whole picture here. Files of
before Blender 4.0 have Principled shaders that let it be lost after once."""

from . import shaders, trees

KINDS = ("ShaderNodeBsdfPrincipled", "ShaderNodeBsdfGlass", "ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfGlossy", "ShaderNodeBsdfMetallic")

# Smoother surfaces lose nothing that one sees.
LEAST_ROUGHNESS = 0.15


def model(holders, report):
    """`microfacet` of [render] that the shaders of all rough metal and glass want; None for the one that loses nothing."""
    once, often = set(), set()
    for material in trees.of_materials(holders):
        if not material.use_nodes or material.node_tree is None:
            continue
        for _, node in trees.nodes_with_trees(material.node_tree, KINDS):
            if node.outputs[0].is_linked and not node.mute and _loses(node):
                (often if node.distribution == "MULTI_GGX" else once).add(material.name)
    if not once:
        return None
    if not often:
        return "single"
    for name in sorted(once):
        report.warn(name, "light that leaves no facet at once is lost in Cycles (GGX), but not in other materials (Multiscatter GGX), and here nowhere")
    return None


def _loses(node):
    """Is the shader a rough metal or rough glass?"""
    roughness = shaders.constant(node.inputs["Roughness"])
    if roughness is not None and roughness < LEAST_ROUGHNESS:
        return False
    if node.bl_idname != "ShaderNodeBsdfPrincipled":
        return True
    return any(shaders.constant(node.inputs[name]) != 0 for name in ("Metallic", "Transmission Weight"))
