"""The mosaic of a RAW file in DN, with the camera's metadata."""

import io
import logging
import math
import os
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from labrig.foundation.errors import FrameError
from labrig.foundation.file_kind import PHOTOGRAPH, PICTURE, require_kind
from labrig.foundation.input_file import MAX_FRAME_BYTES, read_bytes
from labrig.reduce.black_cut_off import BlackCutOff, find_cut_off
from labrig.reduce.dng import (
    MONOCHROME,
    DngPattern,
    Letters,
    channels_of,
    read_dng,
    side_of,
    smallest_square,
)
from labrig.reduce.plane_noise import Floats, Mosaic
from labrig.reduce.saturation import clip_level

_STDERR = 2
#: First bytes of LibRaw's lines (a buffer has no file name), and of those of its libjpeg.
_PREFIXES = (b"unknown file:", b"Corrupt JPEG data:", b"Premature end of JPEG file")
#: The process has one stderr: two redirections at once would restore each other's.
_lock = threading.Lock()


@contextmanager
def libraw_stderr() -> Iterator[None]:
    """Drop LibRaw's lines on the process's stderr.

    Lines that other threads write meanwhile are passed on at the end.
    """
    with _lock, tempfile.TemporaryFile() as captured:
        try:
            original = os.dup(_STDERR)
        except OSError:  # a process without stderr has nothing to keep quiet
            yield
            return
        os.dup2(captured.fileno(), _STDERR)
        try:
            yield
        finally:
            os.dup2(original, _STDERR)
            os.close(original)
            captured.seek(0)
            for line in captured:
                if not line.startswith(_PREFIXES):
                    os.write(_STDERR, line)


@dataclass(frozen=True)
class Exif:
    """EXIF of one frame; None where absent, unreadable or a placeholder such as 0.

    Attributes
    ----------
    exposure_s
        Nominal exposure time in seconds.
    iso, f_number
        ISO and f-number.
    make, model
        Manufacturer and model of the camera.
    lens
        Name and focal length of the lens, as far as the camera records them.
    dng
        Whether the file declares itself a DNG.
    time_s
        Start of the exposure by the camera's own clock, in seconds since 1970 in whatever zone the
        clock is set to.
    time_step_s
        Step of that clock in seconds.
    """

    exposure_s: float | None = None
    iso: float | None = None
    f_number: float | None = None
    make: str | None = None
    model: str | None = None
    lens: str | None = None
    dng: bool = False
    time_s: float | None = None
    time_step_s: float = 1.0


#: Value of EXIF 2.3 for an ISO above 65534, which is in another tag.
_ISO_OVERFLOW = 65535
#: Most digits of a fraction of a second.
_MAX_SUBSECOND_DIGITS = 9
#: Names that exifread gives the tag of DNG files: by its number, or by its name.
_DNG_VERSION = ("Image Tag 0xC612", "Image DNGVersion")


# exifread warns through logging of every odd tag; what matters shows as None.
logging.getLogger("exifread").setLevel(logging.CRITICAL)


def read_exif(source: bytes | BinaryIO) -> Exif:
    """Read the EXIF of a RAW file.

    Damaged EXIF counts as missing: the picture can be reduced without it.

    Parameters
    ----------
    source
        The bytes of the RAW file, or the file, of which only what is needed is read.

    Returns
    -------
    Exif
        Settings of the exposure, camera and lens; None where absent or unreadable.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.reduce import read_exif
    >>> exif = read_exif(Path("frame.dng").read_bytes())
    >>> exif.exposure_s, exif.iso, exif.f_number
    (0.5, 400.0, 4.0)
    """
    import exifread  # with its maker-note tables, only when a RAW file is read

    try:
        file = io.BytesIO(source) if isinstance(source, bytes) else source
        tags: dict[str, Any] = exifread.process_file(file, details=False)
    except MemoryError:
        raise
    except Exception:  # a damaged file can fail anywhere in exifread, with any exception
        return Exif()
    time_s, time_step_s = _time(tags)
    speeds = (_positive(tags, name) for name in ("ISOSpeedRatings", "RecommendedExposureIndex"))
    return Exif(
        exposure_s=_positive(tags, "ExposureTime"),
        iso=next((iso for iso in speeds if iso is not None and iso != _ISO_OVERFLOW), None),
        f_number=_positive(tags, "FNumber"),
        make=_text(tags, "Image Make"),
        model=_text(tags, "Image Model"),
        lens=_lens(tags),
        dng=any(name in tags for name in _DNG_VERSION),
        time_s=time_s,
        time_step_s=time_step_s,
    )


def _positive(tags: dict[str, Any], name: str) -> float | None:
    """Return the first value of a tag in the EXIF directory or, as TIFF/EP has it, the image's."""
    for directory in ("EXIF", "Image"):
        values = getattr(tags.get(f"{directory} {name}"), "values", None)
        try:
            number = float(values[0]) if values else 0.0
        except (TypeError, ValueError, ZeroDivisionError, OverflowError, IndexError):
            continue
        if number > 0 and math.isfinite(number):
            return number
    return None


def _lens(tags: dict[str, Any]) -> str | None:
    """Return the lens as in `EF50mm f/1.4 USM, 50 mm`."""
    focal_mm = _positive(tags, "FocalLength")
    parts = (_text(tags, "EXIF LensModel"), None if focal_mm is None else f"{focal_mm:g} mm")
    return ", ".join(filter(None, parts)) or None


def _time(tags: dict[str, Any]) -> tuple[float | None, float]:
    """Return the start of the exposure by the camera's clock, and the step of that clock, in s."""
    text = _text(tags, "EXIF DateTimeOriginal") or ""
    digits = _text(tags, "EXIF SubSecTimeOriginal") or ""
    try:
        time = datetime.strptime(text, "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC).timestamp()
    except (ValueError, OverflowError):
        return None, 1.0
    if not (digits.isascii() and digits.isdigit() and len(digits) <= _MAX_SUBSECOND_DIGITS):
        return time, 1.0
    return time + int(digits) / 10 ** len(digits), 10.0 ** -len(digits)


def _text(tags: dict[str, Any], name: str) -> str | None:
    """Return a tag's text without the padding of cameras; None if no legible text remains."""
    words = str(tags.get(name, "")).split()
    text = " ".join(words)
    return text if text.isprintable() and text else None


#: LibRaw's colour numbers: the second green, in the blue's row, is 3.
_RGBG = "RGBG"
#: LibRaw's number of the channel whose black level stands for each letter.
_BLACK_NUMBER = {"R": 0, "G": 1, "B": 2, MONOCHROME: 0}
#: Rows of an X-Trans pattern.
_X_TRANS = 6


def sensor_pattern(raw: Any, dng: bytes | None) -> tuple[str, tuple[float, ...]]:
    """Return `cfa` and `black` of a `RawFrame`.

    Parameters
    ----------
    raw
        An open rawpy file.
    dng
        The bytes of the file if it is a DNG, whose own tags then have priority over LibRaw's; else
        None.

    Raises
    ------
    FrameError
        The sensor has other colours, or no pattern that is known for certain.
    """
    if dng is not None:
        pattern = read_dng(dng, raw.sizes.raw_height, raw.sizes.raw_width)
        if pattern is not None:
            return smallest_square(*_visible_pattern(raw, pattern))
    return smallest_square(*_libraw_pattern(raw))


def _visible_pattern(raw: Any, pattern: DngPattern) -> tuple[Letters, Floats]:
    """Return colours and black levels of a DNG, shifted to the first pixel visible to LibRaw."""
    shift = (pattern.corner[0] - raw.sizes.top_margin, pattern.corner[1] - raw.sizes.left_margin)
    colours = np.roll(pattern.colours, shift, axis=(0, 1))
    if pattern.black is not None:
        return colours, np.roll(pattern.black, shift, axis=(0, 1))
    # LibRaw then has measured it in the masked borders, or knows the camera.
    by_number = raw.black_level_per_channel
    numbers = [_BLACK_NUMBER.get(str(letter), 0) for letter in colours.flat]
    return colours, np.array([float(by_number[i]) for i in numbers]).reshape(colours.shape)


def _libraw_pattern(raw: Any) -> tuple[Letters, Floats]:
    """Return colours and black levels by LibRaw, from the first visible pixel on."""
    pattern, levels = raw.raw_pattern, raw.black_level_per_channel
    if pattern is None or pattern.shape == (1, 1):
        return np.array([[MONOCHROME]]), np.array([[float(levels[0])]])
    names = raw.color_desc.decode("ascii", "replace")
    if names != _RGBG:
        raise FrameError(
            f"expected a sensor with filters of red, green and blue, got {names}; "
            "labrig cannot reduce this kind of sensor"
        )
    margins = (raw.sizes.top_margin, raw.sizes.left_margin)
    if len(pattern) == _X_TRANS and any(margin % _X_TRANS for margin in margins):
        # LibRaw and rawpy then count the pattern's rows from different ones.
        raise FrameError(
            "expected an X-Trans pattern whose repeats begin at the border, got margins "
            f"{margins}; convert the file to DNG"
        )
    colours = np.array(list(names))[pattern]
    return colours, np.asarray(levels, dtype=np.float64)[pattern]


#: Pixels that need no more are unpacked whatever their packing; others need no more than
#: `MAX_UNPACKING` times their file.
MAX_UNPACKED_BYTES, MAX_UNPACKING = 50_000_000, 20
_BYTES_OF_PIXEL = 2
#: Fewest rows and columns of one position of the CFA from which noise can be estimated.
_MIN_PIXELS = 3
_EXPECTED = "expected a RAW file with one colour in every pixel"
#: First bytes of RAW files: TIFF (most, NEF, ARW and DNG among them) and its variants of Olympus,
#: Panasonic and Phase One; CIFF; Fujifilm; Minolta; Sigma.
_CONTAINERS = (
    b"II*\0", b"MM\0*", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"IIII", b"MMMM",
    b"II\x1a\0\0\0HEAPCCDR", b"FUJIFILMCCD-RAW", b"\0MRM", b"FOVb",
)  # fmt: skip
#: File type of Canon's CR3, a kind of MPEG-4, and its place in the file.
_CR3, _CR3_AT = b"ftypcrx", 4


@dataclass(frozen=True, eq=False)
class RawFrame:
    """The visible part of a sensor, undemosaiced.

    Parameters
    ----------
    mosaic
        Pixels in DN with the black level in them, uint16, shape (height, width).
    cfa
        Colours of the smallest square that repeats, from the top-left pixel in reading order: four
        letters such as `RGGB`, 36 of an X-Trans sensor, `L` of a monochrome one.
    black
        Black levels of those pixels in DN, in the same order.
    white
        Level in DN from which a pixel is saturated.
    exposure_s
        Nominal exposure time in seconds by EXIF; None where absent or a placeholder.
    iso, f_number, make, model
        Settings and camera by EXIF; None where absent or a placeholder.
    """

    mosaic: Mosaic
    cfa: str
    black: tuple[float, ...]
    white: float
    exposure_s: float | None = None
    iso: float | None = None
    f_number: float | None = None
    make: str | None = None
    model: str | None = None

    def __post_init__(self) -> None:
        if not set(self.cfa) == set(self.channels) or self.cfa_side**2 != len(self.cfa):
            raise FrameError(
                f"{_EXPECTED}, in a square of R, G and B that repeats or without filters, got "
                f"'{self.cfa}'; labrig cannot reduce this kind of sensor"
            )
        least = _MIN_PIXELS * self.cfa_side
        if self.mosaic.ndim != 2 or min(self.mosaic.shape) < least:
            raise FrameError(
                f"{_EXPECTED}, {least} x {least} or more, got an image of shape {self.mosaic.shape}"
            )
        if self.mosaic.dtype != np.uint16:
            raise FrameError(f"{_EXPECTED} of 16 bit, got numbers of type {self.mosaic.dtype}")
        if len(self.black) != len(self.cfa):
            raise FrameError(
                f"expected {len(self.cfa)} black levels, one for each of {self.cfa}, "
                f"got {len(self.black)}"
            )
        if not 0 <= max(self.black) < self.white:
            raise FrameError(
                f"expected black levels below white, got black {self.black}, white {self.white}; "
                "the file's levels are damaged"
            )

    @property
    def width(self) -> int:
        """Number of columns of the visible mosaic."""
        return int(self.mosaic.shape[1])

    @property
    def height(self) -> int:
        """Number of rows of the visible mosaic."""
        return int(self.mosaic.shape[0])

    @property
    def cfa_side(self) -> int:
        """Period of `cfa` in pixels, down and across."""
        return side_of(self.cfa)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels: R, G and B, or L."""
        return channels_of(self.cfa)

    @cached_property
    def cut_off(self) -> BlackCutOff | None:
        """Cut-off of noise below black; None where the camera keeps it, or none is seen."""
        side = self.cfa_side
        return find_cut_off(
            [self.mosaic[row::side, column::side] for row, column in np.ndindex(side, side)]
        )

    def levels_dn(self, pixels: npt.NDArray[np.integer]) -> Floats:
        """Return the values in DN that pixels stand for, black level in them.

        They are the pixels' own numbers but near black, if noise below it is cut off.
        """
        if self.cut_off is None:
            return pixels.astype(np.float64)
        return self.cut_off.file_levels_dn(pixels)


def read_raw(source: str | Path | bytes, name: str = "the frame") -> RawFrame:
    """Read the mosaic of a RAW file, undemosaiced, with its black and saturation levels.

    Parameters
    ----------
    source
        Path of the RAW file, or the bytes of one.
    name
        Name of the frame in messages, if `source` is bytes.

    Returns
    -------
    RawFrame
        The visible mosaic in DN, shape (height, width), and the settings of the exposure.

    Raises
    ------
    UsageError
        The file is missing or not readable.
    DiskError
        The disk does not give it back.
    FrameError
        The file is no RAW file, is cut off or damaged, or is from a sensor of another kind.

    Examples
    --------
    >>> import labrig
    >>> raw = labrig.read_raw("frame.dng")
    >>> raw.mosaic.shape, raw.cfa, raw.black[0], raw.white
    ((64, 96), 'RGGB', 1024.0, 15600.0)
    >>> raw.exposure_s, raw.iso, raw.f_number
    (0.5, 400.0, 4.0)
    """
    if isinstance(source, bytes):
        content = source
    else:
        name = str(source)
        if Path(source).is_dir():
            require_kind(Path(source), PHOTOGRAPH)
        content = read_bytes(Path(source), MAX_FRAME_BYTES)
    try:
        return _decode(content)
    except FrameError as error:
        if not isinstance(source, bytes):
            require_kind(Path(source), PHOTOGRAPH, PICTURE)
        raise FrameError(f"{name}: {error}") from None


def _decode(content: bytes) -> RawFrame:
    if not content:
        raise FrameError(f"{_EXPECTED}, got an empty file; transfer it again")
    if content.startswith(b"\xff\xd8\xff"):
        raise FrameError(f"{_EXPECTED}, got a JPEG; set the camera's image quality to RAW")
    if not content.startswith(_CONTAINERS) and not content.startswith(_CR3, _CR3_AT):
        # LibRaw would take plain numbers for the picture of a webcam, if only their count fits.
        raise FrameError(
            f"{_EXPECTED}, got no RAW container, its header is of no known format; take the file "
            "as the camera wrote it, and transfer it again"
        )
    import rawpy  # LibRaw takes a tenth of a second to load: only when a RAW file is read

    # LibRaw reports damage on the process's stderr besides raising.
    with libraw_stderr():
        try:
            exif = read_exif(content)
            with rawpy.imread(io.BytesIO(content)) as raw:
                _hold_to_budget(raw.sizes, len(content))
                mosaic, sensor = _mosaic_and_sensor(raw, rawpy.RawType.Flat, content, exif)
            # LibRaw's own copy of the pixels is freed before more memory is taken.
            return _frame(mosaic, sensor, exif)
        except (FrameError, MemoryError):
            raise
        except rawpy.LibRawUnsufficientMemoryError:
            raise MemoryError(f"a frame of {len(content) / 1e6:.3g} MB") from None
        except (rawpy.LibRawIOError, rawpy.LibRawFileUnsupportedError):
            raise FrameError(
                f"{_EXPECTED}, got one that is cut off or that LibRaw cannot unpack; transfer it "
                "again, or set the camera to plain (lossless or uncompressed) RAW"
            ) from None
        # A damaged file can fail anywhere in rawpy, with any exception: all mean the same.
        except Exception as error:
            reason = error.args[0] if error.args else type(error).__name__
            text = reason.decode(errors="replace") if isinstance(reason, bytes) else str(reason)
            raise FrameError(
                f"{_EXPECTED}, got a damaged one ({' '.join(text.split())}); transfer it again"
            ) from None


def _hold_to_budget(sizes: Any, file_bytes: int) -> None:
    """Refuse a frame whose header states more pixels than its file holds, before they are unpacked.

    Noise cannot be packed: each pixel of a frame takes bits of its file.
    """
    needed = sizes.raw_width * sizes.raw_height * _BYTES_OF_PIXEL
    if needed > max(MAX_UNPACKED_BYTES, MAX_UNPACKING * file_bytes):
        raise FrameError(
            f"{_EXPECTED}, got {file_bytes} bytes whose header states {sizes.raw_width} × "
            f"{sizes.raw_height} pixels; transfer it again"
        )


class _Sensor(NamedTuple):
    """Colours, black levels and white level of a file."""

    cfa: str
    black: tuple[float, ...]
    white: float


def _mosaic_and_sensor(raw: Any, flat: Any, content: bytes, exif: Exif) -> tuple[Mosaic, _Sensor]:
    """Return the pixels of an open rawpy file, if they are undemosaiced, and their levels."""
    if raw.raw_type != flat:
        raise FrameError(
            f"{_EXPECTED}, got an image with all colours in every pixel (linear DNG, sRAW or "
            "Foveon); convert without demosaicing, or set the camera to full-size RAW"
        )
    cfa, black = sensor_pattern(raw, content if exif.dng else None)
    mosaic = np.array(raw.raw_image_visible)  # a copy: LibRaw frees its own
    return mosaic, _Sensor(cfa, black, float(raw.white_level))


def _frame(mosaic: Mosaic, sensor: _Sensor, exif: Exif) -> RawFrame:
    return RawFrame(
        mosaic=mosaic,
        cfa=sensor.cfa,
        black=sensor.black,
        white=clip_level(mosaic, max(sensor.black), sensor.white),
        exposure_s=exif.exposure_s,
        iso=exif.iso,
        f_number=exif.f_number,
        make=exif.make,
        model=exif.model,
    )
