"""Spectra in the texts that spectrometers and their programs write.

Columns are told by their names and units, by lines such as `XUNITS NANOMETERS` and by the file's
ending: which holds the axis, what the values are, which are σ. Several samples stand beside each
other, in pairs with their own axis or one below the other. What is not said is named in a note, or
refused where it matters.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.foundation.errors import LabrigError
from labrig.optics.curve_table import NamedCurve, sorted_columns
from labrig.optics.spectral_columns import (
    UNKNOWN,
    AxisUnit,
    Ordinate,
    Quantity,
    axis_unit,
    plain,
    read_axis,
    read_ordinate,
    wavelengths_nm,
)
from labrig.text_table import SEPARATORS, Block, Line, Style, read_blocks
from labrig.text_table.names import is_row_number, is_sigma, sigma_of
from labrig.text_table.rows import no_measurements

#: Names of a first column that say nothing.
_NAMELESS = frozenset({"", "x", "x-axis", "x value"})
#: Keys of lines about the axis and about the values, without blanks and signs.
_AXIS_KEY = re.compile(
    r"x(axis|units?|mode|label|axismode|axisunits?)|abscissa|(scan|spectral)?range"
)
_VALUE_KEY = re.compile(
    r"y(axis|units?|mode|label|axisunits?)|ordinate|(data|photometric|measur\w+|phot)mode|mode|"
    r"spectrumtype"
)
_COUNT_KEY = re.compile(r"npoints|numberofpixelsinspectrum|numberof(data)?points")
_KEY = re.compile(
    r"[#\s\"'*]*(?P<key>\S.*?)\s*(?:[=:\t;,]+|\s{2,}|(?<=[A-Z]) )\s*(?P<value>.*?)[\s;,\"']*"
)
_PACKED = re.compile(r"xydata\W*\(x\+\+\(y\.\.y\)\)", re.IGNORECASE)
#: First cell of a line that names what stands in the columns below.
_SAMPLES = frozenset(
    {
        "input", "sample", "samples", "sample name", "name", "names", "title", "titles", "label",
        "labels", "id", "channel", "file", "spectrum", "description", "comment", "probe",
        "bezeichnung",
    }
)  # fmt: skip
#: Where the unit of the axis is not stated: relative difference that is a rounding.
_ROUNDING = 1e-3


@dataclass(frozen=True)
class _Axis:
    column: int
    unit: AxisUnit | None


def foreign_spectra(text: str, ending: str = "") -> list[NamedCurve]:
    r"""Return the spectra in the text of another program.

    Parameters
    ----------
    text
        Text of the file.
    ending
        Ending of the file's name without a point, which some programs let say what the values are.

    Returns
    -------
    list of NamedCurve
        The spectra in the order of the text, over wavelengths in nm.

    Raises
    ------
    ValueError
        The text holds no spectra, is cut, or can be read in two ways.

    Examples
    --------
    >>> from labrig.optics import foreign_spectra
    >>> (paint,) = foreign_spectra("Wavelength (nm),%R\n400,12\n500,40\n600,80\n")
    >>> paint.columns[1].tolist()
    [0.12, 0.4, 0.8]
    """
    if _PACKED.search(text):
        raise ValueError("JCAMP-DX with packed rows (X++(Y..Y)); export it as columns of X and Y")
    try:
        blocks = read_blocks(text)
    except LabrigError as error:
        reason = str(error).replace("times and one of values", "wavelengths and one of values")
        raise ValueError(reason) from None
    tables = [block for block in blocks if len(block.rows[0]) > 1]
    if not tables:
        raise ValueError("expected a column of wavelengths and one of values, got one column")
    found: list[NamedCurve] = []
    for block, axes in _with_spectra(tables):
        above = [line for other in blocks for line in other.above if line.number < block.lines[0]]
        found += _spectra(block, axes, above, ending)
    if not found:
        raise ValueError("expected a table of wavelengths and values, got wavelengths alone")
    return _with_own_names(found)


def _with_spectra(blocks: Sequence[Block]) -> list[tuple[Block, list[_Axis]]]:
    """Return the blocks that hold spectra, with the columns of their axes."""
    named, refused = [], []
    for block in blocks:
        try:
            axes = _axes(block)
        except ValueError as error:
            refused.append(error)
            continue
        if axes:
            named.append((block, axes))
    if named:
        return named
    if refused:
        raise refused[0]
    nameless = sorted(
        (block for block in blocks if plain(_name(block, 0)) in _NAMELESS),
        key=lambda block: -len(block.rows),
    )
    if not nameless:
        shown = ", ".join(" ".join(name.split()) for name in blocks[0].names[:3])
        raise ValueError(f"expected a column of wavelengths, such as wavelength_nm, got '{shown}'")
    if len(nameless) > 1 and 2 * len(nameless[1].rows) >= len(nameless[0].rows):
        raise ValueError(
            f"expected one table or names of the columns, got {nameless[0]} and {nameless[1]}"
        )
    width = len(nameless[0].rows[0])
    if width > 2 and not nameless[0].names:
        raise ValueError(
            f"expected a header such as wavelength_nm,a,b where there are more than wavelengths "
            f"and values, got {width} columns"
        )
    return [(nameless[0], [_Axis(0, None)])]


def _name(block: Block, column: int) -> str:
    return block.names[column] if block.names else ""


def _unit(block: Block, column: int) -> str:
    return block.units[column] if column < len(block.units) else ""


def _axes(block: Block) -> list[_Axis]:
    """Return the columns of a block that are axes of spectra: one, or one for each sample.

    Raises
    ------
    ValueError
        The block has an axis of something else, and none of spectra.
    """
    axes: list[_Axis] = []
    refused: list[ValueError] = []
    for column in range(len(block.rows[0])):
        name, unit = _name(block, column), _unit(block, column)
        try:
            is_axis, stated = read_axis(name or unit, unit)
        except ValueError as error:
            refused.append(error)
            continue
        if is_axis:
            axes.append(_Axis(column, stated))
    if not axes and refused:
        raise refused[0]
    kept: list[_Axis] = []
    for axis in axes:
        # The same axis in another unit beside it.
        if kept and axis.column == kept[-1].column + 1:
            if axis.unit is AxisUnit.NM:
                kept[-1] = axis
            continue
        kept.append(axis)
    return kept


def _spectra(
    block: Block, axes: Sequence[_Axis], above: Sequence[Line], ending: str
) -> Iterator[NamedCurve]:
    """Yield the spectra of a block; `above` are all lines above it in the file."""
    statements = list(_statements([*block.above, *block.below]))
    said_axis = _said_axis(statements)
    said_value = _said_value(statements, ending)
    all_axes = {axis.column for axis in _all_axes(block)} | {axis.column for axis in axes}
    samples = _samples(block, above)
    for number, axis in enumerate(axes):
        end = axes[number + 1].column if number + 1 < len(axes) else len(block.rows[0])
        values = [
            column
            for column in range(axis.column + 1, end)
            if column not in all_axes and not _is_index(block, column)
        ]
        if number == 0 and axis.column:
            values = [
                *[c for c in range(axis.column) if c not in all_axes and not _is_index(block, c)],
                *values,
            ]
        sigmas = _sigmas(block, values)
        values = [column for column in values if column not in sigmas.values()]
        for column in values:
            stated = axis if axis.unit else replace(axis, unit=said_axis)
            spectrum = _spectrum(block, stated, column, sigmas.get(column), said_value, statements)
            if spectrum is None:
                continue
            name = samples.get(column) or samples.get(axis.column, "")
            if not name and (len(values) > 1 or len(axes) > 1):
                name = _name(block, column)
            yield replace(spectrum, name=" ".join(name.split()))


def _all_axes(block: Block) -> Iterator[_Axis]:
    for column in range(len(block.rows[0])):
        try:
            is_axis, unit = read_axis(_name(block, column), _unit(block, column))
        except ValueError:
            is_axis, unit = True, None
        if is_axis:
            yield _Axis(column, unit)


def _is_index(block: Block, column: int) -> bool:
    """Return whether a column numbers rows or frames; a sample's values are no such numbers."""
    numbers = [block.number(row[column]) for row in block.rows]
    if not block.names or not is_row_number(_name(block, column)) or None in numbers:
        return False
    steps = np.diff(np.array(numbers, dtype=np.float64))
    return bool(np.isin(steps, (0, 1)).all())


def _sigmas(block: Block, values: Sequence[int]) -> dict[int, int]:
    """Return the columns of σ by those that they belong to."""
    found: dict[int, int] = {}
    names = {plain(_name(block, column)): column for column in values}
    for before, column in zip([None, *values[:-1]], values, strict=True):
        name = _name(block, column)
        if not name:
            continue
        of = sigma_of(name)
        if of is not None and plain(of) in names:
            found[names[plain(of)]] = column
        elif is_sigma(name) and before is not None:
            found[before] = column
    return found


def _spectrum(
    block: Block,
    axis: _Axis,
    column: int,
    sigma_column: int | None,
    said: Ordinate,
    statements: Sequence[tuple[str, str]],
) -> NamedCurve | None:
    """Return the spectrum in a column, without its name; None if nothing was measured."""
    place = f"'{_name(block, column)}'" if _name(block, column) else f"{column + 1}"
    cells = [row[column] for row in block.rows]
    nothing = no_measurements(cells, block.number)
    rows = [
        k
        for k, row in enumerate(block.rows)
        if cells[k] and k not in nothing and (row[axis.column] or cells[k])
    ]
    if not rows:
        return None
    notes = []
    if nothing:
        first = next(iter(nothing))
        notes.append(
            f"{len(nothing)} value(s) that are no measurement left out, such as '{nothing[first]}' "
            f"in line {block.lines[first]}"
        )
    inner = sum(not cell for cell in cells[rows[0] : rows[-1]])
    if inner:
        notes.append(f"{inner} row(s) without a value left out")
    along = _numbers(block, axis.column, rows)
    _check_statements(along, [row for row in range(len(cells)) if cells[row]], statements)
    nm = wavelengths_nm(along, axis.unit)
    ordinate = read_ordinate(_name(block, column), _unit(block, column))
    if ordinate.quantity is Quantity.UNKNOWN:
        ordinate = said
    sigma = None if sigma_column is None else _numbers(block, sigma_column, rows)
    values, sigma, done = ordinate.linear(_numbers(block, column, rows), sigma)
    quantity = ordinate.quantity
    if axis.unit is None:
        notes.append(f"no unit of the axis is stated: {nm.min():g} to {nm.max():g} taken for nm")
    elif axis.unit is not AxisUnit.NM:
        notes.append(f"axis in {axis.unit.symbol}, converted to nm")
        is_light = quantity in (Quantity.LIGHT, Quantity.UNKNOWN)
        if is_light and axis.unit.is_reciprocal and ordinate.per != "nm":
            quantity = Quantity.OTHER_DENSITY
    if quantity is Quantity.UNKNOWN:
        notes.append(
            f"the file does not state the quantity of column {place}; its values stay as they are"
        )
    elif done:
        notes.append(f"column {place}: {done}")
    order = np.argsort(nm, kind="stable")
    wavelength_nm, sorted_values, _ = sorted_columns(nm, values)
    sorted_sigma = None if sigma is None else sigma[order]
    same_nm = np.append(False, np.diff(wavelength_nm) == 0)
    repeated = same_nm & np.append(False, np.diff(sorted_values) == 0)
    if repeated.any():
        notes.append(f"{repeated.sum()} row(s) that repeat another one left out")
        wavelength_nm, sorted_values = wavelength_nm[~repeated], sorted_values[~repeated]
        sorted_sigma = None if sorted_sigma is None else sorted_sigma[~repeated]
    if others := int((same_nm & ~repeated).sum()):
        notes.append(f"{others} wavelength(s) have more than one value: a scan was repeated")
    return NamedCurve("", (wavelength_nm, sorted_values, sorted_sigma), quantity, tuple(notes))


def _numbers(block: Block, column: int, rows: Sequence[int]) -> np.ndarray:
    numbers = []
    for row in rows:
        cell = block.rows[row][column]
        number = block.number(cell)
        if number is None or not np.isfinite(number):
            raise ValueError(
                f"line {block.lines[row]}: expected a number in column "
                f"{_name(block, column) or column + 1}, got '{cell}'"
            )
        numbers.append(number)
    return np.array(numbers)


def _statements(lines: Sequence[Line]) -> Iterator[tuple[str, str]]:
    """Yield what lines about the measurement say, by their keys."""
    for line in lines:
        if match := _KEY.fullmatch(line.text):
            yield match["key"], match["value"]


def _short(key: str) -> str:
    """Return a key without what stands in brackets, blanks and signs."""
    return re.sub(r"[^a-z]", "", re.sub(r"[(\[].*?[)\]]", "", plain(key)))


def _said_axis(statements: Sequence[tuple[str, str]]) -> AxisUnit | None:
    """Return the unit of the axis that a line such as `X Mode  Wavelength (nm)` states."""
    for key, value in statements:
        if not _AXIS_KEY.fullmatch(_short(key)):
            continue
        in_brackets = re.search(r"[(\[](.*?)[)\]]", key)
        for text in (value, in_brackets[1] if in_brackets else ""):
            unit = axis_unit(text) or read_axis(text, "")[1]
            if unit is not None:
                return unit
    return None


def _said_value(statements: Sequence[tuple[str, str]], ending: str) -> Ordinate:
    """Return what the values are by a line such as `YUNITS ABSORBANCE`, or the file's ending."""
    for key, value in statements:
        if _VALUE_KEY.fullmatch(_short(key)):
            ordinate = read_ordinate(value)
            if ordinate.quantity is not Quantity.UNKNOWN:
                return ordinate
    return read_ordinate(ending) if ending else UNKNOWN


def _check_statements(
    along: np.ndarray, rows: Sequence[int], statements: Sequence[tuple[str, str]]
) -> None:
    """Refuse a table that ends elsewhere than the lines above it say.

    Raises
    ------
    ValueError
        The file was cut, or the header is that of another one.
    """
    for key, value in statements:
        short = _short(key)
        try:
            number = float(value.replace(",", "."))
        except ValueError:
            continue
        if _COUNT_KEY.fullmatch(short) and number != len(rows):
            raise ValueError(
                f"expected {number:g} points ('{key}'), got {len(rows)}; the table is cut"
            )
        at = {"firstx": 0, "lastx": -1}.get(short)
        if at is not None and abs(along[at] - number) > _ROUNDING * abs(number):
            raise ValueError(
                f"expected the table to {'begin' if at == 0 else 'end'} at {number:g} ('{key}'), "
                f"got {along[at]:g}; the table is cut"
            )


def _samples(block: Block, above: Sequence[Line]) -> dict[int, str]:
    """Return the names of samples in a line above the names of the columns, by column."""
    if block.names_line is None:
        return {}
    width = len(block.names)
    separator = next(
        (
            mark
            for mark in SEPARATORS
            if len(Style(mark, block.decimal).cells(block.names_line)) == width
        ),
        None,
    )
    if separator is None:
        return {}
    style = Style(separator, block.decimal)
    lines = [line for line in above if line.number < block.names_line.number]
    for distance, line in enumerate(reversed(lines), start=1):
        cells = style.cells(line)
        is_next = distance == 1 and line.number == block.names_line.number - 1
        if not is_next and plain(cells[0] if cells else "") not in _SAMPLES:
            continue
        labels = {column: cell for column, cell in enumerate(cells[:width]) if cell}
        is_about = style.count_numbers(cells) or any(re.search("[:=]", cell) for cell in cells)
        if plain(cells[0]) not in _SAMPLES and is_about:
            continue
        # A line of settings has the same in all columns, or a key of its own.
        if len(set(labels.values())) == len(labels) and (len(labels) > 1 or width == 2):
            return labels
    return {}


def _with_own_names(spectra: Sequence[NamedCurve]) -> list[NamedCurve]:
    """Return spectra whose names differ: equal ones are numbered."""
    named: list[NamedCurve] = []
    used: set[str] = set()
    for number, spectrum in enumerate(spectra, start=1):
        name = spectrum.name or ("" if len(spectra) == 1 else str(number))
        while name in used:
            name = f"{spectrum.name} ({number})" if spectrum.name else f"{name}."
        used.add(name)
        named.append(replace(spectrum, name=name))
    return named
