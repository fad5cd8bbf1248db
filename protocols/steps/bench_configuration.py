"""Configuration of the bench: what lies where, made by a person and by devices, and put back."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from labrig.acquire import (
    CAMERA_FILTER_WHEEL,
    FILTER_WHEEL,
    LAMP,
    LAMP_OFF,
    LAMP_ON,
    ManualStep,
    PartUnit,
    ProtocolModel,
    Rig,
    Session,
    Tune,
    TurnCameraWheel,
    TurnWheel,
    Unit,
)
from labrig.optics import CHART_PATCHES
from labrig.record import PERSON, FrameRole

from .sample_pose import face_lamp

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
COMPONENTS = "lamp", "target", "lvf", "filter", "camera_filter", "monochromator_nm"


@dataclass(frozen=True)
class BenchConfiguration:
    """BenchConfiguration of the bench; the default is that before and after every protocol.

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
    def target(self) -> tuple[Stage, int]:
        """Object that lamp and camera face, and its patch."""
        return self.stage, self.chart_patch

    def set_up(self, session: Session, before: "BenchConfiguration", why: str) -> None:
        """Ask for the manual steps from `before`, and set what devices set.

        The lamp is switched off for another one.

        The bench may have been put to another use before a run is resumed: all that has been
        arranged in it is asked for again.

        Parameters
        ----------
        session
            Session of the run.
        before
            BenchConfiguration after the unit before.
        why
            Reason for the configuration, for the person.
        """
        again = _arranged_before_resuming(session)
        if self.lamp != before.lamp or "lamp" in again:
            _lamp_off(session)
        now, then = self._by_hand(session.rig), before._by_hand(session.rig)
        for name in COMPONENTS:
            if getattr(now, name) != getattr(then, name) or name in again:
                instruction, task = now._step(name)
                session.ask(ManualStep(instruction, why, task))
        if FILTER_WHEEL in session.rig:
            in_wheel = self.filter in session.rig[FILTER_WHEEL].names()
            session.perform(TurnWheel(self.filter if in_wheel else None))
        if CAMERA_FILTER_WHEEL in session.rig:
            in_wheel = self.camera_filter in session.rig[CAMERA_FILTER_WHEEL].names()
            session.perform(TurnCameraWheel(self.camera_filter if in_wheel else None))
        if self.monochromator_nm is not None:
            session.perform(Tune(self.monochromator_nm))

    def _by_hand(self, rig: Rig) -> "BenchConfiguration":
        """Return the part of the configuration that is made by hand."""
        filter_name, camera_filter = self.filter, self.camera_filter
        if FILTER_WHEEL in rig and filter_name in rig[FILTER_WHEEL].names():
            filter_name = None
        if CAMERA_FILTER_WHEEL in rig and camera_filter in rig[CAMERA_FILTER_WHEEL].names():
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
            case "target" if self.chart_patch:
                name = CHART_PATCHES[self.chart_patch - 1]
                return (
                    f"lay the ColorChecker so that its patch {self.chart_patch}, {name}, alone is "
                    "seen, from end to end of the variable filter",
                    f"{self.stage} {self.chart_patch}",
                )
            case "target":
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
    frame_times = [*session.frame_times(FrameRole.DARK), *session.frame_times(FrameRole.LOOK)]
    if any(time >= since for time in [*frame_times, *(step.start_time for step in steps)]):
        return set()
    return {thing for step in steps if (thing := _component_of(step.task)) is not None}


def _component_of(task: str) -> str | None:
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
        return "target"
    if task.startswith("camera filter "):
        return "camera_filter"
    if task.startswith(("lvf ", "filter ")):
        return task.partition(" ")[0]
    return words.get(task)


@dataclass(frozen=True)
class WithConfiguration:
    """A unit that needs another configuration of the bench than the unit before it.

    Attributes
    ----------
    unit
        Unit that is run in the configuration.
    now, before
        Its configuration, and that of the unit before it.
    why
        Reason for the configuration, for the person.
    goes_dark
        Whether the lamp that the unit before has left burning is switched off first.
    """

    unit: Unit
    now: BenchConfiguration
    before: BenchConfiguration
    why: str
    goes_dark: bool = False

    @property
    def name(self) -> str:
        """Name of the unit."""
        return self.unit.name

    def run(self, session: Session) -> None:
        """Ask for the configuration, then run the unit."""
        if self.goes_dark and session.rig[LAMP].is_on():
            session.perform(LAMP_OFF)
        self.now.set_up(session, self.before, self.why)
        self.unit.run(session)


@dataclass(frozen=True)
class ConfiguredUnit:
    """A unit and the configuration of the bench in which it is run.

    Attributes
    ----------
    unit
        Unit, which asks for none of the configuration's steps itself.
    configuration
        BenchConfiguration of the bench.
    why
        Reason for the configuration, for the person.
    is_dark
        Whether it takes dark frames only, for which any configuration without a glow will do.
    rests
        Whether the sample rests in the dark before it is charged, so that others may be measured
        meanwhile.
    leaves_lamp_on
        Whether the unit leaves the lamp burning, warm for another one that does so.
    """

    unit: Unit
    configuration: BenchConfiguration
    why: str
    is_dark: bool = False
    rests: bool = False
    leaves_lamp_on: bool = False

    def of_part(self, part: str) -> "ConfiguredUnit":
        """Return the scene as one of a part of a chain."""
        return replace(self, unit=PartUnit(part, self.unit))


def in_turn(scenes: Sequence[ConfiguredUnit]) -> list[Unit]:
    """Return the units of scenes, each asking for what changes, and at last the bench put back."""
    units: list[Unit] = []
    before, burns = BenchConfiguration(), False
    for scene in scenes:
        goes_dark = burns and not scene.leaves_lamp_on
        units.append(
            WithConfiguration(scene.unit, scene.configuration, before, scene.why, goes_dark)
        )
        before, burns = scene.configuration, scene.leaves_lamp_on
    return units if before == BenchConfiguration() else [*units, RestoreBench(before)]


class ConfiguredProtocol(ProtocolModel):
    """Base of protocols whose units are scenes, so that a chain can put them into another order."""

    @abstractmethod
    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return all units with their configurations, in the order in which they build."""

    def units(self) -> Sequence[Unit]:
        """Return the units of all scenes in order, and the bench put back."""
        return in_turn(self.configured_units())


@dataclass(frozen=True)
class WithManualStep:
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
class RestoreBench:
    """The bench put back; a unit of its own, so that nothing is measured again for it."""

    before: BenchConfiguration
    name: str = "put-back"

    def run(self, session: Session) -> None:
        """Switch the lamp off, have filters and card taken away."""
        _lamp_off(session)
        BenchConfiguration().set_up(
            session, self.before, "the next measurement finds the bench as usual"
        )
