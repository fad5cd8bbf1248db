"""What is asked of a run's processing: by its protocol, and by a person who wants it otherwise."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from labrig.acquire import Optics, ProtocolModel, RigFile, read_protocol, read_rig_file
from labrig.errors import UsageError
from labrig.record import FrameRecord
from labrig.region import Region, parse_region
from labrig.yaml_file import did_you_mean


def read_run_protocol(run: Path) -> ProtocolModel:
    """Read the protocol in a run folder.

    Parameters
    ----------
    run
        A run folder.

    Returns
    -------
    ProtocolModel
        The protocol as it was when the run was recorded.

    Raises
    ------
    UsageError
        The folder has no protocol.yaml, or it is malformed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.analyse import read_run_protocol
    >>> protocol = read_run_protocol(Path("runs/decay"))
    >>> protocol.protocol, protocol.sample.name, list(protocol.patches)
    ('decay', 'sample', ['sample'])
    """
    path = run / "protocol.yaml"
    if not path.is_file():
        raise UsageError(f"{run}: expected a run folder with protocol.yaml in it")
    return read_protocol(path)


@dataclass(frozen=True)
class Overrides:
    """What a person wants otherwise than the protocol says.

    Attributes
    ----------
    regions
        Patch name → region; the name "" stands for the only patch there is.
    excluded
        Frames to leave out, by file name or number.
    states
        Number of states; None leaves it to the protocol.
    fixed_rates_per_s
        Rates known from elsewhere, which take part and are held; they count as states.
    camera
        Other camera curves than the rig file names, for the report's colours.
    optics
        Keys of the rig file's `optics:` as they should be: calibrations that came later.
    """

    regions: Mapping[str, Region] = field(default_factory=dict)
    excluded: frozenset[str] = frozenset()
    states: int | None = None
    fixed_rates_per_s: tuple[float, ...] = ()
    camera: str | None = None
    optics: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def parse(
        cls,
        regions: Sequence[str],
        excluded: Sequence[str],
        states: int | None = None,
        fixed_rates_per_s: Sequence[float] = (),
        camera: str | None = None,
        optics: Sequence[str] = (),
    ) -> Self:
        """From the texts of a command line: `NAME=x,y,w,h` or `x,y,w,h`, frame numbers or names,
        `KEY=PATH` of optics.

        Raises
        ------
        UsageError
            A region, a rate or a calibration that is none.
        """
        if wrong := [rate for rate in fixed_rates_per_s if not 0 < rate < math.inf]:
            raise UsageError(f"--rate: expected a rate > 0 in 1/s, got {wrong[0]}")
        named = {}
        for text in regions:
            name, _, numbers = text.rpartition("=")
            named[name] = parse_region(numbers)
        return cls(
            named,
            frozenset(excluded),
            states,
            tuple(fixed_rates_per_s),
            camera,
            dict(_calibration(text) for text in optics),
        )

    def bench(self, run: Path) -> RigFile:
        """The rig of a run as it was, but for the calibrations that a person names instead.

        Raises
        ------
        UsageError
            The rig file in the run folder is malformed.
        """
        rig = read_rig_file(run / "rig.yaml")
        return rig.model_copy(update={"optics": rig.optics.model_copy(update=dict(self.optics))})

    def patches(self, protocol: Any) -> dict[str, Region]:
        """The patches of a protocol that has some, moved where a person wants them.

        Raises
        ------
        UsageError
            There is no patch of that name.
        """
        patches = dict(protocol.patches)
        for name, region in self.regions.items():
            if not name and len(patches) == 1:
                name = next(iter(patches))
            if name not in patches:
                raise UsageError(
                    f"--roi: no patch is called '{name}'; {did_you_mean(name, list(patches))}; "
                    "write --roi NAME=x,y,width,height"
                )
            patches[name] = region
        return patches

    def excludes(self, frame: FrameRecord) -> bool:
        """Whether `frame` is to be left out."""
        return bool(self.excluded & _names(frame))

    def check(self, frames: Sequence[FrameRecord]) -> None:
        """Refuse to exclude what is not there.

        Raises
        ------
        UsageError
            Names the frames that are not in the run.
        """
        unknown = self.excluded.difference(*(_names(frame) for frame in frames))
        if unknown:
            there = f"; it has {frames[0].path.name} to {frames[-1].path.name}" if frames else ""
            raise UsageError(f"--exclude: the run has no frame {', '.join(sorted(unknown))}{there}")


def _calibration(text: str) -> tuple[str, str]:
    """The key and the path, absolute if it is one."""
    key, _, named = text.partition("=")
    if key not in Optics.model_fields or not named:
        raise UsageError(
            f"--optics: expected KEY=PATH with a key of 'optics:' in a rig file, got '{text}'; "
            f"{did_you_mean(key, list(Optics.model_fields))}"
        )
    return key, str(Path(named).resolve()) if Path(named).exists() else named


def _names(frame: FrameRecord) -> set[str]:
    return {frame.path.name, frame.path.stem, frame.path.stem.lstrip("0")}
