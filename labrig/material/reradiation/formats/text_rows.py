"""Lines and numbers of text formats; every message names the line."""

import math
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material.reradiation.matrix import ReradiationMatrix, are_same_bands

#: Range of wavelengths in nm, which excludes tables in µm or in Hz.
PLAUSIBLE_NM = (100.0, 20_000.0)
#: Largest magnitude of a fraction that is no fault of the file.
MAX_FRACTION = 2.0
#: Characters of a line that a message repeats.
_SHOWN = 30


class Line(NamedTuple):
    """A line of a file, with its number from 1."""

    number: int
    text: str


def filled_lines(text: str) -> list[Line]:
    """Return the lines that are not blank, whatever ends them."""
    lines = re.split(r"\r+\n|\n|\r", text)
    return [Line(k, line.strip()) for k, line in enumerate(lines, start=1) if line.strip()]


def shown(text: str) -> str:
    """Return the beginning of a text in quotation marks, on one line."""
    plain = " ".join(text.split())
    return f"'{plain[:_SHOWN]}…'" if len(plain) > _SHOWN else f"'{plain}'"


def number(cell: str, line_number: int) -> float:
    """Return the finite number in a cell.

    Raises
    ------
    ValueError
        It is no number, or not finite.
    """
    try:
        # Python reads 1_000 as a number.
        value = float(cell.replace("_", "?"))
    except ValueError:
        raise ValueError(f"line {line_number}: expected a number, got {shown(cell)}") from None
    if not math.isfinite(value):
        raise ValueError(f"line {line_number}: expected a finite number, got {shown(cell)}")
    return value


def numbers(cells: Iterable[str], line_number: int) -> list[float]:
    """Return the finite numbers in cells."""
    return [number(cell, line_number) for cell in cells]


def numbers_or_nan(cells: Iterable[str], line_number: int) -> list[float]:
    """Return the finite numbers in cells, NaN of empty ones."""
    return [number(cell, line_number) if cell else math.nan for cell in cells]


def wavelengths(cells: Sequence[str], line_number: int) -> FloatArray:
    """Return the wavelengths in nm that stand in cells."""
    nm = np.array(numbers(cells, line_number))
    check_wavelengths(nm, f"line {line_number}: ")
    return nm


def check_wavelengths(nm: FloatArray, place: str = "") -> None:
    """Raise ValueError if there is one wavelength, or they do not rise or are no nm."""
    low, high = PLAUSIBLE_NM
    if len(nm) < 2:
        raise ValueError(f"{place}expected two or more wavelengths, got {len(nm)}")
    if (nm < low).any() or (nm > high).any():
        raise ValueError(
            f"{place}expected wavelengths from {low:g} to {high:g} nm, "
            f"got {nm.min():g} to {nm.max():g}"
        )
    if (np.diff(nm) <= 0).any():
        at = int(np.argmax(np.diff(nm) <= 0))
        raise ValueError(
            f"{place}expected wavelengths that rise, got {nm[at + 1]:g} after {nm[at]:g} nm"
        )


def check_fractions(values: Sequence[float], place: str) -> None:
    """Raise ValueError if a fraction per band is absurd; NaN is none."""
    absurd = next((value for value in values if abs(value) > MAX_FRACTION), None)
    if absurd is not None:
        raise ValueError(
            f"{place}: expected fractions, got {absurd:g}, which is above "
            f"{MAX_FRACTION:g} in magnitude"
        )


def one_line(name: str) -> str:
    """Return a name with single blanks in between, as text formats hold it."""
    return " ".join(name.split())


def number_text(value: float) -> str:
    """Return the shortest text that is read back as the same number, nothing for NaN."""
    return "" if math.isnan(value) else repr(float(value))


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
