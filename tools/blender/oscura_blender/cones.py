"""The cones of spots whose scale differs by axis: Cycles stretches them. The way to what is lit counts in the space of the lamp, so
that cones become wider, narrower or elliptic; what fades at their edge does so by the cosine there."""

import math
import os

import bpy
import numpy as np

from . import lamp_trees

# Steps around the axis and along it.
AROUND, ALONG = 128, 256

# Scales that differ by no more are the same.
EVEN = 1e-4


class Cone:
    """The cone of a spot by its half angle (radians), the part of it that fades, and the scale of the lamp."""

    def __init__(self, light, scale):
        x, y, z = (max(abs(part), 1e-9) for part in scale)
        self.half, self.blend, self.across = light.spot_size / 2, light.spot_blend, (x / z, y / z)

    def is_plain(self):
        return all(abs(factor - 1) <= EVEN for factor in self.across)

    def is_round(self):
        return abs(self.across[0] / self.across[1] - 1) <= EVEN

    def mean(self):
        """Half the angle of the round cone that crosses as much of a plane before it."""
        return self._widened(math.sqrt(self.across[0] * self.across[1]))

    def reach(self):
        """Half the largest angle."""
        return self._widened(max(self.across))

    def _widened(self, factor):
        return math.atan2(factor * math.sin(self.half), math.cos(self.half))

    def shares(self):
        """Shares of the light by the angle from the axis (rows, to the reach) and around it (columns)."""
        down = self.reach() * (np.arange(ALONG) + 0.5) / ALONG
        count = 4 if self.is_round() else AROUND
        around = 2 * np.pi * np.arange(count) / count
        wide = np.hypot(np.cos(around) / self.across[0], np.sin(around) / self.across[1])
        cosines = np.cos(down)[:, None] / np.hypot(np.sin(down)[:, None] * wide, np.cos(down)[:, None])
        edge = math.cos(self.half)
        inner = np.clip((cosines - edge) / max(self.blend * (1 - edge), 1e-6), 0, 1)
        return inner * inner * (3 - 2 * inner)

    def write(self, name, folder):
        """Writes the shares as a profile (IES) into a folder; gives its name."""
        file = f"{bpy.path.clean_name(name)}_cone.ies"
        lamp_trees.write_profile(self.shares(), self.reach(), os.path.join(folder, file))
        return file
