"""Still scenes: arranged by a person, photographed in a bracket of exposures."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from labrig.acquire import (
    CAMERA,
    CAMERA_FILTER_WHEEL,
    FILTER_WHEEL,
    LAMP,
    LAMP_OFF,
    LAMP_ON,
    CameraOffers,
    ExposureSettings,
    ManualStep,
    PartUnit,
    ProtocolModel,
    Rig,
    Session,
    Shoot,
    Tune,
    TurnCameraWheel,
    TurnWheel,
    Unit,
)
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.errors import DeviceError
from labrig.foundation.quantity import duration_text
from labrig.foundation.region import CENTRE
from labrig.optics import CHART_PATCHES
from labrig.record import PERSON, FrameRecord, FrameRole
from labrig.reduce import measure, read_raw

from .camera_settings import DARKS_PER_EXPOSURE, CameraSettings
from .exposure_metering import SEEN_DN, TARGET
from .sample_pose import face_lamp
from .sanity_checks import SanityChecks

Stage = Literal["sample", "lit sample", "grey card", "colorchecker", "blank"]
LvfPlace = Literal["away", "before camera", "on sample"]
LampKind = Literal["halogen", "mercury"]

_STAGE = {
    "sample": "take the card away, so that the sample lies in its place",
    "lit sample": "lay the sample in the grey card's place, where lamp and camera both see it",
    "grey card": "lay the grey card where lamp and camera both see it",
    "colorchecker": "lay the ColorChecker where lamp and camera see all of it",
    "blank": "put a grey card in the sample's place (in the door, if there is one)",
}
_LVF = {
    "away": "take the variable filter out",
    "before camera": "put the variable filter before the camera",
    "on sample": "put the variable filter between lamp and sample",
}
#: What is arranged, in the order in which it is asked for.
THINGS = "lamp", "laid", "lvf", "filter", "camera_filter", "monochromator_nm"


@dataclass(frozen=True)
class Arrangement:
    """Arrangement of the bench; the default is that before and after every protocol.

    Attributes
    ----------
    stage
        Object that lamp and camera face.
    lvf
        Place of the linear variable filter.
    filter
        Name of the colour filter before the lamp.
    camera_filter
        Name of the colour filter before the camera.
    monochromator_nm
        Wavelength of the monochromator between lamp and sample in nm; None: it is not there.
    lamp
        Lamp that the relay switches.
    chart_patch
        Patch of the ColorChecker, from 1 on, that alone is seen; 0 is the whole chart.
    """

    stage: Stage = "sample"
    lvf: LvfPlace = "away"
    filter: str | None = None
    camera_filter: str | None = None
    monochromator_nm: float | None = None
    lamp: LampKind = "halogen"
    chart_patch: int = 0

    @property
    def laid(self) -> tuple[Stage, int]:
        """Object that lamp and camera face, and its patch."""
        return self.stage, self.chart_patch

    def set_up(self, session: Session, before: "Arrangement", why: str) -> None:
        """Ask for the manual steps from `before`, and set what devices set.

        The lamp is switched off for another one.

        The bench may have been put to another use before a run is resumed: all that has been
        arranged in it is asked for again.

        Parameters
        ----------
        session
            Session of the run.
        before
            Arrangement after the unit before.
        why
            Reason for the arrangement, for the person.
        """
        again = _arranged_before_resuming(session)
        if self.lamp != before.lamp or "lamp" in again:
            _lamp_off(session)
        now, then = self._by_hand(session.rig), before._by_hand(session.rig)
        for name in THINGS:
            if getattr(now, name) != getattr(then, name) or name in again:
                instruction, task = now._step(name)
                session.ask(ManualStep(instruction, why, task))
        if FILTER_WHEEL in session.rig:
            in_wheel = self.filter in session.rig[FILTER_WHEEL].filters()
            session.perform(TurnWheel(self.filter if in_wheel else None))
        if CAMERA_FILTER_WHEEL in session.rig:
            in_wheel = self.camera_filter in session.rig[CAMERA_FILTER_WHEEL].filters()
            session.perform(TurnCameraWheel(self.camera_filter if in_wheel else None))
        if self.monochromator_nm is not None:
            session.perform(Tune(self.monochromator_nm))

    def _by_hand(self, rig: Rig) -> "Arrangement":
        """Return the part of the arrangement that is made by hand."""
        filter_name, camera_filter = self.filter, self.camera_filter
        if FILTER_WHEEL in rig and filter_name in rig[FILTER_WHEEL].filters():
            filter_name = None
        if CAMERA_FILTER_WHEEL in rig and camera_filter in rig[CAMERA_FILTER_WHEEL].filters():
            camera_filter = None
        tuned_nm = None if self.monochromator_nm is None else 0.0
        return replace(
            self, filter=filter_name, camera_filter=camera_filter, monochromator_nm=tuned_nm
        )

    def _step(self, name: str) -> tuple[str, str]:
        """Return the text of a step for a person, and for a changer."""
        match name:
            case "lamp":
                return f"connect the {self.lamp} lamp to the relay", f"lamp {self.lamp}"
            case "laid" if self.chart_patch:
                name = CHART_PATCHES[self.chart_patch - 1]
                return (
                    f"lay the ColorChecker so that its patch {self.chart_patch}, {name}, alone is "
                    "seen, from end to end of the variable filter",
                    f"{self.stage} {self.chart_patch}",
                )
            case "laid":
                return _STAGE[self.stage], self.stage
            case "lvf":
                return _LVF[self.lvf], f"lvf {self.lvf}"
            case "monochromator_nm" if self.monochromator_nm is None:
                return "take the monochromator out of the lamp's light", "monochromator away"
            case "monochromator_nm":
                return "put the monochromator between lamp and sample", "monochromator on"
            case "camera_filter" if self.camera_filter is None:
                return "take the colour filter before the camera away", "no camera filter"
            case "camera_filter":
                instruction = f"put the colour filter {self.camera_filter} before the camera"
                return instruction, f"camera filter {self.camera_filter}"
            case _ if self.filter is None:
                return "take the colour filter out", "no filter"
            case _:
                instruction = f"put the colour filter {self.filter} before the lamp"
                return instruction, f"filter {self.filter}"


def _lamp_off(session: Session) -> None:
    if LAMP in session.rig:
        session.perform(LAMP_OFF)


def light(session: Session, warm_up_s: float) -> None:
    """Switch the lamp on and wait until it is steady, unless it burns since the unit before."""
    if not session.rig[LAMP].is_on():
        face_lamp(session)
        session.perform(LAMP_ON)
        session.wait(warm_up_s, "the lamp warms up")


def _arranged_before_resuming(session: Session) -> set[str]:
    """Return what was arranged before the devices were connected, if nothing was done since."""
    since = session.clock.wall(session.rig.connected_s)
    steps = session.actions(PERSON)
    frames = [*session.frames(FrameRole.DARK), *session.frames(FrameRole.LOOK)]
    times = [step.start_time for step in steps] + [frame.start_time for frame in frames]
    if any(time >= since for time in times):
        return set()
    return {thing for step in steps if (thing := _thing_of(step.task)) is not None}


def _thing_of(task: str) -> str | None:
    """Return what a changer's task arranges; None for one of another protocol's own."""
    words = {
        "lamp halogen": "lamp",
        "lamp mercury": "lamp",
        "no filter": "filter",
        "no camera filter": "camera_filter",
        "monochromator on": "monochromator_nm",
        "monochromator away": "monochromator_nm",
    }
    if task in _STAGE or task.startswith("colorchecker "):
        return "laid"
    if task.startswith("camera filter "):
        return "camera_filter"
    if task.startswith(("lvf ", "filter ")):
        return task.partition(" ")[0]
    return words.get(task)


@dataclass(frozen=True)
class Arranged:
    """A unit that needs another arrangement of the bench than the unit before it.

    Attributes
    ----------
    unit
        Unit that is run in the arrangement.
    now, before
        Its arrangement, and that of the unit before it.
    why
        Reason for the arrangement, for the person.
    goes_dark
        Whether the lamp that the unit before has left burning is switched off first.
    """

    unit: Unit
    now: Arrangement
    before: Arrangement
    why: str
    goes_dark: bool = False

    @property
    def name(self) -> str:
        """Name of the unit."""
        return self.unit.name

    def run(self, session: Session) -> None:
        """Ask for the arrangement, then run the unit."""
        if self.goes_dark and session.rig[LAMP].is_on():
            session.perform(LAMP_OFF)
        self.now.set_up(session, self.before, self.why)
        self.unit.run(session)


@dataclass(frozen=True)
class Scene:
    """A unit and the arrangement of the bench in which it is run.

    Attributes
    ----------
    unit
        Unit, which asks for none of the arrangement's steps itself.
    arrangement
        Arrangement of the bench.
    why
        Reason for the arrangement, for the person.
    is_dark
        Whether it takes dark frames only, for which any arrangement without a glow will do.
    rests
        Whether the sample rests in the dark before it is charged, so that others may be measured
        meanwhile.
    leaves_lamp_on
        Whether the unit leaves the lamp burning, warm for another one that does so.
    """

    unit: Unit
    arrangement: Arrangement
    why: str
    is_dark: bool = False
    rests: bool = False
    leaves_lamp_on: bool = False

    def of_part(self, part: str) -> "Scene":
        """Return the scene as one of a part of a chain."""
        return replace(self, unit=PartUnit(part, self.unit))


def in_turn(scenes: Sequence[Scene]) -> list[Unit]:
    """Return the units of scenes, each asking for what changes, and at last the bench put back."""
    units: list[Unit] = []
    before, burns = Arrangement(), False
    for scene in scenes:
        goes_dark = burns and not scene.leaves_lamp_on
        units.append(Arranged(scene.unit, scene.arrangement, before, scene.why, goes_dark))
        before, burns = scene.arrangement, scene.leaves_lamp_on
    return units if before == Arrangement() else [*units, PutBackUnit(before)]


class ScenesProtocol(ProtocolModel):
    """Base of protocols whose units are scenes, so that a chain can put them into another order."""

    @abstractmethod
    def scenes(self) -> Sequence[Scene]:
        """Return all units with their arrangements, in the order in which they build on another."""

    def units(self) -> Sequence[Unit]:
        """Return the units of all scenes in order, and the bench put back."""
        return in_turn(self.scenes())


@dataclass(frozen=True)
class Prepared:
    """A unit with another manual step before it."""

    unit: Unit
    step: ManualStep

    @property
    def name(self) -> str:
        """Name of the unit."""
        return self.unit.name

    def run(self, session: Session) -> None:
        """Ask for the manual step, then run the unit."""
        session.ask(self.step)
        self.unit.run(session)


@dataclass(frozen=True)
class PutBackUnit:
    """The bench put back; a unit of its own, so that nothing is measured again for it."""

    before: Arrangement
    name: str = "put-back"

    def run(self, session: Session) -> None:
        """Switch the lamp off, have filters and card taken away."""
        _lamp_off(session)
        Arrangement().set_up(session, self.before, "the next measurement finds the bench as usual")


#: Shutter times of metering, as fractions of the longest.
LADDER = (1 / 4096, 1 / 512, 1 / 64, 1 / 8, 1)
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

    def dark_exposures_s(self, offers: CameraOffers) -> list[float]:
        """Return the shutter time of each dark frame in seconds."""
        exposures_s = {offers.exposure_at_most(self.longest_s / LONGER**step) for step in range(3)}
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
        offers = session.rig[CAMERA].offers()
        self.meter(session, unit)
        # That takes longest: all exposures of a bracket, and the last one as long as it may be.
        worst_s = offers.exposure_at_most(self.longest_s / LONGER ** (self.exposures - 1))
        exposure_s = session.choose(
            "exposure", lambda: self.metered_s(session, unit, lamp, may_be_dark), worst_s
        )
        bracket_s = {
            offers.exposure_at_most(min(exposure_s * LONGER**step, self.longest_s))
            for step in range(self.exposures)
        }
        for each_s in sorted(bracket_s):
            for _ in range(self.repeats):
                session.perform(Shoot(role, self.settings(each_s)))

    def meter(self, session: Session, unit: str) -> None:
        """Photograph the scene with rising exposures until one is bright enough."""
        for exposure_s in self._ladder(session.rig[CAMERA].offers()):
            session.perform(Shoot(FrameRole.LOOK, self.settings(exposure_s)))
            if session.choose(
                "bright enough", lambda: self._is_bright_enough(session, unit), worst=False
            ):
                break

    def _ladder(self, offers: CameraOffers) -> Sequence[float]:
        return sorted({offers.exposure_at_most(self.longest_s * fraction) for fraction in LADDER})

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
        offers, frames = session.rig[CAMERA].offers(), _metering_frames(session, unit)
        brightness = [_measure_brightness(frame) for frame in frames]
        detected = [reading for reading in brightness if reading.visible]
        if not detected and may_be_dark:
            return offers.exposure_at_most(self.longest_s)
        if not detected:
            raise DeviceError(
                f"{unit}: dark even in {duration_text(frames[-1].exposure_s)}: the {lamp} lamp did "
                "not light (check its bulb, its plug and the contact of its relay), or what should "
                "be seen is not in its place"
            )
        unclipped = [reading for reading in detected if not reading.clips]
        if not unclipped:
            session.warn(
                f"{unit}: even the shortest exposure clips; lower camera.iso or close the aperture"
            )
            return offers.exposures_s[0]
        best = unclipped[-1]
        target_s = best.exposure_s * TARGET / best.fraction
        return offers.exposure_at_most(min(target_s, self.longest_s))


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
        exposures_s = scene.dark_exposures_s(session.rig[CAMERA].offers())
        for exposure_s in exposures_s:
            session.perform(Shoot(FrameRole.DARK, scene.settings(exposure_s)))
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
