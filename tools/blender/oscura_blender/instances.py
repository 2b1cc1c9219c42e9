"""Files of the places of copies."""

import os
from itertools import chain

import numpy as np

from .glb import Y_UP

# Properties of vertices, and those that nodes ask for.
PLACE = ("x", "y", "z", *(f"m{row}{column}" for row in range(3) for column in range(3)))
INFO = ("red", "green", "blue", "alpha", "index", "random")


def write(made, copies):
    """Writes the matrices of copies, and what nodes know of each, to a file; gives its name."""
    file = f"{made.name}.places{made.places}.ply"
    made.places += 1
    flat = chain.from_iterable(chain.from_iterable(matrix for matrix, _ in copies))
    matrices = np.array(Y_UP) @ np.fromiter(flat, np.float64, 16 * len(copies)).reshape(-1, 4, 4)
    columns, names = [matrices[:, :3, 3], matrices[:, :3, :3].reshape(-1, 9)], PLACE
    if copies[0][1]:
        columns.append(np.array([[*info["color"], info["index"], info["random"]] for _, info in copies]))
        names += INFO
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(copies)}", *(f"property float {name}" for name in names), "end_header\n"]
    with open(os.path.join(made.folder, file), "wb") as out:
        out.write("\n".join(head).encode())
        out.write(np.ascontiguousarray(np.concatenate(columns, 1), "<f4").tobytes())
    return file
