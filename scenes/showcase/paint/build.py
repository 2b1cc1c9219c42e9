#!/usr/bin/env python3
"""Builds the body on which paint is shown, and the bent floor, in meshes/, in a second."""

import math
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.dirname(HERE))
from shapes import Mesh, arc, grid, smoothstep  # noqa: E402

OUT = os.path.join(HERE, "meshes")
LENGTH = 0.46


def bump(x, low, top_low, top_high, high):
    return smoothstep(low, top_low, x) * (1 - smoothstep(top_high, high, x))


def section(x, angle):
    """Radius of the cross section at x, from -1 (nose) to 1 (tail), in units of half the length."""
    end = max(1 - abs(x) ** 4.2, 0.0) ** 0.42
    waist = 0.40 + 0.035 * math.exp(-((x - 0.52) / 0.28) ** 2) + 0.025 * math.exp(-((x + 0.55) / 0.25) ** 2) - 0.012 * math.exp(-(x / 0.3) ** 2)
    shoulder = 0.185 + 0.10 * smoothstep(-1.0, 0.55, x) + 0.018 * math.exp(-((x + 0.55) / 0.2) ** 2)
    c, s = abs(math.cos(angle)), abs(math.sin(angle))

    def radius(width, height, power):
        return ((c / width) ** power + (s / height) ** power) ** (-1 / power)

    body = radius(waist * end + 1e-6, shoulder * (0.14 + 0.86 * end) + 1e-6, 2.7)
    roof = 0.42 * bump(x, -0.80, 0.12, 0.16, 1.25) + 1e-6
    cabin = radius((0.15 + 0.14 * bump(x, -0.7, 0.05, 0.25, 1.1)) * end + 1e-6, roof, 2.3)
    k = 20
    return math.log(math.exp(k * body) + math.exp(k * cabin)) / k


def body():
    def point(u, v):
        x = math.sin((v - 0.5) * math.pi)
        x = 0.35 * x + 0.65 * (2 * v - 1)
        x = max(min(x, 0.99999), -0.99999)
        angle = math.pi * u
        r = section(x, angle)
        y, z = r * math.sin(angle), r * math.cos(angle)
        # Recesses where wheels would be.
        for wheel in (-0.56, 0.55):
            d = math.hypot(x - wheel, y - 0.015)
            z *= 1 - 0.10 * (1 - smoothstep(0.150, 0.172, d)) * smoothstep(0.2, 0.3, abs(z))
        # A line along the flank.
        line = math.exp(-((y - (0.125 + 0.05 * x)) / 0.012) ** 2) * bump(x, -0.35, -0.1, 0.25, 0.45)
        z *= 1 - 0.02 * line
        h = LENGTH / 2
        return (x * h, 0.004 + y * h, -z * h)

    shell = grid(220, 420, point)
    # A belly closes it.
    n, rows = 221, 421
    belly = [(j * n, (j + 1) * n, (j + 1) * n + n - 1, j * n + n - 1) for j in range(rows - 1)]
    ends = [tuple(range(n)), tuple(reversed(range((rows - 1) * n, rows * n)))]
    return Mesh(shell.points, shell.faces + belly + ends)


def floor():
    profile = [(6.0, 0.0)] + [(-1.0 + x, y) for x, y in arc((0, 0.6), 0.6, -90, -180, 32)] + [(-1.6, 4.0)]
    return grid(1, len(profile) - 1, lambda u, v: (-6 + 12 * u, profile[round(v * (len(profile) - 1))][1],
                                                   profile[round(v * (len(profile) - 1))][0]))


def main():
    os.makedirs(OUT, exist_ok=True)
    body().save(os.path.join(OUT, "body.ply"))
    floor().save(os.path.join(OUT, "floor.ply"))


main()
