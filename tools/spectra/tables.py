"""Writes the tables of measured curves: src/color/spectral/observer.rs and src/color/spectral/metals.rs.

    python tables.py FOLDER_OF_INDICES TARGET

Needs the packages numpy and colour-science, which has the tables of the CIE (CIE 015: the observer of 1931 and D65, every
5 nm), and a folder with the indices of refraction of metals as pairs of files NAME.eta.spd and NAME.k.spd, a wavelength in
nanometres and a value on each line, as the package mitsuba ships them (Palik, "Handbook of Optical Constants of Solids").
"""

import sys
import warnings
from pathlib import Path

warnings.filterwarnings("ignore")
import colour  # noqa: E402
import numpy as np  # noqa: E402

METALS = [
    ("aluminium", "Al"), ("beryllium", "Be"), ("chromium", "Cr"), ("copper", "Cu"), ("gold", "Au"),
    ("iridium", "Ir"), ("molybdenum", "Mo"), ("niobium", "Nb"), ("rhodium", "Rh"),
    ("silver", "Ag"), ("tantalum", "Ta"), ("titanium-nitride", "TiN"), ("tungsten", "W"),
]


def number(value):
    """A literal of single precision that clippy finds readable."""
    text = np.format_float_positional(np.float32(value), trim="0")
    whole, _, rest = text.partition(".")
    groups = [rest[i:i + 3] for i in range(0, len(rest), 3)] if len(rest) > 5 else [rest]
    return whole + "." + "_".join(groups)


def table(name, doc, kind, values):
    return f"/// {doc}\npub const {name}: {kind} = [{', '.join(values)}];\n"


def observer():
    matching = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    d65 = colour.SDS_ILLUMINANTS["D65"]
    nm = range(380, 781, 5)
    triples = ["[" + ", ".join(number(v) for v in matching[w]) + "]" for w in nm]
    text = "//! The standard observer of the CIE and its daylight, every 5 nm from 380 to 780 nm (CIE 015:2018, tables 1 and 5).\n"
    text += "//! Made by `tools/spectra/tables.py`.\n\n"
    text += table("MATCHING", "The colour matching functions of 1931: X, Y and Z.", f"[[f32; 3]; {len(nm)}]", triples)
    text += "\n" + table("D65", "Relative power of the illuminant D65.", f"[f32; {len(nm)}]", [number(d65[w]) for w in nm])
    return text


def metals(folder):
    read = lambda file: np.array([
        [float(v) for v in line.split()[:2]] for line in file.read_text().splitlines()
        if line.strip() and not line.startswith("#")
    ])
    rows = []
    for name, file in METALS:
        eta, k = (read(folder / f"{file}.{part}.spd") for part in ("eta", "k"))
        inside = [w for w in eta[:, 0] if 380 < w < 780]
        below, above = max(w for w in eta[:, 0] if w <= 380), min(w for w in eta[:, 0] if w >= 780)
        nodes = [below, *inside, above]
        at = lambda curve, w: np.interp(w, curve[:, 0], curve[:, 1])
        triples = [f"[{number(round(w, 1))}, {number(at(eta, w))}, {number(at(k, w))}]" for w in nodes]
        rows.append(f'("{name}", &[{", ".join(triples)}])')
    text = "//! Measured indices of refraction of metals (Palik 1998, \"Handbook of Optical Constants of Solids\").\n"
    text += "//! Made by `tools/spectra/tables.py`.\n\n"
    doc = "By name: wavelength in nanometres, real part, extinction coefficient."
    allowed = "#[allow(clippy::approx_constant, reason = \"measured, not circles\")]\n"
    return text + f"/// {doc}\n{allowed}pub const METALS: [(&str, &[[f32; 3]]); {len(rows)}] = [{', '.join(rows)}];\n"


def main():
    folder, target = map(Path, sys.argv[1:])
    (target / "observer.rs").write_text(observer())
    (target / "metals.rs").write_text(metals(folder))


main()
