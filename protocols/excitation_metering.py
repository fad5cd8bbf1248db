"""What comes before the charges of an excitation: darkness, and how long to expose."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.acquire import CAMERA, ByHand, Session, Shoot, at
from labrig.record import FrameRecord, FrameRole

from .excitation_settings import PLACES, ExcitationFrames, ExcitationSettings
from .steps.afterglow import dark_level
from .steps.album import Album
from .steps.charge_times import FloatArray
from .steps.darkness import levels
from .steps.metering import Look
from .steps.posing import charge, check_seen, face_camera, face_lamp, lights_out
from .steps.resting import dark_frames
from .steps.watching import Watcher

LVF_ON = ByHand(
    "lay the variable filter on the sample, between it and the lamp",
    "every place is then charged by light of another wavelength",
    "lvf on sample",
)
LVF_AWAY = ByHand(
    "take the variable filter away",
    "the lamp by itself charges the sample now",
    "lvf away",
)
FRESH = ByHand(
    "put in a fresh sample, one that has been in the dark for hours",
    "it takes the place of waiting until the glow is gone",
    "fresh sample",
)


@dataclass(frozen=True)
class ExcitationUnit:
    """What all units share."""

    protocol: ExcitationSettings
    album: Album

    def darks(self, session: Session) -> list[Look]:
        """One dark frame of each shutter time."""
        frames = {frame.exposure_s: frame for frame in session.frames(FrameRole.DARK)}
        return [self.album.look(frame) for frame in frames.values()]

    def rates(self, frame: FrameRecord, darks: Sequence[Look]) -> FloatArray:
        """(patches, places) along the strip, brightest channel above darkness, DN/s."""
        seen = self.album.look(frame)
        above = levels(seen) - dark_level(darks, frame.exposure_s)
        return np.asarray(above.max(axis=1) / frame.exposure_s).reshape(-1, PLACES)

    def rest(self, session: Session) -> None:
        """Darkness until hardly anything glows, or another sample."""
        rule = self.protocol.rest
        if self.protocol.samples > 1:
            session.ask(FRESH)
            return
        session.wait(rule.at_least, "resting in the dark")
        rested_s = rule.at_least
        exposure_s = max(
            self.protocol.longest_exposures_s(session.rig[CAMERA].offers(), self.protocol.duration)
        )
        look_now = Shoot(FrameRole.REST, self.protocol.settings(exposure_s))
        while True:
            face_camera(session)
            session.perform(look_now)
            face_lamp(session)
            dark = session.choose("dark again", lambda: self._is_dark(session), worst=False)
            left_s = rule.at_most - rested_s
            if dark or left_s <= 0:
                return
            session.wait(min(rule.check_every, left_s), "resting in the dark")
            rested_s += rule.check_every

    def _is_dark(self, session: Session) -> bool:
        """Whether the glow of every patch is low against that just after the last charge."""
        frames = [
            *session.frames(ExcitationFrames.STRIP),
            *session.frames(ExcitationFrames.BARE),
            *session.frames(FrameRole.METER),
        ]
        darks = self.darks(session)
        last_unit = max(frames, key=lambda frame: frame.start_time).unit
        after = [frame for frame in frames if frame.unit == last_unit]
        brightest = np.max([self.rates(frame, darks).max(axis=1) for frame in after], axis=0)
        now = self.rates(session.frames(FrameRole.REST)[-1], darks).max(axis=1)
        return bool((now < self.protocol.rest.below * brightest).all())


@dataclass(frozen=True)
class DarkUnit(ExcitationUnit):
    """Dark frames at the exposures to come, before anything glows."""

    name: str = "dark"

    def run(self, session: Session) -> None:
        """Warm the camera up, then photograph darkness."""
        session.wait_until_warm("camera")
        offers, regions = session.rig[CAMERA].offers(), self.protocol.regions()
        exposures_s = self.protocol.dark_exposures_s(offers)
        exposures = [self.protocol.settings(exposure_s) for exposure_s in exposures_s]
        dark_frames(session, self.name, regions, exposures)
        shorter = [self.protocol.settings(time_s) for _, time_s in self.protocol.ladder(offers)[:3]]
        Watcher(session, self.name, regions, None).insist_on_darkness(shorter)


@dataclass(frozen=True)
class _Meter(ExcitationUnit):
    """A charge whose glow says how long to expose."""

    def _meter(self, session: Session, unit: str, hand: ByHand, charge_s: float) -> None:
        session.wait_until_warm("camera")
        session.ask(hand)
        ladder = self.protocol.ladder(session.rig[CAMERA].offers())
        check_seen(session, ladder[0][0])
        charge(session, charge_s)
        session.run_sequence(
            [
                *lights_out(session),
                *(
                    at(time_s, Shoot(FrameRole.METER, self.protocol.settings(exposure_s)))
                    for time_s, exposure_s in ladder
                ),
            ]
        )
        shorter = [self.protocol.settings(exposure_s) for _, exposure_s in ladder[:3]]
        Watcher(session, unit, self.protocol.regions(), None).insist_on_glow(shorter)


@dataclass(frozen=True)
class StripMeter(_Meter):
    """Through the variable filter."""

    name: str = "strip-meter"

    def run(self, session: Session) -> None:
        """Lay the filter on, charge, a ladder of exposures."""
        self._meter(session, self.name, LVF_ON, self.protocol.first_charge)


@dataclass(frozen=True)
class BareMeter(_Meter):
    """Without the filter."""

    name: str = "bare-meter"

    def run(self, session: Session) -> None:
        """Take the filter away, charge, a ladder of exposures."""
        self.rest(session)
        self._meter(session, self.name, LVF_AWAY, self.protocol.bare[0])
