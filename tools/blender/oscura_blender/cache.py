"""The cache of baked and rendered pictures: files named by a hash of everything that the picture depends on."""

import hashlib
import io
import os
import tempfile
import zipfile
from functools import lru_cache
from pathlib import Path

import bpy
import numpy as np

# `oscura cache` recognizes files by 32 hexadecimal digits and this extension.
EXTENSION = ".oscura"

# Size of the cache in bytes; the least recently used files are deleted first.
MAX_SIZE = 4 << 30


@lru_cache(maxsize=1)
def _version():
    """A hash of Blender's version and this package."""
    digest = hashlib.blake2b(bpy.app.version_string.encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.digest()


def new_digest(*values):
    """A hash of the version and some values."""
    digest = hashlib.blake2b(_version(), digest_size=16)
    digest.update(repr(values).encode())
    return digest


class Cache:
    """The arrays in a folder; without a folder nothing is kept."""

    def __init__(self, folder=None):
        self.folder = Path(folder) if folder else None

    def get(self, digest, make):
        """The array of a hash; if it isn't in the cache, `make` computes it."""
        key = digest.hexdigest()
        array = self._read(key)
        if array is None:
            array = make()
            self._write(key, array)
        return array

    def _read(self, key):
        """None without the file, or if it is damaged."""
        if self.folder is None:
            return None
        path = self.folder / f"{key}{EXTENSION}"
        try:
            with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as arrays:
                array = arrays["made"]
            os.utime(path)  # it was used now
        except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
            return None
        return array

    def _write(self, key, array):
        """Renames a complete file, so that other processes read no partial one. The export goes on without a writable folder."""
        if self.folder is None:
            return
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=self.folder, delete=False) as file:
                np.savez(file, made=array)
            os.replace(file.name, self.folder / f"{key}{EXTENSION}")
        except OSError as error:
            print(f"can't write to the cache {self.folder}: {error}")

    def trim(self):
        """Deletes the least recently used files of a cache that is too large."""
        if self.folder is None or not self.folder.is_dir():
            return
        files = [(path, path.stat()) for path in self.folder.glob(f"*{EXTENSION}")]
        excess = sum(stat.st_size for _, stat in files) - MAX_SIZE
        for path, stat in sorted(files, key=lambda entry: entry[1].st_mtime):
            if excess <= 0:
                break
            path.unlink(missing_ok=True)
            excess -= stat.st_size
