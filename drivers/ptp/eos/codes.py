"""Canon's codes for shutter time, aperture and sensitivity: eighths of a stop (APEX × 8).

A step of three eighths stands for a third of a stop, four for a half, five for two thirds. The
shutter's actual time is the power of two, not the nominal one on the dial: 1/60 is 1/64 s, 30 s is
32 s. Apertures and sensitivities keep their labels, which people, lenses and EXIF use.

Sources: APEX (ISO 2720 annex A); code ↔ label pairs as published with libgphoto2.
"""

import math
from collections.abc import Iterable
from fractions import Fraction
from functools import cache
from types import MappingProxyType

_STEP = {0: Fraction(0), 3: Fraction(1, 3), 4: Fraction(1, 2), 5: Fraction(2, 3)}
#: Code of a shutter time of 1 s.
_TV_ZERO = 0x38
#: 32 s ("30") and 1/8192 s ("1/8000").
MAX_TV, MIN_TV = 0x10, 0xA0
#: Code of bulb: the shutter stays open until the command to close.
BULB_TV = 0x0C
#: Longer times than the dial's begin here, and double.
MIN_BULB_S = 64.0
#: A dial label is at most 0.09 stop off the true time; neighbours are at least 1/6 stop apart.
SAME_SHUTTER_STOPS = 0.1
#: Neighbouring aperture labels differ by 6 % or more.
SAME_F_NUMBER = 0.02

F_NUMBERS = MappingProxyType(
    {
        0x08: 1.0, 0x0B: 1.1, 0x0C: 1.2, 0x0D: 1.2,
        0x10: 1.4, 0x13: 1.6, 0x14: 1.8, 0x15: 1.8,
        0x18: 2.0, 0x1B: 2.2, 0x1C: 2.5, 0x1D: 2.5,
        0x20: 2.8, 0x23: 3.2, 0x24: 3.5, 0x25: 3.5,
        0x28: 4.0, 0x2B: 4.5, 0x2C: 4.5, 0x2D: 5.0,
        0x30: 5.6, 0x33: 6.3, 0x34: 6.7, 0x35: 7.1,
        0x38: 8.0, 0x3B: 9.0, 0x3C: 9.5, 0x3D: 10.0,
        0x40: 11.0, 0x43: 13.0, 0x44: 13.0, 0x45: 14.0,
        0x48: 16.0, 0x4B: 18.0, 0x4C: 19.0, 0x4D: 20.0,
        0x50: 22.0, 0x53: 25.0, 0x54: 27.0, 0x55: 29.0,
        0x58: 32.0,
    }
)  # fmt: skip

ISOS = MappingProxyType(
    {
        0x40: 50, 0x48: 100, 0x4B: 125, 0x4D: 160,
        0x50: 200, 0x53: 250, 0x55: 320,
        0x58: 400, 0x5B: 500, 0x5D: 640,
        0x60: 800, 0x63: 1000, 0x65: 1250,
        0x68: 1600, 0x6B: 2000, 0x6D: 2500,
        0x70: 3200, 0x73: 4000, 0x75: 5000,
        0x78: 6400, 0x7B: 8000, 0x7D: 10000,
        0x80: 12800, 0x83: 16000, 0x85: 20000,
        0x88: 25600,
    }
)  # fmt: skip


@cache
def shutter_time_s(code: int) -> float | None:
    """Return the actual shutter time of a Tv code, in seconds; None for bulb and unknown codes."""
    stops, eighths = divmod(code - _TV_ZERO, 8)
    if not MAX_TV <= code <= MIN_TV or eighths not in _STEP:
        return None
    return float(2.0 ** -float(stops + _STEP[eighths]))


def third_stop_codes() -> tuple[int, ...]:
    """Return the Tv codes in thirds of a stop, from the longest time to the shortest."""
    codes = range(MAX_TV, MIN_TV + 1)
    return tuple(c for c in codes if (c - _TV_ZERO) % 8 in (0, 3, 5))


def bulb_times_s(longest_s: float) -> tuple[float, ...]:
    """Return the times offered at bulb, doubling from 64 s up to `longest_s` seconds."""
    times_s = []
    time_s = MIN_BULB_S
    while time_s <= longest_s:
        times_s.append(time_s)
        time_s *= 2
    return tuple(times_s)


def shutter_code(exposure_s: float, among: Iterable[int]) -> int | None:
    """Return the Tv code in `among` for `exposure_s` seconds, actual or nominal."""
    off_stops = {
        code: abs(math.log2(time_s / exposure_s))
        for code in among
        if (time_s := shutter_time_s(code)) is not None
    }
    nearest = min(off_stops, key=off_stops.__getitem__, default=None)
    return None if nearest is None or off_stops[nearest] > SAME_SHUTTER_STOPS else nearest


def labelled_times_s(label_s: float) -> tuple[float, ...]:
    """Return the actual times in seconds of a dial's label, in thirds and in halves of a stop.

    Labels of halves are as much as a quarter of a stop off: 10 is 11.3 s, 0.3 is 0.35 s. A label
    beyond the dial is of an exposure at bulb, which has no actual time of its own.
    """
    longest_s = shutter_time_s(MAX_TV)
    assert longest_s is not None
    if label_s > longest_s * 2 ** (1 / 6):
        return ()
    return tuple(
        2.0 ** float(Fraction(round(math.log2(label_s) * steps), steps)) for steps in (3, 2)
    )


def aperture_code(f_number: float, among: Iterable[int]) -> int | None:
    """Return the Av code in `among` whose label is `f_number`."""
    for code in among:
        if code in F_NUMBERS and abs(F_NUMBERS[code] / f_number - 1) < SAME_F_NUMBER:
            return code
    return None


def iso_code(iso: int, among: Iterable[int]) -> int | None:
    """Return the sensitivity code in `among` for `iso`."""
    return next((code for code in among if ISOS.get(code) == iso), None)
