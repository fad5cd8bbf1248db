"""A protocol that photographs a grey card under the lamp again and again."""

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
)
from labrig.foundation.quantity import Count, DurationS
from labrig.foundation.region import CENTRE, Region


class DriftFrames(StrEnum):
    """Role of the protocol's frames."""

    CARD = "card"


class LampDrift(ProtocolModel):
    """Keys of the protocol file.

    Attributes
    ----------
    frames
        Number of photographs.
    every
        Time from the end of one photograph to the start of the next, for example `10 s`.
    exposure
        Longest exposure time; the camera's nearest one below is used.
    region
        Region of the card in the frame, `[x, y, width, height]`.
    """

    protocol: Literal["lamp_drift"] = "lamp_drift"
    frames: Count = Field(12, ge=3)
    every: DurationS = Field(10.0, gt=0)
    exposure: DurationS = Field(0.01, gt=0)
    region: Region = CENTRE

    def units(self) -> Sequence[Unit]:
        """Return the units of a run; each is done wholly or not at all."""
        return [CardUnit(self)]


@dataclass(frozen=True)
class CardUnit:
    """The lamp on, all photographs, and the lamp off."""

    protocol: LampDrift
    name: str = "card"

    def run(self, session: Session) -> None:
        """Photograph the card; a plan runs this, too, with devices that only take notes."""
        protocol = self.protocol
        session.wait_until_warm("camera")
        capabilities = session.rig[CAMERA].capabilities()
        settings = ExposureSettings(capabilities.exposure_at_most(protocol.exposure), 100, 4.0)
        session.perform(LAMP_ON)
        for _ in range(protocol.frames):
            session.wait(protocol.every, "lamp burns")
            session.perform(TakeFrame(DriftFrames.CARD, settings))
        session.perform(LAMP_OFF)
