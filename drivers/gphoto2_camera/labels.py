"""Meaning of the labels that libgphoto2 gives to settings: `1/60`, `10/13`, `0.0100s`, `f/5.6`.

A shutter's actual times are powers of two, in thirds or halves of a stop (APEX, ISO 2720 annex A);
its labels, the nominal times, are rounded: 1/60 is 1/64 s, 30 is 32 s. Fujifilm's cameras report
the actual times beside the labels, Canon's codes are eighths of a stop; of other makes it is
assumed. Apertures and sensitivities keep their labels, which people, lenses and EXIF use.
"""

import math
import re
from collections.abc import Collection, Iterable, Mapping

#: Largest deviation of a label in thirds of a stop from the actual time.
LABEL_STOPS = 0.12
#: Tolerance of a requested time, which is nominal or actual.
SAME_SHUTTER_STOPS = 0.05
#: Neighbouring aperture labels differ by 6 % or more.
SAME_F_NUMBER = 0.02
#: Longest time on a dial; longer ones are a timer's, in actual seconds.
MAX_ON_DIAL_S = 30.0
#: Steps of a stop.
_THIRDS, _HALVES = 3, 2

_TIME = re.compile(r'(\d+(?:\.\d+)?)(?:/(\d+(?:\.\d+)?))?\s*(?:s|sec|")?', re.IGNORECASE)
_F_NUMBER = re.compile(r"(?:f\s*/?\s*)?(\d+(?:\.\d+)?)", re.IGNORECASE)
_RAW = re.compile(r"\b(raw|nef|dng)\b", re.IGNORECASE)
_NOT_RAW_ALONE = re.compile(r"\+|,|jpe?g|heif", re.IGNORECASE)


def labelled_time_s(label: str) -> float | None:
    """Return the nominal time of a label, in seconds; None for bulb, automatic and the like."""
    match = _TIME.fullmatch(label.strip())
    if match is None:
        return None
    divisor = float(match[2] or 1)
    time_s = float(match[1]) / divisor if divisor else 0.0
    return time_s if time_s > 0 else None


def true_times_s(labels: Iterable[str]) -> dict[str, float]:
    """Return the actual shutter time of each label that names a time, in seconds.

    The number of labels shows whether a camera counts in thirds or in halves of a stop.
    """
    nominal = {label: time_s for label in labels if (time_s := labelled_time_s(label)) is not None}
    dial = {label: time_s for label, time_s in nominal.items() if time_s <= MAX_ON_DIAL_S}
    steps = _steps_of_a_stop(dial.values())
    return nominal | {label: _true_time_s(time_s, steps) for label, time_s in dial.items()}


def labelled_times_s(time_s: float) -> tuple[float, ...]:
    """Return the actual times of a nominal one in seconds, in thirds and in halves of a stop."""
    if time_s > MAX_ON_DIAL_S:
        return (time_s, time_s)
    return (_true_time_s(time_s, _THIRDS), _true_time_s(time_s, _HALVES))


def label_of_time(exposure_s: float, times_s: Mapping[str, float]) -> str | None:
    """Return the label in `times_s` for `exposure_s` seconds, actual or nominal."""

    def off_stops(label: str) -> float:
        meant_s = (times_s[label], labelled_time_s(label) or times_s[label])
        return min(abs(math.log2(time_s / exposure_s)) for time_s in meant_s)

    nearest = min(times_s, key=off_stops, default=None)
    return None if nearest is None or off_stops(nearest) > SAME_SHUTTER_STOPS else nearest


def f_number(label: str) -> float | None:
    """Return the f-number of a label such as `5.6` or `f/5.6`."""
    match = _F_NUMBER.fullmatch(label.strip())
    return float(match[1]) or None if match else None


def iso(label: str) -> int | None:
    """Return the sensitivity of a label; None for automatic ones."""
    return int(label) or None if label.isascii() and label.isdigit() else None


def is_raw_alone(label: str) -> bool:
    """Return whether an image format is full RAW and nothing else: not `RAW + JPEG`, not `mRAW`."""
    return bool(_RAW.search(label)) and not _NOT_RAW_ALONE.search(label)


def _steps_of_a_stop(times_s: Collection[float]) -> int:
    stops = math.log2(max(times_s) / min(times_s)) if len(times_s) > 1 else 0.0
    return _HALVES if stops and round((len(times_s) - 1) / stops) == _HALVES else _THIRDS


def _true_time_s(time_s: float, steps: int) -> float:
    true_s: float = 2.0 ** (round(math.log2(time_s) * steps) / steps)
    # the labels of halves are as much as a quarter of a stop off: 10 is 11.3 s, 0.3 is 0.35 s
    is_meant = steps == _HALVES or abs(math.log2(true_s / time_s)) < LABEL_STOPS
    return true_s if is_meant else time_s
