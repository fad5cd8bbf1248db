"""Angular dependence of re-radiation: a yarn under a light that turns, or a fabric on a sphere.

After sections 3.2 and 3.3 of the thesis: light and camera 30° to 105° apart about a vertical and a
horizontal yarn; and one view of a sphere, which shows all angles of incidence at once.
"""

import random
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import (
    LEDS,
    LEDS_OFF,
    LedSwitch,
    ManualStep,
    ProtocolModel,
    RigFile,
    Session,
    TakeFrame,
    Unit,
)
from labrig.foundation.errors import ProtocolError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import Count, DurationS
from labrig.foundation.region import Region
from labrig.protocols.steps.bracketing import Bracketing
from labrig.protocols.steps.camera_settings import CameraSettings
from labrig.protocols.steps.led_scenes import LedNames


class AngularFrames(StrEnum):
    """Roles of frames of a view with the LED on and off."""

    VIEW = "angular-view"
    OFF = "angular-off"


Angle = Annotated[int, Field(ge=10, le=150)]
Direction = Literal["vertical", "horizontal"]
Part = Literal["re-radiated", "reflected"]
Coordinate = Annotated[float, Field(ge=0, le=1)]

#: Angle between light and camera at which a sphere is seen.
SPHERE_ANGLE_DEG = 45
#: Least number of repositionings from which scatter is measured.
MIN_REPOSITIONINGS = 3


class Circle(FrozenModel):
    """Outline of the sphere in the frame.

    Attributes
    ----------
    centre
        Centre of the sphere as fractions of the frame's width and height, for example `[0.5, 0.5]`.
    radius
        Radius of the sphere as a fraction of the frame's width, for example `0.2`.
    """

    centre: tuple[Coordinate, Coordinate]
    radius: Annotated[float, Field(gt=0, le=1)]


class SphereLight(FrozenModel):
    """Light on the sphere.

    Attributes
    ----------
    side
        Side of the frame from which the light comes.
    angle
        Angle between light and camera in degrees, seen from the sphere's centre.
    distance_radii
        Distance of the LED from the sphere's centre in radii of the sphere.
    """

    side: Literal["left", "right", "above", "below"] = "left"
    angle: Annotated[float, Field(ge=10, le=80)] = float(SPHERE_ANGLE_DEG)
    distance_radii: Annotated[float, Field(ge=2, le=1000)] = 10.0


@dataclass(frozen=True)
class Pose:
    """One view: the sample put in, and lit.

    Attributes
    ----------
    unit
        Name of the view's unit.
    led
        Name of the LED.
    step
        Step by hand that puts the sample in.
    angle_deg
        Angle between light and camera in degrees.
    direction
        Direction of the yarn; empty for a sphere.
    part
        Part of the light that is of interest under this LED.
    """

    unit: str
    led: str
    step: ManualStep
    angle_deg: int
    direction: str = ""
    part: Part = "re-radiated"


class AngularFluorescence(ProtocolModel):
    """Settings of a test whether re-radiation depends on angle.

    `angular_fluorescence.yaml` is the commented example.

    Attributes
    ----------
    shape
        Shape of the sample: a `yarn` under a light that is turned about it, or a fabric on a
        `sphere`.
    leds
        Names of the exciting LEDs in the rig file, for example `[365 nm]`. Best is one
        whose own light the camera does not see.
    reflected_led
        Name of an LED whose light excites nothing, so that the reflected part is compared, too;
        null: none. For a sphere only.
    channels
        Channels of the camera that see re-radiated light, for example `[R]`; null: those of which
        the reflected light is at most 5 %.
    angles
        Angles between light and camera in whole degrees, for a yarn. The first one is also
        photographed before and after all others.
    directions
        Directions of the yarn, for example `[vertical]`.
    repositionings
        Number of times that the sample is put in anew at each angle, or as a sphere; its scatter is
        measured by that.
    region
        Region that lies inside of the yarn at every angle, or that contains the sphere:
        `[x, y, width, height]` in pixels, or all four as fractions of the frame.
    circle
        Outline of the sphere; null: it is found in each view.
    light
        Direction and distance of the light on a sphere.
    camera
        Sensitivity and aperture of the camera.
    longest
        Longest exposure, for example `8 s`.
    repeats
        Number of photographs of each view.
    order_seed
        Seed of the order of the angles, which is shuffled in each round.
    """

    protocol: Literal["angular_fluorescence"] = "angular_fluorescence"
    shape: Literal["yarn", "sphere"] = "yarn"
    leds: LedNames = ("365 nm",)
    reflected_led: str | None = None
    channels: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    angles: tuple[Angle, ...] = Field((30, 45, 60, 75, 90, 105), min_length=2)
    directions: tuple[Direction, ...] = Field(("vertical", "horizontal"), min_length=1)
    repositionings: Count = Field(4, ge=MIN_REPOSITIONINGS)
    region: Region = (0.1, 0.12, 0.3, 0.3)
    circle: Circle | None = None
    light: SphereLight = SphereLight()
    camera: CameraSettings = CameraSettings(iso=100)
    longest: DurationS = Field(8.0, gt=0)
    repeats: Count = Field(2, ge=1)
    order_seed: Count = Field(1, ge=0)

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        for name, values in (("angle", self.angles), ("direction", self.directions)):
            if len(set(values)) < len(values):
                raise ValueError(f"expected every {name} once, got {list(values)}")
        if self.reflected_led is not None and self.shape != "sphere":
            raise ValueError("expected 'reflected_led' for 'shape: sphere' only")
        if self.reflected_led in self.leds:
            raise ValueError(f"expected 'reflected_led' not among 'leds', got {self.reflected_led}")
        return self

    def resolved_for(self, rig: RigFile) -> Self:
        """Refuse a rig whose LEDs shine on a sphere from another angle than is told here."""
        angles = rig.optics.angles_deg
        if self.shape == "sphere" and angles is not None and sum(angles) != self.light.angle:
            raise ProtocolError(
                f"light.angle: expected {sum(angles)} degrees between light and camera, which is "
                f"the rig's 'geometry: {rig.optics.geometry}', got {self.light.angle:g}"
            )
        return self

    @property
    def bracketing(self) -> Bracketing:
        """Bracketing with which views are metered and photographed."""
        return Bracketing(self.camera, self.longest, self.repeats, 1)

    def poses(self) -> Sequence[Pose]:
        """Return all views in order."""
        if self.shape == "sphere":
            parts: list[tuple[str, Part]] = [(led, "re-radiated") for led in self.leds]
            if self.reflected_led is not None:
                parts.append((self.reflected_led, "reflected"))
            return [
                Pose(f"{led} {turn}", led, _SPHERE, SPHERE_ANGLE_DEG, part=part)
                for led, part in parts
                for turn in range(1, self.repositionings + 1)
            ]
        return [
            Pose(
                f"{led} {direction} {angle}° {turn}", led, _yarn(direction, angle), angle, direction
            )
            for led in self.leds
            for direction in self.directions
            for turn, angle in self._rounds()
        ]

    def _rounds(self) -> Sequence[tuple[str, int]]:
        """Return name of the round and angle of the views of one yarn, shuffled in each round."""
        order = random.Random(self.order_seed)
        views = [("before", self.angles[0])]
        for turn in range(1, self.repositionings + 1):
            angles = list(self.angles)
            order.shuffle(angles)
            views += [(str(turn), angle) for angle in angles]
        return [*views, ("after", self.angles[0])]

    @property
    def picture_frames(self) -> Collection[str]:
        """Role of the frames that show the sample under the LED."""
        return (AngularFrames.VIEW,)

    def units(self) -> Sequence[Unit]:
        """Return metering under each LED, then all views, then the bench put back."""
        poses = self.poses()
        first = {pose.led: pose for pose in reversed(poses)}
        brackets = self.bracketing
        units: list[Unit] = [
            AngularMeterUnit(brackets, pose) for led, pose in reversed(first.items())
        ]
        units += [ViewUnit(brackets, pose) for pose in poses]
        return [*units, LightBackUnit()] if self.shape == "yarn" else units


_SPHERE = ManualStep(
    "put the sphere in anew, turned a little about itself",
    "the scatter from view to view is the uncertainty of each view",
    "sphere anew",
)


def _yarn(direction: str, angle: int) -> ManualStep:
    return ManualStep(
        f"put the yarn in anew, {direction}, and turn the light to {angle}° from the camera",
        "the scatter between views of one angle is the uncertainty of each view",
        f"yarn {direction} {angle}",
    )


def _metering(led: str) -> str:
    return f"meter {led}"


def _light(session: Session, led: str) -> None:
    session.perform(LedSwitch(led))
    session.wait(session.rig[LEDS].settling_s(led), f"the {led} LED settles")


@dataclass(frozen=True)
class AngularMeterUnit:
    """Metering under one LED, in the first pose; all views have the same exposure."""

    bracketing: Bracketing
    pose: Pose

    @property
    def name(self) -> str:
        """Name of the unit."""
        return _metering(self.pose.led)

    def run(self, session: Session) -> None:
        """Put the sample in, light the LED, meter."""
        session.wait_until_warm("camera")
        session.ask(self.pose.step)
        _light(session, self.pose.led)
        self.bracketing.meter(session, self.name)
        session.perform(LEDS_OFF)
        _exposure_s(session, self.bracketing, self.pose.led)


@dataclass(frozen=True)
class ViewUnit:
    """One view: the sample put in anew, photographed with the LED on and off."""

    bracketing: Bracketing
    pose: Pose

    @property
    def name(self) -> str:
        """Name of the unit."""
        return self.pose.unit

    def run(self, session: Session) -> None:
        """Put the sample in, light the LED, photograph; then photograph what is left without it."""
        session.wait_until_warm("camera")
        session.ask(self.pose.step)
        exposure_s = _exposure_s(session, self.bracketing, self.pose.led)
        settings = self.bracketing.settings(exposure_s)
        _light(session, self.pose.led)
        for _ in range(self.bracketing.repeats):
            session.perform(TakeFrame(AngularFrames.VIEW, settings))
        session.perform(LEDS_OFF)
        for _ in range(self.bracketing.repeats):
            session.perform(TakeFrame(AngularFrames.OFF, settings))


@dataclass(frozen=True)
class LightBackUnit:
    """The light put back; a unit of its own, so that nothing is measured again for it."""

    name: str = "put-back"

    def run(self, session: Session) -> None:
        """Have the light turned back."""
        session.ask(
            ManualStep(
                "turn the light back to its usual place",
                "the next measurement finds the bench as usual",
                "light back",
            )
        )


def _exposure_s(session: Session, bracketing: Bracketing, led: str) -> float:
    return session.decide(
        "exposure",
        lambda: bracketing.metered_s(session, _metering(led), led),
        bracketing.longest_s,
    )
