"""What an excitation consists of: darks, metering, charges through the filter and without it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.acquire import ByHand, Session, Shoot, at
from labrig.record import FrameRecord

from .excitation_settings import ExcitationSettings
from .steps.afterglow import dark_level
from .steps.album import Album
from .steps.charge_times import FloatArray, most_telling_s, still_grows
from .steps.darkness import levels
from .steps.metering import DecayMeter, Look, Schedule
from .steps.posing import charge, check_seen, face_camera, face_lamp, lights_out
from .steps.resting import dark_frames
from .steps.watching import Watcher

#: Frames of a charge are made for it to glow at most this much brighter than the one looked at.
HEADROOM = 2.0
#: A growing exposure saves counts late in a decay.
EXPOSURES_GROW = 16.0

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
class _Own:
    """What all units share."""

    protocol: ExcitationSettings
    album: Album

    def _darks(self, session: Session) -> list[Look]:
        frames = {frame.exposure_s: frame for frame in session.frames("dark")}
        return [self.album.look(frame) for frame in frames.values()]

    def _rates(self, frame: FrameRecord, darks: Sequence[Look]) -> FloatArray:
        """(places,) of the strip, brightest channel above darkness, DN/s."""
        seen = self.album.look(frame)
        above = levels(seen) - dark_level(darks, frame.exposure_s)
        return np.asarray(above.max(axis=1) / frame.exposure_s)

    def _rest(self, session: Session) -> None:
        """Darkness until hardly anything glows, or another sample."""
        rule = self.protocol.rest
        if self.protocol.samples > 1:
            session.ask(FRESH)
            return
        session.wait(rule.at_least, "resting in the dark")
        rested_s = rule.at_least
        exposure_s = max(
            self.protocol.longest_exposures_s(session.rig.camera.offers(), self.protocol.duration)
        )
        look_now = Shoot("rest", self.protocol.settings(exposure_s))
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
        """Whether the glow is low against that just after the last charge."""
        frames = [*session.frames("strip"), *session.frames("bare"), *session.frames("meter")]
        darks = self._darks(session)
        last_unit = max(frames, key=lambda frame: frame.start_time).unit
        after = [frame for frame in frames if frame.unit == last_unit]
        brightest = max(float(self._rates(frame, darks).max()) for frame in after)
        now = float(self._rates(session.frames("rest")[-1], darks).max())
        return now < self.protocol.rest.below * brightest


@dataclass(frozen=True)
class DarkUnit(_Own):
    """Dark frames at the exposures to come, before anything glows."""

    name: str = "dark"

    def run(self, session: Session) -> None:
        """Warm the camera up, then photograph darkness."""
        session.wait_until_warm("camera")
        offers, sites = session.rig.camera.offers(), self.protocol.strip()
        exposures_s = self.protocol.dark_exposures_s(offers)
        exposures = [self.protocol.settings(exposure_s) for exposure_s in exposures_s]
        dark_frames(session, self.name, sites, exposures)
        shorter = [self.protocol.settings(time_s) for _, time_s in self.protocol.ladder(offers)[:3]]
        Watcher(session, self.name, sites, None).insist_on_darkness(shorter)


@dataclass(frozen=True)
class _Meter(_Own):
    """A charge whose glow says how long to expose."""

    def _meter(self, session: Session, unit: str, hand: ByHand, charge_s: float) -> None:
        session.wait_until_warm("camera")
        session.ask(hand)
        ladder = self.protocol.ladder(session.rig.camera.offers())
        check_seen(session, ladder[0][0])
        charge(session, charge_s)
        session.run_sequence(
            [
                *lights_out(session),
                *(
                    at(time_s, Shoot("meter", self.protocol.settings(exposure_s)))
                    for time_s, exposure_s in ladder
                ),
            ]
        )
        shorter = [self.protocol.settings(exposure_s) for _, exposure_s in ladder[:3]]
        Watcher(session, unit, self.protocol.strip(), None).insist_on_glow(shorter)


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
        self._rest(session)
        self._meter(session, self.name, LVF_AWAY, self.protocol.bare[0])


@dataclass(frozen=True)
class _Charged(_Own):
    """One charge and the decay after it."""

    def _charge(
        self, session: Session, unit: str, purpose: str, charge_s: float, lasting_s: float
    ) -> None:
        self._rest(session)
        offers = session.rig.camera.offers()
        schedule = self._schedule(session, purpose, charge_s, lasting_s)
        longest_s = self.protocol.longest_exposures_s(offers, lasting_s)
        check_seen(session, self.protocol.first)
        charge(session, charge_s)
        session.run_sequence(
            [
                *lights_out(session),
                *(
                    at(time_s, Shoot(purpose, self.protocol.settings(min(exposure_s, most_s))))
                    for (time_s, exposure_s), most_s in zip(
                        schedule.frames(), longest_s, strict=True
                    )
                ),
            ]
        )

    def _schedule(
        self, session: Session, purpose: str, charge_s: float, lasting_s: float
    ) -> Schedule:
        """Exposures by what was seen after the longest charge like this one, else by the meter."""
        protocol, offers = self.protocol, session.rig.camera.offers()
        times_s = protocol.frame_times_s(lasting_s)
        longest_s = max(protocol.longest_exposures_s(offers, lasting_s))

        def decide() -> Schedule:
            looked_s, frames = self._looked_at(session, purpose)
            found = DecayMeter([self.album.look(frame) for frame in frames]).schedule(
                times_s, offers, longest_s, EXPOSURES_GROW, session.warn
            )
            shorter = max(charge_s / looked_s / HEADROOM, 1.0)
            exposures_s = [offers.exposure_at_most(one_s / shorter) for one_s in found.exposures_s]
            return Schedule(found.times_s, tuple(exposures_s))

        return session.choose("exposure", decide, Schedule.constant(times_s, longest_s))

    def _looked_at(self, session: Session, purpose: str) -> tuple[float, list[FrameRecord]]:
        """Charge time and frames of the longest charge of the kind."""
        done = self._done(session, purpose)
        if done:
            return max(done, key=lambda one: one[0])
        meter = f"{purpose}-meter"
        return _lit_s(session, meter), [f for f in session.frames("meter") if f.unit == meter]

    def _done(self, session: Session, purpose: str) -> list[tuple[float, list[FrameRecord]]]:
        """Charge time and frames of every charge of the kind so far."""
        units: dict[str, list[FrameRecord]] = {}
        for frame in session.frames(purpose):
            units.setdefault(frame.unit, []).append(frame)
        return [(_lit_s(session, unit), frames) for unit, frames in units.items()]

    def _grown(
        self, session: Session, done: Sequence[tuple[float, list[FrameRecord]]]
    ) -> tuple[list[float], FloatArray]:
        """Charge times, and the glow of every place in the first frame after each."""
        darks = self._darks(session)
        return [one[0] for one in done], np.array(
            [self._rates(frames[0], darks) for _, frames in done]
        )


def _lit_s(session: Session, unit: str) -> float:
    """For how long the lamp shone in a unit."""
    times_s = [action.start_time for action in session.actions("lamp") if action.unit == unit]
    return times_s[1] - times_s[0]


@dataclass(frozen=True)
class DoublingUnit(_Charged):
    """Through the filter, twice as long as the one before, unless the glow has stopped growing."""

    number: int

    @property
    def name(self) -> str:
        """`strip-1`, `strip-2`, …"""
        return f"strip-{self.number}"

    def run(self, session: Session) -> None:
        """Charge and photograph, or find that it is enough."""

        def grows() -> bool:
            done = self._done(session, "strip")
            return len(done) == self.number - 1 and still_grows(
                self._grown(session, done)[1], self.protocol.growth
            )

        if self.number > 2 and not session.choose("the glow still grows", grows, worst=True):
            return
        session.wait_until_warm("camera")
        charge_s = self.protocol.doubled_s(self.number)
        self._charge(session, self.name, "strip", charge_s, self.protocol.duration)


@dataclass(frozen=True)
class RefiningUnit(_Charged):
    """Through the filter, for as long as tells most."""

    number: int

    @property
    def name(self) -> str:
        """`refine-1`, `refine-2`, …"""
        return f"refine-{self.number}"

    def run(self, session: Session) -> None:
        """Charge and photograph."""
        session.wait_until_warm("camera")

        def decide() -> float:
            return most_telling_s(*self._grown(session, self._done(session, "strip")))

        worst_s = self.protocol.doubled_s(self.protocol.at_most)
        charge_s = session.choose("charge for so many seconds", decide, worst_s)
        self._charge(session, self.name, "strip", charge_s, self.protocol.duration)


@dataclass(frozen=True)
class BareUnit(_Charged):
    """Under the lamp itself; after the last one, a longer decay."""

    number: int

    @property
    def name(self) -> str:
        """`bare-1`, `bare-2`, …"""
        return f"bare-{self.number}"

    def run(self, session: Session) -> None:
        """Charge and photograph."""
        session.wait_until_warm("camera")
        protocol = self.protocol
        last = self.number == len(protocol.bare)
        lasting_s = protocol.last_decay if last else protocol.duration
        self._charge(session, self.name, "bare", protocol.bare[self.number - 1], lasting_s)
