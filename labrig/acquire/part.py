"""A protocol as one part of a longer one."""

from dataclasses import dataclass

from labrig.acquire.protocol import Unit
from labrig.acquire.session import Session
from labrig.record import unit_in


@dataclass(frozen=True)
class PartUnit:
    """A unit of a protocol that is the part called `part` of a chain."""

    part: str
    unit: Unit

    @property
    def name(self) -> str:
        """`decay/decay-1`."""
        return unit_in(self.part, self.unit.name)

    def run(self, session: Session) -> None:
        """Do it, seeing what its own part has photographed."""
        self.unit.run(session.within(self.part))
