"""Units before which a person arranges the bench, and the one that puts all back."""

from dataclasses import dataclass

from labrig.acquire import LAMP_OFF, ByHand, Session, Unit

from .arrangement import Arrangement, left_by


@dataclass(frozen=True)
class Arranged:
    """A unit that needs the bench otherwise than the unit before it left it."""

    unit: Unit
    now: Arrangement
    before: Arrangement
    why: str

    @property
    def name(self) -> str:
        """Of the unit."""
        return self.unit.name

    def run(self, session: Session) -> None:
        """Have it arranged, then do the unit."""
        self.now.set_up(session, self.before, self.why)
        self.unit.run(session)


@dataclass(frozen=True)
class Prepared:
    """A unit before which something else is done by hand."""

    unit: Unit
    step: ByHand

    @property
    def name(self) -> str:
        """Of the unit."""
        return self.unit.name

    def run(self, session: Session) -> None:
        """Have it done, then do the unit."""
        session.ask(self.step)
        self.unit.run(session)


@dataclass(frozen=True)
class PutBackUnit:
    """The bench as it was found; a unit of its own, so that nothing is measured again for it."""

    before: Arrangement
    name: str = "put-back"

    def run(self, session: Session) -> None:
        """Lamp off, filters and card away."""
        session.perform(LAMP_OFF)
        before = left_by(self.before, session)
        Arrangement().set_up(session, before, "the next measurement finds the bench as usual")
