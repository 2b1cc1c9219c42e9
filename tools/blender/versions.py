"""The exporter's tests with several versions of Blender, as a table.

    python versions.py FOLDER [--blender 4.2.0 4.5.3 5.0.1] [--python python3.11] [--only test_nodes ...]

Each version is the module `bpy` in a virtual environment of its own in FOLDER, made where there is none: with a wheel in FOLDER/wheels,
else by pip. `--python` needs the version that the modules are built for. `OSCURA` names the program. Logs stay in FOLDER; the exit code
is 1 if a test failed.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
INDEX = "https://download.blender.org/pypi/"
TIMEOUT = 3600  # seconds for a file of tests


def environment(folder, version, python):
    """The Python of a version."""
    home = folder / f"bpy-{version}"
    own = home / "bin/python"
    if not own.exists():
        subprocess.run([python, "-m", "venv", home], check=True)
        subprocess.run([own, "-m", "pip", "install", "--quiet", "--find-links", folder / "wheels", "--extra-index-url", INDEX, f"bpy=={version}"], check=True)
    return own


def run(python, test, log):
    """Runs a file of tests; gives how it ended."""
    began = time.monotonic()
    with open(log, "w") as output:
        variables = {**os.environ, "OSCURA_BLENDER": str(python)}
        try:
            code = subprocess.run([python, test], stdin=subprocess.DEVNULL, stdout=output, stderr=output, env=variables, cwd=HERE, timeout=TIMEOUT).returncode
        except subprocess.TimeoutExpired:
            return f"longer than {TIMEOUT} s"
    text = log.read_text(errors="replace")
    failed = sorted(set(re.findall(r"^(?:FAIL|ERROR): (\w+)", text, re.M)))
    count = re.search(r"^Ran (\d+) tests?", text, re.M)
    if code == 0 and count:
        return f"{count[1]} pass, {time.monotonic() - began:.0f} s"
    return ", ".join(failed) or f"ended with {code}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--blender", nargs="+", default=["4.2.0", "4.5.3", "5.0.1"], metavar="VERSION")
    parser.add_argument("--python", default="python3.11")
    parser.add_argument("--only", nargs="+", metavar="TEST")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    folder = options.folder.resolve()
    pythons = {version: environment(folder, version, options.python) for version in options.blender}
    tests = [path for path in sorted(HERE.glob("test_*.py")) if not options.only or path.stem in options.only]
    print(f"| Tests | {' | '.join(pythons)} |\n|---|{'---|' * len(pythons)}", flush=True)
    is_good = True
    for test in tests:
        ends = [run(python, test, folder / f"{test.stem}-{version}.log") for version, python in pythons.items()]
        is_good &= all(" pass, " in end for end in ends)
        print(f"| {test.stem} | {' | '.join(ends)} |", flush=True)
    sys.exit(0 if is_good else 1)


if __name__ == "__main__":
    main()
