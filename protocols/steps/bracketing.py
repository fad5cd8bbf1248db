"""Still scenes, photographed in a bracket of exposures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.acquire import (
    CAMERA,
    CameraCapabilities,
    ExposureSettings,
    Session,
    TakeFrame,
)
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.errors import DeviceError
from labrig.foundation.quantity import duration_text
from labrig.foundation.region import CENTRE
from labrig.record import FrameRecord, FrameRole
from labrig.reduce import measure, read_raw

from .bench_configuration import light
from .camera_settings import DARKS_PER_EXPOSURE, CameraSettings
from .exposure_metering import LADDER, SEEN_DN, TARGET
from .sanity_checks import SanityChecks

#: Fraction of the range that ends metering: noise does not matter there.
ENOUGH = 0.05
#: Ratio of a bracket's second exposure to the first, for dim parts; bright ones clip in it.
LONGER = 8.0


@dataclass(frozen=True)
class Bracketing:
    """Bracket of exposures of a scene.

    Attributes
    ----------
    camera
        Sensitivity and aperture of the camera.
    longest_s
        Longest exposure in seconds.
    repeats
        Number of photographs at each exposure.
    exposures
        Number of exposures, each `LONGER` times the one before.
    """

    camera: CameraSettings
    longest_s: float
    repeats: int
    exposures: int = 2

    def settings(self, exposure_s: float) -> ExposureSettings:
        """Return the camera settings with that shutter time."""
        return ExposureSettings(exposure_s, self.camera.iso, self.camera.f_number)

    def dark_exposures_s(self, capabilities: CameraCapabilities) -> list[float]:
        """Return the shutter time of each dark frame in seconds."""
        exposures_s = {
            capabilities.exposure_at_most(self.longest_s / LONGER**step) for step in range(3)
        }
        return [exposure_s for exposure_s in sorted(exposures_s) for _ in range(DARKS_PER_EXPOSURE)]

    def photograph(
        self, session: Session, unit: str, role: str, lamp: str, may_be_dark: bool = False
    ) -> None:
        """Meter, then take the bracket.

        Parameters
        ----------
        session
            Session of the run.
        unit, role
            Unit and role of the frames.
        lamp
            Name of the expected lamp, for messages.
        may_be_dark
            Whether a dark scene is photographed with the longest exposure, not refused.

        Raises
        ------
        DeviceError
            The scene is dark.
        """
        capabilities = session.rig[CAMERA].capabilities()
        self.meter(session, unit)
        # That takes longest: all exposures of a bracket, and the last one as long as it may be.
        worst_s = capabilities.exposure_at_most(self.longest_s / LONGER ** (self.exposures - 1))
        exposure_s = session.decide(
            "exposure", lambda: self.metered_s(session, unit, lamp, may_be_dark), worst_s
        )
        bracket_s = {
            capabilities.exposure_at_most(min(exposure_s * LONGER**step, self.longest_s))
            for step in range(self.exposures)
        }
        for each_s in sorted(bracket_s):
            for _ in range(self.repeats):
                session.perform(TakeFrame(role, self.settings(each_s)))

    def meter(self, session: Session, unit: str) -> None:
        """Photograph the scene with rising exposures until one is bright enough."""
        for exposure_s in self._ladder(session.rig[CAMERA].capabilities()):
            session.perform(TakeFrame(FrameRole.LOOK, self.settings(exposure_s)))
            if session.decide(
                "bright enough", lambda: self._is_bright_enough(session, unit), when_planned=False
            ):
                break

    def _ladder(self, capabilities: CameraCapabilities) -> Sequence[float]:
        return sorted(
            {capabilities.exposure_at_most(self.longest_s * fraction) for fraction in LADDER}
        )

    def _is_bright_enough(self, session: Session, unit: str) -> bool:
        return _measure_brightness(_metering_frames(session, unit)[-1]).fraction > ENOUGH

    def metered_s(self, session: Session, unit: str, lamp: str, may_be_dark: bool = False) -> float:
        """Return the shutter time at which the brightest pixels fill the target fraction.

        Parameters
        ----------
        session
            Session of the run.
        unit
            Unit that has metered.
        lamp
            Name of the expected lamp, for messages.
        may_be_dark
            Whether a dark scene gets the longest exposure and is not refused.

        Raises
        ------
        DeviceError
            The scene was dark.
        """
        capabilities, frames = session.rig[CAMERA].capabilities(), _metering_frames(session, unit)
        brightness = [_measure_brightness(frame) for frame in frames]
        detected = [reading for reading in brightness if reading.visible]
        if not detected and may_be_dark:
            return capabilities.exposure_at_most(self.longest_s)
        if not detected:
            raise DeviceError(
                f"{unit}: dark even in {duration_text(frames[-1].exposure_s)}: the {lamp} lamp did "
                "not light (check its bulb, its plug and the contact of its relay), or the "
                "target is not in its place"
            )
        unclipped = [reading for reading in detected if not reading.clips]
        if not unclipped:
            session.warn(
                f"{unit}: even the shortest exposure clips; lower camera.iso or close the aperture"
            )
            return capabilities.exposures_s[0]
        best = unclipped[-1]
        target_s = best.exposure_s * TARGET / best.fraction
        return capabilities.exposure_at_most(min(target_s, self.longest_s))


@dataclass(frozen=True)
class _Brightness:
    """The brightest 0.5 % of a frame's pixels, as a fraction of the range."""

    exposure_s: float
    fraction: float
    visible: bool
    clips: bool


def _measure_brightness(frame: FrameRecord) -> _Brightness:
    measured = measure(read_raw(frame.path))
    channels = list(measured.channels.values())
    brightest = max(channels, key=lambda channel: channel.peak)
    noise_dn = DETECTION_SIGMA * brightest.sigma * np.sqrt(brightest.n)
    return _Brightness(
        exposure_s=frame.exposure_s,
        fraction=brightest.peak / measured.range_dn,
        visible=brightest.mean > max(DETECTION_SIGMA * brightest.sigma, SEEN_DN)
        or brightest.peak > max(noise_dn, SEEN_DN),
        clips=measured.clipped,
    )


def _metering_frames(session: Session, unit: str) -> list[FrameRecord]:
    return [frame for frame in session.frames(FrameRole.LOOK) if frame.unit == unit]


@dataclass(frozen=True)
class StillDarkUnit:
    """Dark frames at the later exposures."""

    bracketing: Bracketing
    name: str = "dark"

    def run(self, session: Session) -> None:
        """Warm the camera up, then photograph in the dark."""
        session.wait_until_warm("camera")
        scene = self.bracketing
        exposures_s = scene.dark_exposures_s(session.rig[CAMERA].capabilities())
        for exposure_s in exposures_s:
            session.perform(TakeFrame(FrameRole.DARK, scene.settings(exposure_s)))
        SanityChecks(session, self.name, [CENTRE], None).require_darkness(
            [scene.settings(exposure_s) for exposure_s in sorted(set(exposures_s))]
        )


@dataclass(frozen=True)
class SceneUnit:
    """A lit scene.

    Attributes
    ----------
    bracketing
        Bracketing of the scene's photographs.
    name, role
        Name of the unit, and role of its frames.
    lamp
        Lamp that the relay switches, or name of the light in messages.
    mercury_warm_up_s
        Warm-up time in seconds of the mercury lamp, which the rig file does not have.
    """

    bracketing: Bracketing
    name: str
    role: str
    lamp: str = "halogen"
    mercury_warm_up_s: float = 0.0

    def run(self, session: Session) -> None:
        """Light, photograph, and check the photographs; lamp and camera warm up together."""
        self.light(session)
        session.wait_until_warm("camera")
        self.bracketing.photograph(session, self.name, self.role, self.lamp)
        self.check(session)

    def light(self, session: Session) -> None:
        """Switch the lamp on and wait until it is steady."""
        light(session, self.warm_up_s(session))

    def warm_up_s(self, session: Session) -> float:
        """Return the warm-up time of the lamp in use, in seconds."""
        if self.lamp == "mercury":
            return self.mercury_warm_up_s
        return session.rig.warm_up_s("lamp")

    def check(self, session: Session) -> None:
        """Refuse pictures of another scene; by default none are."""

    def own(self, session: Session) -> list[FrameRecord]:
        """Return the unit's frames."""
        return frames_of(session, self.role, self.name)


def frames_of(session: Session, role: str, unit: str) -> list[FrameRecord]:
    """Return the frames of one unit."""
    return [frame for frame in session.frames(role) if frame.unit == unit]
