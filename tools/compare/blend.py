"""Blender scenes: `oscura render scene.blend` against Cycles, fully automatic.

    python blend.py FOLDER [SCENE...]        with a Python that has bpy, numpy and Pillow

Makes FOLDER/X.blend, Cycles' X.ref.1.exr and X.ref.2.exr where they are missing, oscura's X.1.exr and X.2.exr, and X.png:
oscura, Cycles, and their difference. Prints by scene the mean over Cycles' and the RMS of the relative difference of
blocks of 16 x 16 pixels, each with what noise explains of it taken off, estimated from two seeds of either.
"""

import os
import subprocess
import sys
from pathlib import Path

import blend_scenes
from blend_run import PROGRAM, SAMPLES, environment, make, read, row


def render(folder, name, options):
    for seed in (1, 2):
        command = [PROGRAM, "render", str(folder / f"{name}.blend"), "-o", str(folder / f"{name}.{seed}.exr")]
        command += ["--float", "--seed", str(seed), "--spp", str(SAMPLES), *options]
        done = subprocess.run(command, env=environment(), capture_output=True, text=True)
        if done.returncode:
            print(done.stderr)
            return False
        if seed == 1:
            warnings = [line for line in done.stderr.splitlines() if line.startswith("warning:")]
            print("\n".join(warnings), end="\n" if warnings else "")
    return True


def main():
    folder = Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    options = os.environ.get("OPTIONS", "").split()
    print("| scene | mean | blocks | noise |\n|---|---:|---:|---:|")
    for build in blend_scenes.SCENES:
        name = build.__name__
        if sys.argv[2:] and name not in sys.argv[2:]:
            continue
        if not (folder / f"{name}.ref.2.exr").exists():
            make(folder, build)
        if "ONLY_REFERENCES" in os.environ or not render(folder, name, options):
            continue
        ours, theirs = ([read(folder / f"{name}{k}.{seed}.exr") for seed in (1, 2)] for k in ("", ".ref"))
        row(name, folder / f"{name}.png", ours, theirs)


if __name__ == "__main__":
    main()
