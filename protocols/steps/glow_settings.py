"""What protocols have in common that charge a sample and photograph its glow a few times."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from itertools import pairwise

from pydantic import Field

from labrig.acquire import CAMERA, CameraOffers, ExposureSettings, ProtocolModel, Session
from labrig.quantity import DurationS
from labrig.record import FrameRole
from labrig.region import Region

from .camera_settings import MARGIN_S, CameraSettings, dark_exposures_s
from .metering import DecayMeter, Look, Schedule, look
from .posing import charge
from .watching import Watcher

#: Shutter times of a metering's first frames, as shares of the longest.
LADDER: tuple[float, ...] = (1 / 4096, 1 / 512, 1 / 64, 1 / 8, 1)
#: Of the further ones, along the decay.
LATER = (1 / 16, 1)


class GlowSettings(ProtocolModel):
    """The keys of such a protocol, and the exposures that follow."""

    charge: DurationS = Field(600.0, gt=0)
    longest: DurationS = Field(30.0, gt=0)
    camera: CameraSettings = CameraSettings()

    @property
    @abstractmethod
    def purpose(self) -> str:
        """Of the frames of the glow."""

    @abstractmethod
    def times_s(self) -> Sequence[float]:
        """Begin of each frame, seconds after lamp off, rising."""

    @abstractmethod
    def regions(self) -> Sequence[Region]:
        """Where the glow is to be seen; the brightest decides."""

    def settings(self, exposure_s: float) -> ExposureSettings:
        """Camera settings with that shutter time."""
        return ExposureSettings(exposure_s, self.camera.iso, self.camera.f_number)

    def longest_exposures_s(self, offers: CameraOffers) -> list[float]:
        """Longest shutter time of each frame: it is over before the next one begins."""
        free_s = [
            min(later - earlier - offers.overhead_s - MARGIN_S, self.longest)
            for earlier, later in pairwise(self.times_s())
        ]
        return [offers.exposure_at_most(limit_s) for limit_s in (*free_s, self.longest)]

    def dark_exposures_s(self, offers: CameraOffers) -> list[float]:
        """Shutter time of each dark frame."""
        return dark_exposures_s(max(self.longest_exposures_s(offers)), offers)

    def meter_ladder(self, offers: CameraOffers) -> list[tuple[float, float]]:
        """Begin after lamp off and shutter time of each metering frame, to the last of the glow."""
        longest_s = max(self.longest_exposures_s(offers))
        pause_s = offers.overhead_s + MARGIN_S
        ladder: list[tuple[float, float]] = []
        at_s, shares = self.times_s()[0], LADDER
        while not ladder or at_s < self.times_s()[-1]:
            for share in shares:
                exposure_s = offers.exposure_at_most(longest_s * share)
                ladder.append((at_s, exposure_s))
                at_s += exposure_s + pause_s
            at_s, shares = at_s * 1.5, LATER
        return ladder

    def schedule(
        self, offers: CameraOffers, looks: Sequence[Look], warn: Callable[[str], None]
    ) -> Schedule:
        """Frames of the glow, as bright as a metering's `looks` let them be."""
        limits_s = self.longest_exposures_s(offers)
        times_s = self.times_s()
        wished = DecayMeter(looks).schedule(times_s, offers, max(limits_s), float("inf"), warn)
        exposures_s = map(min, wished.exposures_s, limits_s)
        return Schedule(tuple(times_s), tuple(exposures_s))

    def brightest_schedule(self, offers: CameraOffers) -> Schedule:
        """The most that `schedule` can come to."""
        return Schedule(tuple(self.times_s()), tuple(self.longest_exposures_s(offers)))

    def short_settings(self, session: Session) -> list[ExposureSettings]:
        """For a closer look at what clips."""
        ladder = self.meter_ladder(session.rig[CAMERA].offers())[:3]
        return [self.settings(exposure_s) for _, exposure_s in ladder]

    def watcher(self, session: Session, unit: str, metering: str = "meter") -> Watcher:
        """Holds a unit's frames against what should have happened, and what `metering` saw."""
        return Watcher(session, unit, self.regions(), None, self.purpose, metering)

    def charge_sample(self, session: Session, duration_s: float) -> None:
        """Lamp on for that long, for its own warm-up at the least."""
        charge(session, max(duration_s, session.rig.warm_up_s("lamp")))


def metered_schedule(session: Session, protocol: GlowSettings, metering: str) -> Schedule:
    """Shutter times of the glow, from what the unit `metering` saw of it."""
    offers = session.rig[CAMERA].offers()

    def decide() -> Schedule:
        frames = [frame for frame in session.frames(FrameRole.METER) if frame.unit == metering]
        looks = [look(frame, protocol.regions()) for frame in frames]
        return protocol.schedule(offers, looks, session.warn)

    return session.choose("exposure", decide, protocol.brightest_schedule(offers))
