"""Photographs of a lit card over a while."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from pydantic import Field

from labrig.acquire import (
    CAMERA,
    LAMP_OFF,
    LAMP_ON,
    ExposureSettings,
    ProtocolModel,
    Session,
    Shoot,
    Unit,
)
from labrig.quantity import Count, DurationS
from labrig.region import CENTRE, Region


class LampDrift(ProtocolModel):
    """Keys of the protocol file."""

    protocol: Literal["lamp_drift"] = "lamp_drift"
    frames: Count = Field(12, ge=3)
    every: DurationS = Field(10.0, gt=0)
    exposure: DurationS = Field(0.01, gt=0)
    region: Region = CENTRE

    def units(self) -> Sequence[Unit]:
        """All in one go."""
        return [WatchUnit(self)]


@dataclass(frozen=True)
class WatchUnit:
    """The lamp on, photographed again and again, and off."""

    protocol: LampDrift
    name: str = "watch"

    def run(self, session: Session) -> None:
        """Do it."""
        protocol = self.protocol
        session.wait_until_warm("camera")
        offers = session.rig[CAMERA].offers()
        settings = ExposureSettings(offers.exposure_at_most(protocol.exposure), 100, 4.0)
        session.perform(LAMP_ON)
        for _ in range(protocol.frames):
            session.wait(protocol.every, "lamp burns")
            session.perform(Shoot("lit", settings))
        session.perform(LAMP_OFF)
