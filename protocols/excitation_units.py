"""The charges of an excitation: through the filter for longer and longer, then without it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.acquire import CAMERA, Session, Shoot, at
from labrig.record import FrameRecord, FrameRole

from .excitation_metering import ExcitationUnit
from .excitation_settings import ExcitationFrames, UnitKind
from .steps.charge_times import FloatArray, most_telling_s, still_grows
from .steps.metering import DecayMeter, Schedule
from .steps.posing import charge, check_seen, lights_out

#: Frames of a charge are made for it to glow at most this much brighter than the one looked at.
HEADROOM = 2.0
#: A growing exposure saves counts late in a decay.
EXPOSURES_GROW = 16.0


@dataclass(frozen=True)
class _Charged(ExcitationUnit):
    """One charge and the decay after it."""

    def _charge(self, session: Session, purpose: str, charge_s: float, lasting_s: float) -> None:
        self.rest(session)
        offers = session.rig[CAMERA].offers()
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
        protocol, offers = self.protocol, session.rig[CAMERA].offers()
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
        return _lit_s(session, meter), [
            f for f in session.frames(FrameRole.METER) if f.unit == meter
        ]

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
        darks = self.darks(session)
        return [one[0] for one in done], np.array(
            [self.rates(frames[0], darks) for _, frames in done]
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
        return UnitKind.STRIP.numbered(self.number)

    def run(self, session: Session) -> None:
        """Charge and photograph, or find that it is enough."""

        def grows() -> bool:
            done = self._done(session, ExcitationFrames.STRIP)
            return len(done) == self.number - 1 and still_grows(
                self._grown(session, done)[1], self.protocol.growth
            )

        if self.number > 2 and not session.choose("the glow still grows", grows, worst=True):
            return
        session.wait_until_warm("camera")
        charge_s = self.protocol.doubled_s(self.number)
        self._charge(session, ExcitationFrames.STRIP, charge_s, self.protocol.duration)


@dataclass(frozen=True)
class RefiningUnit(_Charged):
    """Through the filter, for as long as tells most."""

    number: int

    @property
    def name(self) -> str:
        """`refine-1`, `refine-2`, …"""
        return UnitKind.REFINE.numbered(self.number)

    def run(self, session: Session) -> None:
        """Charge and photograph."""
        session.wait_until_warm("camera")

        def decide() -> float:
            return most_telling_s(
                *self._grown(session, self._done(session, ExcitationFrames.STRIP))
            )

        worst_s = self.protocol.doubled_s(self.protocol.at_most)
        charge_s = session.choose("charge for so many seconds", decide, worst_s)
        self._charge(session, ExcitationFrames.STRIP, charge_s, self.protocol.duration)


@dataclass(frozen=True)
class BareUnit(_Charged):
    """Under the lamp itself; after the last one, a longer decay."""

    number: int

    @property
    def name(self) -> str:
        """`bare-1`, `bare-2`, …"""
        return UnitKind.BARE.numbered(self.number)

    def run(self, session: Session) -> None:
        """Charge and photograph."""
        session.wait_until_warm("camera")
        protocol = self.protocol
        last = self.number == len(protocol.bare)
        lasting_s = protocol.last_decay if last else protocol.duration
        self._charge(session, ExcitationFrames.BARE, protocol.bare[self.number - 1], lasting_s)
