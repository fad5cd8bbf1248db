"""Excitation-emission matrices as spectrofluorometers and spreadsheets lay them out.

A grid with one axis above and the other one to the left; spectra beside each other, whose names
state the wavelength of the other axis (`EX_220.00`) or how far the other one is beyond (`SYN_50`);
emission spectra one below the other; and three columns of both wavelengths and the intensity.

Light is re-emitted at longer wavelengths (G. G. Stokes, 1852), so the signal is where the emission
is the longer of the two. Light that is merely scattered is left out: at the same wavelength, and in
higher orders of the grating at twice the wavelength.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import LabrigError
from labrig.material.reradiation.formats.text_rows import PLAUSIBLE_NM, shown
from labrig.optics import Quantity, foreign_spectra
from labrig.text_table import SEPARATORS, Block, Line, Style, parse_number, read_blocks
from labrig.text_table.rows import no_measurements

Axis: TypeAlias = Literal["emission", "excitation"]
#: Name of the upper left cell of labrig's own tables of curves, which are no matrices.
_CURVES = "wavelength_nm"
_NAMES: dict[Axis, re.Pattern[str]] = {
    "excitation": re.compile(r"(?<![a-z])(λ?_?ex|exc|excitation|anregung)(?![a-z])"),
    "emission": re.compile(r"(?<![a-z])(λ?_?em|emi|emission|emissions)(?![a-z])"),
}
_LABEL = re.compile(
    r"(?:.*?(?P<kind>(?<![a-z])(?:ex[a-z]*|em[a-z]*|syn[a-z]*))[\s_:=(\[]*)?"
    r"(?:λ|wl|wavelength)?[\s_:=(\[]*(?P<nm>\d+(?:[.,]\d+)?)\s*_?(?:nm)?[)\]]?"
    r"(?:[\s_]*(?P<after>ex|em)[a-z]*)?",
    re.IGNORECASE,
)
#: Most lines between the wavelengths above a grid and its rows.
_BETWEEN = 8
#: Fewest wavelengths of either axis.
_FEWEST = 2


@dataclass(frozen=True, eq=False)
class Grid:
    """Intensities over two axes of wavelengths, which need not rise.

    Attributes
    ----------
    row_nm, column_nm
        Wavelengths in nm, shapes (n,) and (m,).
    intensity
        Intensities, shape (n, m); NaN where nothing was measured.
    rows
        What the rows are as the names say; None where they do not.
    notes
        What was done to lay them out.
    """

    row_nm: FloatArray
    column_nm: FloatArray
    intensity: FloatArray
    rows: Axis | None
    notes: tuple[str, ...] = ()


def read_grid(text: str, excitation_nm: FloatArray | None = None) -> Grid:
    """Return the intensities in a text.

    Parameters
    ----------
    text
        Text of a file.
    excitation_nm
        Excitation wavelengths of emission spectra that stand one below the other without them.

    Raises
    ------
    ValueError
        The text is no excitation-emission matrix, or is broken.
    """
    try:
        blocks = read_blocks(text)
    except LabrigError as error:
        reason = str(error).replace(
            "a table with a column of times and one of values", "an excitation-emission matrix"
        )
        raise ValueError(reason) from None
    block = max(blocks, key=lambda block: len(block.rows) * len(block.rows[0]))
    width = len(block.rows[0])
    if width == 2:
        return _stacked(block, excitation_nm)
    if excitation_nm is not None:
        raise ValueError(
            "expected emission spectra one below the other where excitation wavelengths are "
            f"given, got a table of {width} columns"
        )
    if width == 3 and (listed := _listed(block)):
        return listed
    if grid := _synchronous(block):
        return grid
    if grid := _plain(block):
        return grid
    return _named_spectra(text)


def _axis_of(label: str) -> Axis | None:
    """Return the axis that a text names first: `Emission`, or the rows of `Ex/Em`."""
    plain = label.lower()
    found: list[tuple[int, Axis]] = [
        (match.start(), axis)
        for axis, pattern in _NAMES.items()
        if (match := pattern.search(plain)) is not None
    ]
    return min(found)[1] if found else None


def _other(axis: Axis | None) -> Axis | None:
    if axis is None:
        return None
    return "emission" if axis == "excitation" else "excitation"


def _labels(cells: Sequence[str], decimal: str) -> tuple[FloatArray, Axis | None] | None:
    """Return wavelengths that stand in cells, and what they are; None if these hold none."""
    numbers, kinds = [], set()
    for cell in cells:
        number = parse_number(cell, decimal)
        if number is None:
            match = _LABEL.fullmatch(cell.strip())
            if match is None:
                return None
            number = float(match["nm"].replace(",", "."))
            kinds.add((match["kind"] or match["after"] or "")[:2].lower())
        numbers.append(number)
    nm = np.array(numbers)
    low, high = PLAUSIBLE_NM
    if len(nm) < _FEWEST or not ((nm >= low) & (nm <= high)).all() or len(set(numbers)) < len(nm):
        return None
    kind = kinds.pop() if len(kinds) == 1 else ""
    return nm, {"ex": "excitation", "em": "emission"}.get(kind)  # type: ignore[return-value]


def _plain(block: Block) -> Grid | None:
    """Return the grid of a block with the wavelengths of its columns above it."""
    width, rows = len(block.rows[0]), block.rows
    lines: list[tuple[Sequence[str], Line | None]] = []
    if not rows[0][0]:
        lines.append((rows[0], None))
        rows = rows[1:]
    if block.names:
        lines.append((block.names, block.names_line))
    above = block.above[::-1][:_BETWEEN]
    lines += [(cells, line) for line in above for cells in _splits(line, width, block.decimal)]
    for cells, line in lines:
        corner, labels = (cells[0], cells[1:]) if len(cells) == width else ("", cells)
        found = _labels(labels, block.decimal)
        if found is None:
            continue
        if corner == _CURVES:
            raise ValueError("expected an excitation-emission matrix, got a table of curves")
        column_nm, columns = found
        first = [parse_number(row[0], block.decimal) for row in rows]
        if any(number is None for number in first):
            wrong = first.index(None)
            raise ValueError(
                f"line {block.lines[wrong]}: expected a wavelength, got {shown(rows[wrong][0])}"
            )
        said = [_other(columns), _axis_of(corner)]
        over = next(
            (other for other in block.above if line and other.number == line.number - 1), None
        )
        if over is not None and not corner:
            said.append(_other(_axis_of(over.text)))
        row_nm = np.array(first, dtype=np.float64)
        intensity = _intensities(block, rows, range(1, width))
        return Grid(row_nm, column_nm, intensity, next((axis for axis in said if axis), None))
    return None


def _splits(line: Line, width: int, decimal: str) -> list[tuple[str, ...]]:
    """Return the cells of a line, in each way that gives as many as stand above a grid."""
    try:
        splits = [Style(mark, decimal).cells(line) for mark in SEPARATORS]
    except LabrigError:
        return []
    return [cells for cells in splits if len(cells) in (width, width - 1)]


def _intensities(block: Block, rows: Sequence[Sequence[str]], columns: Sequence[int]) -> FloatArray:
    """Return the numbers in some columns of rows; NaN where nothing was measured."""
    first = len(block.rows) - len(rows)
    table = np.full((len(rows), len(columns)), np.nan)
    for target, column in enumerate(columns):
        cells = [row[column] for row in rows]
        nothing = no_measurements(cells, block.number)
        for k, cell in enumerate(cells):
            if not cell or k in nothing:
                continue
            number = block.number(cell)
            if number is None:
                raise ValueError(
                    f"line {block.lines[first + k]}: expected a number, got {shown(cell)}"
                )
            table[k, target] = number
    return table


def _synchronous(block: Block) -> Grid | None:
    """Return the grid of scans in which both monochromators moved, the emission ahead.

    Its diagonals are interpolated to emission wavelengths that all have.
    """
    matches = [re.search(r"syn[a-z]*[\s_]*(\d+(?:\.\d+)?)", name, re.I) for name in block.names[1:]]
    if not matches or not all(matches):
        return None
    ahead_nm = np.array([float(match[1]) for match in matches if match])
    rows = [row for row in block.rows if row[0]]
    excitation_nm = _intensities(block, block.rows, [0])[:, 0]
    intensity = _intensities(block, block.rows, range(1, len(block.names)))
    is_row = np.isfinite(excitation_nm)
    excitation_nm, intensity = excitation_nm[is_row], intensity[is_row]
    assert len(rows) == len(excitation_nm)
    if len(ahead_nm) < _FEWEST or (np.diff(ahead_nm) <= 0).any():
        raise ValueError("expected synchronous scans whose offsets rise")
    step_nm = float(np.median(np.diff(ahead_nm)))
    start, end = excitation_nm.min() + ahead_nm[0], excitation_nm.max() + ahead_nm[-1]
    emission_nm = np.arange(step_nm * np.ceil(start / step_nm - 1e-9), end + 1e-6, step_nm)
    table = np.array(
        [
            np.interp(emission_nm - nm, ahead_nm, row, left=np.nan, right=np.nan)
            for nm, row in zip(excitation_nm, intensity, strict=True)
        ]
    )
    note = f"synchronous scans, interpolated to emission wavelengths every {step_nm:g} nm"
    return Grid(excitation_nm, emission_nm, table, "excitation", (note,))


def _stacked(block: Block, excitation_nm: FloatArray | None) -> Grid:
    """Return the grid of emission spectra that stand one below the other in two columns."""
    table = _intensities(block, block.rows, [0, 1])
    first = int(np.argmax(table[1:, 0] == table[0, 0])) + 1
    count = len(table) // first if first > 1 else 0
    if count < _FEWEST or len(table) != count * first:
        raise ValueError(
            "expected an excitation-emission matrix, got two columns; a decay goes to labrig fit "
            "decay, a spectrum to labrig optics show"
        )
    axis_nm = table[:first, 0]
    if not np.array_equal(table[:, 0].reshape(count, first), np.tile(axis_nm, (count, 1))):
        raise ValueError("expected the same emission wavelengths in all spectra, got others")
    got = f"got {count} spectra from {axis_nm[0]:g} to {axis_nm[-1]:g} nm"
    if excitation_nm is None:
        raise ValueError(
            f"expected excitation wavelengths, which the file does not have; {got}: give them, "
            "such as --excitation 230:450:5"
        )
    if len(excitation_nm) != count:
        raise ValueError(f"expected {len(excitation_nm)} spectra, as many as excitations; {got}")
    return Grid(axis_nm, excitation_nm, table[:, 1].reshape(count, first).T, "emission")


def _listed(block: Block) -> Grid | None:
    """Return the grid of rows that hold both wavelengths and an intensity; None if it is none."""
    table = _intensities(block, block.rows, [0, 1, 2])
    row_nm, row = np.unique(table[:, 0], return_inverse=True)
    column_nm, column = np.unique(table[:, 1], return_inverse=True)
    low, high = PLAUSIBLE_NM
    both = np.concatenate([row_nm, column_nm])
    names = block.names or ("", "", "")
    rows = _axis_of(names[0]) or _other(_axis_of(names[1]))
    # Without names a full grid shows that these are wavelengths; with them pairs may be missing.
    is_grid = min(len(row_nm), len(column_nm)) > 1 and (
        len(row_nm) * len(column_nm) == len(table)
        or (rows is not None and _axis_of(names[1]) == _other(rows))
    )
    if not is_grid or not ((both >= low) & (both <= high)).all():
        return None
    intensity = np.full((len(row_nm), len(column_nm)), np.nan)
    if len(set(zip(row.tolist(), column.tolist(), strict=True))) < len(table):
        raise ValueError("expected each pair of wavelengths once, got some of them twice")
    intensity[row, column] = table[:, 2]
    return Grid(row_nm, column_nm, intensity, rows)


def _named_spectra(text: str) -> Grid:
    """Return the grid of spectra whose names state the wavelength of the other axis."""
    spectra = foreign_spectra(text)
    names = [spectrum.name for spectrum in spectra]
    if any(spectrum.quantity not in (Quantity.LIGHT, Quantity.UNKNOWN) for spectrum in spectra):
        raise ValueError("expected intensities of light, got absorbance or a fraction of light")
    found = _labels(names, ".")
    if found is None or found[1] is None:
        raise ValueError(
            "expected an excitation-emission matrix, with wavelengths above the columns or in the "
            f"names of its spectra, such as EX_220; got {shown(', '.join(names[:3]))}"
        )
    column_nm, columns = found
    row_nm = spectra[0].columns[0]
    notes: tuple[str, ...] = ()
    if any(not np.array_equal(spectrum.columns[0], row_nm) for spectrum in spectra):
        notes = ("wavelengths of the spectra differ: interpolated to those of the first",)
    intensity = np.stack(
        [
            np.interp(row_nm, *spectrum.columns[:2], left=np.nan, right=np.nan)
            for spectrum in spectra
        ],
        axis=1,
    )
    return Grid(row_nm, column_nm, intensity, _other(columns), notes)


#: Distance from a line of scattered light in nm from which light is fluorescence.
_BESIDE_NM = 15.0
#: Ratio of mean signals on both sides that tells one side from noise and stray light.
_CLEAR = 3.0
_OPTION = "say --rows emission or --rows excitation"


def emission_in_rows(grid: Grid, rows: Axis | None) -> tuple[bool, str]:
    """Return whether the rows of a grid are emission wavelengths, and by what, in words.

    Parameters
    ----------
    grid
        Intensities over two axes.
    rows
        What the rows are, as somebody says; None leaves it to the names and the signal.

    Raises
    ------
    ValueError
        Neither names nor signal tell it, or they contradict each other.
    """
    if rows is not None:
        return rows == "emission", ""
    told = _by_signal(grid)
    if grid.rows is not None:
        if told is not None and told != grid.rows:
            raise ValueError(
                f"expected light at longer wavelengths than those that excite it, got the rows "
                f"named {grid.rows} and the signal on the other side; {_OPTION}"
            )
        return grid.rows == "emission", ""
    if told is None:
        raise ValueError(
            "expected names of the axes or light on one side of the diagonal, which identifies "
            "them, "
            f"got neither; {_OPTION}"
        )
    return told == "emission", f"rows are {told}: their side of the diagonal has the light"


def _by_signal(grid: Grid) -> Axis | None:
    """Return what the rows are by the side of the diagonal that has the light."""
    rows, columns = grid.row_nm[:, np.newaxis], grid.column_nm
    is_clear = np.isfinite(grid.intensity)
    with np.errstate(over="ignore"):  # of a damaged file
        for order in (1, 2, 3):
            is_clear &= np.abs(rows - order * columns) > _BESIDE_NM
            is_clear &= np.abs(columns - order * rows) > _BESIDE_NM
    in_rows = _mean(grid.intensity[is_clear & (rows > columns)])
    in_columns = _mean(grid.intensity[is_clear & (rows < columns)])
    if in_rows > _CLEAR * abs(in_columns):
        return "emission"
    if in_columns > _CLEAR * abs(in_rows):
        return "excitation"
    return None


def _mean(values: FloatArray) -> float:
    return float(values.mean()) if len(values) else 0.0
