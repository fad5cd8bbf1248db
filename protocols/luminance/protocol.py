"""The luminance of an afterglow as products state it: charged under lux, then in mcd/m² until 0.3.

A grey card is photographed under the bare lamp, whose light a luxmeter or a luminance meter has
read: the counts of the glow relative to those of the card are luminances. A sample that has rested
is charged only once, so that the exposures follow from the frames before them.
"""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from labrig.acquire import (
    CAMERA,
    LAMP,
    LAMP_ON,
    CameraCapabilities,
    ExposureSettings,
    LampType,
    ProtocolModel,
    RigFile,
    Session,
    TakeFrame,
    Unit,
    at,
)
from labrig.bench_optics import card_radiance, illuminance_lx, luminance
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.models import FrozenModel
from labrig.foundation.named_files import ShippedOrFile, is_path
from labrig.foundation.quantity import DurationS, duration_text
from labrig.foundation.region import CENTRE
from labrig.material import read_material
from labrig.optics import read_spectrum
from labrig.protocols.steps.afterglow import Afterglow, dark_level, glow
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    RestoreBench,
    WithConfiguration,
    light,
)
from labrig.protocols.steps.bracketing import Bracketing
from labrig.protocols.steps.camera_settings import DARKS_PER_EXPOSURE, MARGIN_S, CameraSettings, Iso
from labrig.protocols.steps.darkness import levels, range_dn
from labrig.protocols.steps.exposure_metering import TARGET, MeteringFrame, measure_frame
from labrig.protocols.steps.glow import dark_frames
from labrig.protocols.steps.patch_names import Patches
from labrig.protocols.steps.sample_pose import (
    check_visible,
    face_camera,
    face_lamp,
    has_door,
    lights_out,
)
from labrig.protocols.steps.sanity_checks import SanityChecks
from labrig.record import FrameRecord, FrameRole
from labrig.results import (
    VISIBLE_MCD_PER_M2,
    LuminanceRequirement,
    luminance_requirement,
    luminance_unit,
)

Preset = Literal["DIN 67510-1", "JIS Z 9107", "ASTM E2073", "own"]
Class = Literal["JA", "JB", "JC", "JD"]

#: Least luminances of the classes of JIS Z 9107 in mcd/m², at times in minutes.
CLASSES: dict[str, dict[int, float]] = {
    "JA": {2: 210, 10: 50, 20: 24, 30: 15, 60: 7},
    "JB": {2: 440, 10: 105, 20: 50, 30: 31, 60: 15},
    "JC": {2: 880, 10: 210, 20: 100, 30: 62, 60: 30},
    "JD": {2: 1760, 10: 420, 20: 200, 30: 124, 60: 60},
}
#: Relative differences of illuminance and time of excitation within which they are as prescribed.
LUX_TOLERANCE, TIME_TOLERANCE = 0.05, 0.02

#: Suffixes of tables of an emission spectrum.
TABLES = (".csv", ".txt", ".dat")

#: Shutter times of the first frames of the glow, as fractions of the longest.
FIRST = (1 / 4096, 1 / 512, 1 / 64)
#: Ratio of the times of neighbouring frames, and frames that are chosen together.
STEP, TOGETHER = 1.08, 3
#: Longest exposure relative to the time after lamp off: the luminance changes little meanwhile.
SHORT = 0.1
#: Fraction of the range below which a higher ISO is taken, and by how much it is higher.
LOW, ISO_STEP = 0.03, 4
#: Frames at either ISO, in turn, where it changes.
AT_EITHER = 2
#: Time after lamp off by which every glow has faded by that fraction.
FADES_BY_S, FADED = 60.0, 0.02
#: Part of 0.3 mcd/m² at which the run may end, by an estimate of the luminance.
ENOUGH = 0.5
#: BenchConfiguration of the bench for the card, and its reason.
CARD = BenchConfiguration("grey card")
WHY_CARD = "its light under the lamp is the scale of luminances"
#: Frames of the card, and the longest exposure of it in seconds.
CARD_FRAMES, CARD_LONGEST_S = 6, 2.0


class LuminanceFrames(StrEnum):
    """Roles of frames of the glow, and of the grey card under the bare lamp."""

    GLOW = "luminance"
    CARD = "card"


@dataclass(frozen=True)
class Conditions:
    """Excitation that a standard prescribes.

    Attributes
    ----------
    name
        Name of the standard; empty if the conditions are the user's own.
    lamp, illuminance_lx, rest_s
        Kind of the lamp, illuminance in lx and least time in the dark before; None where it is not
        prescribed.
    time_s
        Time of excitation in seconds.
    """

    name: str
    lamp: LampType | None
    illuminance_lx: float | None
    time_s: float
    rest_s: float | None

    def deviations(
        self,
        lamp: LampType | None,
        illuminance_lx: float,
        charged_s: float,
        rested_s: float | None,
    ) -> Iterator[str]:
        """Iterate over what was not as prescribed, a clause each.

        Parameters
        ----------
        lamp
            Kind of the lamp; None if it is not stated.
        illuminance_lx
            Illuminance of the sample in lx.
        charged_s
            Time of the excitation in seconds.
        rested_s
            Time in the dark before it in seconds; None if it is not stated.
        """
        if self.lamp is not None and lamp != self.lamp:
            found = (
                "the rig file does not say which lamp it has" if lamp is None else f"{lamp} lamp"
            )
            yield f"{found}, not {self.lamp}"
        if self.illuminance_lx is not None and not math.isclose(
            illuminance_lx, self.illuminance_lx, rel_tol=LUX_TOLERANCE
        ):
            yield f"{illuminance_lx:.3g} lx, not {self.illuminance_lx:g} lx"
        if not math.isclose(charged_s, self.time_s, rel_tol=TIME_TOLERANCE):
            yield f"excited for {duration_text(charged_s)}, not {duration_text(self.time_s)}"
        if self.rest_s is not None and rested_s is None:
            yield f"not stated that it was {duration_text(self.rest_s)} in the dark (rested:)"
        elif self.rest_s is not None and rested_s is not None and rested_s < self.rest_s:
            yield (
                f"{duration_text(rested_s)} in the dark before, not {duration_text(self.rest_s)}"
            )

    def __str__(self) -> str:
        parts = [self.lamp, self.illuminance_lx and f"{self.illuminance_lx:g} lx"]
        rest = self.rest_s and f"after {duration_text(self.rest_s)} in the dark"
        parts += [duration_text(self.time_s), rest]
        return ", ".join(str(part) for part in parts if part)


#: What the standards prescribe that leave no choice.
PRESETS = {
    "DIN 67510-1": Conditions("DIN 67510-1:2020", "xenon", 1000.0, 300.0, 48 * 3600.0),
    "JIS Z 9107": Conditions("JIS Z 9107", "D65 fluorescent", 200.0, 1200.0, None),
}


class Excitation(FrozenModel):
    """Excitation of the sample, by a standard or as the user wants it.

    Attributes
    ----------
    preset
        Standard: `DIN 67510-1` (xenon, 1000 lx, 5 min, after 48 h in the dark), `JIS Z 9107` (D65
        fluorescent lamp, 200 lx, 20 min), `ASTM E2073` with the conditions below, or `own`.
    lamp
        Kind of the lamp that `ASTM E2073` or `own` asks for, for example `fluorescent`.
    illuminance_lx
        Illuminance in lx that they ask for, for example `54`.
    time
        Time of excitation that they ask for, for example `1 h`.
    rest
        Least time in the dark before, that they ask for, for example `24 h`.
    rested
        Time for which this sample was in the dark before the run, for example `50 h`.
    """

    preset: Preset = "DIN 67510-1"
    lamp: LampType | None = None
    illuminance_lx: float | None = Field(None, gt=0, allow_inf_nan=False)
    time: DurationS | None = Field(None, gt=0)
    rest: DurationS | None = Field(None, gt=0)
    rested: DurationS | None = Field(None, ge=0)

    @model_validator(mode="after")
    def _as_the_preset_says(self) -> Self:
        given = [key for key in ("lamp", "illuminance_lx", "time", "rest") if getattr(self, key)]
        if self.preset in PRESETS and given:
            raise ValueError(
                f"expected no '{given[0]}' with 'preset: {self.preset}', which prescribes "
                f"{PRESETS[self.preset]}; for other conditions write 'preset: own'"
            )
        needed = {"ASTM E2073": ("lamp", "illuminance_lx", "time"), "own": ("time",)}
        for key in needed.get(self.preset, ()):
            if getattr(self, key) is None:
                raise ValueError(
                    f"expected '{key}' with 'preset: {self.preset}', whose conditions are yours"
                )
        return self

    @property
    def conditions(self) -> Conditions:
        """Conditions of the preset, or the user's."""
        if self.preset in PRESETS:
            return PRESETS[self.preset]
        assert self.time is not None
        name = "" if self.preset == "own" else self.preset
        return Conditions(name, self.lamp, self.illuminance_lx, self.time, self.rest)


def _is_requirement(text: str) -> str:
    luminance_requirement(text)
    return text


def _mcd_per_m2(text: str) -> float:
    number, _, unit = text.strip().partition(" ")
    return float(number) * luminance_unit(unit)


def _is_luminance(text: str) -> str:
    if not 0 < _mcd_per_m2(text) < math.inf:
        raise ValueError(f"expected a luminance above 0, such as '50 mcd/m2', got '{text}'")
    return text


class Luminance(ProtocolModel):
    """Settings of a luminance run; `luminance.yaml` is the commented example.

    Attributes
    ----------
    excitation
        How the sample is excited, by a standard or as you want it.
    until
        Time after lamp off at which the run ends even if the glow is brighter than 0.3 mcd/m², for
        example `2 h`.
    first
        Time from lamp off to the first photograph, for example `5 s`.
    longest
        Longest exposure, for example `30 s`.
    camera
        Sensitivity of the first frames and of those of the grey card, and the aperture of all.
    iso_at_most
        Highest sensitivity, which the dim end of the glow may take.
    card
        When the grey card is photographed under the bare lamp: `before` the excitation, lying on
        the sample, which it keeps from the light meanwhile, or `after` the glow. `auto` is `before`
        where there is no trap door.
    emission
        Emission spectrum of the glow: material file, run folder of `emission_spectrum`, or table of
        wavelengths and values. Default: estimated from the colour of the glow.
    colours
        Letters of the colours for the marking, for example `K-W`.
    rank
        Class of JIS Z 9107 to be met: `JA`, `JB`, `JC` or `JD`.
    require
        Least luminances, for example `[140 mcd/m2 at 10 min]`.
    adaptation
        Luminance to which eyes are adapted, for example `50 mcd/m2`, for mesopic luminances by CIE
        191. Default: none are given.
    patches
        Regions of interest by name: `[x, y, width, height]` in pixels, or all four as fractions of
        the frame. Of several, the result has their ratios.
    card_cd_per_m2
        Luminance of the lit card in cd/m², by which the run knows that 0.3 mcd/m² is reached.
        `auto` is that of the rig file's reading.
    """

    protocol: Literal["luminance"] = "luminance"
    excitation: Excitation = Excitation()
    until: DurationS = Field(7200.0, gt=0)
    first: DurationS = Field(5.0, gt=0)
    longest: DurationS = Field(30.0, gt=0)
    camera: CameraSettings = CameraSettings(iso=100)
    iso_at_most: Iso = 1600
    card: Literal["auto", "before", "after"] = "auto"
    emission: ShippedOrFile | None = None
    colours: str = ""
    rank: Class | None = Field(None, alias="class")
    require: tuple[Annotated[str, AfterValidator(_is_requirement)], ...] = ()
    adaptation: Annotated[str, AfterValidator(_is_luminance)] | None = None
    patches: Patches = Field({"sample": CENTRE}, min_length=1)
    card_cd_per_m2: Annotated[float, Field(gt=0)] | Literal["auto"] = "auto"

    @model_validator(mode="after")
    def _has_time(self) -> Self:
        if self.until < 4 * self.first:
            raise ValueError(
                f"until: {duration_text(self.until)} leaves too little after the first frame at "
                f"{duration_text(self.first)}; make it longer"
            )
        return self

    @property
    def requirements(self) -> tuple[LuminanceRequirement, ...]:
        """Least luminances, those of the class first."""
        of_class = CLASSES[self.rank] if self.rank else {}
        return (
            *(LuminanceRequirement(60.0 * minutes, least) for minutes, least in of_class.items()),
            *(luminance_requirement(text) for text in self.require),
        )

    @property
    def adaptation_mcd_per_m2(self) -> float | None:
        """Luminance to which eyes are adapted in mcd/m²."""
        return None if self.adaptation is None else _mcd_per_m2(self.adaptation)

    def resolved_for(self, rig: RigFile) -> Self:
        """Return the protocol with the card's luminance by the rig file's reading.

        Raises
        ------
        UsageError
            The rig file has no reading, or curves are missing.
        """
        if self.emission is not None:
            _require_emission(self.emission)
        card = self.card
        if card == "auto":
            card = "after" if "door" in rig.devices else "before"
        card_cd_per_m2 = luminance(card_radiance(rig))
        return self.model_copy(update={"card": card, "card_cd_per_m2": card_cd_per_m2})

    def notes(self, rig: RigFile) -> Sequence[str]:
        """Return why the excitation does not accord with its standard, as far as is known."""
        reading, conditions = rig.optics.luminance, self.excitation.conditions
        if reading is None or not conditions.name:
            return ()
        deviations = "; ".join(
            conditions.deviations(
                reading.lamp,
                illuminance_lx(rig),
                conditions.time_s,
                self.excitation.rested,
            )
        )
        return (f"not according to {conditions.name}: {deviations}",) if deviations else ()

    @property
    def rate_frames(self) -> Collection[str]:
        """Roles of the frames to which rates are fitted."""
        return (LuminanceFrames.GLOW,)

    def units(self) -> Sequence[Unit]:
        """Return darks at every ISO, card and glow, the bench put back."""
        darks = [LuminanceDarkUnit(self, iso) for iso in self.isos()]
        card = WithConfiguration(CardUnit(self), CARD, BenchConfiguration(), WHY_CARD)
        if self.card == "after":
            return [*darks, GlowUnit(self), card, RestoreBench(CARD)]
        return [*darks, card, GlowUnit(self)]

    def isos(self) -> list[int]:
        """Return the sensitivities, rising."""
        isos = [self.camera.iso]
        while isos[-1] * ISO_STEP <= self.iso_at_most:
            isos.append(isos[-1] * ISO_STEP)
        return isos

    def settings(self, exposure_s: float, iso: int | None = None) -> ExposureSettings:
        """Return the camera settings with that shutter time, at the card's ISO or another one."""
        return ExposureSettings(exposure_s, iso or self.camera.iso, self.camera.f_number)

    def longest_exposure_s(self, at_s: float, capabilities: CameraCapabilities) -> float:
        """Return the longest shutter time at a time after lamp off."""
        return capabilities.exposure_at_most(min(self.longest, SHORT * at_s))

    def next_s(self, begin_s: float, capabilities: CameraCapabilities) -> float:
        """Return the start of the frame after one, however long that exposes."""
        spent_s = (
            self.longest_exposure_s(begin_s, capabilities) + capabilities.overhead_s + MARGIN_S
        )
        return max(begin_s + spent_s, begin_s * STEP)

    def first_frames(self, capabilities: CameraCapabilities) -> list[tuple[float, float]]:
        """Return begin and shutter time of the first frames: one of them is right."""
        frames, at_s = [], self.first
        for fraction in FIRST:
            exposure_s = capabilities.exposure_at_most(self.longest * fraction)
            frames.append((at_s, exposure_s))
            at_s += exposure_s + capabilities.overhead_s + MARGIN_S
        return frames

    def checks(self, session: Session, unit: str) -> SanityChecks:
        """Return the sanity checks of a unit's frames."""
        regions = list(self.patches.values())
        return SanityChecks(session, unit, regions, None, LuminanceFrames.GLOW)


def _require_emission(named: str) -> None:
    """Refuse an emission that the analysis could not read, hours later."""
    path = Path(named)
    is_run = is_path(named) and path.is_dir()
    if is_run and not (path / "result" / "result.json").is_file():
        raise UsageError(
            f"emission: {named}: expected a run of emission_spectrum with a result; make it with: "
            f"labrig process {named}"
        )
    if path.suffix in TABLES:
        read_spectrum(path)
    elif not is_run:
        read_material(named)


@dataclass(frozen=True)
class LuminanceDarkUnit:
    """Dark frames at one ISO, with the sample in its place before anything has lit it."""

    protocol: Luminance
    iso: int

    @property
    def name(self) -> str:
        """Name of the unit: `dark-100`, `dark-400`, …"""
        return f"dark-{self.iso}"

    def run(self, session: Session) -> None:
        """Photograph in the dark; refuse a light."""
        session.wait_until_warm("camera")
        capabilities, protocol = session.rig[CAMERA].capabilities(), self.protocol
        exposures = [
            protocol.settings(capabilities.exposure_at_most(protocol.longest * part), self.iso)
            for part in (1 / 64, 1 / 4, 1)
            for _ in range(DARKS_PER_EXPOSURE)
        ]
        checks = protocol.checks(session, self.name)
        dark_frames(session, self.name, checks.patches, exposures)
        checks.require_darkness(
            [protocol.settings(exposure_s, self.iso) for exposure_s in capabilities.exposures_s[:3]]
        )


@dataclass(frozen=True)
class CardUnit:
    """The grey card under the bare, warm lamp; before the excitation the lamp burns on."""

    protocol: Luminance
    name: str = "card"

    def run(self, session: Session) -> None:
        """Light the card and photograph it."""
        session.wait_until_warm("camera")
        light(session, session.rig.warm_up_s("lamp"))
        bracketing = Bracketing(self.protocol.camera, CARD_LONGEST_S, CARD_FRAMES, exposures=1)
        bracketing.photograph(session, self.name, LuminanceFrames.CARD, "bare")


@dataclass(frozen=True)
class Shots:
    """Photographs of the glow: begin in seconds after lamp off, and settings."""

    begins_s: tuple[float, ...]
    settings: tuple[ExposureSettings, ...]

    def __str__(self) -> str:
        shown = dict.fromkeys(str(settings) for settings in self.settings)
        return ", ".join(shown)


@dataclass(frozen=True)
class GlowUnit:
    """The excitation, once, and the glow after it, with exposures that follow it."""

    protocol: Luminance
    name: str = "glow"

    def run(self, session: Session) -> None:
        """Excite, switch the lamp off, photograph until it is dim or time is over."""
        protocol = self.protocol
        session.wait_until_warm("camera")
        check_visible(session, protocol.first)
        capabilities = session.rig[CAMERA].capabilities()
        first = protocol.first_frames(capabilities)
        self._excite(session)
        off_s = session.clock.now()
        session.run_sequence(
            [
                *lights_out(session),
                *(
                    at(time_s, TakeFrame(LuminanceFrames.GLOW, protocol.settings(exposure_s)))
                    for time_s, exposure_s in first
                ),
            ]
        )
        self._follow(session, first[-1][0], off_s)

    def _follow(self, session: Session, last_s: float, off_s: float) -> None:
        """Photograph the glow from the last of the first frames on until it is dim."""
        protocol, iso, is_checked = self.protocol, self.protocol.camera.iso, False
        capabilities, is_over = session.rig[CAMERA].capabilities(), False
        while not is_over:
            begin_s = max(
                protocol.next_s(last_s, capabilities), session.clock.now() - off_s + MARGIN_S
            )
            is_over = begin_s > protocol.until
            if not is_over:
                shots = self._photograph(session, begin_s, off_s, iso)
                last_s, iso = shots.begins_s[-1], shots.settings[-1].iso
                is_over = session.decide(
                    "dim enough", lambda: self._is_dim(session), when_planned=False
                )
            if not is_checked and (is_over or last_s > FADES_BY_S):
                session.decide(
                    "after lamp off",
                    lambda: self._afterglow(session),
                    when_planned=Afterglow.FADING,
                ).require(session.warn)
                is_checked = True

    def _photograph(self, session: Session, begin_s: float, off_s: float, iso: int) -> Shots:
        """Take the next frames from a time after lamp off, and return them."""
        capabilities = session.rig[CAMERA].capabilities()
        shots = session.decide(
            "exposures",
            lambda: self._next(session, begin_s, iso, capabilities),
            self._longest(begin_s, iso, capabilities),
        )
        now_s = session.clock.now() - off_s
        glow = [TakeFrame(LuminanceFrames.GLOW, settings) for settings in shots.settings]
        timed = zip(shots.begins_s, glow, strict=True)
        session.run_sequence([at(time_s - now_s, shoot) for time_s, shoot in timed])
        return shots

    def _excite(self, session: Session) -> None:
        """Light the rested sample with the warm lamp for the time of the excitation."""
        protocol = self.protocol
        if session.decide("first in its session", lambda: _is_first(session), when_planned=False):
            session.warn(
                "the run was resumed: if the lamp has shone on the sample since, let it rest as "
                "long as before and begin a new run"
            )
        if protocol.card == "before":
            if not session.rig[LAMP].is_on():  # as in a resumed run
                CARD.set_up(session, BenchConfiguration(), "it covers the sample meanwhile")
                light(session, session.rig.warm_up_s("lamp"))
            BenchConfiguration().set_up(session, CARD, "the excitation begins")
        else:
            if has_door(session):
                face_camera(session)
                session.perform(LAMP_ON)
                session.wait(
                    session.rig.warm_up_s("lamp"), "lamp warms up, the sample away from it"
                )
            face_lamp(session)
            if not session.rig[LAMP].is_on():
                session.perform(LAMP_ON)
        session.wait(protocol.excitation.conditions.time_s, "excitation")

    def _longest(self, begin_s: float, iso: int, capabilities: CameraCapabilities) -> Shots:
        """Return frames with the longest exposures that `_next` can return."""
        exposures_s = [self.protocol.longest_exposure_s(begin_s, capabilities)] * TOGETHER
        return self._shots(begin_s, [(exposure_s, iso) for exposure_s in exposures_s], capabilities)

    def _shots(
        self, begin_s: float, wanted: Sequence[tuple[float, int]], capabilities: CameraCapabilities
    ) -> Shots:
        """Return frames of these exposures and ISOs until the run's end."""
        begins_s, settings = [], []
        for exposure_s, iso in wanted:
            if begin_s > self.protocol.until:
                break
            begins_s.append(begin_s)
            settings.append(self.protocol.settings(exposure_s, iso))
            begin_s = self.protocol.next_s(begin_s, capabilities)
        return Shots(tuple(begins_s), tuple(settings))

    def _next(
        self, session: Session, begin_s: float, iso: int, capabilities: CameraCapabilities
    ) -> Shots:
        """Return the next frames, from the last one that does not clip.

        They are as bright as the target, if the glow falls inversely as the time.
        """
        frame, measured = self._last(session)
        if measured is None:
            return self._shots(
                begin_s, [(capabilities.exposures_s[0], iso)] * TOGETHER, capabilities
            )
        channels = [channel for patch in measured.patches for channel in patch.channels.values()]
        at_s = self.protocol.first + measured.start_s - self._frames(session)[0].start_time
        to_begin = at_s / begin_s / (range_dn(measured) * measured.exposure_s * frame.iso)
        mean_per_s = to_begin * max(channel.mean for channel in channels)
        peak_per_s = to_begin * max(max(channel.peak for channel in channels), 1.0)
        limit_s = self.protocol.longest_exposure_s(begin_s, capabilities)
        before, isos = iso, self.protocol.isos()
        while iso < isos[-1] and mean_per_s * iso * limit_s < LOW:
            iso = isos[isos.index(iso) + 1]
        exposure_s = capabilities.exposure_at_most(min(TARGET / (peak_per_s * iso), limit_s))
        if iso > before:
            in_turn = [(exposure_s, before), (exposure_s, iso)] * AT_EITHER
            return self._shots(begin_s, in_turn, capabilities)
        return self._shots(begin_s, [(exposure_s, iso)] * TOGETHER, capabilities)

    def _last(self, session: Session) -> tuple[FrameRecord, MeteringFrame | None]:
        """Return the unit's last frame in which no patch clips; None if all clip."""
        frames = self._frames(session)
        for frame in reversed(frames):
            measured = measure_frame(frame, list(self.protocol.patches.values()))
            if not any(patch.clipped for patch in measured.patches):
                return frame, measured
        return frames[-1], None

    def _frames(self, session: Session) -> list[FrameRecord]:
        return [f for f in session.frames(LuminanceFrames.GLOW) if f.unit == self.name]

    def _signal(self, session: Session, frame: FrameRecord, measured: MeteringFrame) -> FloatArray:
        """Return a frame's signal above the dark frames of its ISO in DN, (patches, channels)."""
        regions = list(self.protocol.patches.values())
        darks = [
            measure_frame(dark, regions)
            for dark in session.frames(FrameRole.DARK)
            if dark.iso == frame.iso
        ]
        return levels(measured) - dark_level(darks, measured.exposure_s)

    def _afterglow(self, session: Session) -> Afterglow:
        """Return whether the light after lamp off fades; a lamp that burns on does not."""
        regions, rates, clips = list(self.protocol.patches.values()), [], False
        for frame in self._frames(session):
            measured = measure_frame(frame, regions)
            clips = any(patch.clipped for patch in measured.patches)
            signal = glow(measured, levels(measured) - self._signal(session, frame, measured), 0.0)
            if signal.seen and not clips:
                rates.append(signal.brightest / frame.iso)
        if not rates:
            return Afterglow.STEADY if clips else Afterglow.ABSENT
        return Afterglow.STEADY if rates[-1] > (1 - FADED) * rates[0] else Afterglow.FADING

    def _is_dim(self, session: Session) -> bool:
        """Return whether all patches are below 0.3 mcd/m², by their signal relative to the card's.

        It is an estimate for an end beyond that luminance. Without frames of the card it is False.
        """
        cards = session.frames(LuminanceFrames.CARD)
        frame, measured = self._last(session)
        if not cards or measured is None or isinstance(self.protocol.card_cd_per_m2, str):
            return False
        regions = list(self.protocol.patches.values())
        lit = [levels(measure_frame(card, regions)) / card.exposure_s / card.iso for card in cards]
        per_s = self._signal(session, frame, measured) / measured.exposure_s / frame.iso
        ratio = (per_s / np.mean(lit, axis=0)).max(axis=1)
        limit = ENOUGH * VISIBLE_MCD_PER_M2 / (1000 * self.protocol.card_cd_per_m2)
        return bool((ratio < limit).all())


def _is_first(session: Session) -> bool:
    """Return whether no frame was taken since the devices were connected, as in a resumed run."""
    since = session.clock.wall(session.rig.connected_s)
    frames = [
        frame
        for role in (FrameRole.DARK, FrameRole.LOOK, LuminanceFrames.CARD)
        for frame in session.frames(role)
    ]
    return all(frame.start_time < since for frame in frames)
