"""Errors of measured ceramic tiles, which do not re-radiate, in units of their estimated σ.

python -m tests.acceptance.tile_noise
"""

from collections.abc import Sequence

import numpy as np

from labrig.material import (
    InstrumentNoise,
    ReradiationMatrix,
    corrected,
    instrument_noise,
    with_sigma,
)
from tests.material.reradiation.bfc450 import INPUT_NM, samples, tiles
from tests.material.reradiation.noisy_bands import REGIONS, ULTRAVIOLET, band_sigma

#: Columns over which sums are compared, in nm.
SUMMED_NM = (430, 600)


def rms_over_sigma(
    learnt: InstrumentNoise | None, others: Sequence[ReradiationMatrix], is_corrected: bool
) -> dict[str, float]:
    """Return the rms of re-radiation over σ, by region; without repeats not of the ultraviolet."""
    known = [
        corrected(tile, learnt) if is_corrected else with_sigma(tile, learnt) for tile in others
    ]
    pulls = np.array([10 * tile.reradiation / band_sigma(tile) for tile in known])
    regions = REGIONS if learnt is None else REGIONS | {"ultraviolet": ULTRAVIOLET}
    return {name: float(np.sqrt(np.mean(pulls[:, at] ** 2))) for name, at in regions.items()}


def main() -> None:
    """Learn the noise from every second tile and print the errors of the others."""
    measured = list(tiles())
    learnt, others = instrument_noise(measured[::2]), measured[1::2]
    print(f"{len(measured)} measurements of tiles; rms of error over σ")
    for name, noise in (("repeats known", learnt), ("by itself", None)):
        for is_corrected in (False, True):
            told = rms_over_sigma(noise, others, is_corrected)
            what = "corrected" if is_corrected else "as measured"
            print(f"{name}, {what}:", *(f"{where} {rms:.2f};" for where, rms in told.items()))
    first, last = (int(np.searchsorted(INPUT_NM, nm)) for nm in SUMMED_NM)
    for what, some in (("as measured", others), ("corrected", [corrected(one) for one in others])):
        sums = np.array([tile.reradiated_fraction[first : last + 1] for tile in some])
        print(f"sums over columns, {what}: rms {np.sqrt(np.mean(sums**2)):.4f}")
    surfaces = samples()
    most = max(map(_all_that_returns, surfaces))
    print(f"{len(surfaces)} other surfaces: up to {most:.2f} of a wavelength comes back")


def _all_that_returns(matrix: ReradiationMatrix) -> float:
    reflected = np.interp(matrix.input_nm, matrix.output_nm, matrix.reflectance, left=0.0)
    return float(np.max(matrix.reradiated_fraction + reflected))


if __name__ == "__main__":
    main()
