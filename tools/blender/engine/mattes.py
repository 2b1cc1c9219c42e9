"""What files say about Cryptomattes (Psyop's specification 1.2.0), in the words of Blender's render results."""

from . import passes

MASK = 0xFFFFFFFF


def tell(result, texts, layer):
    """Hands the manifests in a file's header to a result: under the names that its layers get when Blender writes them."""
    for kind in passes.matte_kinds(layer):
        owner = next((key for key, value in texts.items() if key.endswith("/name") and value == kind), None)
        if owner is None:
            continue
        name = f"{layer.name}.{kind}"
        for what in ("hash", "conversion", "manifest"):
            result.stamp_data_add_field(f"cryptomatte/{key_of(name)}/{what}", texts[owner.removesuffix("name") + what])
        result.stamp_data_add_field(f"cryptomatte/{key_of(name)}/name", name)


def key_of(name):
    """What marks a matte's attributes: the first seven digits of the hash of its name."""
    return f"{hashed(name.encode()):08x}"[:7]


def hashed(data):
    """MurmurHash3_x86_32 with seed 0, from its description."""
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
