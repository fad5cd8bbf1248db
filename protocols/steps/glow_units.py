"""Units before the glow of a charged sample is measured: darkness, and how long to expose."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from labrig.acquire import CAMERA, CameraOffers, ExposureSettings, Session, Shoot, at
from labrig.record import FrameRole

from .posing import check_seen, lights_out
from .resting import dark_frames
from .watching import Watcher

#: Charge before metering; a longer one glows brighter, which the metering's headroom allows for.
METER_CHARGE_S = 600.0


class MeteredProtocol(Protocol):
    """What a protocol says that photographs darkness, then meters a glow."""

    def settings(self, exposure_s: float) -> ExposureSettings:
        """Camera settings with that shutter time."""

    def dark_exposures_s(self, offers: CameraOffers) -> Sequence[float]:
        """Shutter time of each dark frame."""

    def meter_ladder(self, offers: CameraOffers) -> Sequence[tuple[float, float]]:
        """Begin after lamp off and shutter time of each metering frame."""

    def short_settings(self, session: Session) -> list[ExposureSettings]:
        """For a closer look at what clips."""

    def charge_sample(self, session: Session, duration_s: float) -> None:
        """Lamp on for that long, for its own warm-up at the least."""

    def watcher(self, session: Session, unit: str) -> Watcher:
        """Holds a unit's frames against what should have happened."""


@dataclass(frozen=True)
class DarkUnit:
    """Dark frames at the exposures to come, before anything glows."""

    protocol: MeteredProtocol
    name: str = "dark"

    def run(self, session: Session) -> None:
        """Warm the camera up, then photograph darkness."""
        session.wait_until_warm("camera")
        exposures_s = self.protocol.dark_exposures_s(session.rig[CAMERA].offers())
        exposures = [self.protocol.settings(exposure_s) for exposure_s in exposures_s]
        watcher = self.protocol.watcher(session, self.name)
        dark_frames(session, self.name, watcher.patches, exposures)
        watcher.insist_on_darkness(self.protocol.short_settings(session))


@dataclass(frozen=True)
class MeterUnit:
    """A shorter charge whose glow says how long to expose."""

    protocol: MeteredProtocol
    charge_s: float
    name: str = "meter"

    def run(self, session: Session) -> None:
        """Charge, lamp off, a ladder of exposures; for `grow`, then on along the decay."""
        session.wait_until_warm("camera")
        self.protocol.charge_sample(session, min(self.charge_s, METER_CHARGE_S))
        ladder = self.protocol.meter_ladder(session.rig[CAMERA].offers())
        check_seen(session, ladder[0][0])
        session.run_sequence(
            [
                *lights_out(session),
                *(
                    at(time_s, Shoot(FrameRole.METER, self.protocol.settings(exposure_s)))
                    for time_s, exposure_s in ladder
                ),
            ]
        )
        self.protocol.watcher(session, self.name).insist_on_glow(
            self.protocol.short_settings(session)
        )
