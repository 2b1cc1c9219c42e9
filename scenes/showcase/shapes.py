"""Shapes for the scenes of this folder: meshes of polygons, written as binary PLY. Standard library only."""

import array
import math
import struct
import sys

TAU = 2 * math.pi


class Mesh:
    """Points, texture coordinates (one a point, or none) and polygons."""

    def __init__(self, points=(), faces=(), uvs=None):
        self.points, self.faces = list(points), list(faces)
        self.uvs = list(uvs) if uvs is not None else None

    def add(self, other):
        """Appends another mesh."""
        start = len(self.points)
        if other.uvs is not None or self.uvs is not None:
            self.uvs = (self.uvs or [(0.0, 0.0)] * start) + (other.uvs or [(0.0, 0.0)] * len(other.points))
        self.points += other.points
        self.faces += [tuple(start + i for i in face) for face in other.faces]
        return self

    def map(self, function):
        """Moves every point."""
        self.points = [function(*p) for p in self.points]
        return self

    def moved(self, x, y, z):
        return Mesh([(a + x, b + y, c + z) for a, b, c in self.points], self.faces, self.uvs)

    def scaled(self, x, y=None, z=None):
        y, z = (x if y is None else y), (x if z is None else z)
        return Mesh([(a * x, b * y, c * z) for a, b, c in self.points], self.faces, self.uvs)

    def turned(self, axis, degrees):
        """Turned about an axis of the world, counter-clockwise seen from its tip."""
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        turn = {
            "x": lambda x, y, z: (x, c * y - s * z, s * y + c * z),
            "y": lambda x, y, z: (c * x + s * z, y, c * z - s * x),
            "z": lambda x, y, z: (c * x - s * y, s * x + c * y, z),
        }[axis]
        return Mesh([turn(*p) for p in self.points], self.faces, self.uvs)

    def flipped(self):
        return Mesh(self.points, [tuple(reversed(f)) for f in self.faces], self.uvs)

    def save(self, path):
        floats = "xyz" if self.uvs is None else "xyzuv"
        header = "ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(self.points)
        header += "".join("property float %s\n" % name for name in floats)
        header += "element face %d\nproperty list int int vertex_indices\nend_header\n" % len(self.faces)
        rows = self.points if self.uvs is None else [p + t for p, t in zip(self.points, self.uvs)]
        values = array.array("f", [v for row in rows for v in row])
        if sys.byteorder == "big":
            values.byteswap()
        faces = b"".join(struct.pack("<i%di" % len(f), len(f), *f) for f in self.faces)
        with open(path, "wb") as file:
            file.write(header.encode() + values.tobytes() + faces)


def grid(columns, rows, point, closed_u=False, closed_v=False):
    """A sheet of quads through point(u, v), u and v from 0 to 1; its front is where du x dv points."""
    across, down = columns + (not closed_u), rows + (not closed_v)
    points, uvs, faces = [], [], []
    for j in range(down):
        for i in range(across):
            points.append(tuple(point(i / columns, j / rows)))
            uvs.append((i / columns, j / rows))
    for j in range(rows):
        for i in range(columns):
            a, b = i, (i + 1) % across
            c, d = j, (j + 1) % down
            faces.append((c * across + a, c * across + b, d * across + b, d * across + a))
    return Mesh(points, faces, uvs)


def lathe(profile, segments=128, start=0.0, end=360.0):
    """A profile of (radius, height) turned about y. Upwards along the profile the outside is the front; points on the
    axis close it."""
    whole = abs(end - start) >= 360
    columns = segments if whole else segments + 1
    points, rings = [], []
    for radius, height in profile:
        if radius <= 0:
            rings.append([len(points)] * columns)
            points.append((0.0, height, 0.0))
            continue
        rings.append(range(len(points), len(points) + columns))
        for i in range(columns):
            angle = math.radians(start + (end - start) * i / segments)
            points.append((radius * math.cos(angle), height, -radius * math.sin(angle)))
    faces = []
    for low, high in zip(rings, rings[1:]):
        for i in range(segments):
            j = (i + 1) % columns
            face = [low[i], low[j], high[j], high[i]]
            face = [p for k, p in enumerate(face) if p != face[k - 1]]
            if len(face) > 2:
                faces.append(tuple(face))
    return Mesh(points, faces)


def smooth_profile(points, steps=8):
    """A Catmull-Rom curve through points of a profile."""
    ends = [points[0]] + list(points) + [points[-1]]
    result = []
    for a, b, c, d in zip(ends, ends[1:], ends[2:], ends[3:]):
        for k in range(steps):
            t = k / steps
            result.append(tuple(
                0.5 * (2 * q + (r - p) * t + (2 * p - 5 * q + 4 * r - s) * t * t + (3 * q - p - 3 * r + s) * t**3)
                for p, q, r, s in zip(a, b, c, d)))
    return result + [points[-1]]


def arc(center, radius, start, end, steps=8):
    """Points of a circular arc in a plane, angles in degrees."""
    angles = [math.radians(start + (end - start) * k / steps) for k in range(steps + 1)]
    return [(center[0] + radius * math.cos(a), center[1] + radius * math.sin(a)) for a in angles]


def rounded_rectangle(width, height, radius, steps=8):
    """Counter-clockwise outline around the origin."""
    x, y = width / 2 - radius, height / 2 - radius
    return (arc((x, -y), radius, -90, 0, steps) + arc((x, y), radius, 0, 90, steps)
            + arc((-x, y), radius, 90, 180, steps) + arc((-x, -y), radius, 180, 270, steps))


def offset(outline, distance):
    """An outline moved inwards by a distance, along the mean of the normals of its edges."""
    result = []
    for i, (x, y) in enumerate(outline):
        (x0, y0), (x1, y1) = outline[i - 1], outline[(i + 1) % len(outline)]
        a, b = math.hypot(x - x0, y - y0) or 1, math.hypot(x1 - x, y1 - y) or 1
        n0, n1 = ((y0 - y) / a, (x - x0) / a), ((y - y1) / b, (x1 - x) / b)
        nx, ny = n0[0] + n1[0], n0[1] + n1[1]
        scale = 2 * distance / max(nx * nx + ny * ny, 0.5)
        result.append((x + nx * scale, y + ny * scale))
    return result


def extrude(outline, depth, bevel=0.0, steps=3):
    """A counter-clockwise outline in x and y, with a depth along z around 0 and round edges."""
    layers = []
    for k in range(steps + 1 if bevel else 1):
        a = math.radians(90 * k / steps) if bevel else 0
        layers.append((bevel * (1 - math.sin(a)), -depth / 2 + bevel * (1 - math.cos(a))))
    layers = layers + [(inset, -z) for inset, z in reversed(layers)]
    points = []
    for inset, z in layers:
        points += [(x, y, z) for x, y in (offset(outline, inset) if inset else outline)]
    n, faces = len(outline), []
    for k in range(len(layers) - 1):
        for i in range(n):
            j = (i + 1) % n
            faces.append((k * n + i, k * n + j, (k + 1) * n + j, (k + 1) * n + i))
    top = (len(layers) - 1) * n
    faces.append(tuple(top + i for i in range(n)))
    faces.append(tuple(reversed(range(n))))
    return Mesh(points, faces)


def rounded_box(x, y, z, radius, steps=4):
    """A box around the origin with round edges and corners."""
    a, b, c = x / 2 - radius, y / 2 - radius, z / 2 - radius
    outline = []
    for cx, cz, first in ((a, c, 0), (-a, c, 90), (-a, -c, 180), (a, -c, 270)):
        outline += [(cx, cz, math.radians(first + 90 * k / steps)) for k in range(steps + 1)]
    rings = [(-b, math.radians(-90 + 90 * k / steps)) for k in range(steps + 1)]
    rings += [(b, math.radians(90 * k / steps)) for k in range(steps + 1)]
    points, n, faces = [], len(outline), []
    for height, t in rings:
        for cx, cz, angle in outline:
            r = radius * math.cos(t)
            points.append((cx + r * math.cos(angle), height + radius * math.sin(t), -cz - r * math.sin(angle)))
    for k in range(len(rings) - 1):
        for i in range(n):
            j = (i + 1) % n
            faces.append((k * n + i, k * n + j, (k + 1) * n + j, (k + 1) * n + i))
    faces.append(tuple(reversed(range(n))))
    faces.append(tuple((len(rings) - 1) * n + i for i in range(n)))
    return Mesh(points, faces)


def tube(path, radius, sides=12, closed=False):
    """A round tube along points; radius is a number or one for each point."""
    radii = radius if isinstance(radius, (list, tuple)) else [radius] * len(path)
    n, points, side = len(path), [], (0.3, 0.9, 0.31)
    for i, p in enumerate(path):
        before = path[i - 1] if closed or i else p
        after = path[(i + 1) % n] if closed or i + 1 < n else p
        along = normalized(subtract(after, before))
        side = normalized(subtract(side, tuple(dot(side, along) * a for a in along)))
        other = cross(along, side)
        for k in range(sides):
            c, s = math.cos(TAU * k / sides) * radii[i], math.sin(TAU * k / sides) * radii[i]
            points.append(tuple(p[m] + c * side[m] + s * other[m] for m in range(3)))
    faces = []
    for i in range(n if closed else n - 1):
        for k in range(sides):
            a, b = i * sides, (i + 1) % n * sides
            faces.append((a + k, a + (k + 1) % sides, b + (k + 1) % sides, b + k))
    if not closed:
        faces += [tuple(reversed(range(sides))), tuple((n - 1) * sides + k for k in range(sides))]
    return Mesh(points, faces)


def subtract(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def normalized(a):
    length = math.sqrt(dot(a, a)) or 1.0
    return (a[0] / length, a[1] / length, a[2] / length)


def mix(a, b, t):
    return a + (b - a) * t


def smoothstep(low, high, x):
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3 - 2 * t)
