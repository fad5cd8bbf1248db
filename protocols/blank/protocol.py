"""A blank: the sequence of a decay on an inert card, for background and stray light.

A lamp that is off still glows a little (Nalbach et al., section 4.4), light leaks in, a stray
reflection reaches the camera. An inert card in the sample's place shows all of that and nothing
else.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import (
    CAMERA,
    CameraCapabilities,
    ExposureSettings,
    Session,
    TakeFrame,
    at,
)
from labrig.foundation.errors import ProtocolError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS, Fraction, WordOrDuration, duration_text
from labrig.foundation.region import CENTRE, Region
from labrig.protocols.steps.bench_configuration import (
    BenchConfiguration,
    ConfiguredProtocol,
    ConfiguredUnit,
)
from labrig.protocols.steps.camera_settings import (
    DARKS_PER_EXPOSURE,
    CameraSettings,
    FramePeriod,
    exposure_lines,
    frame_times_s,
    longest_exposure_s,
)
from labrig.protocols.steps.sample_pose import charge, face_camera, lights_out, visible_after_s
from labrig.protocols.steps.sanity_checks import SanityChecks
from labrig.record import FrameRole

#: Reason for the blank.
WHY = "the frames of the sequence without a glow are measured"
#: Role of the frames of the sequence.
BLANK_FRAMES = "blank"
#: Start of the first frame of a sequence without a door.
EARLIEST_S = 0.1


class Clean(FrozenModel):
    """Limits below which the signal of a blank counts as zero.

    Attributes
    ----------
    sigmas
        Signal in standard uncertainties below which the blank counts as clean, for example `4`.
    fraction
        Signal as a fraction of the camera's range from black to white below which the blank counts
        as clean, whatever its uncertainty, for example `0.001 %`.
    """

    sigmas: float = Field(4.0, gt=0)
    fraction: Fraction = Field(1e-5, ge=0, lt=1)


class Blank(ConfiguredProtocol):
    """Settings of a blank; `blank.yaml` is the commented example.

    Attributes
    ----------
    charge
        Time for which the lamp shines before each sequence, for example `5 min`. The lamp's housing
        should become as warm as in a decay.
    every
        Time between the begins of two photographs, for example `5 s`.
    duration
        Time after lamp off until which photographs begin, for example `60 s`; at least four times
        `every`.
    first
        Time from lamp off to the first photograph, for example `500 ms`. `auto` is as soon as the
        trap door is open, or 100 ms without a door.
    later_by
        Further delay of each sequence's first photograph, one sequence for each, so that the time
        just after lamp off is sampled in small steps, for example `[0 s, 100 ms]`.
    exposure
        Shutter time of the first photograph of each sequence, for example `500 ms`. All others are
        as long as fits between two begins.
    camera
        Sensitivity and aperture of the camera: those of the decays to which the blank belongs.
    region
        Place of the blank in the frame, where the sample will be: `[x, y, width, height]` in
        pixels, or all four as fractions of the frame.
    clean
        Limits below which the signal of the blank counts as zero.
    """

    protocol: Literal["blank"] = "blank"
    charge: DurationS = Field(300.0, gt=0)
    every: FramePeriod = 5.0
    duration: DurationS = Field(60.0, gt=0, alias="for")
    first: Annotated[float | Literal["auto"], WordOrDuration("auto")] = "auto"
    later_by: tuple[DurationS, ...] = Field((0.0, 0.1, 0.2, 0.4), min_length=1)
    exposure: DurationS = Field(0.5, gt=0)
    camera: CameraSettings = CameraSettings()
    region: Region = CENTRE
    clean: Clean = Clean()

    @model_validator(mode="after")
    def _leaves_room(self) -> Self:
        if self.duration < 4 * self.every:
            raise ValueError(
                f"for: {duration_text(self.duration)} leaves fewer than four frames "
                f"{duration_text(self.every)} apart; make it longer"
            )
        return self

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return dark frames, then the sequences."""
        blank = BenchConfiguration("blank")
        sequences = (SequenceUnit(self, number) for number in range(1, len(self.later_by) + 1))
        return [
            ConfiguredUnit(BlankDarkUnit(self), blank, WHY, is_dark=True),
            *(ConfiguredUnit(sequence, blank, WHY) for sequence in sequences),
        ]

    def settings(self, exposure_s: float) -> ExposureSettings:
        """Return the camera settings with that shutter time."""
        return ExposureSettings(exposure_s, self.camera.iso, self.camera.f_number)

    def exposures_s(self, capabilities: CameraCapabilities) -> tuple[float, float]:
        """Return the shutter times of a sequence's first frame and of all others, in seconds."""
        longest_s = longest_exposure_s(self.every, capabilities)
        return min(capabilities.exposure_at_most(self.exposure), longest_s), longest_s

    def frame_spacing(self, capabilities: CameraCapabilities) -> Sequence[str]:
        """Return that the first exposure is another one than was asked for, in a line or none."""
        return exposure_lines(self.exposure, self.exposures_s(capabilities)[0])

    def times_s(self, earliest_s: float, later_s: float) -> list[float]:
        """Return the start of each frame of a sequence in seconds after lamp off."""
        first_s = (earliest_s if self.first == "auto" else self.first) + later_s
        return frame_times_s(first_s, self.every, self.duration)


@dataclass(frozen=True)
class BlankDarkUnit:
    """Dark frames in the pose of the sequences, with the blank in its place."""

    protocol: Blank
    name: str = "dark"

    def run(self, session: Session) -> None:
        """Photograph at the shortest shutter time and at the later ones; refuse a burning lamp."""
        session.wait_until_warm("camera")
        face_camera(session)
        capabilities = session.rig[CAMERA].capabilities()
        times_s = [capabilities.exposures_s[0], *self.protocol.exposures_s(capabilities)]
        for exposure_s in dict.fromkeys(times_s):
            for _ in range(DARKS_PER_EXPOSURE):
                session.perform(TakeFrame(FrameRole.DARK, self.protocol.settings(exposure_s)))
        shorter = [self.protocol.settings(time_s) for time_s in capabilities.exposures_s[:3]]
        SanityChecks(session, self.name, [self.protocol.region], None).require_darkness(shorter)


@dataclass(frozen=True)
class SequenceUnit:
    """A charge of the blank, lamp off, then frames as in a decay."""

    protocol: Blank
    number: int

    @property
    def name(self) -> str:
        """Name of the unit: `blank-1`, `blank-2`, …"""
        return f"blank-{self.number}"

    def run(self, session: Session) -> None:
        """Charge and photograph, a little later in each sequence."""
        protocol = self.protocol
        session.wait_until_warm("camera")
        first_s, others_s = protocol.exposures_s(session.rig[CAMERA].capabilities())
        visible_s = visible_after_s(session.rig)
        earliest_s = visible_s or EARLIEST_S
        if protocol.first != "auto" and protocol.first < visible_s:
            raise ProtocolError(
                f"first: {duration_text(protocol.first)} after lamp off the door still moves; "
                f"write first: auto, which is {duration_text(earliest_s)} on this rig"
            )
        times_s = protocol.times_s(earliest_s, protocol.later_by[self.number - 1])
        charge(session, protocol.charge)
        session.run_sequence(
            [
                *lights_out(session),
                *(
                    at(
                        time_s,
                        TakeFrame(BLANK_FRAMES, protocol.settings(others_s if number else first_s)),
                    )
                    for number, time_s in enumerate(times_s)
                ),
            ]
        )
