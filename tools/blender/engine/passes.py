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
        planes = [picture[name].astype(np.float32) for name in self.channels]
        if self.is_direction:
            x, y, z = planes
            planes = [x, -z, y]
        return np.stack(planes, axis=-1)


COMBINED = Pass("", "Combined", "Combined", "The picture", "RGBA", "COLOR", ("R", "G", "B", "A"))

TABLE = (
    Pass("depth", "Depth", "Depth", "Distance from the camera's plane", "Z", "VALUE", ("Z",)),
    Pass("nearest", "Nearest", "Nearest Depth", "Least distance of any sample", "Z", "VALUE", ("nearest.Z",)),
    Pass("position", "Position", "Position", "Where surfaces are", "XYZ", "VECTOR", ("P.X", "P.Y", "P.Z"), True),
    Pass("normal", "Normal", "Normal", "Shading normal", "XYZ", "VECTOR", ("N.X", "N.Y", "N.Z"), True),
    Pass("albedo", "Albedo", "Albedo", "Reflectance", "RGB", "COLOR", ("albedo.R", "albedo.G", "albedo.B")),
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


def by_name(name):
    """The pass of a name in render results; None for others."""
    return next((entry for entry in (COMBINED, *TABLE) if entry.name == name), None)
