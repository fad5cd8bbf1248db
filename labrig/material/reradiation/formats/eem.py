"""Excitation-emission matrices (EEM) of spectrofluorometers, as text.

Those of instruments and spreadsheets are read in any of their layouts; what is scattered light in
them, and what is not measured, is left out. labrig's own begin with the cell
`excitation_nm/emission_nm` and the emission wavelengths in nm; every other line is an excitation
wavelength, then intensities in an arbitrary unit, of which 0 was not measured. There is no
reflectance.

What solution and cell scatter comes back at the wavelength of the excitation (Rayleigh and Tyndall
scattering) and, in higher orders of the emission's grating, at its multiples; water shifts a part
by its O-H stretching vibration, 3400 cm⁻¹ (Raman scattering; J. R. Lakowicz, Principles of
Fluorescence Spectroscopy, 3rd edition, section 2.5). Such lines are looked for, and no longer count
as measured from where they rise above what is beside them; without lines nothing is left out.
"""

import logging
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.material.reradiation.formats.eem_grid import Axis, emission_in_rows, read_grid
from labrig.material.reradiation.formats.text_rows import (
    Line,
    check_wavelengths,
    filled_lines,
    numbers,
    wavelengths,
)
from labrig.material.reradiation.matrix import ReradiationMatrix

#: Shift of light that water scatters, in 1/nm.
_RAMAN_PER_NM = 3400e-7
#: Half the width in nm of the middle of a line, and the distances at which its surroundings are.
_MIDDLE_NM, _BESIDE_NM = 6.0, (20.0, 40.0)
#: How far a line rises above both sides, as a ratio and over their noise, to be one.
_RATIO, _NOISES = 1.8, 5.0
#: Fewest excitations, and part of them, in which a line stands out.
_FEWEST, _PART = 4, 0.5
#: Ratio of widths of a line and of the one that it follows.
_WIDER = 1.5
#: A line ends where it is no more than this many times what is beside it.
_END_RATIO = 1.5
#: Plateau of a detector that is saturated: fewest entries, each beside another one.
_MIN_SATURATED = 3


class _Line(NamedTuple):
    """A line of scattered light.

    Where it cannot be looked for, it is there if the lines are that it `follows`, and is wider than
    the first of them.
    """

    name: str
    emission_nm: FloatArray
    follows: tuple[str, ...] = ()


def without_scatter(
    excitation_nm: FloatArray, emission_nm: FloatArray, intensity: FloatArray
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return intensities with NaN on lines of scattered light and where the detector is saturated.

    Parameters
    ----------
    excitation_nm, emission_nm
        Rising wavelengths, shapes (m,) and (n,).
    intensity
        Intensities, shape (n, m).

    Returns
    -------
    intensity : ndarray
        Shape (n, m).
    notes : tuple of str
        What was left out, in words.
    """
    notes = []
    left_out = np.zeros(intensity.shape, dtype=bool)
    reaches: dict[str, tuple[float, float] | None] = {}
    for line in _lines(excitation_nm):
        offset_nm = emission_nm[:, np.newaxis] - line.emission_nm
        # A line may take the side of another one for its own.
        reach = _reach(offset_nm, np.where(left_out, np.nan, intensity))
        narrower = [found for name in line.follows if (found := reaches[name]) is not None]
        if reach is None and narrower and len(narrower) == len(line.follows):
            # At the edge of a matrix there are too few excitations to look.
            low, high = narrower[0]
            reach = (_WIDER * low, _WIDER * high)
        reaches[line.name] = reach
        if reach is None:
            continue
        is_line = (offset_nm >= reach[0]) & (offset_nm <= reach[1])
        if is_line.any():
            left_out |= is_line
            notes.append(f"{line.name} left out, {reach[0]:+.0f} to {reach[1]:+.0f} nm about it")
    is_saturated = _saturated(intensity)
    if (is_saturated & ~left_out).any():
        notes.append(
            f"{(is_saturated & ~left_out).sum()} entries left out where the detector is saturated "
            f"at {np.nanmax(intensity):g}"
        )
    return np.where(left_out | is_saturated, np.nan, intensity), tuple(notes)


def _lines(excitation_nm: FloatArray) -> tuple[_Line, ...]:
    # Beyond, a difference of wavenumbers is none of light.
    raman_nm = 1 / (1 / np.minimum(excitation_nm, 2500.0) - _RAMAN_PER_NM)
    first, second, raman = "scattered light", "its second order", "Raman scattering of water"
    return (
        _Line(first, excitation_nm),
        _Line(second, 2 * excitation_nm),
        _Line("its third order", 3 * excitation_nm, (second,)),
        _Line(raman, raman_nm),
        _Line(f"the second order of {raman}", 2 * raman_nm, (raman, second)),
    )


def _reach(offset_nm: FloatArray, intensity: FloatArray) -> tuple[float, float] | None:
    """Return how far a line reaches to both sides of offset 0; None if there is no line."""
    measured = np.isfinite(intensity)
    stands_out, looked_at = 0, 0
    for offset, column, is_there in zip(offset_nm.T, intensity.T, measured.T, strict=True):
        sides = [
            column[is_there & (sign * offset >= _BESIDE_NM[0]) & (sign * offset <= _BESIDE_NM[1])]
            for sign in (-1, 1)
        ]
        middle = column[is_there & (np.abs(offset) <= _MIDDLE_NM)]
        if not len(middle) or not all(len(side) for side in sides):
            continue
        looked_at += 1
        level = max(float(np.median(side)) for side in sides)
        noise = (
            max(float(np.median(np.abs(np.diff(side)))) for side in sides if len(side) > 1)
            if (any(len(side) > 1 for side in sides))
            else 0.0
        )
        top = float(middle.max())
        stands_out += top > _RATIO * max(level, 0.0) and top > level + _NOISES * noise
    if stands_out < _FEWEST or stands_out < _PART * looked_at:
        return None
    return _ends(offset_nm[measured], intensity[measured])


def _ends(offset_nm: FloatArray, intensity: FloatArray) -> tuple[float, float] | None:
    """Return where the profile of a line, its median over the excitations, ends on either side."""
    width_nm = 2.0
    index = np.rint(offset_nm / width_nm).astype(int)
    most = int(_BESIDE_NM[1] / width_nm)
    profile = {
        k: float(np.median(intensity[index == k]))
        for k in range(-most, most + 1)
        if (index == k).any()
    }
    ends = []
    for sign in (-1, 1):
        side = [value for k, value in profile.items() if sign * k * width_nm >= _BESIDE_NM[0]]
        if not side:
            return None
        limit = _END_RATIO * max(float(np.median(side)), 0.0)
        outwards = sorted((k for k in profile if sign * k >= 2), key=abs)
        end = next(
            (k for k in outwards if profile[k] <= limit), sign * int(_BESIDE_NM[0] / width_nm)
        )
        ends.append(end * width_nm)
    return ends[0], ends[1]


def _saturated(intensity: FloatArray) -> BoolArray:
    """Return where the detector shows its largest number, in more than one entry together."""
    with np.errstate(invalid="ignore"):
        is_top = (
            intensity == np.nanmax(intensity)
            if np.isfinite(intensity).any()
            else (np.zeros(intensity.shape, dtype=bool))
        )
    pairs = (is_top[1:] & is_top[:-1]).sum()
    return is_top if pairs >= _MIN_SATURATED - 1 else np.zeros(intensity.shape, dtype=bool)


_logger = logging.getLogger(__name__)

#: First cell of labrig's own files.
_CORNER = "excitation_nm/emission_nm"


@dataclass(frozen=True, eq=False)
class MatrixLayout:
    """Answers to what the table of an excitation-emission matrix leaves open.

    Parameters
    ----------
    rows
        What its rows are, `emission` or `excitation`; None leaves it to the names and the signal.
    excitation_nm
        Excitation wavelengths of emission spectra that stand one below the other without them,
        shape (m,).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import MatrixLayout
    >>> MatrixLayout(excitation_nm=np.arange(230.0, 455, 5)).rows is None
    True
    """

    rows: Axis | None = None
    excitation_nm: FloatArray | None = None


def parse_eem(text: str, layout: MatrixLayout, place: str) -> ReradiationMatrix:
    """Return the matrix in the text of an EEM, without a name, in a relative unit.

    What was taken and left out is logged.

    Parameters
    ----------
    text
        Text of the file.
    layout
        Answers to what the table leaves open.
    place
        Name of the file in what is logged.

    Raises
    ------
    ValueError
        The text is broken, or its axes are not told.
    """
    if text.lstrip().startswith(_CORNER):
        return _own(text)
    grid = read_grid(text, layout.excitation_nm)
    is_emission, told = emission_in_rows(grid, layout.rows)
    emission_nm, input_nm, intensity = grid.row_nm, grid.column_nm, grid.intensity
    if not is_emission:
        emission_nm, input_nm, intensity = input_nm, emission_nm, intensity.T
    order, input_order = np.argsort(emission_nm), np.argsort(input_nm)
    emission_nm, input_nm = emission_nm[order], input_nm[input_order]
    intensity = intensity[np.ix_(order, input_order)]
    check_wavelengths(emission_nm, "emission: ")
    check_wavelengths(input_nm, "excitation: ")
    if not np.isfinite(intensity).any():
        raise ValueError("expected intensities, got none")
    notes = [*grid.notes, *([told] if told else [])]
    if _is_cut(emission_nm, input_nm, intensity):
        intensity = np.where(intensity == 0, np.nan, intensity)
        notes.append("0 is taken for not measured, as all of it is at and below the excitation")
    else:
        intensity, left_out = without_scatter(input_nm, emission_nm, intensity)
        notes += left_out
    for note in notes:
        _logger.warning("note: %s: %s", place, note)
    return _relative(input_nm, emission_nm, intensity)


def _is_cut(emission_nm: FloatArray, input_nm: FloatArray, intensity: FloatArray) -> bool:
    """Return whether all entries up to the excitation wavelength are 0: scatter was taken out."""
    below = intensity[emission_nm[:, np.newaxis] <= input_nm]
    return len(below) > 0 and bool((below == 0).all())


def _relative(input_nm: FloatArray, output_nm: FloatArray, table: FloatArray) -> ReradiationMatrix:
    nothing = np.full(len(output_nm), np.nan)
    return ReradiationMatrix("", input_nm, output_nm, nothing, table, unit="relative")


def _own(text: str) -> ReradiationMatrix:
    lines = filled_lines(text)
    if len(lines) < 3:
        raise ValueError(
            "expected a line of emission wavelengths and one for each excitation, "
            f"got {len(lines)} lines"
        )
    output_nm = wavelengths(lines[0].text.split()[1:], lines[0].number)
    rows = np.array([_row(line, len(output_nm)) for line in lines[1:]])
    if rows[0, 0] > rows[-1, 0]:
        rows = rows[::-1]
    input_nm = rows[:, 0]
    check_wavelengths(input_nm, f"lines {lines[1].number} to {lines[-1].number}: ")
    intensities = rows[:, 1:].T
    return _relative(input_nm, output_nm, np.where(intensities == 0, np.nan, intensities))


def _row(line: Line, n_emission: int) -> list[float]:
    values = numbers(line.text.split(), line.number)
    if len(values) != n_emission + 1:
        raise ValueError(
            f"line {line.number}: expected an excitation wavelength and {n_emission} "
            f"intensities, got {len(values)} numbers"
        )
    return values


def eem_text(matrix: ReradiationMatrix) -> str:
    """Return the text of an EEM, excitation falling.

    Raises
    ------
    ValueError
        The matrix has a reflectance, a unit, or a measured 0.
    """
    check_wavelengths(matrix.input_nm)
    check_wavelengths(matrix.output_nm)
    if matrix.unit != "relative" or not np.isnan(matrix.reflectance).all():
        raise ValueError("EEM text holds relative intensities without reflectance; use CSV")
    if (matrix.reradiation == 0).any():
        raise ValueError("in EEM text an intensity of 0 was not measured; use CSV")
    rows = [" ".join([_CORNER, *map(_text, matrix.output_nm)])]
    for nm, column in zip(matrix.input_nm[::-1], matrix.reradiation.T[::-1], strict=True):
        rows.append(" ".join([_text(nm), *map(_text, np.nan_to_num(column))]))
    return "\n".join(rows) + "\n"


def _text(value: float) -> str:
    return repr(float(value)).removesuffix(".0")
