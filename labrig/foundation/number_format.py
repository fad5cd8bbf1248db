"""Formatting of numbers in reports, rounded according to their uncertainty."""

import math
import re
from collections.abc import Sequence

_SUBSCRIPT = str.maketrans("aehijklmnoprstuvx0123456789", "ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓ₀₁₂₃₄₅₆₇₈₉")
_SYMBOL = re.compile(r"\b([A-Za-zΑ-Ωα-ω])_([aehijklmnoprstuvx0-9])\b")
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_NUMBER_OF_A_PROGRAM = re.compile(r"(?<![\w.])(-?)(\d+(?:\.\d+)?)(e[+-]?\d+)?(%?)(?![\w])")
#: Smallest value written without a power of ten.
MIN_PLAIN = 1e-3
#: Values from here on are written with a power of ten.
MAX_PLAIN = 1e6
#: Value in its σ below which rounding to the digits of σ would leave 0: it keeps its own digits.
VANISHES_SIGMAS = 0.005

#: Exposure times below this are written as fractions.
MAX_FRACTION_S = 0.3


def plus_minus(value: float, sigma: float) -> str:
    """Format value and σ as `0.03208 ± 0.00027`: σ to two digits, the value to the same place.

    `σ = 0` marks a fixed value, a σ that is not finite an unknown uncertainty.
    """
    if not math.isfinite(value):
        return "–"
    if sigma == 0:
        return f"{rounded(value)} (held)"
    if not math.isfinite(sigma):
        return f"{rounded(value, 3)} ± ?"
    if 0 < abs(value) < VANISHES_SIGMAS * sigma:
        return f"{rounded(value, 2)} ± {rounded(sigma, 2)}"
    exponent = _exponent(max(abs(value), sigma))
    plain = MIN_PLAIN <= 10.0**exponent < MAX_PLAIN
    scale = 1.0 if plain else 10.0**exponent
    decimals = 1 - _exponent(float(f"{sigma / scale:.1e}"))
    places = max(decimals, 0)
    numbers = (f"{round(number / scale, decimals):.{places}f}" for number in (value, sigma))
    text = " ± ".join(numbers).replace("-", "−")
    return text if plain else f"({text}) × {power_of_ten(exponent)}"


def rounded(value: float, digits: int = 4) -> str:
    """Format `value` to `digits` significant digits, with a power of ten if very large or small."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    exponent = int(power)
    if MIN_PLAIN <= 10.0**exponent < MAX_PLAIN:
        decimals = digits - 1 - exponent
        text = f"{round(value, decimals):.{max(decimals, 0)}f}"
        text = text.rstrip("0").rstrip(".") if "." in text else text
        return text.replace("-", "−")
    mantissa = mantissa.rstrip("0").rstrip(".").replace("-", "−")
    return f"{mantissa} × {power_of_ten(exponent)}"


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table for a terminal, each column as wide as its widest cell."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def exposure_text(exposure_s: float) -> str:
    """Format an exposure time, such as `1/64 s`, `0.5 s` or `30 s`."""
    if 0 < exposure_s < MAX_FRACTION_S:
        return f"1/{1 / exposure_s:.0f} s"
    return f"{rounded(exposure_s, 3)} s"


def power_of_ten(exponent: int) -> str:
    """Format a power of ten, such as `10⁻³`."""
    return "10" + str(exponent).translate(_SUPERSCRIPT)


def subscripted(text: str) -> str:
    """Return text with symbols such as `k_r` set with a subscript, `kᵣ`, where no markup is."""
    return _SYMBOL.sub(lambda found: found[1] + found[2].translate(_SUBSCRIPT), text)


def typeset(text: str) -> str:
    """Return a text whose numbers are as people write them: `−1.2`, `12 %`, `3 × 10⁻⁷`.

    Numbers that are parts of words, file names and dates stay as they are.
    """
    return _NUMBER_OF_A_PROGRAM.sub(lambda found: as_written(found[0]), text)


def as_written(number: str) -> str:
    """Return a formatted number as people write it: `−1.2`, `12 %`, `3 × 10⁻⁷`."""
    mantissa, e, exponent = number.replace("-", "−").replace("%", " %").partition("e")
    if not e:
        return mantissa
    return f"{mantissa} × {power_of_ten(int(exponent.replace('−', '-')))}"


def _exponent(number: float) -> int:
    return math.floor(math.log10(abs(number)))


def digits_of_range(low: float, high: float, value: float) -> int:
    """Return the number of digits that shows the distance of two limits to two digits.

    An infinite limit counts as `value`.
    """
    size = max((abs(limit) for limit in (low, high) if math.isfinite(limit)), default=1.0)
    ends = [limit if math.isfinite(limit) else value for limit in (low, high)]
    width = abs(ends[1] - ends[0])
    if not (0 < width < math.inf and size > 0):
        return 3
    return min(max(2 + math.floor(math.log10(size)) - math.floor(math.log10(width)), 2), 8)
