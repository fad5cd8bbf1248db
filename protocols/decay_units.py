"""What a decay consists of: dark frames, a metered charge, charge and decay, daylight."""

from dataclasses import dataclass
from enum import StrEnum

from labrig.acquire import CAMERA, LAMP_ON, Session, Shoot, at
from labrig.quantity import duration_text
from labrig.record import FrameRole

from .decay_settings import DecaySettings
from .steps.metering import Schedule, glow, look
from .steps.posing import check_seen, face_lamp, has_door, lights_out


class DecayFrames(StrEnum):
    """The glow between two charges, to see whether it still grows."""

    PLATEAU = "plateau"


#: Shutter times of the daylight photograph: one of them is right whatever the lamp.
DAYLIGHT_EXPOSURES_S = (1 / 4096, 1 / 512, 1 / 64, 1 / 8)
LAMP_SETTLES_S = 5.0


@dataclass(frozen=True)
class DecayUnit:
    """One charge and the decay after it, exposed as the unit `metering` found."""

    protocol: DecaySettings
    name: str
    metering: str = "meter"

    def run(self, session: Session) -> None:
        """Charge, lamp off, one frame every `every` seconds."""
        session.wait_until_warm("camera")
        schedule = self._schedule(session)
        check_seen(session, self.protocol.first)
        self._charge(session, schedule.exposures_s[0])
        session.run_sequence(
            [
                *lights_out(session),
                *(
                    at(time_s, Shoot(FrameRole.DECAY, self.protocol.settings(exposure_s)))
                    for time_s, exposure_s in schedule.frames()
                ),
            ]
        )
        watcher = self.protocol.watcher(session, self.name, self.metering)
        watcher.tell_of_delays(schedule.times_s)
        watcher.insist_on_decay(self.protocol.short_settings(session))

    def _schedule(self, session: Session) -> Schedule:
        protocol, offers = self.protocol, session.rig[CAMERA].offers()
        regions = list(protocol.patches.values())

        def decide() -> Schedule:
            frames = [one for one in session.frames(FrameRole.METER) if one.unit == self.metering]
            looks = [look(frame, regions) for frame in frames]
            return protocol.schedule(offers, looks, session.warn)

        if isinstance(protocol.exposure, float):
            return protocol.schedule(offers, [], session.warn)
        longest_s = protocol.longest_exposure_s(offers)
        worst = Schedule.constant(protocol.frame_times_s(), longest_s)
        return session.choose("exposure", decide, worst)

    def _charge(self, session: Session, exposure_s: float) -> None:
        if isinstance(self.protocol.charge, float):
            self.protocol.charge_sample(session, self.protocol.charge)
            return
        rule = self.protocol.plateau
        self.protocol.charge_sample(session, rule.check_every)
        charged_s = rule.check_every
        while charged_s < rule.at_most:
            look = Shoot(DecayFrames.PLATEAU, self.protocol.settings(exposure_s))
            session.run_sequence([*lights_out(session), at(self.protocol.first, look)])
            face_lamp(session)
            session.perform(LAMP_ON)
            if session.choose("plateau reached", lambda: self._level(session), worst=False):
                session.wait(LAMP_SETTLES_S, "lamp settles, charge topped up")
                return
            session.wait(rule.check_every, "charging")
            charged_s += rule.check_every
        session.warn(
            f"the glow still grows after {duration_text(rule.at_most)} of charge; amplitudes are "
            "below saturation (raise plateau.at_most)"
        )

    def _level(self, session: Session) -> bool:
        """Whether every patch grew by less than the rule allows since the last look."""
        looks = [frame for frame in session.frames(DecayFrames.PLATEAU) if frame.unit == self.name]
        if len(looks) < 2:
            return False
        before, now = (
            [glow(frame.path, region) for region in self.protocol.patches.values()]
            for frame in looks[-2:]
        )
        limit = 1 + self.protocol.plateau.growth
        return all(new <= old * limit for old, new in zip(before, now, strict=True))


@dataclass(frozen=True)
class DaylightUnit:
    """What the samples look like under the lamp."""

    protocol: DecaySettings
    name: str = "daylight"

    def run(self, session: Session) -> None:
        """Lamp on, a ladder of short exposures, lamp off."""
        if has_door(session):
            session.warn("no daylight photograph: behind a door the lamp lights the sample unseen")
            return
        offers = session.rig[CAMERA].offers()
        session.perform(LAMP_ON)
        session.wait(LAMP_SETTLES_S, "lamp settles")
        under_lamp = [
            self.protocol.settings(offers.exposure_at_most(wanted_s))
            for wanted_s in DAYLIGHT_EXPOSURES_S
        ]
        for settings in under_lamp:
            session.perform(Shoot(FrameRole.DAYLIGHT, settings))
        self.protocol.watcher(session, self.name).switch_off(under_lamp)
