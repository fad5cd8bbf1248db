"""Settings of the camera, and times that follow from them."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field

from labrig.acquire import (
    CAMERA,
    MAX_STEPS,
    TOLERANCE_S,
    CameraCapabilities,
    Offer,
    Rig,
    shutter_text,
)
from labrig.foundation.errors import ProtocolError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS, duration_text


def frame_times_s(first_s: float, every_s: float, until_s: float) -> list[float]:
    """Return the start of each frame, evenly from `first_s` to `until_s`, included if it fits.

    Raises
    ------
    ProtocolError
        There are more frames than a run may have steps.
    """
    count = (until_s - first_s) / every_s + 1e-9
    if count >= MAX_STEPS:
        raise ProtocolError(
            f"a frame every {duration_text(every_s)} until {duration_text(until_s)} makes "
            f"{count:.3g} frames, expected at most {MAX_STEPS}; take fewer"
        )
    return [first_s + number * every_s for number in range(int(count) + 1)]


def longest_exposure_s(
    every_s: float, capabilities: CameraCapabilities, wanted_s: float = 0.0
) -> float:
    """Return the longest offered shutter time that fits between frames `every_s` seconds apart.

    Parameters
    ----------
    every_s
        Time in seconds between the begins of two frames.
    capabilities
        Exposure settings that the camera offers.
    wanted_s
        Shutter time in seconds that has to fit in any case.

    Raises
    ------
    ProtocolError
        If `wanted_s`, or even the shortest shutter time, does not fit; the message has the shortest
        time between frames that works.
    """
    spent_s = capabilities.overhead_s + MARGIN_S
    shortest_s = max(wanted_s + capabilities.overhead_s, capabilities.exposures_s[0] + spent_s)
    if every_s + TOLERANCE_S < shortest_s:
        shortest_text = duration_text(math.ceil(10 * (shortest_s - TOLERANCE_S)) / 10)
        exposing = f"an exposure of {duration_text(wanted_s)}" if wanted_s else "any exposure"
        raise ProtocolError(
            f"frames every {duration_text(every_s)} leave no time for {exposing}: from its end to "
            f"the next one this camera takes {duration_text(capabilities.overhead_s)} "
            "(frame_time), "
            f"and {duration_text(spent_s)} where settings change; let frames begin at least "
            f"{shortest_text} apart (every: {shortest_text})"
        )
    return capabilities.exposure_at_most(max(every_s - spent_s, capabilities.exposures_s[0]))


#: Frames at each exposure of the dark unit: enough for a mean, its scatter and a map of hot pixels.
DARKS_PER_EXPOSURE = 4
#: Time between a frame and the next deadline for setting the camera and half-pressing it.
MARGIN_S = 0.5


#: Part of the time between two frames that is left for exposing, where a slow camera decides it.
EXPOSING = 0.25


@dataclass(frozen=True)
class NearestOfCamera(Offer):
    """Annotation of a sensitivity or an aperture, or of several, each of which is taken once.

    Attributes
    ----------
    setting
        Name of the setting among the camera's capabilities.
    prefix
        Text before a value in messages.
    """

    setting: Literal["isos", "f_numbers"]
    prefix: str

    def fitted(self, value: Any, rig: Rig) -> Any:
        """Return the nearest offered values, by ratio; a lens that reports none has any."""
        offered = self._offered(rig)
        if value is None or not offered:
            return value
        if not isinstance(value, tuple):
            return min(offered, key=lambda each: abs(math.log(each / value)))
        return tuple(dict.fromkeys(self.fitted(each, rig) for each in value))

    def reason(self, rig: Rig) -> str:
        """Return what the camera offers, and where the rig file gives more."""
        return (
            f"the camera offers {self.text(self._offered(rig))} ('{self.setting}' of the rig file; "
            "'labrig rig check' prints those of the connected camera)"
        )

    def text(self, value: Any) -> str:
        """Return values such as `f/4, f/5.6`."""
        values = value if isinstance(value, tuple) else (value,)
        return ", ".join(f"{self.prefix}{each:g}" for each in values)

    def _offered(self, rig: Rig) -> tuple[float, ...]:
        if CAMERA not in rig:
            return ()
        offered: tuple[float, ...] = getattr(rig[CAMERA].capabilities(), self.setting)
        return offered


@dataclass(frozen=True)
class LongEnoughForCamera(Offer):
    """Annotation of the time between two frames, within which a slow camera has to be ready.

    Several times are those of frames' begins.
    """

    is_required = False

    def fitted(self, value: Any, rig: Rig) -> Any:
        """Return times in seconds that leave a part for exposing, and are no shorter than asked."""
        if CAMERA not in rig:
            return value
        spent_s = rig[CAMERA].capabilities().overhead_s + MARGIN_S
        shortest_s = math.ceil(10 * spent_s / (1 - EXPOSING)) / 10
        if not isinstance(value, tuple):
            return max(value, shortest_s)
        begins_s = list(value[:1])
        for begin_s in value[1:]:
            begins_s.append(max(begin_s, begins_s[-1] + shortest_s))
        return tuple(begins_s)

    def reason(self, rig: Rig) -> str:
        """Return the time that the camera takes for a frame."""
        overhead_s = rig[CAMERA].capabilities().overhead_s
        return f"frame_time: the camera takes {duration_text(overhead_s)} after each frame"

    def text(self, value: Any) -> str:
        """Return the times as text."""
        return ", ".join(map(duration_text, value if isinstance(value, tuple) else (value,)))


#: Relative difference from which an exposure time is another one than was asked for.
NOTABLE = 0.005

#: Sensitivities and apertures beyond those of any camera and lens are slips of the pen.
Iso = Annotated[int, Field(ge=1, le=10_000_000), NearestOfCamera("isos", "ISO ")]
FNumber = Annotated[float, Field(ge=0.1, le=1000), NearestOfCamera("f_numbers", "f/")]
#: Time from the start of a frame to that of the next one.
FramePeriod = Annotated[DurationS, Field(gt=0), LongEnoughForCamera()]


class CameraSettings(FrozenModel):
    """Sensitivity and aperture of the camera; the shutter time has a key of its own.

    Attributes
    ----------
    iso
        ISO sensitivity, one of those that the camera offers, for example `400`.
    f_number
        Aperture as f-number, for example `4`; null for a lens that reports none.
    """

    iso: Iso = 400
    f_number: FNumber | None = 4.0


def exposure_lines(asked_s: float, taken_s: float) -> list[str]:
    """Return that another exposure is taken than was asked for, in a line for a plan; or none."""
    if math.isclose(asked_s, taken_s, rel_tol=NOTABLE):
        return []
    return [f"{shutter_text(asked_s)} asked, {shutter_text(taken_s)} taken: the camera's nearest"]


def dark_exposures_s(longest_s: float, capabilities: CameraCapabilities) -> list[float]:
    """Return the shutter time of each dark frame, where later frames take up to `longest_s`."""
    exposures_s = [capabilities.exposure_at_most(longest_s * part) for part in (1 / 64, 1 / 4, 1)]
    return [exposure_s for exposure_s in exposures_s for _ in range(DARKS_PER_EXPOSURE)]
