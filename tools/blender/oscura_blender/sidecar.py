"""Writes TOML: the little of it that the file of settings needs."""

import json
import math


def number(value):
    """A number as TOML has it, as short as single precision allows."""
    value = float(value)
    if not math.isfinite(value):
        raise ValueError(f"{value} is no number for a file")
    text = f"{value:.7g}"
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


def placed(matrix):
    """A transform by a matrix: its last row exactly, which products of Blender's matrices have up to rounding."""
    return [{"matrix": [float(x) for row in list(matrix)[:3] for x in row] + [0.0, 0.0, 0.0, 1.0]}]


def table(title, entries):
    """A table; keys whose value is None are left out."""
    lines = [f"{key} = {value(v)}" for key, v in entries.items() if v is not None]
    return "\n".join([title, *lines])


def write(path, comment, tables):
    """Writes tables, each a pair of its title in brackets and its entries."""
    parts = [f"# {comment}"] + [table(title, entries) for title, entries in tables if entries]
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.write("\n\n".join(parts) + "\n")
