import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import tifffile

from labrig.reduce import RawFrame

SHARED = Path(__file__).parents[3] / "shared" / "data"

WriteDng = Callable[..., bytes]
MakeRaw = Callable[..., RawFrame]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    if not SHARED.is_dir():
        pytest.skip(f"needs the real measured data in {SHARED}")
    return SHARED


@pytest.fixture(scope="session")
def write_dng() -> WriteDng:
    return _dng


@pytest.fixture(scope="session")
def make_raw() -> MakeRaw:
    return _raw


def _raw(pixels: npt.NDArray[Any], black: float = 1000.0, **changes: Any) -> RawFrame:
    """A frame of pixels given as real numbers, rounded as a converter does."""
    mosaic = np.clip(np.rint(pixels), 0, 65535).astype(np.uint16)
    settings: dict[str, Any] = {"cfa": "RGGB", "black": (black,) * 4, "white": 60000.0}
    return RawFrame(mosaic=mosaic, **settings | changes)


def _dng(
    mosaic: npt.NDArray[Any],
    cfa: str = "RGGB",
    black: tuple[int, int, int, int] = (1000, 1000, 1000, 1000),
    white: int = 15000,
    exposure: tuple[int, int] | None = None,
    f_number: tuple[int, int] | None = None,
    iso: int | None = None,
    pattern: bytes | None = None,
) -> bytes:
    """The tags LibRaw needs (wire.md), black levels in the order of the CFA."""
    colours = pattern or bytes("RGB".index(colour) for colour in cfa)
    side = round(len(colours) ** 0.5)
    tags: list[tuple[int, str, int, Any, bool]] = [
        (271, "s", 0, "labrig", True),
        (272, "s", 0, "test  camera", True),
        (33421, "H", 2, (side, side), True),
        (33422, "B", len(colours), colours, True),
        (50706, "B", 4, bytes([1, 4, 0, 0]), True),
        (50708, "s", 0, "labrig test", True),
        (50713, "H", 2, (2, 2), True),
        (50714, "H", 4, black, True),
        (50717, "H", 1, white, True),
        (50728, "2I", 3, (1, 1, 1, 1, 1, 1), True),
    ]
    if exposure:
        tags.append((33434, "2I", 1, exposure, True))
    if f_number:
        tags.append((33437, "2I", 1, f_number, True))
    if iso is not None:
        tags.append((34855, "H", 1, iso, True))
    file = io.BytesIO()
    tifffile.imwrite(
        file,
        mosaic.astype(np.uint16),
        photometric="cfa",
        metadata=None,
        software=False,
        extratags=tags,
    )
    return file.getvalue()
