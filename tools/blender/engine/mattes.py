"""Metadata of Cryptomattes (specification 1.2.0) for Blender's render results."""

from . import passes

MASK = 0xFFFFFFFF


def add_metadata(result, strings, layer):
    """Adds the manifests in a file's header to a result, under the names that Blender gives the layers in files."""
    for kind in passes.matte_kinds(layer):
        owner = next((key for key, value in strings.items() if key.endswith("/name") and value == kind), None)
        if owner is None:
            continue
        name = f"{layer.name}.{kind}"
        for field in ("hash", "conversion", "manifest"):
            result.stamp_data_add_field(f"cryptomatte/{key_of(name)}/{field}", strings[owner.removesuffix("name") + field])
        result.stamp_data_add_field(f"cryptomatte/{key_of(name)}/name", name)


def key_of(name):
    """The key in the names of attributes: the first seven digits of the hash of the layer's name."""
    return f"{hashed(name.encode()):08x}"[:7]


def hashed(data):
    """MurmurHash3_x86_32 with seed 0."""
    whole = len(data) // 4 * 4
    value = 0
    for at in range(0, whole, 4):
        value = _rotated(value ^ _mixed(int.from_bytes(data[at : at + 4], "little")), 13)
        value = (value * 5 + 0xE6546B64) & MASK
    value ^= _mixed(int.from_bytes(data[whole:], "little")) ^ len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        value = (value ^ (value >> shift)) * factor & MASK
    return value ^ (value >> 16)


def _mixed(word):
    return _rotated(word * 0xCC9E2D51 & MASK, 15) * 0x1B873593 & MASK


def _rotated(word, bits):
    return ((word << bits) | (word >> (32 - bits))) & MASK
