"""What Cycles' shader nodes give that trace rays, Ambient Occlusion and Bevel: the truth of a test in tests/pictures/shader_nodes.rs. Writes
tests/references/nodes/rays.json and the meshes beside it.

    blender/bin/python tools/compare/nodes_rays.py [PART OF A LABEL]

A cube stands on a floor, and a smooth ball stands beside it, partly in the floor. Pictures are as those of `nodes_surface.py`.
"""

import sys
from pathlib import Path

import bpy
from mathutils import Euler, Matrix, Vector

sys.path.insert(0, str(Path(__file__).parent))
from nodes_surface import FOLDER, SAMPLES, SIZE, node, pictures, write_cases, write_ply  # noqa: E402
from raw_exr import set_up  # noqa: E402


def cases():
    """By label: a Blender node, and its counterpart in a scene file (its output, its table)."""
    found = {}

    def occlusion(label, output="AO", step=None, distance=1.0, color=(1.0, 1.0, 1.0), **settings):
        blender = node("ShaderNodeAmbientOcclusion", output, settings, {"Distance": distance, "Color": (*color, 1.0)})
        if step is not None:
            blender["step"] = step
        table = {"type": "ambient_occlusion", "distance": distance, "color": list(color), **settings}
        found[f"ambient_occlusion {label}"] = (blender, output.lower(), table)

    occlusion("distance 1")
    occlusion("distance 0.3", distance=0.3)
    occlusion("distance 20", distance=20.0)
    occlusion("Color", "Color", color=(0.8, 0.4, 0.1))
    occlusion("only_local", only_local=True)
    occlusion("inside", inside=True)
    occlusion("inside only_local 0.4", inside=True, only_local=True, distance=0.4)
    for samples in (1, 4, 16):
        occlusion(f"step of {samples} samples", step=0.6, samples=samples)
    occlusion("inside step of 5 samples", step=0.5, inside=True, samples=5)
    for samples in (1, 4, 16):
        for radius in (0.1, 0.3):
            blender = node("ShaderNodeBevel", "Normal", {"samples": samples}, {"Radius": radius})
            found[f"bevel {radius} of {samples} samples"] = (blender, "normal", {"type": "bevel", "radius": radius, "samples": samples})
    blender = node("ShaderNodeBevel", "Normal", {"samples": 4}, {"Radius": 0.2, "Normal": "object coordinates"})
    found["bevel Normal"] = (blender, "normal", {"type": "bevel", "radius": 0.2, "samples": 4, "normal": "given.vector"})
    return found


def scene():
    """The objects and the camera."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    items = []
    for name, add, matrix in (
        ("floor", lambda: bpy.ops.mesh.primitive_plane_add(size=2), Matrix.Scale(4.0, 4)),
        ("cube", lambda: bpy.ops.mesh.primitive_cube_add(size=1), Matrix.LocRotScale(Vector((-0.5, 0.0, 0.5)), Euler((0, 0, 0.5)), Vector((1, 1, 1)))),
        ("sphere", lambda: bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=0.5), Matrix.Translation((0.55, -0.2, 0.3))),
    ):
        add()
        item = bpy.context.object
        item.name, item.matrix_world = name, matrix
        items.append(item)
    bpy.ops.object.shade_smooth()
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    bpy.context.collection.objects.link(camera)
    camera.location, camera.rotation_euler = (0.3, -2.6, 2.2), (0.88, 0.0, 0.1)
    camera.data.sensor_width, camera.data.lens = 36, 50
    bpy.context.scene.camera = camera
    bpy.context.view_layer.update()
    return items, camera


def main():
    only = sys.argv[1] if len(sys.argv) > 1 else ""
    items, camera = scene()
    set_up(bpy.context.scene, SIZE, samples=SAMPLES, filter_width=1.0)
    for item in items:
        write_ply(FOLDER / f"{item.name}.ply", item)
    known = cases()
    values = {}
    # One at a time: Cycles merges equal nodes.
    for case in known.items():
        if only in case[0]:
            values.update(pictures([case], items))
    write_cases(FOLDER / "rays.json", known, values, camera, items)


if __name__ == "__main__":
    main()
