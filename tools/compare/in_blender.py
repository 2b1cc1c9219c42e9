"""Files with all passes, opened in Blender: each pass that its compositor shows against what OpenEXR reads from the file, pixel by pixel,
and the mattes of Blender's own Cryptomatte node against the shares in the file, for each layout.

    python tools/compare/in_blender.py OUT [SCENE]

with a Python that has bpy (4.2 or newer), numpy and OpenEXR; says so and succeeds where they are missing. `OSCURA` names another
binary. Ends with 1 where something differs."""

import json
import os
import subprocess
import sys
from pathlib import Path

try:
    import bpy
    import numpy as np
    import OpenEXR
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(0)

from layers import MATTES, matte_id

ROOT = Path(__file__).resolve().parent.parent.parent
PROGRAM = os.environ.get("OSCURA", str(ROOT / "target/release/oscura"))
LAYOUTS = ("single", "multipart", "layers")
SIZE = (96, 72)
TOLERANCE = 1e-3  # of mattes
NEW = bpy.app.version >= (5, 0, 0)
# Passes of channels without a dot; the letters that files of Blender have by sockets; all letters in order.
SPECIAL = {**{letter: ("Combined", letter) for letter in "RGBA"}, "Z": ("Depth", "Z"), "samples": ("Samples", "X")}
LETTERS = {"VALUE": "V", "VECTOR": "XYZ", "RGBA": "RGBA"}
ORDER = "RGBAXYZWUV"
KINDS = {"VALUE": "FLOAT", "VECTOR": "VECTOR", "RGBA": "RGBA"}


def channels(path):
    """All channels of all parts by OpenEXR, the texts of all headers, and the passes: names -> planes in order of their letters."""
    found, texts, passes = {}, {}, {}
    for part in OpenEXR.File(str(path), separate_channels=True).parts:
        found |= {name: np.asarray(channel.pixels) for name, channel in part.channels.items()}
        texts |= {key: value for key, value in part.header.items() if isinstance(value, str)}
    for name, pixels in found.items():
        plain = name.removeprefix("ViewLayer.")
        owner, letter = SPECIAL.get(plain) or plain.rsplit(".", 1)
        passes.setdefault(owner.lower(), {})[letter] = pixels
    order = lambda letters: sorted(letters, key=lambda letter: ORDER.find(letter) if len(letter) == 1 else 0)
    return found, texts, {name: [of[letter] for letter in order(of)] for name, of in passes.items()}


class Compositor:
    """A compositing scene whose results are written to a multi-layer file."""

    def __init__(self, picture, target):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene, self.target = bpy.context.scene, target
        self.scene.render.resolution_x, self.scene.render.resolution_y = SIZE
        self.scene.camera = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
        self.scene.collection.objects.link(self.scene.camera)
        if NEW:
            self.tree = bpy.data.node_groups.new("mattes", "CompositorNodeTree")
            self.scene.compositing_node_group = self.tree
        else:
            self.scene.use_nodes = True
            self.tree = self.scene.node_tree
            self.tree.nodes.clear()
        self.image = bpy.data.images.load(str(picture))
        self.file = self.tree.nodes.new("CompositorNodeOutputFile")
        if NEW:
            self.file.directory, self.file.file_name = str(target.parent), target.name
            self.file.format.media_type = "MULTI_LAYER_IMAGE"
        else:
            self.file.base_path = str(target)
        self.file.format.file_format = "OPEN_EXR_MULTILAYER"
        self.file.format.color_depth, self.file.format.exr_codec = "32", "ZIP"
        (self.file.file_output_items if NEW else self.file.layer_slots).clear()

    def write(self, name, socket):
        """Asks for a socket as a layer of a name."""
        if NEW:
            self.file.file_output_items.new(KINDS[socket.type], name)
        else:
            self.file.layer_slots.new(name)
        self.tree.links.new(socket, self.file.inputs[name])

    def layers(self):
        """The names of the layers that Blender finds in the file; None for the one that it shows before a choice."""
        node = self.tree.nodes.new("CompositorNodeImage")
        node.image = self.image
        names = _choices(node, "layer")
        first = getattr(node, "layer", "")
        self.tree.nodes.remove(node)
        return names if first in names else [None, *names]

    def passes(self, layer):
        """The sockets of a layer."""
        node = self.tree.nodes.new("CompositorNodeImage")
        node.image = self.image
        if layer:
            node.layer = layer
        return [socket for socket in node.outputs if socket.enabled and not socket.is_unavailable]

    def mattes(self):
        """The names of the mattes that Blender's node finds."""
        return _choices(self._cryptomatte(), "layer_name")

    def matte(self, layer, name):
        """The socket of the matte of one name."""
        node = self._cryptomatte()
        node.layer_name, node.matte_id = layer, name
        return node.outputs["Matte"]

    def _cryptomatte(self):
        node = self.tree.nodes.new("CompositorNodeCryptomatteV2")
        node.source, node.image = "IMAGE", self.image
        return node

    def run(self):
        """Composites; gives the channels of the file by name."""
        before = set(self.target.parent.iterdir())
        bpy.ops.render.render()
        written = [path for path in self.target.parent.iterdir() if path not in before]
        assert len(written) == 1, f"Blender wrote {written}"
        found, _, _ = channels(written[0])
        written[0].unlink()
        # Blender writes small letters for mattes.
        return {".".join((name.rsplit(".", 1)[0], name.rsplit(".", 1)[1].upper())): plane for name, plane in found.items()}


def _choices(node, name):
    """The values of an enumeration, which only the error message of an invalid one lists."""
    try:
        setattr(node, name, "?")
    except TypeError as error:
        listed = str(error).rsplit("(", 1)[1].rstrip(")")
        return [word.strip(" '") for word in listed.split(",") if word.strip(" '")]
    return []


def difference(a, b):
    """The largest difference of two planes; NaNs of equal bits are equal."""
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    with np.errstate(invalid="ignore"):
        gap = np.where((a == b) | (np.isnan(a) & np.isnan(b)), 0.0, abs(a - b))
    return float(gap.max())


def check_passes(path, folder):
    """Compares all passes; returns their number and the differences."""
    _, _, truth = channels(path)
    compositor = Compositor(path, folder / "passes")
    asked, wrong = {}, []
    for layer in compositor.layers():
        for socket in compositor.passes(layer):
            name = f"p{len(asked)}"
            asked[name] = (socket.name.lower(), socket.type)
            compositor.write(name, socket)
    found = compositor.run()
    seen = set()
    for name, (title, kind) in asked.items():
        owner = {"rgba": "combined", "image": "combined"}.get(title, title)
        if title == "alpha":
            owner, planes = "combined", truth["combined"][3:]
        elif owner not in truth:
            wrong.append(f"{title}: the file has no such pass")
            continue
        else:
            planes = truth[owner]
            seen.add(owner)
        for letter, plane in zip(LETTERS[kind], planes):
            gap = difference(found[f"{name}.{letter}"], plane)
            if gap > 0:
                wrong.append(f"{title}.{letter}: {gap:.3g}")
    wrong += [f"{name}: not shown by Blender" for name in sorted(set(truth) - seen)]
    return len(seen), wrong


def check_mattes(path, folder):
    """Compares all mattes of all kinds; returns their number, the largest difference and missing ones."""
    planes, texts, _ = channels(path)
    compositor = Compositor(path, folder / "mattes")
    shown, expected, wrong = compositor.mattes(), {}, []
    for kind in MATTES:
        layer = next((name for name in shown if name.endswith(kind)), None)
        (manifest,) = [texts[f"{key.removesuffix('name')}manifest"] for key, value in texts.items() if key.startswith("cryptomatte/") and value.endswith(kind)]
        prefix = next(name for name in planes if name.endswith(f"{kind}00.R")).removesuffix("00.R")
        if layer is None:
            wrong.append(f"{kind}: not found by Blender's node")
            continue
        for name in json.loads(manifest):
            slot = f"m{len(expected)}"
            compositor.write(slot, compositor.matte(layer, name))
            expected[slot] = shares(planes, prefix, matte_id(name))
    if not expected:
        return 0, 0.0, wrong
    found = compositor.run()
    largest = max(difference(found[f"{slot}.V"], matte) for slot, matte in expected.items())
    if largest > TOLERANCE:
        wrong.append(f"mattes differ by {largest:.3g}")
    if not any(matte.max() > 0.5 for matte in expected.values()):
        wrong.append("all mattes are empty")
    return len(expected), largest, wrong


def shares(planes, prefix, wanted):
    """The coverage of an id in each pixel, by the file's ranks."""
    matte, level = np.zeros((SIZE[1], SIZE[0])), 0
    while f"{prefix}{level:02}.R" in planes:
        for id_name, share in ("RG", "BA"):
            ids = np.ascontiguousarray(planes[f"{prefix}{level:02}.{id_name}"]).view(np.uint32)
            matte += np.where(ids == wanted, planes[f"{prefix}{level:02}.{share}"], 0)
        level += 1
    return matte


def main(folder, scene):
    folder.mkdir(parents=True, exist_ok=True)
    lines, failed = [], False
    for layout in LAYOUTS:
        path = folder / f"{layout}.exr"
        size = ["--width", str(SIZE[0]), "--height", str(SIZE[1])]
        command = [PROGRAM, "render", scene, "-o", str(path), "--aov", "all", "--light-groups", "--spp", "16", "--quiet", "--exr-layout", layout, *size]
        subprocess.run(command, check=True)
        passes, wrong = check_passes(path, folder)
        mattes, largest, missing = check_mattes(path, folder)
        lines.append(f"| {layout} | {passes} | {mattes} | {largest:.1g} | {'; '.join(wrong + missing) or 'nothing'} |")
        failed |= bool(wrong or missing)
    print(f"Blender {bpy.app.version_string}\n\n| Layout | passes | mattes | largest difference of a matte | what differs |\n|---|---:|---:|---:|---|")
    print("\n".join(lines), flush=True)
    # The module `bpy` may hang at exit.
    os._exit(1 if failed else 0)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else str(ROOT / "scenes/cornell-spheres.toml"))
