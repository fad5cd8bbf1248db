"""What passes between protocols, drivers and the recorder."""

import math
from dataclasses import dataclass

from labrig.errors import ProtocolError
from labrig.quantity import duration_text


@dataclass(frozen=True)
class ExposureSettings:
    """How a photograph is taken.

    Attributes
    ----------
    exposure_s
        Shutter time in seconds; a camera reports the true one, not the label on its dial.
    iso
        Sensitivity, ISO 12232.
    f_number
        Aperture; `None` for a camera that cannot set or tell it.
    """

    exposure_s: float
    iso: int
    f_number: float | None = None

    def __str__(self) -> str:
        shutter = (
            f"1/{1 / self.exposure_s:.0f} s"
            if self.exposure_s < 0.3
            else f"{self.exposure_s:.3g} s"
        )
        aperture = "" if self.f_number is None else f" f/{self.f_number:g}"
        return f"{shutter} ISO {self.iso}{aperture}"


@dataclass(frozen=True)
class CameraOffers:
    """What a camera can be set to, each ascending, and what a frame costs.

    Attributes
    ----------
    exposures_s
        True shutter times in seconds.
    isos
        Sensitivities.
    f_numbers
        Apertures; empty where the camera cannot set them (a manual lens).
    overhead_s
        Seconds from the end of an exposure until the next can begin: readout and transfer.
    frame_bytes
        Typical size of a frame.
    """

    exposures_s: tuple[float, ...]
    isos: tuple[int, ...]
    f_numbers: tuple[float, ...] = ()
    overhead_s: float = 0.0
    frame_bytes: int = 0

    def exposure_near(self, exposure_s: float) -> float:
        """The offered shutter time that is meant by `exposure_s`, such as 1/64 s by 1/60 s.

        Raises
        ------
        ProtocolError
            None is within a sixth of a stop.
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
        """Longest offered shutter time ≤ `limit_s` seconds, else the shortest there is."""
        below = [offered for offered in self.exposures_s if offered <= limit_s * 1.0001]
        return max(below, default=self.exposures_s[0])

    def check(self, settings: ExposureSettings) -> None:
        """Refuse `settings` that are not on offer.

        Raises
        ------
        ProtocolError
            Says what is offered instead.
        """
        if settings.iso not in self.isos:
            raise ProtocolError(
                f"the camera does not offer ISO {settings.iso} (natively); choose one of "
                f"{', '.join(map(str, self.isos))}"
            )
        if self.f_numbers and settings.f_number not in self.f_numbers:
            asked = "no aperture" if settings.f_number is None else f"f/{settings.f_number:g}"
            raise ProtocolError(
                f"the camera cannot be set to {asked}; choose 'f_number:' among "
                f"{', '.join(f'{offered:g}' for offered in self.f_numbers)}"
            )
        self.exposure_near(settings.exposure_s)


@dataclass(frozen=True)
class Frame:
    """One photograph as the camera delivered it.

    Attributes
    ----------
    data
        The file's bytes, untouched.
    suffix
        Lower-case extension with its dot, such as `.cr2`.
    start_s, end_s
        Measured begin and end of the exposure on the injected clock.
    settings
        As read back from the camera.
    """

    data: bytes
    suffix: str
    start_s: float
    end_s: float
    settings: ExposureSettings
