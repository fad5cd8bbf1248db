"""The camera, which delivers RAW frames."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from labrig.acquire.continuation import Pace
from labrig.acquire.roles.role import (
    Device,
    ExerciseContext,
    Exercised,
    Measured,
    PlannedDevice,
    Role,
    Suggestion,
    spread_ms,
)
from labrig.acquire.values import CameraCapabilities, ExposureSettings, Frame
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError
from labrig.foundation.quantity import duration_text

#: Exercise: number and exposure time of the frames for timing, exposure time of that for noise.
SHORT_FRAMES = 3
SHORT_S, LONG_S = 1 / 60, 2.0
#: Time from half press until the camera is ready, which a run allows, too.
SETTLING_S = 0.5
#: Sensitivity at which both read noise and dark current are visible.
ISO = 400
#: Steps to which suggested times are rounded up, so that plans are met.
STEP_S, CHANGE_STEP_S = 0.1, 1e-3


@runtime_checkable
class Camera(Device, Protocol):
    """A camera that delivers RAW frames. Safe state: shutter released, nothing pending.

    A driver's class may have `recorded_exposures_s(label_s, identity)`: the exposure times in
    seconds that the driver gives to frames with `label_s` in their EXIF, one for each way in which
    such cameras count, or none where the PC ends the exposure. Journals are compared with RAW files
    by it; without it, to 1 % with the label and with thirds and halves of a stop.
    """

    def capabilities(self) -> CameraCapabilities:
        """Return the settings that the camera offers in its present state."""

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        """Apply and read back settings; return those in force, with the actual exposure time.

        Raises
        ------
        DeviceError
            If the camera does not offer the settings or did not apply them.
        """

    def arm(self) -> None:
        """Do everything that can be done beforehand, so that `shoot` starts without delay."""

    def shoot(self) -> Frame:
        """Release the shutter now, wait for the exposure and transfer the frame."""


class PlannedCamera(PlannedDevice):
    """Stand-in of a camera in a plan, which takes the time that the driver declares.

    Parameters
    ----------
    clock
        Clock of the plan.
    capabilities
        Settings that the camera offers.
    pace
        Times that frames have taken, which are better known than the driver declares them; None
        without frames.
    """

    def __init__(
        self,
        clock: VirtualClock,
        capabilities: CameraCapabilities,
        pace: Pace | None = None,
    ) -> None:
        self._clock = clock
        self._offers = capabilities
        self._pace = pace or Pace(capabilities.overhead_s, capabilities.change_s)
        self._settings: ExposureSettings | None = None
        #: Time at which the button was half-pressed; infinite where it is with the release.
        self._armed_s = math.inf

    def capabilities(self) -> CameraCapabilities:
        """Return the settings that the driver declares."""
        return self._offers

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        """Accept settings that are offered."""
        self._offers.check(settings)
        self._clock.spend(self._pace.change_s)
        self._settings = settings
        return settings

    def arm(self) -> None:
        """Settle from now on."""
        self._armed_s = self._clock.now()

    def shoot(self) -> Frame:
        """Let the time of an exposure and its transfer pass; return a frame without data."""
        assert self._settings is not None, "a session configures before it shoots"
        start_s = self._clock.now()
        end_s = start_s + self._settings.exposure_s
        settled_s = min(start_s - self._armed_s, self._offers.settling_s)
        self._armed_s = math.inf
        self._clock.spend(self._settings.exposure_s + self._pace.frame_time_s - max(settled_s, 0.0))
        return Frame(b"", "", start_s, end_s, self._settings)


@dataclass(frozen=True)
class TakeFrame:
    """One photograph, for which the session configures the camera beforehand and records the frame.

    Attributes
    ----------
    role
        Purpose of the frame, such as `dark`, `meter`, `decay`, `daylight`.
    settings
        Settings of the camera.
    """

    role: str
    settings: ExposureSettings

    def __str__(self) -> str:
        return f"{self.role} frame, {self.settings}"


def exercise_camera(camera: Camera, context: ExerciseContext) -> Exercised:
    """Take three short frames to measure the timing and a longer one to measure the noise.

    Raises
    ------
    LabrigError
        If the camera failed, or its frame cannot be reduced.
    """
    capabilities = camera.capabilities()
    measured, suggestions = _timing(camera, capabilities, context)
    frame, _ = _shoot(camera, _settings(capabilities, LONG_S), context)
    reduced = context.frame_reader.dark_frame(frame)
    return Exercised(
        (_measured_offers(capabilities), *measured, *reduced.measured),
        reduced.findings,
        (*suggestions, *reduced.suggestions, *_offers(capabilities)),
    )


def _offers(capabilities: CameraCapabilities) -> Iterator[Suggestion]:
    """Yield the sensitivities and apertures, which a plan does not ask the camera for."""
    for key, values in (("isos", capabilities.isos), ("f_numbers", capabilities.f_numbers)):
        if values:
            yield Suggestion(key, f"[{', '.join(f'{value:g}' for value in values)}]")


def _timing(
    camera: Camera, capabilities: CameraCapabilities, context: ExerciseContext
) -> tuple[list[Measured], list[Suggestion]]:
    settings = _settings(capabilities, SHORT_S)
    lags_s, cycles_s, changes_s = [], [], []
    for _ in range(SHORT_FRAMES):
        frame, requested_s = _shoot(camera, settings, context)
        camera.arm()  # only now can the next exposure begin
        lags_s.append(frame.start_s - requested_s)
        cycles_s.append(context.clock.now() - frame.end_s)
    for exposure_s in (LONG_S, SHORT_S):
        began_s = context.clock.now()
        camera.configure(_settings(capabilities, exposure_s))
        changes_s.append(context.clock.now() - began_s)
    return [
        Measured(
            "release asked to exposure begun, with the rig file's shutter_lag", spread_ms(lags_s)
        ),
        Measured("exposure over to ready for the next", spread_ms(cycles_s)),
        Measured("change of the exposure time", spread_ms(changes_s)),
    ], [
        Suggestion("frame_time", duration_text(_rounded_up(max(cycles_s), STEP_S))),
        Suggestion("change_time", duration_text(_rounded_up(max(changes_s), CHANGE_STEP_S))),
    ]


def _rounded_up(time_s: float, step_s: float) -> float:
    return math.ceil(time_s / step_s) * step_s


def _shoot(
    camera: Camera, settings: ExposureSettings, context: ExerciseContext
) -> tuple[Frame, float]:
    """Return a frame and the time at which it was requested."""
    camera.configure(settings)
    camera.arm()
    context.clock.sleep(SETTLING_S)
    requested_s = context.clock.now()
    frame = camera.shoot()
    if not frame.data:
        raise DeviceError("the camera delivered an empty frame; try again")
    return frame, requested_s


def _settings(capabilities: CameraCapabilities, exposure_s: float) -> ExposureSettings:
    return ExposureSettings(
        capabilities.exposure_at_most(exposure_s),
        min(capabilities.isos, key=lambda iso: abs(iso - ISO)),
        max(capabilities.f_numbers, default=None),
    )


def _measured_offers(capabilities: CameraCapabilities) -> Measured:
    return Measured(
        "it offers",
        f"{duration_text(capabilities.exposures_s[0])} to "
        f"{duration_text(capabilities.exposures_s[-1])}, "
        f"ISO {', '.join(map(str, capabilities.isos))}, "
        + (
            f"f/{capabilities.f_numbers[0]:g} to f/{capabilities.f_numbers[-1]:g}"
            if capabilities.f_numbers
            else "no aperture"
        ),
    )


CAMERA: Role[Camera] = Role(
    key="camera",
    protocol_class=Camera,
    name="camera",
    planned=lambda settings, clock: PlannedCamera(clock, settings.planned_offers()),
    exercise=exercise_camera,
)
