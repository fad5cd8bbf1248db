"""Input of the analysis of one protocol."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self, TypeVar

from pydantic import BaseModel

from labrig.acquire import RigFile
from labrig.analyse.overrides import Overrides
from labrig.bench_optics import calibration
from labrig.calibration import (
    BlankFile,
    CalibrationKind,
    CameraFile,
    FadeFile,
    IrradianceFile,
    LedsFile,
    LvfFile,
    ReferenceFile,
    ReflectanceFile,
    kinds,
)
from labrig.material import Material
from labrig.record import RunRecord
from labrig.results import EmissionSpectrum, FittedDecay, RunResult

FileT = TypeVar("FileT", bound=BaseModel)


@dataclass(frozen=True)
class Inputs:
    """Calibrations and earlier results; None or empty where there are none.

    Attributes
    ----------
    camera, blank, fade, lvf, irradiance, leds, reference, reflectance
        Calibrations, by the names of their kinds: from a rig file's `optics:`, or measured earlier
        in the same run.
    others
        Calibrations of kinds that packages add, by the names of their kinds.
    spectra
        Emission spectrum of each patch; that of the only one under "".
    decays
        Fitted decay of each patch.
    materials
        Material of each patch by excitation, decay and spectrum together; that of the only one
        under "".
    """

    camera: CameraFile | None = None
    blank: BlankFile | None = None
    fade: FadeFile | None = None
    lvf: LvfFile | None = None
    irradiance: IrradianceFile | None = None
    leds: LedsFile | None = None
    reference: ReferenceFile | None = None
    reflectance: ReflectanceFile | None = None
    others: Mapping[str, Any] = field(default_factory=dict)
    spectra: Mapping[str, EmissionSpectrum] = field(default_factory=dict)
    decays: Mapping[str, FittedDecay] = field(default_factory=dict)
    materials: Mapping[str, Material] = field(default_factory=dict)

    @classmethod
    def of(cls, rig: RigFile) -> Self:
        """Read the calibrations that the rig file names.

        Raises
        ------
        UsageError
            A file is missing or malformed.
        """
        named = {kind.name: calibration(rig, kind) for kind in kinds()}
        return cls()._with(named)

    def calibration(self, kind: CalibrationKind[FileT]) -> FileT | None:
        """Return the calibration of a kind; None if none is named or measured."""
        found: FileT | None = getattr(self, kind.name, None) or self.others.get(kind.name)
        return found

    def updated_by(self, result: RunResult) -> Self:
        """Return these inputs updated by a result; mappings by patch keep the other patches."""
        provided: dict[str, Any] = {
            name: {**getattr(self, name, {}), **value} if isinstance(value, Mapping) else value
            for name, value in result.provides().items()
        }
        return self._with(provided)

    def _with(self, values: Mapping[str, Any]) -> Self:
        """Return these inputs with values by the names of fields or of further kinds."""
        own = {item.name for item in fields(self)}
        others = {name: value for name, value in values.items() if name not in own}
        return replace(
            self,
            **{name: value for name, value in values.items() if name in own},
            others={**self.others, **others},
        )


@dataclass(frozen=True)
class Part:
    """One protocol's part of a run, or all of a run that is not a chain.

    Attributes
    ----------
    run
        Record of the part's units, by their own names.
    protocol
        Model of the protocol.
    rig
        Rig file of the bench during the run.
    overrides
        The user's settings.
    inputs
        Calibrations that the rig file names, and results of earlier parts of a chain.
    beside
        Record of the other parts' units, where samples took turns: the lamp burned for them, too.
    """

    run: RunRecord
    protocol: Any
    rig: RigFile
    overrides: Overrides
    inputs: Inputs
    beside: RunRecord | None = None
