"""The steps on the bench: a charge, and photographs of the glow after it."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from pydantic import Field

from labrig.acquire import (
    CAMERA,
    LAMP_OFF,
    LAMP_ON,
    ExposureSettings,
    ProtocolModel,
    Session,
    TakeFrame,
    Unit,
    at,
)
from labrig.foundation.quantity import Count, DurationS
from labrig.foundation.region import CENTRE, Region


class MyProtocolFrames(StrEnum):
    """Role of each photograph, by which the analysis finds it."""

    GLOW = "glow"


class MyProtocol(ProtocolModel):
    """Keys of the protocol file; editors show what stands here.

    Attributes
    ----------
    charge
        Time for which the lamp is on, for example `10 s`.
    frames
        Number of photographs.
    every
        Time between the begins of two photographs, for example `5 s`.
    exposure
        Longest exposure time; the camera's nearest one below is used.
    region
        Region of the sample in the frame, `[x, y, width, height]`.
    """

    protocol: Literal["my_protocol"] = "my_protocol"
    charge: DurationS = Field(10.0, gt=0)
    frames: Count = Field(5, ge=2)
    every: DurationS = Field(5.0, gt=0)
    exposure: DurationS = Field(1.0, gt=0)
    region: Region = CENTRE

    def units(self) -> Sequence[Unit]:
        """Return the units of a run: each is done completely or not at all, and then once more."""
        return [GlowUnit(self)]


@dataclass(frozen=True)
class GlowUnit:
    """The lamp on and off, and all photographs."""

    protocol: MyProtocol
    name: str = "glow"

    def run(self, session: Session) -> None:
        """Do the unit; a plan runs this, too, with devices that only take notes.

        Use devices through `session` alone: it records, waits, and can be interrupted.
        """
        protocol = self.protocol
        session.wait_until_warm("camera")
        capabilities = session.rig[CAMERA].capabilities()
        settings = ExposureSettings(capabilities.exposure_at_most(protocol.exposure), 400, 4.0)
        session.perform(LAMP_ON)
        session.wait(protocol.charge, "charging")
        # A sequence keeps to the times since its start, whatever each photograph takes.
        shots = [
            at(1.0 + number * protocol.every, TakeFrame(MyProtocolFrames.GLOW, settings))
            for number in range(protocol.frames)
        ]
        session.run_sequence([at(0.0, LAMP_OFF), *shots])
