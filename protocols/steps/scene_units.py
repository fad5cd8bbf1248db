"""Units that photograph a steadily lit scene, and the darkness before."""

from dataclasses import dataclass

from labrig.acquire import CAMERA, Session, Shoot
from labrig.record import FrameRecord, FrameRole
from labrig.region import CENTRE

from .arrangement import Arrangement, left_by, light
from .still_life import StillLife
from .watching import Watcher


@dataclass(frozen=True)
class StillDarkUnit:
    """Dark frames at the exposures to come."""

    still_life: StillLife
    name: str = "dark"

    def run(self, session: Session) -> None:
        """Warm the camera up, then photograph darkness."""
        session.wait_until_warm("camera")
        scene = self.still_life
        exposures_s = scene.dark_exposures_s(session.rig[CAMERA].offers())
        for exposure_s in exposures_s:
            session.perform(Shoot(FrameRole.DARK, scene.settings(exposure_s)))
        Watcher(session, self.name, [CENTRE], None).insist_on_darkness(
            [scene.settings(exposure_s) for exposure_s in sorted(set(exposures_s))]
        )


@dataclass(frozen=True)
class SceneUnit:
    """A lit scene.

    Attributes
    ----------
    still_life
        How it is photographed.
    name, purpose
        Of the unit, and of its frames.
    wanted, before
        What lies where now, and in the unit before.
    why
        To arrange it.
    mercury_warm_up_s
        Of the lamp that the rig file does not know.
    """

    still_life: StillLife
    name: str
    purpose: str
    wanted: Arrangement
    before: Arrangement
    why: str
    mercury_warm_up_s: float = 0.0

    def run(self, session: Session) -> None:
        """Arrange, light, photograph, and see whether it shows what it should."""
        session.wait_until_warm("camera")
        self.arrange(session)
        light(session, self.warm_up_s(session))
        self.still_life.photograph(session, self.name, self.purpose, self.wanted.lamp)
        self.check(session)

    def arrange(self, session: Session) -> None:
        """Have everything put in its place."""
        self.wanted.set_up(session, left_by(self.before, session), self.why)

    def warm_up_s(self, session: Session) -> float:
        """Until the lamp in use is steady."""
        if self.wanted.lamp == "mercury":
            return self.mercury_warm_up_s
        return session.rig.warm_up_s("lamp")

    def check(self, session: Session) -> None:
        """Refuse pictures of something else; here none are."""

    def own(self, session: Session) -> list[FrameRecord]:
        """Its frames."""
        return frames_of(session, self.purpose, self.name)


def frames_of(session: Session, purpose: str, unit: str) -> list[FrameRecord]:
    """Frames of one unit."""
    return [frame for frame in session.frames(purpose) if frame.unit == unit]
