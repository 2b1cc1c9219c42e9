"""The components of the program as a CycloneDX 1.5 list: every crate that it contains, with version, licence and checksum.

python3 tools/packaging/components.py > oscura.cdx.json
"""

import json
import pathlib
import subprocess
import sys
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]


def metadata():
    """What Cargo knows of the dependencies on this platform."""
    host = next(line.split()[1] for line in _run("rustc", "-vV").splitlines() if line.startswith("host:"))
    return json.loads(_run("cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", host))


def contained(found):
    """Ids of the packages that are in the program: reached without build and test dependencies."""
    nodes = {node["id"]: node for node in found["resolve"]["nodes"]}
    root = next(package["id"] for package in found["packages"] if package["name"] == "oscura")
    reached, left = set(), [root]
    while left:
        here = left.pop()
        if here not in reached:
            reached.add(here)
            kinds = nodes[here]["deps"]
            left += [dep["pkg"] for dep in kinds if any(kind["kind"] is None for kind in dep["dep_kinds"])]
    return root, reached


def component(package, checksums):
    """The entry of a package."""
    name, version = package["name"], package["version"]
    entry = {"type": "library", "name": name, "version": version, "purl": f"pkg:cargo/{name}@{version}"}
    if package["license"]:
        entry["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
    checksum = checksums.get((name, version))
    if checksum:
        entry["hashes"] = [{"alg": "SHA-256", "content": checksum}]
    return entry


def main():
    found = metadata()
    locked = tomllib.loads((ROOT / "Cargo.lock").read_text())["package"]
    checksums = {(package["name"], package["version"]): package.get("checksum") for package in locked}
    root, reached = contained(found)
    packages = {package["id"]: package for package in found["packages"]}
    program = component(packages[root], checksums) | {"type": "application"}
    others = sorted((packages[id] for id in reached if id != root), key=lambda package: (package["name"], package["version"]))
    json.dump(
        {
            "bomFormat": "CycloneDX",
            "specVersion": "1.5",
            "version": 1,
            "metadata": {"component": program},
            "components": [component(package, checksums) for package in others],
        },
        sys.stdout,
        indent=1,
    )


def _run(*command):
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


main()
