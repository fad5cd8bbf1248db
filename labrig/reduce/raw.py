"""A RAW file as the numbers the sensor counted, with what the camera says about them."""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from labrig.errors import FrameError
from labrig.input_file import read_bytes
from labrig.reduce.cfa import channels_of, side_of
from labrig.reduce.exif import Exif, read_exif
from labrig.reduce.noise import Mosaic
from labrig.reduce.quiet import quiet_stderr
from labrig.reduce.saturation import clip_level
from labrig.reduce.sensor import sensor_pattern

#: No camera's file is larger.
MOST_BYTES = 1_000_000_000
#: Rows and columns of one position of the CFA, the least from which noise can be told.
_LEAST_PIXELS = 3
_EXPECTED = "expected a RAW file with one colour in every pixel"
#: How files begin that hold what a sensor counted: TIFF (most, NEF, ARW and DNG among them) and its
#: kin of Olympus, Panasonic and Phase One; CIFF; Fujifilm; Minolta; Sigma.
_CONTAINERS = (
    b"II*\0", b"MM\0*", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"IIII", b"MMMM",
    b"II\x1a\0\0\0HEAPCCDR", b"FUJIFILMCCD-RAW", b"\0MRM", b"FOVb",
)  # fmt: skip
#: Canon's CR3, a kind of MPEG-4, says so here.
_CR3, _CR3_AT = b"ftypcrx", 4


@dataclass(frozen=True, eq=False)
class RawFrame:
    """The visible part of a sensor, undemosaiced.

    Parameters
    ----------
    mosaic
        Shape (height, width), uint16, DN with the black level in it.
    cfa
        Colours of the smallest square that repeats, from the top-left pixel in reading order:
        four letters such as `RGGB`, 36 of an X-Trans sensor, `L` of a monochrome one.
    black
        Black level in DN of those pixels, in the same order.
    white
        Level in DN from which a pixel is saturated.
    exposure_s, iso, f_number, make, model
        From EXIF; None where absent or a placeholder.
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
        least = _LEAST_PIXELS * self.cfa_side
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
        """Columns of the visible mosaic."""
        return int(self.mosaic.shape[1])

    @property
    def height(self) -> int:
        """Rows of the visible mosaic."""
        return int(self.mosaic.shape[0])

    @property
    def cfa_side(self) -> int:
        """Pixels after which `cfa` repeats, down and across."""
        return side_of(self.cfa)

    @property
    def channels(self) -> tuple[str, ...]:
        """R, G and B, or L."""
        return channels_of(self.cfa)


def read_raw(source: Path | bytes, name: str = "the frame") -> RawFrame:
    """The RAW file `source`, a path or the bytes of one (then `name` names it in messages).

    Raises
    ------
    UsageError
        The file is missing or not readable.
    DiskError
        The disk does not give it back.
    FrameError
        Not a RAW file, cut off or damaged, or from a sensor of another kind.
    """
    if isinstance(source, Path):
        name = str(source)
        content = read_bytes(source, MOST_BYTES)
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
    if not content.startswith(_CONTAINERS) and not content.startswith(_CR3, _CR3_AT):
        # LibRaw would take plain numbers for the picture of a webcam, if only their count fits.
        raise FrameError(
            f"{_EXPECTED}, got no RAW container, its header is of no known format; take the file "
            "as the camera wrote it, and transfer it again"
        )
    import rawpy  # LibRaw takes a tenth of a second to load: only when a RAW file is read

    # LibRaw reports damage on the process's stderr besides raising.
    with quiet_stderr():
        try:
            with rawpy.imread(io.BytesIO(content)) as raw:
                return _frame(raw, rawpy.RawType.Flat, content, read_exif(content))
        except FrameError:
            raise
        except (rawpy.LibRawIOError, rawpy.LibRawFileUnsupportedError):
            raise FrameError(
                f"{_EXPECTED}, got one that is cut off or that LibRaw cannot unpack; transfer it "
                "again, or set the camera to plain (lossless or uncompressed) RAW"
            ) from None
        # A damaged file can fail anywhere in rawpy, with any exception: all mean the same.
        except Exception as error:
            said = error.args[0] if error.args else type(error).__name__
            text = said.decode(errors="replace") if isinstance(said, bytes) else str(said)
            raise FrameError(
                f"{_EXPECTED}, got a damaged one ({' '.join(text.split())}); transfer it again"
            ) from None


def _frame(raw: Any, flat: Any, content: bytes, exif: Exif) -> RawFrame:
    """`raw`, an open rawpy file, if it is undemosaiced."""
    if raw.raw_type != flat:
        raise FrameError(
            f"{_EXPECTED}, got an image with all colours in every pixel (linear DNG, sRAW or "
            "Foveon); convert without demosaicing, or set the camera to full-size RAW"
        )
    cfa, black = sensor_pattern(raw, content if exif.dng else None)
    mosaic = np.array(raw.raw_image_visible)  # a copy: LibRaw frees its own
    return RawFrame(
        mosaic=mosaic,
        cfa=cfa,
        black=black,
        white=clip_level(mosaic, max(black), float(raw.white_level)),
        exposure_s=exif.exposure_s,
        iso=exif.iso,
        f_number=exif.f_number,
        make=exif.make,
        model=exif.model,
    )
