"""A Blender animation, frame by frame: `oscura render scene.blend --frames` against Cycles.

    python blend_motion.py FOLDER [FRAMES]        with a Python that has bpy, numpy and Pillow

A tube that its armature bends, objects that hang on each other, shape keys, a lamp and a camera that move. Prints by frame
what blend.py prints by scene.
"""

import math
import os
import subprocess
import sys
from pathlib import Path

import bpy

import blend_parts as scenes
import blend_run

NAME = "motion"


def motion():
    """The scene; its frames count from 1."""
    scenes.still_life()
    scenes.world((0.15, 0.18, 0.25))
    _tube()
    _hierarchy()
    _shape_keys()
    lamp = scenes.light("AREA", "Key", 150, (-3, -3, 4), (0.6, -0.5, 0), size=1)
    scenes.keyed(lamp, "location", {1: (-3, -3, 4), 10: (1, -4, 4)})
    eye = scenes.camera()
    scenes.keyed(eye, "location", {1: (6, -7, 4), 10: (3, -8, 5)})
    scenes.keyed(eye, "rotation_euler", {1: (1.15, 0, 0.7), 10: (1.05, 0, 0.35)})


def _tube():
    """A tube that bends at its second bone."""
    tube = scenes.add(
        "cylinder", scenes.material("tube", Base_Color=(0.2, 0.6, 0.3, 1), Roughness=0.4), (-2, 1, 1.2), "Tube", True,
        radius=0.3, depth=2.4, vertices=24,
    )  # fmt: skip
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide(number_cuts=8)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.object.armature_add(location=(-2, 1, 0))
    rig = bpy.context.object
    bpy.ops.object.mode_set(mode="EDIT")
    lower = rig.data.edit_bones[0]
    lower.tail = (0, 0, 1.2)
    upper = rig.data.edit_bones.new("Upper")
    upper.head, upper.tail, upper.parent, upper.use_connect = (0, 0, 1.2), (0, 0, 2.4), lower, True
    bpy.ops.object.mode_set(mode="OBJECT")
    for name, share in (("Bone", lambda z: 1 - z), ("Upper", lambda z: z)):
        group = tube.vertex_groups.new(name=name)
        for vertex in tube.data.vertices:
            group.add([vertex.index], share(min(max((vertex.co.z + 0.4) / 0.8, 0.0), 1.0)), "REPLACE")
    tube.parent = rig
    tube.matrix_parent_inverse = rig.matrix_world.inverted()
    tube.modifiers.new("Rig", "ARMATURE").object = rig
    bone = rig.pose.bones["Upper"]
    bone.rotation_mode = "XYZ"
    scenes.keyed(bone, "rotation_euler", {1: (0, 0, 0), 10: (0.4, 0, 1.2)})
    scenes.keyed(rig, "rotation_euler", {1: (0, 0, 0), 10: (0, 0, 0.8)})


def _hierarchy():
    """A box on an arm on a turning stand."""
    stand = scenes.link("Stand", None, (1, -2, 0.5))
    arm = scenes.link("Arm", None, (1, 0, 0.4), scale=(1, 0.6, 1))
    box = scenes.add("cube", scenes.material("box", Base_Color=(0.7, 0.5, 0.1, 1)), (0.3, 0, 0), "Carried", size=0.6)
    arm.parent, box.parent = stand, arm
    scenes.keyed(stand, "rotation_euler", {1: (0, 0, 0), 10: (0, 0, math.pi)})
    scenes.keyed(arm, "rotation_euler", {1: (0, 0, 0), 10: (0, 1, 0)})


def _shape_keys():
    """A sphere with a shape key that bulges to one side."""
    ball = scenes.ball(scenes.material("dough", Base_Color=(0.6, 0.3, 0.5, 1), Roughness=0.6), (2, -1, 0.6), 0.5, "Dough")
    ball.shape_key_add(name="Basis")
    swollen = ball.shape_key_add(name="Swollen")
    for vertex, target in zip(ball.data.vertices, swollen.data):
        target.co = vertex.co * (1.0 + 0.8 * max(vertex.co.x, 0.0))
    scenes.keyed(swollen, "value", {1: 0.0, 10: 1.0})


def main():
    folder = Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    count = int(sys.argv[2]) if sys.argv[2:] else 10
    frames = range(1, count + 1)
    if not (folder / f"{NAME}.ref.2.{count:04}.exr").exists():
        blend_run.make(folder, motion, frames)
    for seed in (1, 2):
        command = [blend_run.PROGRAM, "render", str(folder / f"{NAME}.blend"), "--frames", f"1-{count}", "--resume"]
        command += ["-o", str(folder / f"{NAME}.{seed}.####.exr"), "--float", "--spp", str(blend_run.SAMPLES)]
        subprocess.run([*command, "--seed", str(seed), "--quiet"], env=blend_run.environment(), check=True)
    print("| frame | mean | blocks | noise |\n|---|---:|---:|---:|")
    for frame in frames:
        read = lambda kind: [blend_run.read(folder / f"{NAME}{kind}.{seed}.{frame:04}.exr") for seed in (1, 2)]
        ours, theirs = read(""), read(".ref")
        blend_run.row(frame, folder / f"{NAME}.{frame:04}.png", ours, theirs)


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    # The module `bpy` may hang at exit.
    os._exit(0)
