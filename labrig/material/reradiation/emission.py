"""Emission spectra of measured surfaces, such as a library of dyes."""

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from labrig.foundation.errors import DataError, UsageError
from labrig.material.reradiation.formats import matrix_files, read_reradiation
from labrig.material.reradiation.matrix import ReradiationMatrix
from labrig.material.reradiation.noise import reradiates, with_sigma
from labrig.optics import Spectrum, read_curve_file, read_spectrum


def emission_spectrum(matrix: ReradiationMatrix) -> Spectrum:
    """Return what a surface re-radiates, on average over its excitation.

    Parameters
    ----------
    matrix
        Reflectance and re-radiation of the surface.

    Returns
    -------
    Spectrum
        Emission per nm, on any scale: the columns of the matrix on its Stokes side, weighted by the
        light that they re-radiate, since the others are mostly noise. Negative values are 0.

    Examples
    --------
    >>> from labrig.material import emission_spectrum, read_reradiation
    >>> emission = emission_spectrum(read_reradiation("paper.csv"))
    >>> float(emission.wavelength_nm[emission.value.argmax()])
    520.0
    """
    stokes = np.where(matrix.is_stokes, np.nan_to_num(matrix.reradiation), 0.0)
    weight = np.maximum(matrix.reradiated_fraction, 0.0) * matrix.input_width_nm
    return Spectrum(matrix.name, matrix.output_nm, np.maximum(stokes @ weight, 0.0))


def read_emissions(path: str | os.PathLike[str]) -> tuple[Spectrum, ...]:
    r"""Read a library of emission spectra.

    Parameters
    ----------
    path
        Path of a folder of re-radiation matrices, whose emissions are taken, or of tables of
        spectra, or of one such file: a table has a column `wavelength_nm` and one for each dye.

    Returns
    -------
    tuple of Spectrum
        The emissions, on any scale. Matrices that do not re-radiate more than their noise are left
        out.

    Raises
    ------
    UsageError
        A file is malformed, or there is no emission.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.material import read_emissions
    >>> _ = Path("dyes.csv").write_text("wavelength_nm,a,b\n480,0,1\n520,1,0.5\n560,0,0\n")
    >>> [emission.name for emission in read_emissions("dyes.csv")]
    ['a', 'b']
    """
    place = Path(path)
    if not place.exists():
        raise UsageError(
            f"{place}: expected an emission_library, a folder or a file, got none; give its path"
        )
    files = matrix_files(place) if place.is_dir() else [place]
    emissions = tuple(emission for file in files for emission in _emissions(file))
    if not emissions:
        raise UsageError(
            f"{place}: expected re-radiation matrices or tables of emission spectra, got none that "
            "re-radiates; name another emission_library"
        )
    return emissions


def _emissions(file: Path) -> Iterator[Spectrum]:
    try:
        matrix = read_reradiation(file)
    except UsageError as no_matrix:
        try:
            names = tuple(read_curve_file(file).curves)
        except UsageError:
            raise UsageError(
                f"{no_matrix}; nor is it a table of spectra; take it out of the emission_library"
            ) from None
        yield from (read_spectrum(file, name) for name in names)
        return
    if _is_seen(matrix):
        yield emission_spectrum(matrix)


def _is_seen(matrix: ReradiationMatrix) -> bool:
    """Return whether a surface re-radiates more than its noise, if it has any."""
    if matrix.reradiation_sigma is not None:
        return reradiates(matrix)
    try:
        return reradiates(with_sigma(matrix))
    except DataError:  # without noise, as a model's
        return bool(matrix.reradiated_fraction.max() > 0)
