"""Isotropy: the glow at several angles, always after the same charge.

After Nalbach et al., sec. 4: 0° to 80° in 20° steps, the intensity fluctuated by less than 5 %.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import ManualStep, Session, TakeFrame, Unit, at
from labrig.foundation.quantity import Count, DurationS, duration_text
from labrig.foundation.region import Region
from labrig.protocols.steps.camera_settings import FramePeriod
from labrig.protocols.steps.glow import DarkUnit, GlowSettings, MeterUnit, metered_schedule
from labrig.protocols.steps.patch_names import Patches
from labrig.protocols.steps.sample_pose import lights_out

#: Time to turn the sample in the dark.
TURNING_S = 20.0

Angle = Annotated[int, Field(ge=-85, le=85)]


class Isotropy(GlowSettings):
    """Settings of an isotropy test; `isotropy.yaml` is the commented example.

    Attributes
    ----------
    angles
        Angles in whole degrees by which the sample is turned against the camera, by hand and in the
        dark, for example `[20, 40]`. The straight view is photographed before and after all others.
    first
        Time from lamp off to the first photograph, for example `60 s`. The sample is turned before
        it.
    every
        Time between the begins of two photographs, for example `10 s`.
    frames
        Number of photographs at each angle.
    patch
        Position of the patches: `inside` of the sample at every angle, so that its radiance is
        measured, or `around` all of it with darkness about, so that its intensity is measured and
        divided by the cosine of the angle.
    patches
        Regions of interest by name: `[x, y, width, height]` in pixels, or all four as fractions of
        the frame.
    """

    protocol: Literal["isotropy"] = "isotropy"
    angles: tuple[Angle, ...] = Field((20, 40, 60, 80), min_length=1)
    first: DurationS = Field(60.0, gt=0)
    every: FramePeriod = 10.0
    frames: Count = Field(4, ge=2)
    patch: Literal["inside", "around"] = "inside"
    patches: Patches = Field({"sample": (0.48, 0.35, 0.04, 0.3)}, min_length=1)

    @model_validator(mode="after")
    def _turned(self) -> Self:
        if 0 in self.angles or len(set(self.angles)) < len(self.angles):
            raise ValueError(
                "expected every angle once and none of 0°, which is photographed before and after "
                f"all others anyway, got {list(self.angles)}"
            )
        return self

    @property
    def role(self) -> str:
        """Role of the frames of the glow."""
        return "isotropy"

    def times_s(self) -> Sequence[float]:
        """Return the start of each frame in seconds after lamp off."""
        return [self.first + number * self.every for number in range(self.frames)]

    def regions(self) -> Sequence[Region]:
        """Return the regions of the patches."""
        return list(self.patches.values())

    def units(self) -> Sequence[Unit]:
        """Return darks, metering, and every angle between two straight views."""
        units: list[Unit] = [DarkUnit(self), MeterUnit(self, self.charge)]
        previous = 0
        for name, angle in [
            ("before", 0),
            *((str(degrees), degrees) for degrees in self.angles),
            ("after", 0),
        ]:
            units.append(AngleUnit(self, f"angle-{name}", angle, previous))
            previous = angle
        return units


@dataclass(frozen=True)
class AngleUnit:
    """One charge at normal incidence; then the glow at an angle.

    Attributes
    ----------
    angle
        Angle of the sample against the camera's axis, in degrees.
    previous_angle
        Angle at which the unit before left the sample, in degrees.
    """

    protocol: Isotropy
    name: str
    angle: int
    previous_angle: int

    def run(self, session: Session) -> None:
        """Turn straight, charge, switch the lamp off, turn, photograph."""
        session.wait_until_warm("camera")
        schedule = metered_schedule(session, self.protocol, "meter")
        if self.previous_angle:
            session.ask(_turn(0, "it is charged the same way every time", 60.0))
        self.protocol.charge_sample(session, self.protocol.charge)
        lamp_off_s = session.clock.now()
        session.run_sequence(lights_out(session))
        if self.angle:
            by = duration_text(self.protocol.first)
            reason = (
                f"the glow is photographed {by} after lamp off, so in the dark and without delay"
            )
            session.ask(_turn(self.angle, reason, TURNING_S))
        first_s = lamp_off_s + self.protocol.first - session.clock.now()
        if first_s < 0:
            session.warn(
                f"turned {duration_text(-first_s)} after the planned time of the first frame; the "
                "straight views correct for the decay meanwhile (for more time, raise first:)"
            )
        late_s = max(first_s, 0.0) - self.protocol.first
        glow = [
            (time_s, TakeFrame(self.protocol.role, self.protocol.settings(exposure_s)))
            for time_s, exposure_s in schedule.frames()
        ]
        session.run_sequence([at(time_s + late_s, shoot) for time_s, shoot in glow])
        checks = self.protocol.checks(session, self.name)
        checks.require_decay(self.protocol.short_settings(session))


def _turn(angle: int, reason: str, duration_s: float) -> ManualStep:
    return ManualStep(
        f"turn the sample by {angle}° against the camera", reason, f"tilt {angle}", duration_s
    )
