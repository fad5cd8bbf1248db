"""What every protocol is: a small YAML file as a frozen model, that says which units it takes."""

from abc import abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self

from pydantic import BaseModel, ConfigDict, Field

from labrig.acquire.rig_file import RigFile
from labrig.acquire.session import Session
from labrig.calibration import CalibrationKind
from labrig.record import FrameRole, unit_in
from labrig.region import Region


class Unit(Protocol):
    """Something that is done completely or did not happen: one charge-and-decay, one filter."""

    @property
    def name(self) -> str:
        """Unique within the protocol, the same at every run of it."""

    def run(self, session: Session) -> None:
        """Do it. Ends by exception or complete."""


class Sample(BaseModel):
    """What lies on the bench, for the record.

    Attributes
    ----------
    name
        Name of the sample, which the material file takes over, for example `blue-paint`.
    thickness
        Thickness of the sample as free text, for example `0.4 mm`. It is recorded, not used.
    batch
        Batch or lot of the sample as free text, for example `B-17`. It is recorded, not used.
    last_light
        When the sample last saw light, and which, as free text, for example
        `daylight, yesterday evening`.
    notes
        Anything else worth keeping about the sample, as free text.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field("sample", min_length=1)
    thickness: str | None = None
    batch: str | None = None
    last_light: str | None = Field(None, description="when and which light it saw last")
    notes: str | None = None


class ProtocolModel(BaseModel):
    """Base of the protocols' models; a YAML file names its model in `protocol:`.

    Attributes
    ----------
    protocol
        Name of the protocol, which decides what the other keys are, for example `decay`.
    sample
        Description of the sample, for the record.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    #: Roles of the frames to whose glow rates are fitted: rates belong to their temperature.
    rate_frames: ClassVar[Collection[str]] = (FrameRole.DECAY,)
    #: Calibrations on which this one's results rest.
    rests_on: ClassVar[tuple[CalibrationKind[Any], ...]] = ()

    protocol: str
    sample: Sample = Sample()

    @abstractmethod
    def units(self) -> Sequence[Unit]:
        """All units in order, known before anything moves."""

    def patches_of(self, unit: str) -> Mapping[str, Region]:
        """The regions of interest in the frames of one of its units, by name; most have none."""
        patches: Mapping[str, Region] = getattr(self, "patches", {})
        return patches

    def suited_to(self, rig: RigFile) -> Self:
        """The protocol with what it leaves to the rig file filled in; most leave nothing to it.

        Raises
        ------
        UsageError
            The rig file names what is not there.
        """
        return self

    def unmeasured(self, rig: RigFile) -> Sequence[str]:
        """Protocols on whose results this one's rest, of which the rig file names no run."""
        return [kind.protocol for kind in self.rests_on if rig.optics.named(kind) is None]


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
