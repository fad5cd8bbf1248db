"""Names and units of the columns, from the lines above a table."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from labrig.foundation.errors import UsageError
from labrig.text_table.names import is_abscissa, is_abscissa_unit, is_time
from labrig.text_table.numbers import DECIMAL_MARKS, is_clock, parse_number
from labrig.text_table.style import FEWEST, SEPARATORS, Line, Style

COMMENT = "#"
#: Number of lines above the rows in which names are looked for.
_HEAD_LINES = 6
_BEFORE_UNIT = re.compile(r"\s+(?=[(\[])")
_SLASH = re.compile(r"\s*/\s*")
#: Names in brackets after the mark of a block, as in `*BLOCK 1  ( Time[ns]  No_of_photons )`.
_IN_BRACKETS = re.compile(r"\*[^()]*\(\s*(.*\S)\s*\)\s*")
#: A line that says what an axis is, or what the curves are called: `Xaxis,Time(ns)`.
_AXIS = re.compile(
    r"""[#\s"'*]*(?:(?P<x>x|horizontal|abscissa)|(?P<y>y|vertical|ordinate)|(?P<labels>labels?))
    (?:[\s_-]*(?:axis|units?|label|title|dimension))*["']?
    \s*[\t,;:=|\s]\s*(?P<value>.*)""",
    re.VERBOSE | re.IGNORECASE,
)
_AXIS_WORD = re.compile(r"axis|unit|label|title|dimension|abscissa|ordinate", re.IGNORECASE)
#: Marks of a comment in other programs, above or before the names.
_COMMENTED = re.compile(r"\s*(?:%+|//+|!+|--)\s*(.*)")
_BETWEEN_VALUES = re.compile(r"[\t;,|]")


@dataclass(frozen=True)
class Header:
    """Names and units of the columns and the lines that have them; empty without."""

    names: tuple[str, ...] = ()
    names_line: Line | None = None
    units: tuple[str, ...] = ()
    units_line: Line | None = None


def find_header(above: Sequence[Line], width: int, style: Style) -> Header:
    """Return what the lines above a table of `width` columns say about its columns.

    Raises
    ------
    UsageError
        The names are fewer than the columns, or curves have axes of several kinds.
    """
    lines = [line for line in above if not line.text.lstrip().startswith(COMMENT)]
    axes = _from_axes(above, width)
    # From the rows upwards.
    near = [line for line in reversed(lines) if not is_axis_line(line)][:_HEAD_LINES]
    named = [names_in(line, width, style) for line in near]
    for index, names in enumerate(named):
        if not any(map(is_abscissa, names)):
            continue
        above_them = named[index + 1] if index + 1 < len(named) else ()
        if any(map(is_abscissa_unit, names)) and any(map(is_abscissa, above_them)):
            # A line of units, each of which could be a name.
            return Header(above_them, near[index + 1], names, near[index])
        below = named[index - 1] if index else ()
        if any(map(is_abscissa_unit, below)):
            return Header(names, near[index], below, near[index - 1])
        if len(above_them) == len(names) and is_abscissa_unit(above_them[_first_abscissa(names)]):
            return Header(names, near[index], above_them, near[index + 1])
        return Header(names, near[index])
    if axes is not None:
        return axes
    if named and named[0]:
        return Header(named[0], near[0])
    if near:
        _refuse_other_names(near[0], width, style)
    for comment in reversed([line for line in above if line not in lines]):
        names = names_in(Line(comment.number, comment.text.lstrip(" #")), width, style)
        if any(map(is_time, names)):
            return Header(names, comment)
    return Header()


def _first_abscissa(names: Sequence[str]) -> int:
    return next(column for column, name in enumerate(names) if is_abscissa(name))


def names_in(line: Line, width: int, style: Style) -> tuple[str, ...]:
    """Return the names in a line above a table of `width` columns; nothing if it has none."""
    if bracketed := _IN_BRACKETS.fullmatch(line.text.strip()):
        return _split_by_blanks(bracketed[1], width)
    if (commented := _COMMENTED.match(line.text)) and is_abscissa(_first_name(commented[1], style)):
        line = Line(line.number, commented[1])
    cells = style.cells(line)
    if any(map(_is_reading, cells)):
        return ()
    if style.separator is None:
        names = _split_by_blanks(line.text, width)
    else:
        # More names than columns stand above columns that only the first rows fill.
        names = cells if len(cells) >= width else ()
    if names or width == 1:
        return names
    # Names may be separated in another way than the numbers below.
    for separator in SEPARATORS:
        other = Style(separator, style.decimal)
        names = other.cells(line) if separator else _split_by_blanks(line.text, width)
        if (
            len(names) == width
            and any(map(is_abscissa, names))
            and not any(map(_is_reading, names))
        ):
            return names
    return ()


def _first_name(text: str, style: Style) -> str:
    """Return the first of the names in a text, which may be separated by blanks."""
    if style.separator is not None and style.separator in text:
        return text.split(style.separator)[0].strip()
    return (_SLASH.sub("/", _BEFORE_UNIT.sub("", text)).split() or [""])[0]


def _is_reading(cell: str) -> bool:
    """Return whether a cell is a number with any decimal mark, or a time of day: no name."""
    marks = DECIMAL_MARKS.values()
    return is_clock(cell) or any(parse_number(cell, mark) is not None for mark in marks)


def _split_by_blanks(line: str, width: int) -> tuple[str, ...]:
    """Return `width` names in a line, each perhaps with a unit, or nothing.

    A word with a colon may precede them, as in `Data:   y   x`.
    """
    if '"' in line:
        words = list(Style(None, ".").cells(Line(0, line)))
    else:
        words = _SLASH.sub("/", _BEFORE_UNIT.sub("", line)).split()
    if len(words) == width + 1 and words[0].endswith(":"):
        words = words[1:]
    return tuple(words) if len(words) == width else ()


def is_axis_line(line: Line | None) -> bool:
    """Return whether a line says what an axis is, or what curves are called.

    Parameters
    ----------
    line
        A line above a table, or None.

    Returns
    -------
    bool
        Whether it does, as `Xaxis,Time(ns)`.

    Examples
    --------
    >>> from labrig.text_table import Line, is_axis_line
    >>> is_axis_line(Line(6, "Xaxis,Time(ns)")), is_axis_line(Line(7, "Operator,Ada"))
    (True, False)
    """
    match = _AXIS.match(line.text) if line is not None else None
    return match is not None and _AXIS_WORD.search(match.string[: match.start("value")]) is not None


def _from_axes(above: Sequence[Line], width: int) -> Header | None:
    """Return names and units from lines such as `Xaxis,Time(ns)` and `Yaxis,Counts`."""
    said: dict[str, tuple[tuple[str, ...], Line]] = {}
    for line in above:
        match = _AXIS.match(line.text) if is_axis_line(line) else None
        if match is None:
            continue
        key = next(key for key in ("x", "y", "labels") if match[key])
        values = [value.strip(" \"'") for value in _BETWEEN_VALUES.split(match["value"])]
        if any(values):
            said.setdefault(key, (tuple(value for value in values if value), line))
    if "x" not in said:
        return None
    axes, line = said["x"]
    if len(set(axes)) > 1:
        raise UsageError(
            f"line {line.number}: expected one axis for all curves, got {', '.join(axes)}; "
            "export them one by one"
        )
    ordinates = said["y"][0] if "y" in said else ()
    curves = said["labels"][0] if "labels" in said else ()
    if not is_abscissa(axes[0]) or is_abscissa_unit(axes[0]):
        units = (axes[0], *(ordinates * width)[: width - 1]) if ordinates else (axes[0],)
        return Header(units=units, units_line=line)
    if len(curves) != width - 1 or len(set(curves)) < len(curves):
        curves = ordinates if width == FEWEST and ordinates else ()
        curves = curves or tuple(str(number) for number in range(2, width + 1))
        return Header((axes[0], *curves), line)
    units = ("", *(ordinates * width)[: width - 1]) if ordinates else ()
    return Header((axes[0], *curves), line, units, said["y"][1] if ordinates else None)


def _refuse_other_names(line: Line, width: int, style: Style) -> None:
    """Refuse rows whose cells are more than the names above them."""
    names = style.cells(line)
    if len(names) < FEWEST or style.count_numbers(names) or not any(map(is_time, names)):
        return
    advice = "give every column a name"
    if style.separator == "," and width == 2 * len(names):
        advice = "are these decimal commas between commas? save it with ; between the columns"
    raise UsageError(
        f"line {line.number}: expected a name for each of the {width} columns below, got "
        f"{', '.join(names)}; {advice}"
    )
