"""Colours of mixtures that stand for measured re-radiation matrices, over a folder of them.

    python -m tests.acceptance.mixture_colours [--folder FOLDER] [--components 4] [--scale colour]

For each matrix that re-radiates: masked error, and ΔE2000 and relative XYZ error of the mixture,
with the measured reflectance, against the matrix as corrected; with --uncorrected against it as
measured. A matrix with nothing above its noise is compared without any re-radiation. The last lines
are quantiles, of all and of those that re-radiate.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from labrig.fit import fit_mixture
from labrig.material import (
    compare_colours,
    corrected,
    matrix_files,
    read_reradiation,
    reradiates,
)
from labrig.optics import read_light
from tests.real_data import SHARED

FOLDER = SHARED / "bispectral/rit_bfc450"
LIGHTS = ("D65", "A", "450nm", "395nm")
#: Fraction of the light of some wavelength from which a surface counts as re-radiating here.
MIN_FRACTION = 0.1


def main() -> None:
    """Print a line for each matrix, then quantiles."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=FOLDER)
    parser.add_argument("--components", type=int, default=4)
    parser.add_argument("--scale", default="integral")
    parser.add_argument("--skewed", action="store_true")
    parser.add_argument("--uncorrected", action="store_true")
    asked = parser.parse_args()
    lights = [read_light(name) for name in LIGHTS]
    rows, glowing = [], []
    for path in matrix_files(asked.folder):
        measured = read_reradiation(path)
        if measured.reradiated_fraction.max() <= MIN_FRACTION:
            continue
        whole = corrected(measured)
        reference = measured if asked.uncorrected else whole
        smooth = replace(whole, reradiation=np.where(whole.is_stokes, 0.0, whole.reradiation))
        mse = np.nan
        if reradiates(whole):
            fit = fit_mixture(
                whole, asked.components, asked.scale, skewed=asked.skewed, lights=lights[:3]
            )
            grids_nm = whole.input_nm, whole.output_nm
            smooth = fit.mixture.to_matrix(*grids_nm, reflectance=reference.reflectance)
            mse = fit.masked_mse
        differences = compare_colours(smooth, reference, lights)
        errors = [each.delta_e for each in differences], [each.xyz_error for each in differences]
        rows.append([mse, *errors[0], *errors[1]])
        glowing.append(reradiates(whole))
        remark = "" if reradiates(whole) else "  nothing above its noise"
        print(f"{path.name:14} {_told(np.array(rows[-1]))}{remark}", flush=True)
    print(f"{asked.components} components; ΔE2000 and XYZ error under {', '.join(LIGHTS)}")
    for which, chosen in (("all", slice(None)), ("re-radiating", np.array(glowing))):
        table = np.array(rows)[chosen]
        for quantile in (0.5, 0.9, 1.0):
            values = np.nanquantile(table, quantile, axis=0)
            print(f"{len(table)} {which}, {100 * quantile:.0f} %: {_told(values)}")


def _told(values: np.ndarray) -> str:
    pairs = zip(values[1 : 1 + len(LIGHTS)], values[1 + len(LIGHTS) :], strict=True)
    return f"{1e6 * values[0]:6.2f}e-6  " + "  ".join(f"{a:6.2f} {b:7.2%}" for a, b in pairs)


if __name__ == "__main__":
    main()
