"""Simple shapes with a known upright axis, as triangles; and copies of meshes with another axis up."""
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
    """A curve of (radius, height), turned about y."""
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


def z_up(mesh):
    """The same with z up: it lies on its back for who takes y."""
    vertices, faces = mesh
    return [(x, -z, y) for x, y, z in vertices], faces


def y_up(mesh):
    vertices, faces = mesh
    return [(x, z, -y) for x, y, z in vertices], faces


def read(path):
    """Vertices and triangles of an OBJ or of an ascii PLY file of triangles; nothing else."""
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
    vertices, faces = mesh
    with open(path, 'w') as f:
        if path.endswith('.obj'):
            f.writelines('v %.7g %.7g %.7g\n' % v for v in vertices)
            f.writelines('f %d %d %d\n' % tuple(i + 1 for i in t) for t in faces)
            return
        f.write('ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n' % len(vertices))
        f.write('element face %d\nproperty list uchar int vertex_indices\nend_header\n' % len(faces))
        f.writelines('%.7g %.7g %.7g\n' % v for v in vertices)
        f.writelines('3 %d %d %d\n' % t for t in faces)
