"""Emission spectra through colour filters before the camera, against those of the room.

    python -m tests.acceptance.camera_filters [--materials blue-paint …] [--seed 5]

A bench without a variable filter: five filters in a wheel before the camera, five by hand. Filters
differ by 1 % from their files, and the camera's curves as much as those of three laboratories. The
materials have peaks and shoulders of 25 nm, which the fit does not assume.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from labrig.process import process_run
from labrig.protocols.emission_spectrum.result import EmissionSpectrumResult
from tests.analyse.camera_filters_bench import recorded
from tests.analyse.spectral_bench import emitted

MATERIALS = (
    "blue-paint", "green-paint", "orange-paint", "yellow-paint", "white-paint", "red-paint",
    "pink-paint", "purple-paint",
)  # fmt: skip
#: Least σ of a value over the peak, where all draws are 0.
LEAST = 2e-3


def main() -> None:
    """Print the deviations of every material's spectrum."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--materials", nargs="+", default=list(MATERIALS))
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args()
    squares = []
    for number, material in enumerate(options.materials):
        with tempfile.TemporaryDirectory() as folder:
            run = recorded(
                Path(folder), seed=options.seed + number, sample=material, filters_bent=0.01
            )
            result = process_run(run)
        assert isinstance(result, EmissionSpectrumResult)
        (patch,) = result.patches.values()
        value, sigma = np.array(patch.spectrum.value), np.array(patch.spectrum.sigma)
        difference = value - emitted(material) * value.sum()
        pulls = difference / np.maximum(sigma, LEAST)
        squares.append(np.mean(pulls**2))
        centroid = patch.spectrum.centroid
        true_nm = np.array(patch.spectrum.wavelength_nm) @ emitted(material)
        print(
            f"{material:13} off by {100 * np.sqrt(np.mean(difference**2)):4.1f} % of the peak rms, "
            f"{100 * np.abs(difference).max():4.1f} % at most; {np.abs(pulls).max():3.1f} σ at "
            f"most, rms {np.sqrt(squares[-1]):4.2f}; centroid off by "
            f"{centroid.value - true_nm:+5.1f} ± {centroid.sigma:3.1f} nm"
        )
        for warning in result.warnings:
            print(f"  {warning}")
    print(f"pulls of rms {np.sqrt(np.mean(squares)):.2f}")


if __name__ == "__main__":
    main()
