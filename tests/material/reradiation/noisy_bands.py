"""Bands with noise."""

import numpy as np
from numpy.typing import NDArray

from labrig.material import (
    ReradiationMatrix,
)
from tests.material.reradiation.synthetic import (
    INPUT_NM,
    OUTPUT_NM,
)

FAR = OUTPUT_NM[:, np.newaxis] > INPUT_NM + 15

REGIONS = {
    "seen by few rows": FAR & (INPUT_NM >= 400) & (INPUT_NM <= 430),
    "blue": FAR & (INPUT_NM >= 440) & (INPUT_NM <= 600),
    "red": FAR & (INPUT_NM > 600),
    "middle rows": FAR & (INPUT_NM >= 400) & (abs(OUTPUT_NM - 525) <= 75)[:, np.newaxis],
    "long rows": FAR & (INPUT_NM >= 400) & (OUTPUT_NM >= 700)[:, np.newaxis],
}

ULTRAVIOLET = FAR & (INPUT_NM <= 390)


def band_sigma(matrix: ReradiationMatrix) -> NDArray[np.float64]:
    """σ of the re-radiation as fraction per band."""
    assert matrix.reradiation_sigma is not None
    return matrix.reradiation_sigma * matrix.output_width_nm[:, np.newaxis]
