"""Content of a matrix that formats of fractions per band can hold."""

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material.reradiation.formats.text_rows import check_fractions, check_wavelengths
from labrig.material.reradiation.matrix import ReradiationMatrix, are_same_bands


def band_fractions(matrix: ReradiationMatrix) -> FloatArray:
    """Return the bispectral matrix, reflectance on its diagonal, all of it measured.

    Raises
    ------
    ValueError
        The re-radiation is relative, something was not measured, or has no place in such a matrix.
    """
    check_wavelengths(matrix.input_nm)
    check_wavelengths(matrix.output_nm)
    check_is_absolute(matrix)
    has_input = are_same_bands(matrix.output_nm, matrix.input_nm)
    if np.isnan(matrix.reflectance[has_input.any(axis=1)]).any():
        raise ValueError("some reflectance was not measured, which the format cannot say; use CSV")
    fractions = matrix.to_bands()
    if np.isnan(fractions).any():
        raise ValueError("some entry was not measured, which the format cannot say; use CSV")
    check_fractions(fractions.ravel().tolist(), "the matrix")
    return fractions


def check_is_absolute(matrix: ReradiationMatrix) -> None:
    """Raise ValueError if the re-radiation is relative."""
    if matrix.unit != "1/nm":
        raise ValueError("the re-radiation is relative, the format holds fractions; use CSV")


def regular_grid(nm: FloatArray) -> tuple[float, float]:
    """Return start and step of wavelengths in nm.

    Raises
    ------
    ValueError
        The steps differ.
    """
    start, step = float(nm[0]), float(nm[1] - nm[0])
    if not np.allclose(nm, start + step * np.arange(len(nm)), rtol=0, atol=1e-6):
        raise ValueError("the format needs wavelengths at even steps; rebin the matrix, or use CSV")
    return start, step
