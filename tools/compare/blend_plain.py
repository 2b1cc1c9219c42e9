"""What Blender's own glTF exporter loses of the scenes of blend.py, and which of it oscura says.

    python blend_plain.py FOLDER [SCENE...]      with a Python that has bpy, after blend.py made FOLDER

Writes FOLDER/plain/X.glb with cameras, lights and modifiers, asks `oscura inspect` about it, and prints by scene what was lost that
is reported, what is not, and which materials have nodes that glTF can't hold and are not named.
"""

import re
import subprocess
import sys
from pathlib import Path

import bpy

import blend_scenes
from blend_run import PROGRAM

# Losses, and how they are reported.
SAID = {
    "world": r"the world",
    "area lights": r"area lights",
    "sizes of lamps": r"sizes of lamps",
    "angles of suns": r"angles of suns",
    "portals": r"portals",
    "nodes of lamps": r"nodes of lamps",
    "depth of field": r"depth of field",
    "shift": r"shift",
    "panorama": r"panoramas",
    "size of the picture": r"the picture's size",
    "film transparency": r"transparency of the film",
    "exposure and view": r"exposure and view",
    "motion blur": r"motion blur",
    "volumes": r"volumes",
    "subsurface scattering": r"subsurface scattering",
    "displacement": r"displacement",
    "bumps": r"bumps",
    "nodes": r"nodes beside Principled BSDF",
    "links of lights": r"links of lights",
    "lamps without shadows": r"lamps without shadows",
    "visibility by rays": r"visibility by kinds of rays",
    "holdouts and catchers": r"holdouts and shadow catchers",
    "particles": r"particles",
    "missing geometry": r"instances of particles and geometry nodes",
}
EVEN = {"ShaderNodeTexImage", "ShaderNodeNormalMap", "ShaderNodeUVMap", "ShaderNodeMapping", "ShaderNodeTexCoord", "ShaderNodeRGB"}
RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")


def of_lamps(scene):
    for obj in scene.objects:
        if obj.type != "LIGHT":
            continue
        data = obj.data
        yield "area lights", data.type == "AREA"
        yield "sizes of lamps", data.type in ("POINT", "SPOT") and data.shadow_soft_size > 0
        yield "angles of suns", data.type == "SUN" and data.angle > 0
        yield "portals", data.type == "AREA" and data.cycles.is_portal
        yield "lamps without shadows", not data.use_shadow
        yield "nodes of lamps", bool(data.use_nodes and any(n.bl_idname not in PLAIN_LIGHT for n in data.node_tree.nodes))


PLAIN_LIGHT = ("ShaderNodeEmission", "ShaderNodeOutputLight")


def of_cameras(scene):
    data = scene.camera.data
    yield "depth of field", data.dof.use_dof
    yield "shift", data.shift_x != 0 or data.shift_y != 0
    yield "panorama", data.type == "PANO"
    yield "size of the picture", True
    yield "film transparency", scene.render.film_transparent
    yield "exposure and view", scene.view_settings.exposure != 0 or scene.cycles.film_exposure != 1
    yield "motion blur", scene.render.use_motion_blur


def used(scene):
    """Materials that use nodes."""
    found = {slot.material for obj in scene.objects for slot in obj.material_slots if slot.material}
    return [material for material in found if material.use_nodes and material.node_tree]


def has_other_nodes(material):
    """Has a material nodes that glTF knows nothing of?"""
    nodes = [node for node in material.node_tree.nodes if any(out.is_linked for out in node.outputs)]
    principled = [node for node in nodes if node.bl_idname == "ShaderNodeBsdfPrincipled"]
    return len(principled) != 1 or any(n.bl_idname not in EVEN for n in nodes if n not in principled)


def of_materials(scene):
    for material in used(scene):
        tree = material.node_tree
        end = tree.get_output_node("CYCLES")
        yield "volumes", end is not None and end.inputs["Volume"].is_linked
        yield "displacement", end is not None and end.inputs["Displacement"].is_linked
        nodes = [node for node in tree.nodes if any(out.is_linked for out in node.outputs)]
        yield "bumps", any(node.bl_idname == "ShaderNodeBump" for node in nodes)
        principled = [node for node in nodes if node.bl_idname == "ShaderNodeBsdfPrincipled"]
        yield "nodes", has_other_nodes(material)
        yield "subsurface scattering", any(node.inputs["Subsurface Weight"].default_value > 0 for node in principled)


def of_objects(scene):
    for obj in scene.objects:
        linking = obj.light_linking
        yield "links of lights", bool(linking.receiver_collection or linking.blocker_collection)
        if obj.type == "MESH":
            yield "visibility by rays", not all(getattr(obj, f"visible_{kind}") for kind in RAYS)
            yield "holdouts and catchers", obj.is_holdout or obj.is_shadow_catcher
        yield "particles", bool(obj.particle_systems)


def of_worlds(scene):
    world = scene.world
    tree = world.node_tree if world and world.use_nodes else None
    end = tree.get_output_node("CYCLES") if tree else None
    yield "world", world is not None
    yield "volumes", end is not None and end.inputs["Volume"].is_linked


def corners(scene):
    """Triangles of everything that a render shows: what is no mesh comes as an instance of one."""
    found = bpy.context.evaluated_depsgraph_get()
    total = 0
    for instance in found.object_instances:
        obj = instance.object
        if obj.type == "MESH" and instance.show_self:
            mesh = obj.to_mesh()
            mesh.calc_loop_triangles()
            total += len(mesh.loop_triangles)
            obj.to_mesh_clear()
    return total


def main():
    folder = Path(sys.argv[1]).resolve()
    (folder / "plain").mkdir(exist_ok=True)
    rows = []
    for build in blend_scenes.SCENES:
        name = build.__name__
        if sys.argv[2:] and name not in sys.argv[2:]:
            continue
        bpy.ops.wm.open_mainfile(filepath=str(folder / f"{name}.blend"))
        scene, path = bpy.context.scene, folder / "plain" / f"{name}.glb"
        lost = {kind for of in (of_worlds, of_lamps, of_cameras, of_materials, of_objects) for kind, is_so in of(scene) if is_so}
        meant = corners(scene)
        bpy.ops.export_scene.gltf(filepath=str(path), export_cameras=True, export_lights=True, export_apply=True)
        listing = subprocess.run([PROGRAM, "inspect", str(path)], capture_output=True, text=True).stdout
        there = re.search(r"\((\d+) triangles\)", listing)
        # Hidden things are exported, so that there may be more.
        if int(there.group(1) if there else 0) < 0.99 * meant:
            lost.add("missing geometry")
        words = listing[listing.find("  notes") :]
        unsaid = sorted(kind for kind in lost if not re.search(SAID[kind], words))
        silent = [m.name for m in used(scene) if has_other_nodes(m) and f"'{m.name}'" not in words]
        rows.append(f"| {name} | {', '.join(sorted(lost - set(unsaid)))} | {', '.join(unsaid)} | {', '.join(sorted(silent))} |")
    head = "| scene | lost and reported | lost and not reported | materials with other nodes that are not named |"
    print(head, "|---|---|---|---|", *rows, sep="\n")


if __name__ == "__main__":
    main()
