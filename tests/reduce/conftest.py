import io
import struct
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import tifffile

from labrig.reduce import RawFrame

WriteDng = Callable[..., bytes]
MakeRaw = Callable[..., RawFrame]


@pytest.fixture(scope="session")
def write_dng() -> WriteDng:
    return _dng


@pytest.fixture(scope="session")
def make_raw() -> MakeRaw:
    return _raw


def _raw(
    pixels: npt.NDArray[Any], black: float = 1000.0, cfa: str = "RGGB", **changes: Any
) -> RawFrame:
    """A frame of pixels given as real numbers, rounded as a converter does."""
    mosaic = np.clip(np.rint(pixels), 0, 65535).astype(np.uint16)
    settings: dict[str, Any] = {"cfa": cfa, "black": (black,) * len(cfa), "white": 60000.0}
    return RawFrame(mosaic=mosaic, **settings | changes)


def _dng(
    mosaic: npt.NDArray[Any],
    cfa: str = "RGGB",
    black: tuple[float, ...] | None = (1000, 1000, 1000, 1000),
    white: int = 15000,
    exposure: tuple[int, int] | None = None,
    f_number: tuple[int, int] | None = None,
    iso: int | None = None,
    repeat: tuple[int, int] | None = None,
    black_repeat: tuple[int, int] | None = None,
    make: str = "labrig",
    model: str = "test  camera",
    tags: Sequence[tuple[int, str, int, Any]] = (),
    inside: bool = False,
) -> bytes:
    """A DNG as LibRaw needs it (wire.md), black levels in the order of the CFA.

    Parameters
    ----------
    cfa
        Row by row, `repeat` (by default a square) giving its shape; `L` for no CFA.
    black
        Likewise with `black_repeat`; fractions of 256 are kept.
    tags
        Further ones: code, type, count, value.
    inside
        Whether the raw image is a sub-image of a preview, as Adobe's converter writes it.
    """
    about: list[tuple[int, str, int, Any, bool]] = [
        (271, "s", 0, make, True),
        (272, "s", 0, model, True),
        (50706, "B", 4, bytes([1, 4, 0, 0]), True),
        (50708, "s", 0, f"{make} {model}", True),
        (50728, "2I", 3, (1, 1, 1, 1, 1, 1), True),
    ]
    if exposure:
        about.append((33434, "2I", 1, exposure, True))
    if f_number:
        about.append((33437, "2I", 1, f_number, True))
    if iso is not None:
        about.append((34855, "H", 1, iso, True))
    sensor: list[tuple[int, str, int, Any, bool]] = [(50717, "H", 1, white, True)]
    if cfa != "L":
        codes = bytes("RGBCMYW".index(colour) for colour in cfa)
        sensor.append((33421, "H", 2, repeat or _square(codes), True))
        sensor.append((33422, "B", len(codes), codes, True))
    if black is not None:
        fractions = tuple(number for level in black for number in (round(256 * level), 256))
        sensor.append((50713, "H", 2, black_repeat or _square(black), True))
        sensor.append((50714, "2I", len(black), fractions, True))
    sensor += [(*tag, True) for tag in tags]
    settings: dict[str, Any] = {"metadata": None, "software": False}
    photometric = "minisblack" if cfa == "L" else "cfa"
    file = io.BytesIO()
    with tifffile.TiffWriter(file) as writer:
        if inside:
            preview = np.zeros((16, 24, 3), np.uint8)
            writer.write(preview, subifds=1, subfiletype=1, extratags=about, **settings)
        writer.write(
            mosaic.astype(np.uint16),
            photometric=photometric,
            extratags=sensor if inside else about + sensor,
            subfiletype=0,
            **settings,
        )
    # tifffile knows LinearRaw as three colours only.
    return file.getvalue().replace(_tag_of_photometric(1), _tag_of_photometric(34892))


def _square(values: Sequence[Any]) -> tuple[int, int]:
    side = round(len(values) ** 0.5)
    return side, side


def _tag_of_photometric(value: int) -> bytes:
    return struct.pack("<HHIHH", 262, 3, 1, value, 0)
