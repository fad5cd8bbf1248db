"""What a person arranges on the bench before a unit, and how that is asked for."""

from dataclasses import dataclass
from typing import Literal

from labrig.acquire import LAMP, LAMP_OFF, LAMP_ON, ByHand, Session
from labrig.record import FrameRole

from .posing import face_lamp

Stage = Literal["sample", "grey card"]
LvfPlace = Literal["away", "before camera", "on sample"]
LampKind = Literal["halogen", "mercury"]

_STAGE = {
    "sample": "take the card away, so that the sample lies in its place",
    "grey card": "lay the grey card where lamp and camera both see it",
}
_LVF = {
    "away": "take the variable filter out",
    "before camera": "put the variable filter before the camera",
    "on sample": "put the variable filter between lamp and sample",
}


@dataclass(frozen=True)
class Arrangement:
    """What lies where; as it stands here a bench is before and after every protocol.

    Attributes
    ----------
    stage
        What lamp and camera see.
    lvf
        Where the linear variable filter is.
    filter
        Name of the colour filter before the lamp.
    lamp
        Which one the relay switches.
    """

    stage: Stage = "sample"
    lvf: LvfPlace = "away"
    filter: str | None = None
    lamp: LampKind = "halogen"

    def set_up(self, session: Session, before: "Arrangement | None", why: str) -> None:
        """Have done by hand what differs from `before`; another lamp is not exchanged while lit.

        Parameters
        ----------
        before
            What lies there; None if nobody can be sure, and all is asked for.
        """
        if before is None or self.lamp != before.lamp:
            session.perform(LAMP_OFF)
        for name in ("lamp", "stage", "lvf", "filter"):
            if before is None or getattr(self, name) != getattr(before, name):
                what, task = self._step(name)
                session.ask(ByHand(what, why, task))

    def _step(self, name: str) -> tuple[str, str]:
        """As one says it to a person, and to hands."""
        match name:
            case "lamp":
                return f"connect the {self.lamp} lamp to the relay", f"lamp {self.lamp}"
            case "stage":
                return _STAGE[self.stage], self.stage
            case "lvf":
                return _LVF[self.lvf], f"lvf {self.lvf}"
            case _ if self.filter is None:
                return "take the colour filter out", "no filter"
            case _:
                what = f"put the colour filter {self.filter} before the lamp"
                return what, f"filter {self.filter}"


def light(session: Session, warm_up_s: float) -> None:
    """Lamp on, and steady; one that has been on since the unit before is."""
    if not session.rig[LAMP].is_on():
        face_lamp(session)
        session.perform(LAMP_ON)
        session.wait(warm_up_s, "the lamp warms up")


def left_by(before: Arrangement, session: Session) -> Arrangement | None:
    """How the unit before left the bench; None in a run that was resumed, when it may have been
    put to another use meanwhile.
    """

    def decide() -> bool:
        since = session.clock.wall(session.rig.connected_s)
        frames = [*session.frames(FrameRole.DARK), *session.frames(FrameRole.LOOK)]
        return any(frame.start_time >= since for frame in frames)

    untouched = session.choose("bench as the unit before left it", decide, worst=True)
    return before if untouched else None
