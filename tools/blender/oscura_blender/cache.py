"""What is kept for the next time: each result in a file named by a hash of all that it was made from, so that none is ever
out of date. The program tells the folder, says what it holds, and clears it (`oscura cache`)."""

import hashlib
import io
import os
import tempfile
import zipfile
from functools import lru_cache
from pathlib import Path

import bpy
import numpy as np

# `oscura cache` knows its files by 32 hexadecimal digits and this.
ENDING = ".oscura"

# Most bytes that are kept; what was not used for longest goes first.
MOST = 4 << 30


@lru_cache(maxsize=1)
def _ourselves():
    """Who makes the results: Blender, and this package."""
    found = hashlib.blake2b(bpy.app.version_string.encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        found.update(path.read_bytes())
    return found.digest()


def digest():
    """The beginning of every hash."""
    return hashlib.blake2b(_ourselves(), digest_size=16)


class Store:
    """The results in a folder; without a folder, none."""

    def __init__(self, folder=None):
        self.folder = Path(folder) if folder else None

    def kept(self, digest, make):
        """The array of a result: the one that was kept for a hash, else one that is made now, and kept."""
        key = digest.hexdigest()
        found = self.get(key)
        if found is None:
            found = {"made": make()}
            self.put(key, found)
        return found["made"]

    def get(self, key):
        """The arrays of a result by name; None if it isn't there, or damaged."""
        if self.folder is None:
            return None
        path = self._path(key)
        try:
            with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as arrays:
                found = {name: arrays[name] for name in arrays.files}
            os.utime(path)  # it was used now
        except (OSError, ValueError, EOFError, zipfile.BadZipFile):
            return None
        return found

    def put(self, key, arrays):
        """Keeps the arrays of a result; it appears as a whole. A folder that takes none is no reason to end."""
        if self.folder is None:
            return
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=self.folder, delete=False) as file:
                np.savez(file, **arrays)
            os.replace(file.name, self._path(key))
        except OSError as error:
            print(f"{self.folder} keeps nothing: {error}")

    def trim(self):
        """Deletes the oldest results of a folder that holds too much."""
        if self.folder is None or not self.folder.is_dir():
            return
        files = [(path, path.stat()) for path in self.folder.glob(f"*{ENDING}")]
        left = sum(stat.st_size for _, stat in files) - MOST
        for path, stat in sorted(files, key=lambda entry: entry[1].st_mtime):
            if left <= 0:
                break
            path.unlink(missing_ok=True)
            left -= stat.st_size

    def _path(self, key):
        return self.folder / f"{key}{ENDING}"
