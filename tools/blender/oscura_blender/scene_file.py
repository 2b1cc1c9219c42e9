"""Writes the scene file: the little of TOML that it needs, and transforms in the axes of oscura."""

import json
import math

from mathutils import Matrix

# From Blender's axes (z up) to those of scene files (y up).
Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))


class Exact(float):
    """A number of which all digits are written."""


def number(value):
    """A number as TOML has it, as short as single precision allows unless it is exact."""
    if not math.isfinite(value):
        raise ValueError(f"{value} is no number for a file")
    text = repr(float(value)) if isinstance(value, Exact) else f"{float(value):.7g}"
    return text if any(c in text for c in ".e") else text + ".0"


def value(of):
    """Any value. Names in double quotes are the same in JSON and TOML."""
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


def is_flat(matrix):
    """Does a matrix scale by 0 along an axis? Scene files have such transforms of still meshes only."""
    return abs(matrix.to_3x3().determinant()) < 1e-30


def placed(matrix, kind=float):
    """A transform by a matrix: its last row exactly, which products of Blender's matrices have up to rounding."""
    return [{"matrix": [kind(x) for row in list(matrix)[:3] for x in row] + [0.0, 0.0, 0.0, 1.0]}]


def placement(matrix, frames, matrices):
    """The keys of the place of a camera or a light, in Blender's axes: its matrix, or those at frames if it moves."""
    if matrices is None:
        return {"transform": placed(Y_UP @ matrix, Exact)}
    keys = [{"frame": frame, "transform": placed(Y_UP @ then, Exact)} for frame, then in zip(frames, matrices)]
    return {"transform": [], "motion": {"keys": keys}}


def table(title, entries):
    """A table; keys whose value is None are left out."""
    lines = [f"{key} = {value(v)}" for key, v in entries.items() if v is not None]
    return "\n".join([title, *lines])


def write(path, comment, tables):
    """Writes tables, each a pair of its title in brackets and its entries."""
    head = f"# {comment}" if any(title == "[[objects]]" for title, _ in tables) else f"# {comment}\n\nobjects = []"
    parts = [head] + [table(title, entries) for title, entries in tables if entries]
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.write("\n\n".join(parts) + "\n")
