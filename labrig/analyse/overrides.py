"""Settings of a run's processing: those of its protocol, and the user's instead."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self, get_args

from labrig.acquire import Optics, ProtocolModel, RigFile, read_protocol, read_rig_file
from labrig.foundation.errors import UsageError
from labrig.foundation.named_files import with_absolute_paths
from labrig.foundation.region import Region, parse_region
from labrig.foundation.yaml_file import did_you_mean
from labrig.material import MAX_ORDER
from labrig.record import FileRecord
from labrig.results import AUTO, EstimateMethod, require_law

#: Kinetic orders that are fitted, one of each state.
FREE = "free"


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
    """The user's settings that replace the protocol's.

    Attributes
    ----------
    regions
        Region of each patch by its name; the name "" stands for the only patch there is.
    excluded
        Frames to leave out, by file name or number.
    states
        Number of states; None takes the protocol's.
    fixed_rates_per_s
        Rates in 1/s known from elsewhere, which are held in the fit; they count as states.
    law
        Law that describes a decay, or `auto`.
    order
        Kinetic order of excitation: `auto`, `free` or a number from 1 to 4.
    camera
        Camera curves for the report's colours instead of the rig file's.
    optics
        Keys of the rig file's `optics:` to replace: calibrations that were made later.
    method
        Method of estimating re-radiation; None takes the protocol's.
    intervals
        Whether every rate and order has an interval by profile likelihood.
    """

    regions: Mapping[str, Region] = field(default_factory=dict)
    excluded: frozenset[str] = frozenset()
    states: int | None = None
    fixed_rates_per_s: tuple[float, ...] = ()
    law: str = AUTO
    order: str = AUTO
    camera: str | None = None
    optics: Mapping[str, str] = field(default_factory=dict)
    method: EstimateMethod | None = None
    intervals: bool = False

    @classmethod
    def parse(
        cls,
        regions: Sequence[str],
        excluded: Sequence[str],
        states: int | None = None,
        fixed_rates_per_s: Sequence[float] = (),
        camera: str | None = None,
        optics: Sequence[str] = (),
        law: str = AUTO,
        method: str | None = None,
        order: str = AUTO,
        *,
        intervals: bool = False,
    ) -> Self:
        """Parse the texts of a command line.

        Parameters
        ----------
        regions
            Regions as `NAME=x,y,w,h` or `x,y,w,h`.
        excluded
            Numbers or names of frames.
        states
            Number of states.
        fixed_rates_per_s
            Rates in 1/s.
        camera
            Camera curves.
        optics
            Calibrations as `KEY=PATH` of the rig file's `optics:`.
        law
            Law that describes a decay, or `auto`.
        method
            Method of estimating re-radiation.
        order
            Kinetic order of excitation: `auto`, `free` or a number.
        intervals
            Whether every rate and order has an interval by profile likelihood.

        Raises
        ------
        UsageError
            A region, a rate, an order or a calibration is malformed, or there is no such law or
            method.
        """
        require_law(law)
        require_order(order)
        if invalid := [rate for rate in fixed_rates_per_s if not 0 < rate < math.inf]:
            raise UsageError(f"--rate: expected a rate > 0 in 1/s, got {invalid[0]}")
        named = {}
        for text in regions:
            name, _, numbers = text.rpartition("=")
            named[name] = parse_region(numbers)
        return cls(
            named,
            frozenset(excluded),
            states,
            tuple(fixed_rates_per_s),
            law,
            order,
            camera,
            dict(_parse_calibration(text) for text in optics),
            None if method is None else _parse_method(method),
            intervals,
        )

    def bench(self, run: Path) -> RigFile:
        """Return the rig of a run as it was, with the user's calibrations instead.

        Raises
        ------
        UsageError
            The rig file in the run folder is malformed.
        """
        rig = read_rig_file(run / "rig.yaml")
        return rig.model_copy(update={"optics": rig.optics.model_copy(update=dict(self.optics))})

    def patches(self, protocol: Any) -> dict[str, Region]:
        """Return the patches of a protocol, with the user's regions instead.

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

    def check_method(self, protocol: Any) -> None:
        """Refuse a method for a protocol that has none to choose from.

        Raises
        ------
        UsageError
            Neither the protocol nor a part of its chain has methods.
        """
        if self.method is None:
            return
        chain = [part.protocol for part in protocol.chain()] if hasattr(protocol, "chain") else []
        if not any(hasattr(each, "method") for each in (protocol, *chain)):
            raise UsageError(
                f"--method: expected a protocol with several methods, such as "
                f"led_fluorescence, got {protocol.protocol}; leave --method out"
            )

    def excludes(self, frame: FileRecord) -> bool:
        """Return whether `frame` is to be left out."""
        return bool(self.excluded & _names(frame))

    def check(self, frames: Sequence[FileRecord]) -> None:
        """Refuse to exclude frames that the run does not have.

        Raises
        ------
        UsageError
            Frames are not in the run; the message names them.
        """
        unknown = self.excluded.difference(*(_names(frame) for frame in frames))
        if unknown:
            there = f"; it has {frames[0].path.name} to {frames[-1].path.name}" if frames else ""
            raise UsageError(f"--exclude: the run has no frame {', '.join(sorted(unknown))}{there}")


def _parse_calibration(text: str) -> tuple[str, str]:
    """Return key and absolute path of a calibration."""
    key, _, named = text.partition("=")
    if key not in Optics.model_fields or not named:
        raise UsageError(
            f"--optics: expected KEY=PATH with a key of 'optics:' in a rig file, got '{text}'; "
            f"{did_you_mean(key, list(Optics.model_fields))}"
        )
    return key, with_absolute_paths({key: named}, Optics, Path.cwd())[key]


def require_order(text: str) -> None:
    """Refuse what is no kinetic order, nor `auto` or `free`."""
    if text in (AUTO, FREE):
        return
    try:
        is_order = 1 <= float(text) <= MAX_ORDER
    except ValueError:
        is_order = False
    if not is_order:
        raise UsageError(
            f"--order: expected {AUTO}, {FREE} or a number from 1 to {MAX_ORDER:g}, got '{text}'"
        )


def _parse_method(text: str) -> EstimateMethod:
    methods: tuple[EstimateMethod, ...] = get_args(EstimateMethod)
    for method in methods:
        if text == method:
            return method
    raise UsageError(f"--method: expected {' or '.join(methods)}, got '{text}'")


def _names(frame: FileRecord) -> set[str]:
    return {frame.path.name, frame.path.stem, frame.path.stem.lstrip("0")}
