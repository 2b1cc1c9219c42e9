"""Passes: how Blender calls what the program's pictures hold."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Pass:
    """A pass of Blender: its name in render results, what users see, what it says, its channels' letters, what kind of
    values Blender takes them for, and the names of the channels in files."""

    option: str  # of `oscura render --aov`
    name: str
    title: str
    about: str
    letters: str
    kind: str
    channels: tuple
    is_direction: bool = False  # vectors, in files with y up

    def values(self, picture):
        """The pass as rows of a picture of these channels, shape (height, width, channels)."""
        planes = [picture[name].astype(np.float32, copy=False) for name in self.channels]
        if self.is_direction:
            x, y, z = planes
            planes = [x, -z, y]
        return np.stack(planes, axis=-1)


COMBINED = Pass("", "Combined", "Combined", "The picture", "RGBA", "COLOR", ("R", "G", "B", "A"))



def _colour(option, name, title, about):
    """A pass of three colours, in files and in Blender of one name."""
    return Pass(option, name, title, about, "RGB", "COLOR", tuple(f"{name}.{letter}" for letter in "RGB"))


TABLE = (
    Pass("depth", "Depth", "Depth", "Distance from the camera's plane", "Z", "VALUE", ("Z",)),
    Pass("nearest", "Nearest", "Nearest Depth", "Least distance of any sample", "Z", "VALUE", ("nearest.Z",)),
    Pass("position", "Position", "Position", "Where surfaces are", "XYZ", "VECTOR", ("P.X", "P.Y", "P.Z"), True),
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
    Pass("facing", "Facing", "Facing", "Cosine between normal and view", "X", "VALUE", ("facing.V",)),
    Pass("albedo", "Albedo", "Albedo", "Reflectance", "RGB", "COLOR", ("albedo.R", "albedo.G", "albedo.B")),
    Pass("roughness", "Roughness", "Roughness", "Roughness of the material", "X", "VALUE", ("roughness.V",)),
    _colour("diffuse_direct", "DiffDir", "Diffuse Direct", "Scattered light of lights, times its colour"),
    _colour("diffuse_indirect", "DiffInd", "Diffuse Indirect", "Scattered light of surfaces, times its colour"),
    _colour("diffuse_color", "DiffCol", "Diffuse Color", "Colour of what is scattered diffusely"),
    _colour("glossy_direct", "GlossDir", "Glossy Direct", "Reflected light of lights, times its colour"),
    _colour("glossy_indirect", "GlossInd", "Glossy Indirect", "Reflected light of surfaces, times its colour"),
    _colour("glossy_color", "GlossCol", "Glossy Color", "Colour of what is reflected, seen along the normal"),
    _colour("transmission_direct", "TransDir", "Transmission Direct", "Light of lights let through, times its colour"),
    _colour("transmission_indirect", "TransInd", "Transmission Indirect", "Light of surfaces let through, times its colour"),
    _colour("transmission_color", "TransCol", "Transmission Color", "Colour of what is let through"),
    _colour("emission", "Emit", "Emission", "What surfaces emit towards the camera"),
    _colour("environment", "Env", "Environment", "The world where the camera sees it"),
    Pass("shadow", "Shadow", "Shadow", "Share of the direct light that something blocks", "X", "VALUE", ("shadow.V",)),
    Pass("object_id", "Object", "Object", "Number of the object", "X", "VALUE", ("object.id",)),
    Pass("material", "Material", "Material", "Number of the material", "X", "VALUE", ("material.id",)),
    Pass("samples", "Samples", "Samples", "Samples a pixel", "X", "VALUE", ("samples",)),
    Pass(
        "variance",
        "Variance",
        "Variance",
        "Variance of the colour, were the samples independent",
        "RGB",
        "COLOR",
        ("variance.R", "variance.G", "variance.B"),
    ),
)

# Kinds of Cryptomattes: Blender's names of them, of its own switches and of the program's options.
MATTES = {
    "CryptoObject": ("use_pass_cryptomatte_object", "crypto_object"),
    "CryptoMaterial": ("use_pass_cryptomatte_material", "crypto_material"),
    "CryptoAsset": ("use_pass_cryptomatte_asset", "crypto_asset"),
}


def _matte(name):
    """One layer of a matte: two ids, each with its share."""
    return Pass("", name, name, "", "RGBA", "COLOR", tuple(f"{name}.{letter}" for letter in "RGBA"))


def matte_kinds(layer):
    """The kinds of mattes that a view layer asks for by Blender's own switches, where its Cryptomatte node looks for them."""
    return [kind for kind, (switch, _) in MATTES.items() if getattr(layer, switch)]


def chosen(layer):
    """All passes of a view layer but the picture."""
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
    """The pass of a name in render results; None for others."""
    if name[:-2] in MATTES:
        return _matte(name)
    return next((entry for entry in (COMBINED, *TABLE) if entry.name == name), None)
