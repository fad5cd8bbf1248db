"""The CIE 1931 2° standard observer, without the half second and 60 MB of a colour library.

C. Wyman, P.-P. Sloan, P. Shirley, *Simple analytic approximations to the CIE XYZ color matching
functions*, JCGT 2 (2013) 2, eq. 4: sums of Gaussians with two widths. Against the tables at 5 nm:
RMS 0.006, 0.003 and 0.005, integrals to 0.1 %; a camera's own misfit is twenty times that.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: Rows: height, peak in nm, width below and above it in nm; for x̄, ȳ, z̄.
_LOBES = (
    ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
    ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
    ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
)


def colour_matching(wavelength_nm: FloatArray) -> FloatArray:
    """x̄, ȳ, z̄ at each wavelength, shape (n, 3)."""
    columns = []
    for lobes in _LOBES:
        column = np.zeros_like(wavelength_nm, dtype=np.float64)
        for height, peak_nm, below_nm, above_nm in lobes:
            width_nm = np.where(wavelength_nm < peak_nm, below_nm, above_nm)
            column += height * np.exp(-0.5 * ((wavelength_nm - peak_nm) / width_nm) ** 2)
        columns.append(column)
    return np.stack(columns, axis=1)
