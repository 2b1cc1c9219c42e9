"""Pictures of what commands of the guide make, side by side: python strips.py PROGRAM MODEL FOLDER

Writes FOLDER/scan-strip.jpg (MODEL's normals, its picture, frames of its turntable) and FOLDER/denoise.jpg (a scene of this repository
before and after denoising). Needs Pillow.
"""

import pathlib
import subprocess
import sys
import tempfile

from PIL import Image, ImageDraw

ROOT = pathlib.Path(__file__).resolve().parents[2]
PANEL = (300, 300)
GAP = 6
LARGEST = 200_000


def run(program, *arguments):
    subprocess.run([str(program), *map(str, arguments)], check=True)


def strip(pictures, path):
    """Pictures of one height, with gaps of white between them."""
    pictures = [picture.convert("RGB") for picture in pictures]
    width = sum(picture.width for picture in pictures) + GAP * (len(pictures) - 1)
    row = Image.new("RGB", (width, pictures[0].height), "white")
    x = 0
    for picture in pictures:
        row.paste(picture, (x, 0))
        x += picture.width + GAP
    row.save(path, quality=85, optimize=True)
    assert path.stat().st_size < LARGEST, f"{path} has {path.stat().st_size} bytes"


def scan(program, model, folder, path):
    size = ["--size", "{}x{}".format(*PANEL)]
    exr, normals, turn = folder / "scan.exr", folder / "normals.png", folder / "turn.####.png"
    run(program, model, "-o", exr, "-o", folder / "scan.png", "--aov", "normal", "--noise", "3", "--denoise", *size)
    run(program, "convert", exr, "--layer", "normal", "-o", normals)
    run(program, model, "-o", turn, "--orbit", "8", "--noise", "6", "--denoise", *size)
    frames = sorted(folder.glob("turn.*.png"))[1::2]
    strip([Image.open(name) for name in [normals, folder / "scan.png", *frames]], path)


def denoiser(program, folder, path):
    scene, size = ROOT / "scenes/rings.toml", ["--size", "480x270"]
    names = [("16 samples per pixel", ["--spp", "16", "--no-denoise"]), ("the same, denoised", ["--spp", "16", "--denoise"])]
    pictures = []
    for i, (name, how) in enumerate(names):
        png = folder / f"{i}.png"
        run(program, scene, "-o", png, *size, *how)
        picture = Image.open(png).convert("RGB")
        ImageDraw.Draw(picture).text((8, 252), name, fill="white", stroke_width=2, stroke_fill="black")
        pictures.append(picture)
    strip(pictures, path)


def main():
    program, model, out = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
    with tempfile.TemporaryDirectory() as folder:
        scan(program, model, pathlib.Path(folder), out / "scan-strip.jpg")
        denoiser(program, pathlib.Path(folder), out / "denoise.jpg")


if __name__ == "__main__":
    main()
