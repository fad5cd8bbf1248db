"""The camera's exposure codes: eight steps a stop, and the actual APEX value behind each.

A dial shows 1/60 s or f/5.6; the shutter's actual time is 2⁻⁶ s and the diaphragm's f-number 2^2.5.
The difference (up to 7 %) is real and stays in the simulated photographs.
"""

import math
from fractions import Fraction
from typing import Literal

#: Sensitivity code of automatic ISO, and what a 5D Mark II takes for it with its dial at M.
ISO_AUTO, AUTO_AT_M = 0x00, 400
#: Shutter code of the bulb setting.
TV_BULB = 0x0C
_TV_ONE_SECOND = 0x38
_AV_F_1 = 0x08
_ISO_100 = 0x48

#: Thirds of a stop are coded 0, 3, 5 in eighths.
_THIRD_OF_EIGHTH = {0: 0, 3: 1, 5: 2}
_EIGHTHS = tuple(_THIRD_OF_EIGHTH)

#: The numbers on the dial from ISO 100 up in thirds of a stop.
ISO_LABELS = (
    *(100, 125, 160, 200, 250, 320, 400, 500, 640, 800),
    *(1000, 1250, 1600, 2000, 2500, 3200, 4000, 5000, 6400),
)


def _codes(first: int, last: int) -> tuple[int, ...]:
    return tuple(code for code in range(first, last + 1) if code % 8 in _EIGHTHS)


#: 30 s … 1/8000 s, and bulb.
TV_CODES = (TV_BULB, *_codes(0x10, 0xA0))
#: f/1.8 … f/22, an EF 50 mm f/1.8.
AV_CODES = _codes(0x15, 0x50)
#: ISO 100 … 6400.
ISO_CODES = _codes(_ISO_100, 0x78)


def iso_code(iso: int | Literal["auto"]) -> int:
    """Return the code of a sensitivity on the dial."""
    return ISO_AUTO if iso == "auto" else ISO_CODES[ISO_LABELS.index(iso)]


def _stops(code: int, zero: int) -> Fraction:
    """Return the stops between two codes, exact in thirds."""
    eighths = code - zero
    return eighths // 8 + Fraction(_THIRD_OF_EIGHTH[eighths % 8], 3)


def exposure_s(tv_code: int) -> float:
    """Return the actual shutter time in seconds: 2^-Tv; infinite at bulb."""
    if tv_code == TV_BULB:
        return math.inf
    return float(2.0 ** -_stops(tv_code, _TV_ONE_SECOND))


def f_number(av_code: int) -> float:
    """Return the actual relative aperture: 2^(Av/2)."""
    return float(2.0 ** (_stops(av_code, _AV_F_1) / 2))


def iso(iso_code: int) -> int:
    """Return the sensitivity on the dial."""
    if iso_code == ISO_AUTO:
        return AUTO_AT_M
    return ISO_LABELS[int(_stops(iso_code, _ISO_100) * 3)]


def true_f_number(label: float) -> float:
    """Return the actual relative aperture of a label in thirds of a stop: 2^2.5 for f/5.6."""
    return float(2.0 ** (round(6 * math.log2(label)) / 6))
