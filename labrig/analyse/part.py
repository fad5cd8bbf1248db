"""What the analysis of one protocol is given."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self, TypeVar

from labrig.acquire import RigFile
from labrig.analyse.overrides import Overrides
from labrig.bench_optics import calibration
from labrig.calibration import (
    BlankFile,
    CalibrationKind,
    CameraFile,
    FadeFile,
    IrradianceFile,
    LvfFile,
    kinds,
)
from labrig.material import Material
from labrig.record import RunRecord
from labrig.results import EmissionSpectrum, FittedDecay, RunResult

FileT = TypeVar("FileT")


@dataclass(frozen=True)
class Inputs:
    """Calibrations and earlier results; None or empty where nothing is known.

    Attributes
    ----------
    camera, blank, fade, lvf, irradiance
        Calibrations, by the names of their kinds: from a rig file's `optics:`, or measured earlier
        in the same run.
    others
        Calibrations of kinds that packages add, by the names of their kinds.
    spectra
        By patch; under "" of the only one.
    decays
        By patch.
    materials
        As excitation, decay and spectrum together say, by patch; under "" the only one.
    """

    camera: CameraFile | None = None
    blank: BlankFile | None = None
    fade: FadeFile | None = None
    lvf: LvfFile | None = None
    irradiance: IrradianceFile | None = None
    others: Mapping[str, Any] = field(default_factory=dict)
    spectra: Mapping[str, EmissionSpectrum] = field(default_factory=dict)
    decays: Mapping[str, FittedDecay] = field(default_factory=dict)
    materials: Mapping[str, Material] = field(default_factory=dict)

    @classmethod
    def of(cls, rig: RigFile) -> Self:
        """Read the files that the rig file names.

        Raises
        ------
        UsageError
            One is missing or malformed.
        """
        named = {kind.name: calibration(rig, kind) for kind in kinds()}
        return cls()._with(named)

    def calibration(self, kind: CalibrationKind[FileT]) -> FileT | None:
        """What is known of a kind of calibration; None if nothing is."""
        found: FileT | None = getattr(self, kind.name, None) or self.others.get(kind.name)
        return found

    def with_those_of(self, result: RunResult) -> Self:
        """These, and what a result provides; of mappings by patch, the other patches stay."""
        provided: dict[str, Any] = {
            name: {**getattr(self, name, {}), **value} if isinstance(value, Mapping) else value
            for name, value in result.provides().items()
        }
        return self._with(provided)

    def _with(self, values: Mapping[str, Any]) -> Self:
        """These, with values by the names of fields, or of further kinds of calibration."""
        own = {item.name for item in fields(self)}
        others = {name: value for name, value in values.items() if name not in own}
        return replace(
            self,
            **{name: value for name, value in values.items() if name in own},
            others={**self.others, **others},
        )


@dataclass(frozen=True)
class Part:
    """One protocol's part of a run; all of it, unless it is a chain.

    Attributes
    ----------
    run
        Its units alone, by their own names.
    protocol
        Its model.
    rig
        The bench as it was.
    choices
        What a person wants otherwise.
    inputs
        Calibrations that the rig file names, and what earlier parts of a chain found.
    """

    run: RunRecord
    protocol: Any
    rig: RigFile
    overrides: Overrides
    inputs: Inputs
