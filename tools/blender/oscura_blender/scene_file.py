"""Writes the scene file: the subset of TOML that it needs, and transforms in its coordinate system."""

import json
import math

from mathutils import Matrix

# From Blender's coordinate system (z up) to that of scene files (y up).
Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))


class Exact(float):
    """A number that is written with all digits."""


def number(value):
    """A number in TOML, with the digits of single precision unless it is `Exact`."""
    if not math.isfinite(value):
        raise ValueError(f"{value} can't be written to a scene file")
    text = repr(float(value)) if isinstance(value, Exact) else f"{float(value):.7g}"
    return text if any(c in text for c in ".e") else text + ".0"


def value(of):
    """Any value in TOML. Strings are written as in JSON, but for DEL."""
    if isinstance(of, bool):
        return "true" if of else "false"
    if isinstance(of, int):
        return str(of)
    if isinstance(of, str):
        return json.dumps(of, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(of, dict):
        return "{ " + ", ".join(f"{key} = {value(v)}" for key, v in of.items()) + " }"
    if isinstance(of, (list, tuple)):
        return "[" + ", ".join(value(v) for v in of) + "]"
    return number(of)


def is_singular(matrix):
    """Does a matrix scale by 0 along an axis? Only meshes that don't move may have such transforms."""
    return abs(matrix.to_3x3().determinant()) < 1e-30


def transform(matrix, kind=float):
    """The value of `transform` for a matrix, whose last row is written without rounding errors."""
    return [{"matrix": [kind(x) for row in list(matrix)[:3] for x in row] + [0.0, 0.0, 0.0, 1.0]}]


def placement(matrix, frames, matrices):
    """`transform` of a camera or a light by its matrix in Blender; with matrices at frames also `motion`."""
    if matrices is None:
        return {"transform": transform(Y_UP @ matrix, Exact)}
    keys = [{"frame": frame, "transform": transform(Y_UP @ then, Exact)} for frame, then in zip(frames, matrices)]
    return {"transform": [], "motion": {"keys": keys}}


def table(title, entries):
    """A table without the keys whose value is None."""
    lines = [f"{key} = {value(v)}" for key, v in entries.items() if v is not None]
    return "\n".join([title, *lines])


def write(path, comment, tables):
    """Writes tables: pairs of a title in brackets and a dictionary."""
    head = f"# {comment}" if any(title == "[[objects]]" for title, _ in tables) else f"# {comment}\n\nobjects = []"
    parts = [head] + [table(title, entries) for title, entries in tables if entries]
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.write("\n\n".join(parts) + "\n")
