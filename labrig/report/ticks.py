"""Ticks of linear and logarithmic axes, with their labels."""

import math
from collections.abc import Callable

from labrig.foundation.number_format import power_of_ten, rounded

#: Ticks as pairs of value and label, by rising value.
Ticks = tuple[tuple[float, str], ...]

#: Steps between ticks within a decade that are easy to read.
STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
#: Number of decades of an axis below which ticks between decades are labelled, too.
FEW_DECADES = 2.0
#: Number of labels below which evenly spaced ticks are labelled instead.
FEWEST_LABELS = 2


def linear_ticks(
    low: float, high: float, most: int, label: Callable[[float], str] = rounded
) -> Ticks:
    """Return at most `most + 1` evenly spaced ticks from `low` to `high`."""
    raw_step = (high - low) / most
    if not (math.isfinite(raw_step) and raw_step > 0):
        return ()
    decade = 10.0 ** math.floor(math.log10(raw_step))
    step = next(
        (factor * decade for factor in STEPS if factor * decade >= raw_step * (1 - 1e-9)),
        10 * decade,
    )
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return tuple((number * step, label(number * step)) for number in range(first, last + 1))


def decade_ticks(low: float, high: float, most: int = 8) -> tuple[Ticks, tuple[float, ...]]:
    """Return the labelled ticks of a logarithmic axis, and its short ticks without labels.

    Labelled ticks stand at `most` decades or between them; if every decade is labelled, short ticks
    stand at its multiples from 2 to 9.
    """
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    inside = [decade for decade in decades if low <= 10.0**decade <= high]
    step = max(1, math.ceil(len(inside) / most))
    labelled_decades = decades[::step]
    labelled = [10.0**decade for decade in labelled_decades]
    if high < low * 10**FEW_DECADES:
        labelled = [digit * 10.0**decade for decade in labelled_decades for digit in (1, 2, 5)]
    labelled = [tick for tick in labelled if low <= tick <= high]
    if len(labelled) < FEWEST_LABELS:
        labelled = [tick for tick, _ in linear_ticks(low, high, 5)]
    multiples = [digit * 10.0**decade for decade in decades for digit in range(2, 10)]
    short = tuple(tick for tick in multiples if low <= tick <= high) if step == 1 else ()
    return tuple((tick, decade_text(tick)) for tick in labelled), short


def decade_text(value: float) -> str:
    """Return the label of a tick: `0.001` to `10000`, beyond that with a power of ten."""
    exponent = math.floor(math.log10(value) + 1e-9)
    if -3 <= exponent <= 4:
        return f"{value:g}"
    digit = round(value / 10.0**exponent)
    return power_of_ten(exponent) if digit == 1 else f"{digit} × {power_of_ten(exponent)}"
