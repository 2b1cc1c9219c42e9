"""Writing 1920 x 1080 pixels with 20 channels (ZIP) against OpenEXR's own library, on one thread and on all.

    cargo build --release -p oscura-bench
    python tools/bench/writing.py OUT

needs `pip install OpenEXR numpy`; says so and succeeds where they are missing. Both encode the same pixels into memory; the best
of some times counts. Ours makes the channels from the film's sums, too."""

import io
import json
import os
import subprocess
import sys
import time

try:
    import numpy as np
    import OpenEXR
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(0)

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
TOOL = os.environ.get("WRITING", os.path.join(ROOT, "target", "release", "writing"))
REPEAT = 5


def theirs(path, threads):
    """Seconds and bytes of OpenEXR for the pixels of a file."""
    OpenEXR.set_global_thread_count(threads if threads > 1 else 0)
    file = OpenEXR.File(path, separate_channels=True)
    channels = {name: np.ascontiguousarray(channel.pixels) for name, channel in file.channels().items()}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    seconds = []
    for _ in range(REPEAT):
        stream = io.BytesIO()
        copy = OpenEXR.File(dict(header), dict(channels))
        start = time.perf_counter()
        copy.write(stream)
        seconds.append(time.perf_counter() - start)
    return min(seconds), len(stream.getvalue()), len(channels)


def main(out):
    os.makedirs(out, exist_ok=True)
    path = os.path.join(out, "writing.exr")
    print("| Threads | oscura, s | OpenEXR, s | ratio | oscura, MB | OpenEXR, MB |\n|---:|---:|---:|---:|---:|---:|")
    for threads in sorted({1, os.cpu_count()}):
        command = [TOOL, path, "--threads", str(threads), "--repeat", str(REPEAT)]
        ours = json.loads(subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout)
        seconds, size, channels = theirs(path, threads)
        assert channels == ours["channels"] == 20, (channels, ours["channels"])
        best = min(ours["seconds"])
        print(f"| {threads} | {best:.3f} | {seconds:.3f} | {best / seconds:.2f} | {ours['bytes'] / 1e6:.1f} | {size / 1e6:.1f} |")


if __name__ == "__main__":
    main(sys.argv[1])
