"""What the camera wrote beside the picture."""

import io
import logging
import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Exif:
    """EXIF of one frame; None where absent, unreadable or a placeholder such as 0.

    `lens` is its name and focal length, as far as the camera tells. `dng`: the file says that it is
    a DNG.
    """

    exposure_s: float | None = None
    iso: float | None = None
    f_number: float | None = None
    make: str | None = None
    model: str | None = None
    lens: str | None = None
    dng: bool = False


#: The value by which EXIF 2.3 says "more than 65534, look elsewhere".
_ISO_OVERFLOW = 65535
#: What exifread calls the tag that only DNG files have: by its number, as long as it has no name.
_DNG_VERSION = ("Image Tag 0xC612", "Image DNGVersion")


# exifread warns through logging of every odd tag; what matters shows as None.
logging.getLogger("exifread").setLevel(logging.CRITICAL)


def read_exif(content: bytes) -> Exif:
    """EXIF in the bytes of a RAW file.

    Damaged EXIF is as good as none: the picture can be reduced without it.
    """
    import exifread  # with its maker-note tables, only when a RAW file is read

    try:
        tags: dict[str, Any] = exifread.process_file(io.BytesIO(content), details=False)
    except Exception:  # a damaged file can fail anywhere in exifread, with any exception
        return Exif()
    speeds = (_positive(tags, name) for name in ("ISOSpeedRatings", "RecommendedExposureIndex"))
    return Exif(
        exposure_s=_positive(tags, "ExposureTime"),
        iso=next((iso for iso in speeds if iso is not None and iso != _ISO_OVERFLOW), None),
        f_number=_positive(tags, "FNumber"),
        make=_text(tags, "Image Make"),
        model=_text(tags, "Image Model"),
        lens=_lens(tags),
        dng=any(name in tags for name in _DNG_VERSION),
    )


def _positive(tags: dict[str, Any], name: str) -> float | None:
    """First value of a tag, in the EXIF directory or, as TIFF/EP has it, beside the image."""
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
    """`EF50mm f/1.4 USM, 50 mm`."""
    focal_mm = _positive(tags, "FocalLength")
    said = (_text(tags, "EXIF LensModel"), None if focal_mm is None else f"{focal_mm:g} mm")
    return ", ".join(filter(None, said)) or None


def _text(tags: dict[str, Any], name: str) -> str | None:
    """A tag's text without the padding cameras write, None if nothing legible is left."""
    words = str(tags.get(name, "")).split()
    text = " ".join(words)
    return text if text.isprintable() and text else None
