"""Run folder → reduce → fit → material → report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Literal, Protocol, Self

from labrig.acquire import ProtocolModel, RigFile, Sample, plugins, read_rig_file
from labrig.errors import DataError, FitError, UsageError
from labrig.fit import DecayFit
from labrig.material import Material, Provenance, State, write_material
from labrig.record import Attempt, FrameRecord, RunRecord, read_run
from labrig.reduce import Series, SeriesFrame, add_flag, reduce_patches, write_series
from labrig.region import Region, parse_region
from labrig.report import RunReport, write_report
from labrig.series_fit import fit_series
from labrig.yaml_file import did_you_mean

#: A frame later than this after its planned time is worth a warning; its measured time is used.
LATE_S = 0.05


class DecayProtocol(Protocol):
    """The keys of a protocol that its processing needs."""

    sample: Sample
    patches: dict[str, Region]
    background: Region | None
    dark: Literal["frames", "background"]
    states: Literal["auto", 1, 2, 3]


@dataclass(frozen=True)
class Choices:
    """What a person wants otherwise than the protocol says.

    Attributes
    ----------
    regions
        Patch name → region; the name "" stands for the only patch there is.
    excluded
        Frames to leave out, by file name or number.
    states
        Number of states; None leaves it to the protocol.
    """

    regions: Mapping[str, Region] = field(default_factory=dict)
    excluded: frozenset[str] = frozenset()
    states: int | None = None

    @classmethod
    def parse(cls, regions: Sequence[str], excluded: Sequence[str], states: int | None) -> Self:
        """From the texts of a command line: `NAME=x,y,w,h` or `x,y,w,h`, frame numbers or names.

        Raises
        ------
        UsageError
            A region that is none.
        """
        named = {}
        for text in regions:
            name, _, numbers = text.rpartition("=")
            named[name] = parse_region(numbers)
        return cls(named, frozenset(excluded), states)


@dataclass(frozen=True)
class Result:
    """What came out of a run."""

    folder: Path
    report: Path
    series: Mapping[str, Series]
    fits: Mapping[str, DecayFit]
    failures: Mapping[str, str]
    warnings: tuple[str, ...]
