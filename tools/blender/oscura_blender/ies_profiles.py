"""IES profiles: files of measured lights, of rendered emission, and of spot cones that the light's scale stretches."""

import math

import numpy as np

# Resolution of cones around the axis and from it.
AZIMUTHS, POLAR_ANGLES = 128, 256

# Scales that differ by no more are the same.
TOLERANCE = 1e-4


def write(values, max_angle, path):
    """Writes intensities by polar angle (rows, evenly up to the largest angle in radians) and azimuth (columns) as IES LM-63, whose azimuths
    run clockwise."""
    rows, columns = values.shape
    steps = values[:, (columns // 2 - np.arange(columns + 1)) % columns]
    # On the axis there is one value.
    table = np.concatenate([np.full((1, columns + 1), steps[0].mean()), steps, steps[-1:]]).T
    polar = np.degrees(max_angle) * np.array([0.0, *(np.arange(rows) + 0.5) / rows, 1.0])
    azimuths = np.linspace(0.0, 360.0, columns + 1)
    text = lambda numbers: " ".join(f"{n:.6g}" for n in numbers)
    with open(path, "w", encoding="ascii", newline="\n") as file:
        file.write("IESNA:LM-63-2002\nTILT=NONE\n")
        file.write(f"1 -1 1 {len(polar)} {len(azimuths)} 1 2 0 0 0\n1 1 0\n{text(polar)}\n{text(azimuths)}\n")
        file.writelines(f"{text(row)}\n" for row in table)


class SpotCone:
    """The cone of a spot light under its scale: Cycles computes directions in the light's space, so that different scales by axis make cones
    wider, narrower or elliptic."""

    def __init__(self, light, scale):
        x, y, z = (max(abs(part), 1e-9) for part in scale)
        self.half_angle, self.blend, self.stretch = light.spot_size / 2, light.spot_blend, (x / z, y / z)

    def is_unchanged(self):
        return all(abs(factor - 1) <= TOLERANCE for factor in self.stretch)

    def is_round(self):
        return abs(self.stretch[0] / self.stretch[1] - 1) <= TOLERANCE

    def mean_half_angle(self):
        """That of a round cone with the same cross section."""
        return self._stretched(math.sqrt(self.stretch[0] * self.stretch[1]))

    def max_half_angle(self):
        return self._stretched(max(self.stretch))

    def _stretched(self, factor):
        return math.atan2(factor * math.sin(self.half_angle), math.cos(self.half_angle))

    def write(self, path):
        """Writes the falloff of the cone as a profile."""
        polar = self.max_half_angle() * (np.arange(POLAR_ANGLES) + 0.5) / POLAR_ANGLES
        count = 4 if self.is_round() else AZIMUTHS
        azimuths = 2 * np.pi * np.arange(count) / count
        width = np.hypot(np.cos(azimuths) / self.stretch[0], np.sin(azimuths) / self.stretch[1])
        cosines = np.cos(polar)[:, None] / np.hypot(np.sin(polar)[:, None] * width, np.cos(polar)[:, None])
        edge = math.cos(self.half_angle)
        inner = np.clip((cosines - edge) / max(self.blend * (1 - edge), 1e-6), 0, 1)
        write(inner * inner * (3 - 2 * inner), self.max_half_angle(), path)
