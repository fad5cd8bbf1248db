"""Values exchanged by protocols, drivers and the recorder."""

import math
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from labrig.foundation.errors import ProtocolError
from labrig.foundation.quantity import duration_text

#: Width and height of a frame in pixels, in a rig file.
FramePixels = tuple[Annotated[int, Field(gt=0)], Annotated[int, Field(gt=0)]]
#: Size of a RAW file per pixel: 14 bits, losslessly compressed.
TYPICAL_BYTES_PER_PIXEL = 1.5
#: Size of a frame of which nothing is known, as that of 20 megapixels.
TYPICAL_FRAME_BYTES = 30_000_000


def frame_bytes(size_bytes: float | None, pixels: tuple[int, int] | None) -> int:
    """Return the size of a frame: as given, else estimated from the number of its pixels.

    Parameters
    ----------
    size_bytes
        Size of a RAW file in bytes in the rig file; None if it gives none.
    pixels
        Width and height of a frame in pixels; None if they are unknown.

    Returns
    -------
    int
        Size in bytes.

    Examples
    --------
    >>> from labrig.acquire import frame_bytes
    >>> frame_bytes(None, (5634, 3752))
    31708152
    """
    if size_bytes is not None:
        return round(size_bytes)
    if pixels is None:
        return TYPICAL_FRAME_BYTES
    return round(TYPICAL_BYTES_PER_PIXEL * pixels[0] * pixels[1])


@dataclass(frozen=True)
class ExposureSettings:
    """Settings of a photograph.

    Attributes
    ----------
    exposure_s
        Exposure time in seconds: the actual one, not the nominal one on the camera's dial.
    iso
        Sensitivity, ISO 12232.
    f_number
        Aperture; None for a camera that cannot set or report it.
    """

    exposure_s: float
    iso: int
    f_number: float | None = None

    def __str__(self) -> str:
        aperture = "" if self.f_number is None else f" f/{self.f_number:g}"
        return f"{shutter_text(self.exposure_s)} ISO {self.iso}{aperture}"


def shutter_text(exposure_s: float) -> str:
    """Format a shutter time as photographers do.

    Parameters
    ----------
    exposure_s
        Shutter time in seconds.

    Returns
    -------
    str
        Text such as `1/64 s` or `3.17 s`.

    Examples
    --------
    >>> from labrig.acquire import shutter_text
    >>> shutter_text(0.125)
    '1/8 s'
    """
    return f"1/{1 / exposure_s:.0f} s" if exposure_s < 0.3 else f"{exposure_s:.3g} s"


@dataclass(frozen=True)
class CameraCapabilities:
    """Settings that a camera offers, each in ascending order, and the cost of a frame.

    Attributes
    ----------
    exposures_s
        Actual exposure times in seconds.
    isos
        Sensitivities, ISO 12232.
    f_numbers
        Apertures; empty if the camera cannot set them (manual lens).
    overhead_s
        Time in seconds from the end of an exposure until the next can begin: readout and transfer.
    frame_bytes
        Typical size of a frame in bytes.
    frame_pixels
        Width and height of a frame in pixels; None if they are not known before the first one.
    change_s
        Time in seconds by which a change of settings prolongs the time between two frames.
    settling_s
        Part of `overhead_s` from the half-pressed button until the shutter can be released, in
        seconds; other devices may act meanwhile.
    """

    exposures_s: tuple[float, ...]
    isos: tuple[int, ...]
    f_numbers: tuple[float, ...] = ()
    overhead_s: float = 0.0
    frame_bytes: int = 0
    frame_pixels: tuple[int, int] | None = None
    change_s: float = 0.0
    settling_s: float = 0.0

    def exposure_near(self, exposure_s: float) -> float:
        """Return the offered exposure time nearest to `exposure_s`, such as 1/64 s for 1/60 s.

        Raises
        ------
        ProtocolError
            If none is within a sixth of a stop.
        """
        near_s = min(self.exposures_s, key=lambda offered: abs(math.log(offered / exposure_s)))
        if abs(math.log2(near_s / exposure_s)) > 1 / 6:
            raise ProtocolError(
                f"the camera does not offer an exposure of {duration_text(exposure_s)}; the "
                f"nearest is {duration_text(near_s)} ({duration_text(self.exposures_s[0])} to "
                f"{duration_text(self.exposures_s[-1])} are offered)"
            )
        return near_s

    def exposure_at_most(self, limit_s: float) -> float:
        """Return the longest offered exposure time ≤ `limit_s` seconds, else the shortest one."""
        below = [offered for offered in self.exposures_s if offered <= limit_s * 1.0001]
        return max(below, default=self.exposures_s[0])

    def check(self, settings: ExposureSettings) -> None:
        """Refuse settings that are not offered.

        Raises
        ------
        ProtocolError
            If they are not; the message names what is offered.
        """
        if settings.iso not in self.isos:
            raise ProtocolError(
                f"the camera does not offer ISO {settings.iso} (natively); choose one of "
                f"{', '.join(map(str, self.isos))}, or name it in 'isos' under devices.camera if "
                "'labrig rig check' prints it"
            )
        if self.f_numbers and settings.f_number not in self.f_numbers:
            requested = "no aperture" if settings.f_number is None else f"f/{settings.f_number:g}"
            raise ProtocolError(
                f"the camera cannot be set to {requested}; choose 'f_number:' among "
                f"{', '.join(f'{offered:g}' for offered in self.f_numbers)}"
            )
        self.exposure_near(settings.exposure_s)


@dataclass(frozen=True)
class Frame:
    """One photograph as the camera delivered it.

    Attributes
    ----------
    data
        Bytes of the file, unchanged.
    suffix
        File extension in lower case with its dot, such as `.cr2`.
    start_s, end_s
        Begin and end of the exposure on the rig's clock in seconds; the driver has corrected them
        for the shutter lag.
    settings
        Settings read back from the camera.
    """

    data: bytes
    suffix: str
    start_s: float
    end_s: float
    settings: ExposureSettings
