"""Writes src/load/sky/dataset.bin: the published coefficients of the sky of Hosek and Wilkie (2012) and of its sun (2013)
in the form that the program reads: little-endian f32, three arrays one behind the other.

  sky shape   [turbidity 10][albedo 2][control point 6][channel 3][parameter 9]
  sky mean    [turbidity 10][albedo 2][control point 6][channel 3]
  sun         [turbidity 10][segment 45][channel 3][power of the elevation 4]

The sky's are those that the authors give for linear Rec. 709 (as Y times 683 lm/W is a luminance). The sun's are given for
eleven wavelengths. What they mean is linear in the coefficients, so those are converted: weighted by the CIE 1931
observer (spectra linear between the wavelengths), by the mean limb darkening of the disk, and by the matrix to Rec. 709.

Usage: python3 dataset.py ../../src/load/sky/dataset.bin, with the package `mitsuba` (pip), which brings the published
numbers (BSD, see src/load/sky/LICENSE) and the observer.
"""
import os
import struct
import sys

import mitsuba
import numpy as np

RGB_FROM_XYZ = np.array([[3.240479, -1.537150, -0.498535], [-0.969256, 1.875991, 0.041556], [0.055648, -0.204043, 1.057311]])


def fields(path):
    """The arrays of a file of tensors by their names."""
    data = open(path, "rb").read()
    kinds = {10: np.float32, 11: np.float64}
    _, _, count = struct.unpack_from("<12s2sI", data, 0)
    at, found = 18, {}
    for _ in range(count):
        (length,) = struct.unpack_from("<H", data, at)
        name = data[at + 2 : at + 2 + length].decode()
        at += 2 + length
        dimensions, kind, offset = struct.unpack_from("<HBQ", data, at)
        at += 11
        shape = struct.unpack_from(f"<{dimensions}Q", data, at)
        at += 8 * dimensions
        found[name] = np.frombuffer(data, kinds[kind], int(np.prod(shape)), offset).reshape(shape)
    return found


def observer():
    """XYZ of the hat functions around the eleven wavelengths: 3 by 11, for spectra per nanometre."""
    mitsuba.set_variant("scalar_rgb")
    nanometres = np.arange(360.0, 831.0)
    xyz = np.array([np.array(mitsuba.cie1931_xyz(w)).ravel()[:3] for w in nanometres])
    known = np.arange(320.0, 721.0, 40.0)
    hats = np.array([np.interp(nanometres, known, np.eye(11)[k], right=0.0) for k in range(11)])
    return (hats @ xyz).T


def main():
    here = os.path.join(os.path.dirname(mitsuba.__file__), "data", "sunsky", "sunsky_datasets.bin")
    given = fields(here)
    for name, values in given.items():
        print(name, values.shape)
    # The mean of cos^j over a disk seen from far away is 2 / (j + 2).
    darkening = given["sun_ld_spec"] @ np.array([2.0 / (j + 2) for j in range(6)])
    print("mean limb darkening", darkening)
    to_rgb = RGB_FROM_XYZ @ observer() * darkening
    sun = np.einsum("cw,tswk->tsck", to_rgb, given["sun_rad_spec"])
    with open(sys.argv[1], "wb") as out:
        for values in (given["sky_params_rgb"], given["sky_rad_rgb"], sun):
            print(values.shape, values.min(), values.max())
            out.write(values.astype("<f4").tobytes())


main()
