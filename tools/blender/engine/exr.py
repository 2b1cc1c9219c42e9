"""Reads the program's pictures: single-part scan-line OpenEXR files without compression or with ZIP
(https://openexr.com/en/latest/OpenEXRFileLayout.html). Blender's Python API reads color channels only."""

import struct
import zlib

import numpy as np

MAGIC = 20000630
TYPES = (np.dtype("<u4"), np.dtype("<f2"), np.dtype("<f4"))
# Scan lines of a block, by compression.
LINES = {0: 1, 2: 1, 3: 16}


class UnreadablePicture(Exception):
    """The file is damaged or of another type."""


def read(path):
    """The channels of a file by name, shape (height, width), rows from the bottom."""
    return _open(path, _Reader.picture)


def header_strings(path):
    """The string attributes of a file's header by name."""
    return _open(path, lambda reader: reader.strings)


def _open(path, read):
    with open(path, "rb") as file:
        data = file.read()
    try:
        return read(_Reader(data))
    except (struct.error, zlib.error, ValueError, IndexError, KeyError) as error:
        raise UnreadablePicture(f"{path} can't be read: {error}") from error


class _Reader:
    def __init__(self, data):
        self.data, self.at = data, 0
        magic, flags = self._take("<iI")
        if magic != MAGIC or flags & 0x1A00:
            raise ValueError("it is no single-part scan-line OpenEXR file")
        header, self.strings = {}, {}
        for name, kind, value in self._attributes():
            header[name] = value
            if kind == "string":
                self.strings[name] = value.decode("latin-1")
        x0, y0, x1, y1 = struct.unpack("<4i", header["dataWindow"])
        self.width, self.height, self.top = x1 - x0 + 1, y1 - y0 + 1, y0
        self.compression = header["compression"][0]
        self.channels = list(_channels(header["channels"]))

    def _take(self, layout):
        values = struct.unpack_from(layout, self.data, self.at)
        self.at += struct.calcsize(layout)
        return values

    def _text(self):
        end = self.data.index(b"\0", self.at)
        text = self.data[self.at : end].decode()
        self.at = end + 1
        return text

    def _attributes(self):
        while name := self._text():
            kind = self._text()
            (size,) = self._take("<i")
            yield name, kind, self.data[self.at : self.at + size]
            self.at += size

    def picture(self):
        planes = {name: np.empty((self.height, self.width), kind) for name, kind in self.channels}
        line = sum(kind.itemsize for _, kind in self.channels) * self.width
        lines = LINES[self.compression]
        for offset in self._take(f"<{-(-self.height // lines)}Q"):
            y, size = struct.unpack_from("<2i", self.data, offset)
            first = y - self.top
            count = min(lines, self.height - first)
            block = self.data[offset + 8 : offset + 8 + size]
            plain = _decompressed(block) if len(block) < count * line else block
            rows = np.frombuffer(plain, np.uint8).reshape(count, line)
            start = 0
            for name, kind in self.channels:
                end = start + kind.itemsize * self.width
                planes[name][first : first + count] = np.ascontiguousarray(rows[:, start:end]).view(kind)
                start = end
        return {name: plane[::-1] for name, plane in planes.items()}


def _channels(data):
    """Names and types of channels."""
    at = 0
    while data[at]:
        end = data.index(b"\0", at)
        (kind,) = struct.unpack_from("<i", data, end + 1)
        yield data[at:end].decode(), TYPES[kind]
        at = end + 17


def _decompressed(block):
    """ZIP compression stores even bytes before odd ones, as differences of neighbors, by deflate."""
    coded = np.frombuffer(zlib.decompress(block), np.uint8).copy()
    coded[1:] -= 128
    summed = np.cumsum(coded, dtype=np.uint8)
    plain = np.empty_like(summed)
    half = (len(summed) + 1) // 2
    plain[0::2], plain[1::2] = summed[:half], summed[half:]
    return plain
