"""Curves in JCAMP-DX, whose rows have one abscissa and the values of several points.

Only numbers written in full (AFFN) are read; `(XY..XY)` has pairs, `(X++(Y..Y))` equal steps from
`FIRSTX` to `LASTX`.
"""

import re
from collections.abc import Sequence

import numpy as np

from labrig.foundation.errors import UsageError
from labrig.text_table.style import Line

_LABEL = re.compile(r"##([^=]*)=(.*)")
_DATA = ("XYDATA", "XYPOINTS")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_NOT_PLAIN = re.compile(r"[^\d\s+\-.,;eE]")


def jcamp_curves(lines: Sequence[Line]) -> list[tuple[Line, tuple[str, str], list[list[str]]]]:
    """Return the line above the data, the units and the rows of each curve; empty without any.

    Raises
    ------
    UsageError
        A curve is compressed, or has not the points that its labels say.
    """
    curves = []
    labels: dict[str, str] = {}
    for index, line in enumerate(lines):
        match = _LABEL.match(line.text.strip())
        if match is None:
            continue
        key = re.sub(r"[\s\-_/]", "", match[1]).upper()
        labels[key] = match[2].split("$$")[0].strip()
        if key in _DATA:
            data = []
            for other in lines[index + 1 :]:
                if other.text.lstrip().startswith("##"):
                    break
                data.append(Line(other.number, other.text.split("$$")[0]))
            units = labels.get("XUNITS", ""), labels.get("YUNITS", "")
            curves.append((line, units, _rows(labels, key, data)))
    return curves


def _rows(labels: dict[str, str], key: str, data: Sequence[Line]) -> list[list[str]]:
    numbers: list[list[float]] = []
    for line in data:
        if _NOT_PLAIN.search(line.text):
            raise UsageError(
                f"line {line.number}: expected numbers in full, got compressed JCAMP-DX; export "
                "it without compression (AFFN), or as columns of text"
            )
        numbers.append([float(number) for number in _NUMBER.findall(line.text)])
    x_factor, y_factor = (_number(labels, f"{axis}FACTOR", 1.0) for axis in "XY")
    if labels[key].replace(" ", "").upper().startswith("(XY"):
        flat = [number for row in numbers for number in row]
        pairs = np.reshape(flat[: len(flat) // 2 * 2], (-1, 2)) * (x_factor, y_factor)
        return [[repr(float(x)), repr(float(y))] for x, y in pairs]
    values = np.array([number for row in numbers for number in row[1:]])
    first, last = _number(labels, "FIRSTX"), _number(labels, "LASTX", np.nan)
    if np.isnan(last):
        last = first + _number(labels, "DELTAX") * (len(values) - 1)
    if len(values) != _number(labels, "NPOINTS", len(values)):
        raise UsageError(f"expected ##NPOINTS= {labels['NPOINTS']}, got {len(values)} points")
    x = np.linspace(first, last, len(values))
    starts = np.cumsum([0, *(len(row) - 1 for row in numbers if row)])[:-1]
    stated = np.array([row[0] for row in numbers if row]) * x_factor
    step = abs(x[1] - x[0]) if len(x) > 1 else 0.0
    if (np.abs(stated - x[starts]) > 0.5 * step + 1e-9 * np.abs(stated)).any():
        raise UsageError("expected rows that begin at equal steps from FIRSTX to LASTX, got others")
    return [[repr(float(a)), repr(float(b))] for a, b in zip(x, values * y_factor, strict=True)]


def _number(labels: dict[str, str], key: str, default: float | None = None) -> float:
    text = labels.get(key, "")
    if not text and default is not None:
        return default
    try:
        return float(text.replace(",", "."))
    except ValueError:
        raise UsageError(f"expected a number in ##{key}=, got '{text}'") from None
