"""Third-party Blender files: `oscura render file.blend` against Cycles.

    python public_files.py FOLDER OUT CYCLES [--samples 32] [--width 160] [--only NAME...] [--again]
    python public_files.py --summary OUT

with a Python that has bpy 4.2 or newer and numpy. Renders all X.blend of FOLDER at the file's frame, view and limits, but with N
samples, two seeds, and without adaptive sampling, denoising, compositing, sequences, regions and stamps. Cycles' pictures are
kept in CYCLES, so that a later run with another program (`OSCURA`) renders ours alone; ours are kept in OUT, with a row of
OUT/rows.jsonl for each file. Files that have a row are left out, unless `--again` is given.

A row has, besides what the programs said, took and ended with:

- `mean`: the mean of ours over that of Cycles, all pixels and colours, transparent films over black; `mean_noise` is its noise;
- `blocks`: the sum of the differences of blocks of 16 x 16 pixels, without sign, over the sum of Cycles' blocks;
- `noise_ours` and `noise_cycles`: the same of half the difference of two seeds, which is as large as the noise of their mean;
- `variance_ours` and `variance_cycles`: those of a sample count's displayed values (sRGB, clipped), by the difference of two seeds;
- `ours_cpu`: CPU seconds of the program and the Blender that exports, with an empty cache of baked textures;
  `ours_cpu_cached` those of the second seed, `ours_render_cpu` those of the render alone; `ours_export_cpu` is all besides;
- `cycles_cpu`: those of Blender's start, of opening the file and of the first render (`cycles_start_cpu`, `..open..`, `..render..`);
- `cycles_mb`, `ours_mb`: the largest process. Ours may be the Blender that exports; `ours_render_mb` is what the renderer tells.

or `skipped` or `failed`, which say why there is nothing to compare. The summary counts files, lists those out of bounds, and gives the speed at
equal error of each: Cycles' variance times the processor time of its render (with the scene's synchronization) over the same of ours.
"""

import argparse
import collections
import hashlib
import json
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import bpy
import numpy as np

from blend_run import PROGRAM, blocks, environment
from raw_exr import channels

SEEDS = (1, 2)
TIMEOUT = 300  # seconds: of Cycles for both seeds, of oscura for each
BOUNDS = {"mean": 0.02, "blocks": 0.05}
SLOW = 1.2  # times Cycles' CPU time
BLACK = 1e-6  # mean of a picture in which there is nothing to compare
WORDS = 9  # of a note, in the summary


def cpu():
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


# The process of one file in Blender.


def set_all(owner, **values):
    """Sets the properties that exist in this Blender version."""
    for name, value in values.items():
        if hasattr(owner, name):
            setattr(owner, name, value)


def set_up(scene, width, samples):
    """Sets Cycles up to render the scene as saved, but small, noisy and without post-processing; returns the height."""
    render = scene.render
    height = max(1, round(width * render.resolution_y / render.resolution_x))
    set_all(render, engine="CYCLES", resolution_x=width, resolution_y=height, resolution_percentage=100)
    set_all(render, use_border=False, use_crop_to_border=False, use_compositing=False, use_sequencer=False)
    set_all(render, use_single_layer=False, use_multiview=False, use_freestyle=False, use_stamp=False, use_file_extension=False, use_overwrite=True, use_placeholder=False)
    set_all(scene.cycles, device="CPU", samples=samples, time_limit=0, use_adaptive_sampling=False, use_denoising=False)
    set_all(scene.cycles, use_animated_seed=False, use_sample_subset=False, sample_offset=0)
    # As oscura's default: the first view layer that is rendered.
    used = [layer for layer in scene.view_layers if layer.use] or scene.view_layers[:1]
    for layer in scene.view_layers:
        layer.use = layer == used[0]
        layer.samples = 0
    image = render.image_settings
    # Movies first become pictures: only then there are formats of pictures to choose.
    set_all(image, media_type="IMAGE")
    set_all(image, file_format="OPEN_EXR", color_mode="RGBA", color_depth="32", exr_codec="NONE", color_management="FOLLOW_SCENE")
    return height


def by_cycles(path, stem, width, samples):
    """Renders a file to STEM.1.exr and STEM.2.exr; returns what to report about it."""
    start = cpu()
    # Scripts of files that strangers made stay off, as with oscura.
    bpy.ops.wm.open_mainfile(filepath=path, use_scripts=False)
    scene = bpy.context.scene
    found = {"engine": scene.render.engine, "format": scene.render.image_settings.file_format, "frame": scene.frame_current}
    found["saved_by"] = ".".join(map(str, bpy.data.version))
    found |= {"cycles_start_cpu": round(start, 3), "cycles_open_cpu": round(cpu() - start, 3)}
    if scene.camera is None:
        return found | {"skipped": "the scene has no camera"}
    found["size"] = [width, set_up(scene, width, samples)]
    took, wall = [], []
    for seed in SEEDS:
        before, began = cpu(), time.monotonic()
        scene.cycles.seed = seed
        scene.render.filepath = f"{stem}.{seed}.exr"
        bpy.ops.render.render(write_still=True)
        took.append(round(cpu() - before, 3))
        wall.append(round(time.monotonic() - began, 3))
    # The first finds nothing ready, as ours.
    found |= {"cycles_render_cpu": took[0], "cycles_render_cpu_again": took[1], "cycles_render_wall": wall[0]}
    return found | {"cycles_cpu": round(start + found["cycles_open_cpu"] + took[0], 3)}


def in_blender(path, stem, width, samples):
    try:
        found = by_cycles(path, stem, int(width), int(samples))
    except Exception as error:
        found = {"failed": f"Blender: {' '.join(str(error).split())[:300]}"}
    Path(f"{stem}.found.json").write_text(json.dumps(found))
    sys.stdout.flush()
    # The module `bpy` may hang while it tidies up.
    os._exit(0)


# The process that starts those of all files.


def run(command, log):
    """Runs a program that writes to a file; returns its exit code (None: timeout), and its resource use."""
    began = time.monotonic()
    with open(log, "wb") as output:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=output, env=environment(), start_new_session=True)
    late = threading.Event()

    def stop():
        late.set()
        os.killpg(process.pid, signal.SIGKILL)

    timer = threading.Timer(TIMEOUT, stop)
    timer.start()
    _, status, used = os.wait4(process.pid, 0)
    timer.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    wall = round(time.monotonic() - began, 3)
    return None if late.is_set() else process.returncode, round(used.ru_utime + used.ru_stime, 3), wall, used.ru_maxrss // 1024


def ended(code):
    return f"took longer than {TIMEOUT} s" if code is None else f"ended with {code}" + (f" ({signal.Signals(-code).name})" if code < 0 else "")


def theirs(path, folder, width, samples):
    """Cycles' results for a file, cached or new."""
    stem = folder / path.stem
    key = {"sha256": hashlib.sha256(path.read_bytes()).hexdigest(), "samples": samples, "width": width}
    kept = folder / f"{path.stem}.json"
    if kept.exists():
        found = json.loads(kept.read_text())
        if {name: found.get(name) for name in key} == key:
            return found
    told = folder / f"{path.stem}.found.json"
    told.unlink(missing_ok=True)
    python = environment()["OSCURA_BLENDER"]
    code, used, wall, memory = run([python, __file__, "--blender", str(path), str(stem), str(width), str(samples)], folder / f"{path.stem}.log")
    found = json.loads(told.read_text()) if told.exists() else {"failed": f"Blender {ended(code)}"}
    told.unlink(missing_ok=True)
    missing = [seed for seed in SEEDS if not Path(f"{stem}.{seed}.exr").exists()]
    if missing and not {"failed", "skipped"} & set(found):
        found["failed"] = "Blender wrote no picture"
    found |= key | {"cycles_exit": code, "cycles_all_cpu": used, "cycles_all_wall": wall, "cycles_mb": memory}
    kept.write_text(json.dumps(found))
    return found


def ours(path, out, size, samples):
    """oscura's results for a file."""
    found = {}
    with tempfile.TemporaryDirectory(dir=out) as cache:
        for seed in SEEDS:
            log = out / f"{path.stem}.{seed}.log"
            command = [PROGRAM, "render", str(path), "-o", str(out / f"{path.stem}.{seed}.exr"), "--seed", str(seed), "--spp", str(samples)]
            command += ["--width", str(size[0]), "--height", str(size[1]), "--no-denoise", "--float", "--exr-compression", "none"]
            code, used, wall, memory = run([*command, "--cache", cache, "--verbose"], log)
            if seed == SEEDS[0]:
                found |= {"ours_exit": code, "ours_cpu": used, "ours_wall": wall, "ours_mb": memory} | said(path, log, used)
            else:
                found["ours_cpu_cached"] = used
            if code != 0:
                errors = [line for line in log.read_text(errors="replace").splitlines() if line.startswith("error")]
                return found | {"ours_exit": code, "failed": f"oscura {ended(code)}: {' '.join(errors)[:400]}"}
    return found


def said(path, log, used):
    """The messages of the program, and its render report."""
    text = log.read_text(errors="replace")
    found = {}
    for kind in ("warning", "note"):
        lines = [line.removeprefix(f"{kind}: ") for line in text.splitlines() if line.startswith(f"{kind}: ")]
        found[f"{kind}s"] = [line.removeprefix(f"{path}: ") for line in lines]
    times = re.search(r"^time +load ([\d.]+) s.*render ([\d.]+) s \(([\d.]+) s of CPU", text, re.M)
    if times:
        load, render, render_cpu = map(float, times.groups())
        found |= {"ours_load_wall": load, "ours_render_wall": render, "ours_render_cpu": render_cpu}
        found["ours_export_cpu"] = round(used - render_cpu, 3)
    memory = re.search(r"^memory +([\d.]+) ([MG])iB", text, re.M)
    if memory:
        found["ours_render_mb"] = float(memory[1]) * (1024 if memory[2] == "G" else 1)
    return found


def colors(path):
    """The colours of a picture over black, and the number of NaN pixels."""
    planes = channels(path)
    pixels = np.stack([planes[name] for name in "RGB"], -1).astype(np.float64)
    is_number = np.isfinite(pixels)
    return np.where(is_number, pixels, 0), int((~is_number.all(-1)).sum())


def measure(a, b):
    """Differences of two pictures of oscura from two of Cycles."""
    (a1, a2), (b1, b2) = a, b
    if a1.shape != b1.shape:
        return {"failed": f"oscura's picture is {a1.shape[1]} x {a1.shape[0]} pixels, Cycles' {b1.shape[1]} x {b1.shape[0]}"}
    ours, reference = (a1 + a2).mean() / 2, (b1 + b2).mean() / 2
    if max(ours, reference) < BLACK:
        return {"skipped": "both pictures are black"}
    if reference < BLACK:
        return {"failed": f"only Cycles' picture is black: ours has a mean of {ours:.3g}"}
    means = [abs(x1.mean() - x2.mean()) / 2 / x.mean() for x1, x2, x in ((a1, a2, b1), (b1, b2, b1))]
    of = [[blocks(picture) for picture in pictures] for pictures in (a, b)]
    total = (of[1][0] + of[1][1]).sum() / 2
    share = lambda values: round(float(abs(values).sum() / total), 5) if total > 0 else None
    found = {"mean": round(float(ours / reference), 5), "mean_noise": round(float(np.hypot(*means)), 5)}
    found["blocks"] = share((of[0][0] + of[0][1] - of[1][0] - of[1][1]) / 2)
    found |= {f"variance_{name}": variance(x) for name, x in (("ours", a), ("cycles", b))}
    return found | {f"noise_{name}": share((x[0] - x[1]) / 2) for name, x in zip(("ours", "cycles"), of)}


def variance(pictures):
    """The mean variance of the displayed values of a picture, by two seeds."""
    displayed = [np.clip(np.where(x < 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0) ** (1 / 2.4) - 0.055), 0, 1) for x in pictures]
    return float(((displayed[0] - displayed[1]) ** 2).mean() / 2)


def speed(row):
    """The speed at equal error, relative to Cycles; None where undefined."""
    ours, reference = (row.get(f"variance_{of}", 0) * row.get(f"{of}_render_cpu", 0) for of in ("ours", "cycles"))
    return reference / ours if ours > 0 and reference > 0 else None


def compare(path, out, cycles, width, samples):
    """The row of a file."""
    row = {"name": path.stem, "program": PROGRAM} | theirs(path, cycles, width, samples)
    if {"failed", "skipped"} & set(row):
        return row
    row |= ours(path, out, row["size"], samples)
    if "failed" in row:
        return row
    read = lambda folder: zip(*(colors(folder / f"{path.stem}.{seed}.exr") for seed in SEEDS))
    (a, bad_ours), (b, bad_cycles) = read(out), read(cycles)
    return row | {"no_numbers_ours": max(bad_ours), "no_numbers_cycles": max(bad_cycles)} | measure(a, b)


def rows_of(out):
    """The latest row of each file."""
    path = out / "rows.jsonl"
    lines = path.read_text().splitlines() if path.exists() else []
    return {row["name"]: row for row in map(json.loads, lines)}


def table(title, rows, common):
    print(f"\n## {title}: {len(rows)}\n\n| File | mean | blocks | noise ours, Cycles | CPU ours (render), Cycles | messages |\n|---|---:|---:|---:|---:|---|")
    percent = lambda value: "" if value is None else f"{100 * value:.1f} %"
    for row in rows:
        messages = [text for text in map(opening, row.get("warnings", []) + row.get("notes", [])) if text not in common]
        noise = f"{percent(row.get('noise_ours'))}, {percent(row.get('noise_cycles'))}"
        time = f"{row['ours_cpu']:.1f} s ({row.get('ours_render_cpu', float('nan')):.1f} s), {row['cycles_cpu']:.1f} s"
        print(f"| {row['name']} | {row['mean']:.4f} | {percent(row['blocks'])} | {noise} | {time} | {'; '.join(messages)} |")


def speeds(rows):
    """The table of speeds at equal error."""
    found = sorted(((speed(row), row) for row in rows if speed(row) is not None), key=lambda entry: entry[0])
    values = np.array([value for value, _ in found] or [1.0])
    print(f"\n## speed at equal error: median {np.median(values):.2f}, geometric mean {np.exp(np.log(values).mean()):.2f}, of {len(found)}\n")
    print("| File | mean | blocks | render CPU ours, Cycles | variance ours / Cycles | speed |\n|---|---:|---:|---:|---:|---:|")
    for value, row in found:
        time = f"{row['ours_render_cpu']:.2f} s, {row['cycles_render_cpu']:.2f} s"
        ratio = row["variance_ours"] / row["variance_cycles"]
        print(f"| {row['name']} | {row['mean']:.4f} | {100 * (row['blocks'] or 0):.1f} % | {time} | {ratio:.3f} | {value:.2f} |")


def opening(text):
    """The first words of a message."""
    return " ".join(text.split()[:WORDS])


def error(row):
    """How far a file exceeds the bounds; up to 1 it is within."""
    return max(abs(row["mean"] - 1) / BOUNDS["mean"], (row["blocks"] or 0) / BOUNDS["blocks"])


def summary(out):
    rows = list(rows_of(out).values())
    compared = [row for row in rows if "mean" in row and "failed" not in row]
    outside = sorted((row for row in compared if error(row) > 1), key=error, reverse=True)
    slow = [row for row in compared if row["ours_cpu"] > SLOW * row["cycles_cpu"]]
    in_mean = sum(abs(row["mean"] - 1) <= BOUNDS["mean"] for row in compared)
    noisy = sum((row["blocks"] or 0) < 2 * np.hypot(row["noise_ours"] or 0, row["noise_cycles"] or 0) for row in outside)
    bounds = f"mean within {100 * BOUNDS['mean']:.0f} %"
    print(f"{len(rows)} files, {len(compared)} compared: {in_mean} {bounds}, {len(compared) - len(outside)} and blocks within {100 * BOUNDS['blocks']:.0f} %")
    print(f"{noisy} of the {len(outside)} others have a difference of less than twice the noise")
    print(f"processor time: ours {sum(r['ours_cpu'] for r in compared):.0f} s, Cycles {sum(r['cycles_cpu'] for r in compared):.0f} s")
    for kind in ("skipped", "failed"):
        found = sorted((row for row in rows if kind in row), key=lambda row: row[kind])
        print(f"\n## {kind}: {len(found)}\n")
        print("\n".join(f"- {row['name']}: {row[kind]}" for row in found))
    # What most files are told tells nothing of one.
    count = collections.Counter(text for row in compared for text in set(map(opening, row["warnings"] + row["notes"])))
    common = {text for text, n in count.items() if 2 * n > len(compared)}
    common |= {text for text in count if text.startswith(("is set up for", "light ends where"))}
    table("out of bounds", outside, common)
    speeds(compared)
    table(f"more than {SLOW} times Cycles' processor time", sorted(slow, key=lambda r: r["cycles_cpu"] / r["ours_cpu"]), common)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--summary", type=Path, metavar="OUT")
    parser.add_argument("folders", type=Path, nargs="*", metavar="FOLDER OUT CYCLES")
    parser.add_argument("--samples", type=int, default=32)
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--only", nargs="+", metavar="NAME")
    parser.add_argument("--again", action="store_true", help="also files that have a row")
    options = parser.parse_args()
    if options.summary:
        return summary(options.summary)
    if len(options.folders) != 3:
        parser.error("FOLDER, OUT and CYCLES are needed")
    folder, out, cycles = (path.resolve() for path in options.folders)
    for path in (out, cycles):
        path.mkdir(parents=True, exist_ok=True)
    done = {} if options.again else rows_of(out)
    # By a hash of their names: the first files are as mixed as all.
    order = lambda path: hashlib.sha256(path.stem.encode()).digest()
    for path in sorted(folder.glob("*.blend"), key=order):
        if path.stem in done or (options.only and path.stem not in options.only):
            continue
        row = compare(path, out, cycles, options.width, options.samples)
        with open(out / "rows.jsonl", "a") as file:
            file.write(json.dumps(row) + "\n")
        result = row.get("failed") or row.get("skipped") or f"mean {row['mean']:.4f}, blocks {row['blocks']}"
        print(f"{path.stem}: {result}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--blender"]:
        in_blender(*sys.argv[2:])
    main()
    sys.stdout.flush()
    os._exit(0)
