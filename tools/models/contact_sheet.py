#!/usr/bin/env python3
"""Renders forty models by `oscura render MODEL -o PICTURE` and lays them on one sheet, with a table of measurements.

    contact_sheet.py OSCURA DATA OUT [--size 256] [--spp 32] [--plain]

DATA is a folder with `models` and `blender`; models that are not there are skipped. Others are made: things that lie on their
back, flat, thin, tiny and huge, far from the origin, points, painted and open ones.
Measured by a second picture without ground on a transparent background: how much of the room between margins of a tenth
of the shorter side the model fills, how even the margins are, and how many of its pixels have a channel at 255. Whether
the right axis is up is taken from the program's note, where the format leaves it open. `--plain` is for programs that
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
    found = [(n, of('models', n + '.obj'), 'y', []) for n in SCANS]
    found += [('teapot', of('models/teapot.ply'), 'z', []), ('torus', os.path.join(HERE, '../../scenes/meshes/torus.ply'), 'y', [])]
    found += [(n, of('models', n + '.glb'), None, []) for n in ('DamagedHelmet', 'ExplodingBarrel', 'seagulf')]

    def make(name, mesh, up, ending):
        path = os.path.join(made, name + ending)
        shapes.write(path, shapes.z_up(mesh) if up == 'z' else mesh)
        found.append((name, path, up, []))

    read = {n: shapes.read(of('models', n + '.obj')) for n in SCANS if os.path.exists(of('models', n + '.obj'))}
    for i, n in enumerate(['beetle', 'cow', 'spot', 'stanford-bunny', 'suzanne']):
        if n in read:
            make(n + '-z', read[n], 'z', '.ply' if i % 2 else '.obj')
    for n, up, ending in [('chair', 'z', '.ply'), ('table', 'y', '.obj'), ('stairs', 'z', '.ply'), ('vase', 'y', '.obj'), ('pawn', 'z', '.ply'),
                          ('bust', 'z', '.ply'), ('tile', 'y', '.obj'), ('plant', 'z', '.obj'), ('bracket', 'z', '.obj'), ('gear', 'z', '.obj'), ('bowl', 'y', '.ply')]:
        make(n, getattr(shapes, n)(), up, ending)
    make('tile-z', shapes.tile(), 'z', '.ply')
    make('plant-y', shapes.plant(), 'y', '.ply')
    make('terrain-utm', shapes.moved(shapes.terrain(), to=(512345.25, 312.5, -4512345.75)), 'z', '.ply')
    if len(read) == len(SCANS):
        make('tiny', shapes.moved(read['stanford-bunny'], 1e-5), 'y', '.obj')
        make('huge', shapes.moved(read['cow'], 1e6), 'z', '.ply')
        make('utm', shapes.moved(read['spot'], to=(512345.25, 312.5, -4512345.75)), 'z', '.ply')
        make('points', (read['stanford-bunny'][0], []), 'y', '.ply')
        make('points-painted', (shapes.painted(read['spot'])[0], []), 'z', '.ply')
        make('painted', shapes.painted(read['cow']), 'y', '.obj')
        make('open-scan', shapes.cut(read['suzanne']), 'z', '.ply')
    found += [(n, of('blender', f), None, ['--node', node]) for n, f, node in [
        ('ball', 'materials.glb', 'Sphere.006'), ('glass', 'glass.glb', 'Sphere')]]
    return [m for m in found if os.path.exists(m[1])]


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
    print('| model | up | note | fill | off middle | clipped |\n|---|---|---|---:|---:|---:|')
    for name, path, up, more in models(args.data, os.path.join(args.out, 'made')):
        picture, mask = (os.path.join(args.out, name + end) for end in ('.png', '.mask.png'))
        code, log = shoot(args.program, path, picture, args.size, more + ['--spp', str(args.spp)])
        if code:
            print(f'| {name} | failed: {log.strip().splitlines()[-1]} |')
            continue
        tiles.append((name, picture))
        if args.plain:
            continue
        found = re.search(r'(\S+) points up', log)
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
