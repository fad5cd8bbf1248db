"""The simulated camera's RAW file: an uncompressed Bayer DNG, with EXIF as a Canon writes it.

tifffile is not used, since it cannot write an EXIF directory; cameras keep the exposure there. Make
is `labrig`, so that LibRaw applies no quirks of a known model.
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from fractions import Fraction
from typing import Final

from .sensor import BAYER_RGGB, RECORDED, Levels, Mosaic

MAKE = "labrig"
MODEL = "simulated EOS 5D Mark II"

#: Shutter dial of a Canon, label by label; the shutter itself keeps to powers of 2^(1/3) s.
DIAL: Final[tuple[Fraction, ...]] = (
    *(Fraction(seconds) for seconds in (30, 25, 20, 15, 13, 10, 8, 6, 5, 4)),
    *(Fraction(tenths, 10) for tenths in (32, 25, 20, 16, 13, 10, 8, 6, 5, 4, 3)),
    *(Fraction(1, part) for part in (4, 5, 6, 8, 10, 13, 15, 20, 25, 30, 40, 50, 60, 80)),
    *(Fraction(1, part) for part in (100, 125, 160, 200, 250, 320, 400, 500, 640, 800)),
    *(Fraction(1, part) for part in (1000, 1250, 1600, 2000, 2500, 3200, 4000, 5000, 6400, 8000)),
)
#: Labels of apertures in thirds of a stop from f/1 on; the actual ones are powers of 2^(1/6).
APERTURES: Final[tuple[Fraction, ...]] = tuple(
    Fraction(tenths, 10)
    for tenths in (
        *(10, 11, 12, 14, 16, 18, 20, 22, 25, 28, 32, 35, 40, 45, 50, 56, 63, 71, 80),
        *(90, 100, 110, 130, 140, 160, 180, 200, 220, 250, 290, 320),
    )
)
#: log2 of the dial's longest exposure: "30" is 32 s.
MAX_LOG2 = 5

#: XYZ (D65) to camera, row by row, as Adobe gives it for the EOS 5D Mark II; times 10000.
COLOR_MATRIX = (4716, 603, -830, -7798, 15474, 2480, -1496, 1937, 6651)
#: R, G, B of a grey card under the simulated lamp, green 1.
AS_SHOT_NEUTRAL = (Fraction(63, 100), Fraction(1), Fraction(45, 100))

_BYTE, _ASCII, _SHORT, _LONG, _RATIONAL, _UNDEFINED, _SRATIONAL = 1, 2, 3, 4, 5, 7, 10
_CODES = {_BYTE: "B", _SHORT: "H", _LONG: "I", _RATIONAL: "I", _SRATIONAL: "i", _UNDEFINED: "B"}

Values = Sequence[int] | Sequence[Fraction] | str | bytes
Entry = tuple[int, int, Values]


@dataclass(frozen=True)
class Shot:
    """Metadata of an exposure; `start_s` counts from 1970.

    `lens` is its name and focal length in mm; None: it reports nothing.
    """

    start_s: float
    exposure_s: float
    iso: int
    f_number: float
    lens: tuple[str, float] | None = None


def exposure_label(exposure_s: float) -> Fraction:
    """Return the exposure time that a Canon writes: the nominal time, 1/60 for 1/64 s.

    Bulb exposures beyond the dial are written in whole seconds.
    """
    true_s = [2.0 ** (MAX_LOG2 - step / 3) for step in range(len(DIAL))]
    if exposure_s > true_s[0] * 2 ** (1 / 6):
        return Fraction(round(exposure_s))
    nearest = min(range(len(DIAL)), key=lambda step: abs(exposure_s / true_s[step] - 1))
    return DIAL[nearest]


def aperture_label(f_number: float) -> Fraction:
    """Return the f-number that a Canon writes: the label, 2.8 for the actual 2.83."""
    return min(APERTURES, key=lambda label: abs(math.log(f_number / label)))


def encode_dng(mosaic: Mosaic, shot: Shot, levels: Levels = RECORDED) -> bytes:
    """Return the file's bytes.

    Parameters
    ----------
    mosaic
        Pixels of 16 bit, shape (height, width).
    shot
        Metadata of the exposure.
    levels
        Black and white of the mosaic.
    """
    height, width = mosaic.shape
    pixels = mosaic.astype("<u2").tobytes()
    # Whole microseconds first: the clock's seconds must not tip over by rounding twice.
    seconds, microseconds = divmod(round(shot.start_s * 1e6), 1_000_000)
    date_time = datetime.fromtimestamp(seconds, UTC).strftime("%Y:%m:%d %H:%M:%S")
    subsecond = f"{microseconds // 10_000:02d}"
    exif: list[Entry] = [
        (33434, _RATIONAL, [exposure_label(shot.exposure_s)]),
        (33437, _RATIONAL, [aperture_label(shot.f_number)]),
        (34855, _SHORT, [shot.iso]),
        (36864, _UNDEFINED, b"0230"),
        (36867, _ASCII, date_time),
        (37521, _ASCII, subsecond),
    ]
    if shot.lens is not None:
        name, focal_mm = shot.lens
        exif.insert(-1, (37386, _RATIONAL, [Fraction(focal_mm).limit_denominator(10)]))
        exif.append((42036, _ASCII, name))
    image: list[Entry] = [
        (254, _LONG, [0]),
        (256, _LONG, [width]),
        (257, _LONG, [height]),
        (258, _SHORT, [16]),
        (259, _SHORT, [1]),
        (262, _SHORT, [32803]),  # colour filter array
        (271, _ASCII, MAKE),
        (272, _ASCII, MODEL),
        (273, _LONG, [0]),  # where the pixels begin; set below
        (274, _SHORT, [1]),
        (277, _SHORT, [1]),
        (278, _LONG, [height]),
        (279, _LONG, [len(pixels)]),
        (306, _ASCII, date_time),
        (33421, _SHORT, [2, 2]),
        (33422, _BYTE, BAYER_RGGB),
        (34665, _LONG, [0]),  # where EXIF begins; set below
        (50706, _BYTE, [1, 4, 0, 0]),
        (50707, _BYTE, [1, 1, 0, 0]),
        (50708, _ASCII, f"{MAKE} {MODEL}"),
        (50713, _SHORT, [1, 1]),
        (50714, _SHORT, [levels.black_dn]),
        (50717, _LONG, [levels.white_dn]),
        (50721, _SRATIONAL, [Fraction(n, 10_000) for n in COLOR_MATRIX]),
        (50728, _RATIONAL, AS_SHOT_NEUTRAL),
        (50778, _SHORT, [21]),  # D65, to which the colour matrix belongs
    ]
    header = struct.pack("<2sHI", b"II", 42, 8)
    exif_at = len(header) + len(_directory(image, 0))
    pixels_at = exif_at + len(_directory(exif, 0))
    placed = {273: [pixels_at], 34665: [exif_at]}
    image = [(tag, kind, placed.get(tag, values)) for tag, kind, values in image]
    return b"".join([header, _directory(image, len(header)), _directory(exif, exif_at), pixels])


def _directory(entries: list[Entry], at: int) -> bytes:
    """Return a TIFF directory at offset `at`, followed by the values that do not fit in it."""
    table, behind = struct.pack("<H", len(entries)), b""
    behind_at = at + 2 + 12 * len(entries) + 4
    for tag, kind, values in entries:
        count, packed = _packed(kind, values)
        table += struct.pack("<HHI", tag, kind, count)
        if len(packed) <= 4:
            table += packed.ljust(4, b"\0")
        else:
            table += struct.pack("<I", behind_at + len(behind))
            behind += packed.ljust(len(packed) + len(packed) % 2, b"\0")
    return table + struct.pack("<I", 0) + behind


def _packed(kind: int, values: Values) -> tuple[int, bytes]:
    if isinstance(values, str):
        text = values.encode("ascii") + b"\0"
        return len(text), text
    numbers: list[int] = []
    for value in values:
        numbers += [value.numerator, value.denominator] if kind in (5, 10) else [int(value)]
    return len(values), struct.pack(f"<{len(numbers)}{_CODES[kind]}", *numbers)
