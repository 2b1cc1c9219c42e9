#!/usr/bin/env python3
"""Renders forty models by `oscura render MODEL -o PICTURE` and lays them on one sheet, with a table of measurements.

    contact_sheet.py OSCURA DATA OUT [--size 256] [--spp 32] [--plain]

DATA is a folder with `models`, `asset-generator`, `extensions` and `blender`; models that are not there are skipped.
Measured by a second picture without ground on a transparent background: how much of the room between margins of a tenth
of the shorter side the model fills, how even the margins are, and how many of its pixels have a channel at 255. Whether
the right axis is up is told by the program's note, where the format leaves it open. `--plain` is for programs that
have no stage: the sheet alone.
Needs Pillow and numpy.
"""
import argparse
import os
import re
import subprocess
import numpy
from PIL import Image, ImageDraw
import shapes

HERE = os.path.dirname(os.path.abspath(__file__))
SCANS = ['beetle', 'cow', 'spot', 'stanford-bunny', 'suzanne', 'fandisk', 'alligator']


def models(data, made):
    """Name, file, axis that is up (None where the format says it), further arguments."""
    os.makedirs(made, exist_ok=True)
    of = lambda *parts: os.path.join(data, *parts)
    torus = os.path.join(HERE, '../../scenes/meshes/torus.ply')
    all = [(n, of('models', n + '.obj'), 'y', []) for n in SCANS]
    all += [('teapot', of('models/teapot.ply'), 'z', []), ('torus', torus, 'y', [])]
    all += [(n, of('models', n + '.glb'), None, []) for n in ('DamagedHelmet', 'ExplodingBarrel', 'seagulf')]
    for i, n in enumerate(SCANS):
        source = of('models', n + '.obj')
        path = os.path.join(made, n + '-z' + ('.ply' if i % 2 else '.obj'))
        if os.path.exists(source):
            shapes.write(path, shapes.z_up(shapes.read(source)))
        all.append((n + '-z', path, 'z', []))
    if os.path.exists(of('models/teapot.ply')):
        shapes.write(os.path.join(made, 'teapot-y.ply'), shapes.y_up(shapes.read(of('models/teapot.ply'))))
    all.append(('teapot-y', os.path.join(made, 'teapot-y.ply'), 'y', []))
    for n in ('chair', 'table', 'stairs', 'vase', 'pawn', 'terrain'):
        mesh, z = getattr(shapes, n)(), n in ('chair', 'stairs', 'pawn', 'terrain')
        path = os.path.join(made, n + ('-z.ply' if z else '.obj'))
        shapes.write(path, shapes.z_up(mesh) if z else mesh)
        all.append((n, path, 'z' if z else 'y', []))
    ball = lambda n: ('ball' + n, of('blender/materials.glb'), None, ['--node', 'Sphere.' + n])
    all += [ball(n) for n in ('001', '003', '004', '006', '007')]
    all += [('glass', of('blender/glass.glb'), None, ['--node', 'Sphere']), ('cube', of('blender/glass.glb'), None, ['--node', 'Cube'])]
    all += [(n, of(p), None, []) for n, p in [
        ('BoxDraco', 'extensions/BoxDraco.gltf'), ('BoxMeshopt', 'extensions/BoxMeshopt.glb'),
        ('Material_07', 'asset-generator/Material/Material_07.gltf'),
        ('NegativeScale', 'asset-generator/Node_NegativeScale/Node_NegativeScale_02.gltf'),
        ('NegativeScale_5', 'asset-generator/Node_NegativeScale/Node_NegativeScale_05.gltf'),
        ('Animation', 'asset-generator/Animation_Node/Animation_Node_00.gltf'),
        ('Primitives', 'asset-generator/Mesh_Primitives/Mesh_Primitives_00.gltf')]]
    return [m for m in all if os.path.exists(m[1])]


def shoot(program, path, out, size, more):
    command = [program, 'render', path, '-o', out, '--width', str(size), '--height', str(size)] + more
    done = subprocess.run(command, capture_output=True, text=True)
    return done.returncode, done.stderr


def measure(picture, mask):
    """Fill of the room, evenness (largest shift of the middle, share of the side), share of clipped pixels."""
    rgb, alpha = numpy.asarray(Image.open(picture).convert('RGB')), Image.open(mask)
    alpha = numpy.asarray(alpha.getchannel('A')) if alpha.mode == 'RGBA' else numpy.full(rgb.shape[:2], 255)
    ys, xs = numpy.nonzero(alpha > 127)
    side = alpha.shape[0]
    low, high = (xs.min() / side, ys.min() / side), ((xs.max() + 1) / side, (ys.max() + 1) / side)
    fill = max(h - l for l, h in zip(low, high)) / 0.8
    shift = max(abs(l + h - 1) / 2 for l, h in zip(low, high))
    pixels = rgb[alpha > 127]
    return fill, shift, (pixels.max(1) == 255).mean(), alpha[[0, -1]].max() > 0 or alpha[:, [0, -1]].max() > 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ('program', 'data', 'out'):
        parser.add_argument(name)
    parser.add_argument('--size', type=int, default=256)
    parser.add_argument('--spp', type=int, default=32)
    parser.add_argument('--plain', action='store_true')
    args = parser.parse_args()
    os.makedirs(args.out, exist_ok=True)
    tiles, right, asked, worst = [], 0, 0, 0.0
    print('| model | up | said | fill | off middle | clipped |\n|---|---|---|---:|---:|---:|')
    for name, path, up, more in models(args.data, os.path.join(args.out, 'made')):
        picture, mask = (os.path.join(args.out, name + end) for end in ('.png', '.mask.png'))
        code, said = shoot(args.program, path, picture, args.size, more + ['--spp', str(args.spp)])
        if code:
            print(f'| {name} | failed: {said.strip().splitlines()[-1]} |')
            continue
        tiles.append((name, picture))
        if args.plain:
            continue
        found = re.search(r'(\S+) points up', said)
        guess = found.group(1) if found else ('y' if up else '')
        asked, right = asked + 1, right + (guess == (up or ''))
        shoot(args.program, path, mask, args.size, more + ['--spp', '4', '--background', 'transparent', '--ground', 'none'])
        fill, shift, clipped, touches = measure(picture, mask)
        worst = max(worst, clipped)
        note = ' touches the edge' if touches else ''
        wrong = '' if guess == (up or '') else ' WRONG'
        print(f'| {name} | {up or "format"} | {guess or "-"}{wrong} | {fill:.2f}{note} | {shift:.3f} | {100 * clipped:.2f} % |', flush=True)
    if not args.plain:
        print(f'\n{len(tiles)} models; up right for {right} of {asked}; clipped at most {100 * worst:.2f} %')
    columns = 8
    rows = -(-len(tiles) // columns)
    sheet = Image.new('RGB', (columns * args.size, rows * args.size))
    for i, (name, picture) in enumerate(tiles):
        image = Image.open(picture).convert('RGB')
        ImageDraw.Draw(image).text((4, 2), name, fill=(20, 20, 20))
        sheet.paste(image, (i % columns * args.size, i // columns * args.size))
    sheet.save(os.path.join(args.out, 'sheet.png'))


main()
