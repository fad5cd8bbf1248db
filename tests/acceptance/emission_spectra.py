"""Emission spectra measured in the simulated room, against what the samples emit.

    python -m tests.acceptance.emission_spectra [seeds]

For every material and seed a run of `emission_spectrum` with the LVF known without error, curves
bent as laboratories disagree, a white picture and without it. Printed: root mean square and
largest error of Λ* (largest value 1), how often the truth lies within 1 and 2 σ of bands above
2 % of the peak, the largest distance in σ, and how often the spectrum is said to change.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from labrig.analyse import Overrides
from labrig.foundation.arrays import FloatArray
from labrig.protocols.emission_spectrum.analysis import analyse
from labrig.record import read_run
from labrig.results.emission_spectrum import EmissionSpectrum
from tests.analyse.recorded import part_of
from tests.analyse.spectral_bench import emitted, record

MATERIALS = ("blue-paint", "green-paint", "orange-paint", "red-paint", "white-paint")
PROTOCOL = {"protocol": "emission_spectrum", "charge": "5 min", "times": ["2 s", "12 s", "30 s"],
            "longest": "15 s"}  # fmt: skip
BRIGHT = 0.02


def measured(material: str, seed: int) -> list[tuple[EmissionSpectrum, bool]]:
    """Measure with and without the white picture, each with whether a change was reported."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sample = [{"material": material, "region": [0.03, 0.1, 0.94, 0.8]}]
        run = record(folder, PROTOCOL, sample=sample, seed=seed)
        part = part_of(run)
        white = frozenset(frame.path.name for frame in read_run(run).frames("white"))
        found = []
        for excluded in (frozenset[str](), white):
            result = analyse(replace(part, overrides=Overrides(excluded=excluded)))
            patch = result.patches[""]
            found.append((patch.spectrum, patch.changes_with_time))
        return found


def errors(spectrum: EmissionSpectrum, material: str) -> tuple[FloatArray, FloatArray]:
    """Error of Λ*, and in σ where it is bright."""
    value, true = np.array(spectrum.value), emitted(material)
    true = true * value.sum()
    difference = value - true
    return difference, (difference / np.array(spectrum.sigma))[true > BRIGHT]


def main(seeds: int) -> None:
    """Print the table."""
    print(f"{'material':14s}{'white':>7s}{'rms':>8s}{'max':>8s}{'1 σ':>7s}{'2 σ':>7s}{'max/σ':>7s}"
          f"{'changes':>9s}")  # fmt: skip
    for material in MATERIALS:
        runs = [measured(material, seed) for seed in range(1, seeds + 1)]
        for number, white in enumerate(("yes", "no")):
            both = [errors(run[number][0], material) for run in runs]
            difference = np.concatenate([one for one, _ in both])
            in_sigma = np.abs(np.concatenate([two for _, two in both]))
            changes = sum(run[number][1] for run in runs)
            print(
                f"{material:14s}{white:>7s}{np.sqrt(np.mean(difference**2)):8.4f}"
                f"{np.abs(difference).max():8.4f}{np.mean(in_sigma < 1):7.0%}"
                f"{np.mean(in_sigma < 2):7.0%}{in_sigma.max():7.2f}{changes:6d}/{seeds}",
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
