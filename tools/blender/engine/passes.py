"""Passes in Blender, and the channels of the program's pictures."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Pass:
    """A pass: its name in render results, title and description, channel identifiers and type in Blender, and its channels in
    files."""

    option: str  # of `oscura render --aov`
    name: str
    title: str
    about: str
    letters: str
    kind: str
    channels: tuple
    is_vector: bool = False  # with y up in files

    def values(self, picture):
        """The values of the pass, shape (height, width, channels)."""
        planes = [picture[name].astype(np.float32, copy=False) for name in self.channels]
        if self.is_vector:
            x, y, z = planes
            planes = [x, -z, y]
        return np.stack(planes, axis=-1)


COMBINED = Pass("", "Combined", "Combined", "The picture", "RGBA", "COLOR", ("R", "G", "B", "A"))


def _color(option, name, title, about):
    """A color pass with the same name in files and in Blender."""
    return Pass(option, name, title, about, "RGB", "COLOR", tuple(f"{name}.{letter}" for letter in "RGB"))


TABLE = (
    Pass("depth", "Depth", "Depth", "Depth along the viewing direction", "Z", "VALUE", ("Z",)),
    Pass("nearest", "Nearest", "Nearest Depth", "Least depth of all samples", "Z", "VALUE", ("nearest.Z",)),
    Pass("position", "Position", "Position", "Position of surfaces in the world", "XYZ", "VECTOR", ("P.X", "P.Y", "P.Z"), True),
    Pass("normal", "Normal", "Normal", "Shading normal", "XYZ", "VECTOR", ("N.X", "N.Y", "N.Z"), True),
    Pass(
        "geometric_normal",
        "GeometricNormal",
        "Geometric Normal",
        "Normal without smoothing and normal maps",
        "XYZ",
        "VECTOR",
        ("Ng.X", "Ng.Y", "Ng.Z"),
        True,
    ),
    Pass("facing", "Facing", "Facing", "Cosine of the angle between normal and view direction", "X", "VALUE", ("facing.V",)),
    Pass("albedo", "Albedo", "Albedo", "Reflectance", "RGB", "COLOR", ("albedo.R", "albedo.G", "albedo.B")),
    Pass("roughness", "Roughness", "Roughness", "Roughness of the material", "X", "VALUE", ("roughness.V",)),
    _color("diffuse_direct", "DiffDir", "Diffuse Direct", "Direct diffuse light, times the diffuse color"),
    _color("diffuse_indirect", "DiffInd", "Diffuse Indirect", "Indirect diffuse light, times the diffuse color"),
    _color("diffuse_color", "DiffCol", "Diffuse Color", "Color of diffuse reflection"),
    _color("glossy_direct", "GlossDir", "Glossy Direct", "Direct glossy light, times the glossy color"),
    _color("glossy_indirect", "GlossInd", "Glossy Indirect", "Indirect glossy light, times the glossy color"),
    _color("glossy_color", "GlossCol", "Glossy Color", "Color of glossy reflection at normal incidence"),
    _color("transmission_direct", "TransDir", "Transmission Direct", "Direct transmitted light, times the transmission color"),
    _color("transmission_indirect", "TransInd", "Transmission Indirect", "Indirect transmitted light, times the transmission color"),
    _color("transmission_color", "TransCol", "Transmission Color", "Color of transmission"),
    _color("emission", "Emit", "Emission", "Emission that the camera sees"),
    _color("environment", "Env", "Environment", "World background that the camera sees"),
    Pass("shadow", "Shadow", "Shadow", "Fraction of direct light that is blocked", "X", "VALUE", ("shadow.V",)),
    Pass("object_id", "Object", "Object", "Index of the object", "X", "VALUE", ("object.id",)),
    Pass("material", "Material", "Material", "Index of the material", "X", "VALUE", ("material.id",)),
    Pass("samples", "Samples", "Samples", "Samples per pixel", "X", "VALUE", ("samples",)),
    Pass(
        "variance",
        "Variance",
        "Variance",
        "Variance of the color for independent samples",
        "RGB",
        "COLOR",
        ("variance.R", "variance.G", "variance.B"),
    ),
)

# Cryptomattes: names of layers, Blender's switches, and the program's options.
MATTES = {
    "CryptoObject": ("use_pass_cryptomatte_object", "crypto_object"),
    "CryptoMaterial": ("use_pass_cryptomatte_material", "crypto_material"),
    "CryptoAsset": ("use_pass_cryptomatte_asset", "crypto_asset"),
}


def _matte(name):
    """A layer of a Cryptomatte: two IDs, each with its coverage."""
    return Pass("", name, name, "", "RGBA", "COLOR", tuple(f"{name}.{letter}" for letter in "RGBA"))


def matte_kinds(layer):
    """The Cryptomattes of a view layer by Blender's own switches, which its Cryptomatte node needs."""
    return [kind for kind, (switch, _) in MATTES.items() if getattr(layer, switch)]


def chosen(layer):
    """All passes of a view layer besides Combined."""
    levels = -(-layer.pass_cryptomatte_depth // 2)
    layers = [_matte(f"{kind}{level:02}") for kind in matte_kinds(layer) for level in range(levels)]
    return [*layer.oscura.chosen(), *layers]


def arguments(layer):
    """Arguments of `oscura render` for the passes of a view layer."""
    kinds = matte_kinds(layer)
    options = [entry.option for entry in layer.oscura.chosen()] + [MATTES[kind][1] for kind in kinds]
    found = ["--aov", ",".join(options)] if options else []
    return found + (["--crypto-levels", str(2 * -(-layer.pass_cryptomatte_depth // 2))] if kinds else [])


def by_name(name):
    """The pass with a name in render results; None without one."""
    if name[:-2] in MATTES:
        return _matte(name)
    return next((entry for entry in (COMBINED, *TABLE) if entry.name == name), None)
