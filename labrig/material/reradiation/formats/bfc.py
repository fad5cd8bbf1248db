"""Matrices of the Labsphere BFC-450 bispectral fluorescence colorimeter.

Text in ISO-8859-1: two lines that name the format, comments that begin with `;` (the second is the
sample's name), a line of six integers in nm (first, last output, step, number of inputs, first
input, step), a line `r:c:` of input wavelengths, a row for each output wavelength, `EOD`. Entries
are fractions per band, and reflectance where both wavelengths are the same.
"""

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material.reradiation.formats.text_rows import (
    Line,
    band_fractions,
    check_fractions,
    check_wavelengths,
    filled_lines,
    numbers,
    one_line,
    regular_grid,
    shown,
)
from labrig.material.reradiation.matrix import SAME_NM, ReradiationMatrix

ENCODING = "iso-8859-1"
#: In the second line of a file.
MARK = "Matrix File"
_END = "EOD"
_HEAD = "VEC_01\t5167\nBFC-450 Matrix File"
_UNKNOWN = "<none>"
#: Limit of either grid, which excludes broken headers.
_MAX_BANDS = 2000
#: Limit of every integer of the header, above that of its wavelengths and numbers.
_LARGEST = 1_000_000


def parse_bfc(text: str) -> ReradiationMatrix:
    """Return the matrix in the text of a BFC file; its name may be empty.

    Raises
    ------
    ValueError
        The text is cut or broken; the message names the line.
    """
    lines = filled_lines(text)
    comments = [line.text[1:].strip() for line in lines if line.text.startswith(";")]
    body = [line for line in lines if not line.text.startswith(";")]
    if len(body) < 2 or MARK not in body[1].text:
        raise ValueError(
            f"expected 'BFC-450 {MARK}' in the second line; this is no file of a Labsphere BFC-450"
        )
    if len(body) < 4:
        raise ValueError(f"line {body[-1].number}: the file ends before its first row")
    output_nm, input_nm = _grids(body[2])
    _check_columns(body[3], input_nm)
    values = _rows(body[4:], output_nm, input_nm, body[3].number)
    name = comments[1] if len(comments) > 1 else ""
    return ReradiationMatrix.from_bands(one_line(name), input_nm, output_nm, values)


def _grids(line: Line) -> tuple[FloatArray, FloatArray]:
    expected = f"line {line.number}: expected six integers: first, last, step of output, number, "
    expected += "first, step of input"
    try:
        integers = [int(cell) for cell in line.text.split()]
        out_start, out_end, out_step, n_in, in_start, in_step = integers
    except ValueError:
        raise ValueError(f"{expected}; got {shown(line.text)}") from None
    if max(map(abs, integers)) > _LARGEST:
        raise ValueError(f"{expected}, up to {_LARGEST}; got {shown(line.text)}")
    if min(out_step, in_step) < 1 or out_end < out_start or (out_end - out_start) % out_step:
        raise ValueError(f"{expected}; got steps that do not fit in {shown(line.text)}")
    n_out = (out_end - out_start) // out_step + 1
    if not (2 <= n_in <= _MAX_BANDS and 2 <= n_out <= _MAX_BANDS):
        raise ValueError(f"{expected}, 2 to {_MAX_BANDS} of either; got {shown(line.text)}")
    output_nm = out_start + out_step * np.arange(n_out, dtype=np.float64)
    input_nm = in_start + in_step * np.arange(n_in, dtype=np.float64)
    for nm in (output_nm, input_nm):
        check_wavelengths(nm, f"line {line.number}: ")
    return output_nm, input_nm


def _check_columns(line: Line, input_nm: FloatArray) -> None:
    head, *cells = line.text.split()
    if head != "r:c:":
        raise ValueError(f"line {line.number}: expected r:c: and wavelengths, got {shown(head)}")
    if not _are_same(numbers(cells, line.number), input_nm):
        raise ValueError(
            f"line {line.number}: expected the {len(input_nm)} input wavelengths "
            f"{input_nm[0]:g} to {input_nm[-1]:g} nm, got {len(cells)} others"
        )


def _rows(
    lines: list[Line], output_nm: FloatArray, input_nm: FloatArray, line_before: int
) -> FloatArray:
    ends = [k for k, line in enumerate(lines) if line.text == _END]
    rows = lines[: ends[0]] if ends else lines
    values = [_row(line, nm, len(input_nm)) for line, nm in zip(rows, output_nm, strict=False)]
    last = rows[-1].number if rows else line_before
    if len(rows) != len(output_nm):
        raise ValueError(
            f"line {last}: expected {len(output_nm)} rows of numbers, got {len(rows) or 'none'}; "
            "the measurement is not whole"
        )
    if not ends:
        raise ValueError(f"line {last}: expected {_END} after the last row; the file is cut")
    return np.array(values)


def _row(line: Line, output_nm: float, n_in: int) -> list[float]:
    if line.text.startswith(_END):
        raise ValueError(f"line {line.number}: expected {_END} alone, got {shown(line.text)}")
    first, *values = numbers(line.text.split(), line.number)
    if abs(first - output_nm) > SAME_NM:
        raise ValueError(f"line {line.number}: expected the row of {output_nm:g} nm, got {first:g}")
    if len(values) != n_in:
        raise ValueError(f"line {line.number}: expected {n_in} values, got {len(values)}")
    check_fractions(values, f"line {line.number}")
    return values


def _are_same(found: list[float], expected: FloatArray) -> bool:
    return len(found) == len(expected) and np.allclose(found, expected, rtol=0, atol=SAME_NM)


def bfc_text(matrix: ReradiationMatrix) -> str:
    """Return the text of a BFC file, with CRLF.

    Raises
    ------
    ValueError
        The format cannot hold the matrix.
    """
    fractions = band_fractions(matrix)
    grids = [regular_grid(nm) for nm in (matrix.output_nm, matrix.input_nm)]
    if any(not number.is_integer() for grid in grids for number in grid):
        raise ValueError("BFC needs wavelengths of whole nm; rebin the matrix, or use CSV")
    name = one_line(matrix.name)
    try:
        name.encode(ENCODING)
    except UnicodeEncodeError:
        raise ValueError(f"BFC holds names in ISO-8859-1, not {shown(name)}; rename it") from None
    inputs, outputs = ([round(nm) for nm in grid] for grid in (matrix.input_nm, matrix.output_nm))
    grid = [outputs[0], outputs[-1], outputs[1] - outputs[0]]
    grid += [len(inputs), inputs[0], inputs[1] - inputs[0]]
    # File, sample, operator, remark, two settings, date, time.
    comments = [f";{text}" for text in (_UNKNOWN, name, *[_UNKNOWN] * 6)]
    rows = [
        "\t".join([str(nm), *(repr(float(value)) for value in row)])
        for nm, row in zip(outputs, fractions, strict=True)
    ]
    lines = [*_HEAD.split("\n"), *comments, "\t".join(map(str, grid))]
    lines += ["\t".join(["r:c:", *map(str, inputs)]), *rows, _END, ""]
    return "\r\n".join(lines)
