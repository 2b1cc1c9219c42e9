"""Simple triangle meshes with a known up axis; and copies of meshes with another up axis."""
import math


def box(low, high):
    (x0, y0, z0), (x1, y1, z1) = low, high
    v = [(x, y, z) for x in (x0, x1) for y in (y0, y1) for z in (z0, z1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return v, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]


def join(parts):
    vertices, faces = [], []
    for v, f in parts:
        first = len(vertices)
        vertices += v
        faces += [tuple(first + i for i in t) for t in f]
    return vertices, faces


def lathe(profile, steps=48):
    """A profile of (radius, height), revolved about y."""
    vertices = []
    for r, y in profile:
        vertices += [(r * math.cos(2 * math.pi * k / steps), y, r * math.sin(2 * math.pi * k / steps)) for k in range(steps)]
    faces = []
    for i in range(len(profile) - 1):
        for k in range(steps):
            a, b = i * steps + k, i * steps + (k + 1) % steps
            faces += [(a, a + steps, b), (b, a + steps, b + steps)]
    return vertices, faces


def chair():
    legs = [box((x, 0, z), (x + 0.05, 0.45, z + 0.05)) for x in (-0.25, 0.2) for z in (-0.25, 0.2)]
    return join(legs + [box((-0.25, 0.45, -0.25), (0.25, 0.5, 0.25)), box((-0.25, 0.5, -0.25), (0.25, 1.0, -0.2))])


def table():
    legs = [box((x, 0, z), (x + 0.08, 0.7, z + 0.08)) for x in (-0.8, 0.72) for z in (-0.45, 0.37)]
    return join(legs + [box((-0.85, 0.7, -0.5), (0.85, 0.76, 0.5))])


def stairs():
    return join([box((-0.5, 0, -0.2 * k - 0.2), (0.5, 0.18 * (k + 1), -0.2 * k)) for k in range(8)])


def vase():
    return lathe([(0.0, 0.0), (0.3, 0.0), (0.5, 0.4), (0.48, 0.7), (0.2, 1.0), (0.22, 1.25), (0.3, 1.3), (0.27, 1.3), (0.17, 1.0)])


def pawn():
    ball = [(0.22 * math.sin(a), 1.2 - 0.22 * math.cos(a)) for a in [0.4 + k * (math.pi - 0.4) / 10 for k in range(11)]]
    return lathe([(0.0, 0.0), (0.42, 0.0), (0.42, 0.12), (0.3, 0.2), (0.16, 0.5), (0.12, 0.9), (0.2, 0.95), (0.1, 1.0)] + ball)


def terrain(n=80):
    height = lambda x, y: 8 * math.sin(x / 9) * math.cos(y / 13) + 3 * math.sin(x / 3.1 + y / 4.3)
    vertices = [(x, height(x, z), -z) for z in range(n) for x in range(n)]
    at = lambda x, z: z * n + x
    faces = []
    for z in range(n - 1):
        for x in range(n - 1):
            faces += [(at(x, z), at(x + 1, z), at(x + 1, z + 1)), (at(x, z), at(x + 1, z + 1), at(x, z + 1))]
    return vertices, faces


def tile(n=60):
    """A flat relief on a slab, 30 cm wide and 1 cm thick."""
    vertices, faces = box((0, 0, 0), (0.3, 0.008, 0.3))
    first, side = len(vertices), 0.3 / n
    wave = lambda x, z: 0.002 * math.sin(40 * x) * math.sin(40 * z) + 0.0085
    vertices += [(i * side, wave(i * side, k * side), k * side) for k in range(n + 1) for i in range(n + 1)]
    at = lambda i, k: first + k * (n + 1) + i
    for k in range(n):
        for i in range(n):
            faces += [(at(i, k), at(i, k + 1), at(i + 1, k)), (at(i + 1, k), at(i, k + 1), at(i + 1, k + 1))]
    return vertices, faces


def plant(leaves=26):
    """A thin stem with single-sided leaves."""
    parts = [lathe([(0.006, 0), (0.004, 0.9)], 8)]
    for i in range(leaves):
        turn, y, long = 2.4 * i, 0.15 + 0.75 * i / leaves, 0.32 - 0.22 * i / leaves
        c, s = math.cos(turn), math.sin(turn)
        place = lambda out, up, side: (out * c - side * s, y + up, out * s + side * c)
        parts.append(([place(0, 0, 0), place(long / 2, long / 3, 0.035), place(long / 2, long / 3, -0.035), place(long, long / 4, 0)],
                      [(0, 1, 2), (1, 3, 2)]))
    return join(parts)


def bust():
    """Shoulders, neck and a head with a nose, that looks along +z."""
    body = lathe([(0.0, 0.0), (0.2, 0.0), (0.2, 0.06), (0.12, 0.1), (0.12, 0.16), (0.3, 0.3), (0.33, 0.4), (0.12, 0.5), (0.09, 0.62)])
    body = [(x, y, 0.6 * z) for x, y, z in body[0]], body[1]
    head = lathe([(0.14 * math.sin(a), 0.76 - 0.19 * math.cos(a)) for a in [k * math.pi / 16 for k in range(17)]])
    nose = [(0, 0.83, 0.13), (-0.03, 0.73, 0.13), (0.03, 0.73, 0.13), (0, 0.74, 0.19)], [(0, 1, 3), (0, 3, 2), (1, 2, 3)]
    return join([body, head, nose])


def bracket():
    """A mechanical part, in millimetres: a bracket with a rib and two bosses."""
    rib = [(35, 8, -8), (35, 60, -8), (35, 8, -60), (45, 8, -8), (45, 60, -8), (45, 8, -60)], [
        (0, 1, 2), (3, 5, 4), (1, 4, 5), (1, 5, 2), (0, 3, 4), (0, 4, 1), (0, 2, 5), (0, 5, 3)]
    boss = lambda x: ([(x + a, b, c - 40) for a, b, c in lathe([(9, 8), (9, 16), (5, 16), (5, 8)])[0]], lathe([(9, 8), (9, 16), (5, 16), (5, 8)])[1])
    return join([box((0, 0, -80), (80, 8, 0)), box((0, 8, -8), (80, 70, 0)), rib, boss(17), boss(63)])


def gear(teeth=18):
    """A gear with a hole, in millimetres."""
    ring = []
    for k in range(4 * teeth):
        a, r = 2 * math.pi * k / (4 * teeth), 40 if k % 4 < 2 else 34
        ring.append((r * math.cos(a), r * math.sin(a), 10 * math.cos(a), 10 * math.sin(a)))
    vertices = [p for x, z, u, w in ring for p in ((x, 0, z), (x, 9, z), (u, 0, w), (u, 9, w))]
    faces, n = [], len(ring)
    for k in range(n):
        a, b = 4 * k, 4 * ((k + 1) % n)
        for p, q in ((0, 1), (1, 3), (3, 2), (2, 0)):
            faces += [(a + p, a + q, b + p), (a + q, b + q, b + p)]
    return vertices, faces


def bowl():
    """An open shell without thickness."""
    return lathe([(0.3, 0.0)] + [(math.sin(a), 1.02 - math.cos(a)) for a in [0.35 + k * 1.2 / 16 for k in range(17)]])


def cut(mesh, share=0.25):
    """An incomplete scan: its lowest part is missing, and its inside is visible."""
    vertices, faces = mesh
    low, high = min(v[1] for v in vertices), max(v[1] for v in vertices)
    return vertices, [f for f in faces if all(vertices[i][1] > low + share * (high - low) for i in f)]


def moved(mesh, scale=1, to=(0, 0, 0)):
    return [tuple(scale * x + t for x, t in zip(v, to)) for v in mesh[0]], mesh[1]


def painted(mesh):
    """Vertices coloured by position, from 0 to 1."""
    low = [min(v[c] for v in mesh[0]) for c in range(3)]
    high = [max(v[c] for v in mesh[0]) for c in range(3)]
    share = lambda v, c: (v[c] - low[c]) / (high[c] - low[c] or 1)
    return [v + (0.25 + 0.6 * share(v, 1), 0.3 + 0.4 * share(v, 0), 0.75 - 0.5 * share(v, 2)) for v in mesh[0]], mesh[1]


def z_up(mesh):
    """The same with z up: lying on its back in a y-up system."""
    vertices, faces = mesh
    return [(v[0], -v[2], v[1]) + v[3:] for v in vertices], faces


def y_up(mesh):
    vertices, faces = mesh
    return [(x, z, -y) for x, y, z in vertices], faces


def read(path):
    """Vertices and triangles of an OBJ or of an ascii PLY file of triangles; other contents are ignored."""
    vertices, faces = [], []
    lines = open(path, errors='replace').read().splitlines()
    if path.endswith('.ply'):
        start = lines.index('end_header') + 1
        count = next(int(l.split()[2]) for l in lines if l.startswith('element vertex'))
        rows = [l.split() for l in lines[start:] if l.strip()]
        vertices = [tuple(map(float, r[:3])) for r in rows[:count]]
        return vertices, [tuple(map(int, r[1:4])) for r in rows[count:]]
    for line in lines:
        w = line.split()
        if w[:1] == ['v']:
            vertices.append(tuple(map(float, w[1:4])))
        elif w[:1] == ['f']:
            c = [int(x.split('/')[0]) for x in w[1:]]
            c = [i - 1 if i > 0 else len(vertices) + i for i in c]
            faces += [(c[0], c[k], c[k + 1]) for k in range(1, len(c) - 1)]
    return vertices, faces


def write(path, mesh):
    """OBJ or PLY, with colours if vertices have six numbers; as points without faces."""
    vertices, faces = mesh
    coloured = len(vertices[0]) > 3
    with open(path, 'w') as f:
        if path.endswith('.obj'):
            f.writelines('v ' + ' '.join('%.12g' % x for x in v) + '\n' for v in vertices)
            f.writelines('f %d %d %d\n' % tuple(i + 1 for i in t) for t in faces)
            return
        f.write('ply\nformat ascii 1.0\nelement vertex %d\n' % len(vertices))
        f.writelines('property double %s\n' % c for c in 'xyz')
        if coloured:
            f.writelines('property uchar %s\n' % c for c in ('red', 'green', 'blue'))
        if faces:
            f.write('element face %d\nproperty list uchar int vertex_indices\n' % len(faces))
        f.write('end_header\n')
        for v in vertices:
            f.write('%.12g %.12g %.12g' % v[:3] + (' %d %d %d' % tuple(round(255 * x) for x in v[3:]) if coloured else '') + '\n')
        f.writelines('3 %d %d %d\n' % t for t in faces)
