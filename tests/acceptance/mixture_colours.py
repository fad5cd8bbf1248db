"""Colours of mixtures that stand for measured re-radiation matrices, over a folder of them.

    python -m tests.acceptance.mixture_colours [--folder FOLDER] [--components 4]

For each matrix that re-radiates: masked error, and ΔE2000 and relative XYZ error of the mixture,
with the measured reflectance, against the matrix as corrected; with --uncorrected against it as
measured. The last lines are quantiles.
"""

import argparse
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

FOLDER = Path(__file__).parents[3] / "shared/data/bispectral/rit_bfc450"
LIGHTS = ("D65", "A", "450nm", "395nm")
#: Fraction of the light of some wavelength from which a surface counts as re-radiating here.
LEAST_FRACTION = 0.1


def main() -> None:
    """Print a line for each matrix, then quantiles."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=FOLDER)
    parser.add_argument("--components", type=int, default=4)
    parser.add_argument("--uncorrected", action="store_true")
    asked = parser.parse_args()
    lights = [read_light(name) for name in LIGHTS]
    rows = []
    for path in matrix_files(asked.folder):
        measured = read_reradiation(path)
        if measured.reradiated_fraction.max() <= LEAST_FRACTION:
            continue
        whole = corrected(measured)
        if not reradiates(whole):
            print(f"{path.name:14} nothing above its noise")
            continue
        fit = fit_mixture(whole, asked.components)
        reference = measured if asked.uncorrected else whole
        smooth = fit.mixture.to_matrix(
            whole.input_nm, whole.output_nm, reflectance=reference.reflectance
        )
        found = compare_colours(smooth, reference, lights)
        rows.append([fit.masked_mse, *(one.delta_e for one in found),
                     *(one.xyz_error for one in found)])  # fmt: skip
        told = "  ".join(f"{one.delta_e:6.2f} {one.xyz_error:7.2%}" for one in found)
        print(f"{path.name:14} {1e6 * fit.masked_mse:6.2f}e-6  {told}", flush=True)
    table = np.array(rows)
    print(f"{len(table)} matrices, {asked.components} components; ΔE2000 and XYZ error under "
          f"{', '.join(LIGHTS)}")  # fmt: skip
    for quantile in (0.5, 0.9, 1.0):
        values = np.nanquantile(table, quantile, axis=0)
        delta_e, errors = values[1 : 1 + len(LIGHTS)], values[1 + len(LIGHTS) :]
        told = "  ".join(f"{a:6.2f} {b:7.2%}" for a, b in zip(delta_e, errors, strict=True))
        print(f"{100 * quantile:3.0f} %          {1e6 * values[0]:6.2f}e-6  {told}")


if __name__ == "__main__":
    main()
