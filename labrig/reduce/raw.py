"""A RAW file as the numbers the sensor counted, with what the camera says about them."""

import io
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from labrig.errors import FrameError, UsageError
from labrig.reduce.exif import Exif, read_exif
from labrig.reduce.noise import Mosaic
from labrig.reduce.quiet import quiet_stderr

#: LibRaw's colour numbers: the second green, in the blue's row, is 3.
_LIBRAW_COLOURS = "RGBG"
_BAYER = {"RGGB", "BGGR", "GRBG", "GBRG"}
#: Six rows give three of one colour, the least from which noise can be told.
_LEAST_PIXELS = 6
_EXPECTED = "expected a RAW file with a Bayer pattern"


@dataclass(frozen=True, eq=False)
class RawFrame:
    """The visible part of a Bayer sensor, undemosaiced.

    Parameters
    ----------
    mosaic
        Shape (height, width), uint16, DN with the black level in it.
    cfa
        Colours of the top-left 2 × 2 pixels in reading order, such as `RGGB`.
    black
        Black level in DN of those four pixels, in the same order.
    white
        Level in DN from which a pixel is saturated.
    exposure_s, iso, f_number, make, model
        From EXIF; None where absent or a placeholder.
    """

    mosaic: Mosaic
    cfa: str
    black: tuple[float, float, float, float]
    white: float
    exposure_s: float | None = None
    iso: float | None = None
    f_number: float | None = None
    make: str | None = None
    model: str | None = None

    def __post_init__(self) -> None:
        if self.mosaic.ndim != 2 or min(self.mosaic.shape) < _LEAST_PIXELS:
            raise FrameError(f"{_EXPECTED}, got an image of shape {self.mosaic.shape}")
        if self.mosaic.dtype != np.uint16:
            raise FrameError(f"{_EXPECTED} of 16 bit, got numbers of type {self.mosaic.dtype}")
        if self.cfa not in _BAYER:
            raise FrameError(
                f"{_EXPECTED} ({', '.join(sorted(_BAYER))}), got '{self.cfa}'; "
                "labrig cannot reduce this kind of sensor"
            )
        if not 0 <= max(self.black) < self.white:
            raise FrameError(
                f"expected black levels below white, got black {self.black}, white {self.white}; "
                "the file's levels are damaged"
            )

    @property
    def width(self) -> int:
        """Columns of the visible mosaic."""
        return int(self.mosaic.shape[1])

    @property
    def height(self) -> int:
        """Rows of the visible mosaic."""
        return int(self.mosaic.shape[0])

    @property
    def colour_index(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """LibRaw's colour number of the top-left 2 × 2 pixels: R 0, G 1, B 2, blue row's G 3."""
        red_row = self.cfa.index("R") // 2
        number = [
            3 if colour == "G" and position // 2 != red_row else "RGB".index(colour)
            for position, colour in enumerate(self.cfa)
        ]
        return (number[0], number[1]), (number[2], number[3])


def read_raw(source: Path | bytes, name: str = "the frame") -> RawFrame:
    """The RAW file `source`, a path or the bytes of one (then `name` names it in messages).

    Raises
    ------
    UsageError
        The file is missing or not readable.
    FrameError
        Not a RAW file, cut off or damaged, or from a sensor that has no Bayer pattern.
    """
    if isinstance(source, Path):
        name = str(source)
        try:
            content = source.read_bytes()
        except FileNotFoundError:
            raise UsageError(f"{source}: no such file") from None
        except OSError as error:
            raise UsageError(f"{source}: cannot be read ({error.strerror})") from None
    else:
        content = source
    try:
        return _decode(content)
    except FrameError as error:
        raise FrameError(f"{name}: {error}") from None


def _decode(content: bytes) -> RawFrame:
    if not content:
        raise FrameError(f"{_EXPECTED}, got an empty file; transfer it again")
    if content.startswith(b"\xff\xd8\xff"):
        raise FrameError(f"{_EXPECTED}, got a JPEG; set the camera's image quality to RAW")
    import rawpy  # LibRaw takes a tenth of a second to load: only when a RAW file is read

    # LibRaw reports damage on the process's stderr besides raising.
    with quiet_stderr():
        try:
            with rawpy.imread(io.BytesIO(content)) as raw:
                return _bayer(raw, rawpy.RawType.Flat, read_exif(content))
        except FrameError:
            raise
        except rawpy.LibRawIOError:
            raise FrameError(
                f"{_EXPECTED}, got one whose end is missing; transfer it again"
            ) from None
        except rawpy.LibRawFileUnsupportedError:
            raise FrameError(
                f"{_EXPECTED}, got something LibRaw does not know or that is cut off; "
                "check that it is a RAW file and transfer it again"
            ) from None
        # A damaged file can fail anywhere in rawpy, with any exception: all mean the same.
        except Exception as error:
            said = error.args[0] if error.args else type(error).__name__
            text = said.decode(errors="replace") if isinstance(said, bytes) else str(said)
            raise FrameError(
                f"{_EXPECTED}, got a damaged one ({' '.join(text.split())}); transfer it again"
            ) from None


def _bayer(raw: Any, flat: Any, exif: Exif) -> RawFrame:
    """`raw`, an open rawpy file, if it has one 2 × 2 Bayer pattern."""
    if raw.raw_type != flat:
        raise FrameError(
            f"{_EXPECTED}, got an image with all colours in every pixel (linear DNG, sRAW or "
            "Foveon); convert without demosaicing, or set the camera to full-size RAW"
        )
    pattern, names = raw.raw_pattern, raw.color_desc.decode("ascii", "replace")
    if pattern is None:
        raise FrameError(f"{_EXPECTED}, got a monochrome sensor, which labrig cannot reduce yet")
    if pattern.shape != (2, 2) or names != _LIBRAW_COLOURS:
        kind = "X-Trans" if pattern.shape == (6, 6) else names
        rows, columns = pattern.shape
        raise FrameError(
            f"{_EXPECTED}, got a {rows} x {columns} pattern ({kind}), which labrig cannot "
            "reduce yet; use a camera with a Bayer sensor"
        )
    order: Iterable[int] = [int(index) for index in pattern.ravel()]
    # LibRaw lists levels as R, G, B, G2; here they follow the pixels of the pattern.
    first, second, third, fourth = (float(raw.black_level_per_channel[i]) for i in order)
    return RawFrame(
        mosaic=np.array(raw.raw_image_visible),  # a copy: LibRaw frees its own
        cfa="".join(_LIBRAW_COLOURS[index] for index in order),
        black=(first, second, third, fourth),
        white=float(raw.white_level),
        exposure_s=exif.exposure_s,
        iso=exif.iso,
        f_number=exif.f_number,
        make=exif.make,
        model=exif.model,
    )
