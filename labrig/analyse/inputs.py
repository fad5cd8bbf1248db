"""Input of the analysis of one protocol, and of the parts of a chain."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self, TypeVar

from pydantic import BaseModel

from labrig.acquire import RigFile
from labrig.analyse.overrides import Overrides
from labrig.analyse.process_options import OptionsT, chosen_options
from labrig.bench_optics import calibration
from labrig.calibration import CalibrationKind, kinds
from labrig.foundation.activity import counted
from labrig.foundation.errors import DataError, FitError
from labrig.foundation.plugins import measurement
from labrig.foundation.result_warning import ResultWarning, Unmeasured
from labrig.material import Material
from labrig.record import RunRecord
from labrig.results import EmissionSpectrum, FittedDecay, RunResult

FileT = TypeVar("FileT", bound=BaseModel)


@dataclass(frozen=True)
class Inputs:
    """Calibrations and earlier results, whatever measured them.

    Attributes
    ----------
    provided
        Values by name: a calibration by that of its kind, from a rig file's `optics:` or measured
        earlier in the same run, and what results provide.

    Examples
    --------
    >>> from labrig.analyse import Inputs
    >>> from labrig.calibration import LVF_KIND
    >>> Inputs()[LVF_KIND] is None
    True
    """

    provided: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, rig: RigFile) -> Self:
        """Read the calibrations that the rig file names.

        Raises
        ------
        UsageError
            A file is missing or malformed.
        """
        return cls({kind.name: calibration(rig, kind) for kind in kinds()})

    def __getitem__(self, kind: CalibrationKind[FileT]) -> FileT | None:
        """Return the calibration of a kind; None if none is named or measured."""
        calibrated: FileT | None = self.provided.get(kind.name)
        return calibrated

    @property
    def spectra(self) -> Mapping[str, EmissionSpectrum]:
        """Emission spectrum of each patch; that of the only one under ""."""
        return self._by_patch("spectra")

    @property
    def decays(self) -> Mapping[str, FittedDecay]:
        """Fitted decay of each patch."""
        return self._by_patch("decays")

    @property
    def materials(self) -> Mapping[str, Material]:
        """Material of each patch by all that was measured; that of the only one under ""."""
        return self._by_patch("materials")

    def updated_by(self, result: RunResult) -> Self:
        """Return these inputs updated by a result; mappings by patch keep the other patches."""
        provided = {
            name: {**self._by_patch(name), **value} if isinstance(value, Mapping) else value
            for name, value in result.provides().items()
        }
        return type(self)({**self.provided, **provided})

    def _by_patch(self, name: str) -> Mapping[str, Any]:
        by_patch: Mapping[str, Any] = self.provided.get(name, {})
        return by_patch


@dataclass(frozen=True)
class AnalysisContext:
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
    other_parts
        Record of the other parts' units, where samples took turns: the lamp burned for them, too.
    """

    run: RunRecord
    protocol: Any
    rig: RigFile
    overrides: Overrides
    inputs: Inputs
    other_parts: RunRecord | None = None

    def options(self, model: type[OptionsT]) -> OptionsT:
        """Return the measurement's own options, of those that the user gave.

        Raises
        ------
        UsageError
            A value is one that the option cannot have.
        """
        return chosen_options(model, self.overrides.options)


@dataclass(frozen=True)
class AnalysedParts:
    """Results of the parts of a chain.

    Attributes
    ----------
    results
        Result of each part by its name, in the order of the chain.
    failed
        Reason why a part could not be analysed, by its name.
    inputs
        Calibrations and results after the last part, by the sample; those of the bench, and of the
        only sample, under "".
    warnings
        Warnings of all parts, with their names.
    """

    results: Mapping[str, RunResult]
    failed: Mapping[str, str]
    inputs: Mapping[str, Inputs]
    warnings: tuple[ResultWarning, ...]


def analyse_parts(context: AnalysisContext) -> AnalysedParts:
    """Analyse every part of a chain; each may use the results of earlier ones.

    Those of one sample do not use the results of another.

    A part that cannot be analysed is a warning, as long as another one can.

    Raises
    ------
    DataError, FitError
        No part can be analysed.
    """
    results: dict[str, RunResult] = {}
    failures: dict[str, DataError | FitError] = {}
    warnings: list[ResultWarning] = []
    inputs = {"": context.inputs}
    for link in counted(context.protocol.chain(), "analysing parts"):
        known = inputs.get(link.sample, inputs[""])
        try:
            result = _analysed(context, link, known)
            if result.failures():
                raise FitError("; ".join(result.failures()))
        except (DataError, FitError) as error:
            failures[link.name] = error
            warnings.append(
                Unmeasured("part-failed", "{reason}", subject=link.name, reason=str(error))
            )
            continue
        results[link.name] = result
        warnings += [warning.about(link.name) for warning in result.warnings]
        inputs[link.sample] = known.updated_by(result)
    if not results:
        raise next(iter(failures.values()))
    failed = {name: str(error) for name, error in failures.items()}
    return AnalysedParts(results, failed, inputs, tuple(warnings))


def analyse_part(
    context: AnalysisContext, name: str, results: Mapping[str, RunResult]
) -> RunResult:
    """Analyse one part of a chain, with the results of the parts before it as they are.

    Parameters
    ----------
    context
        The chain.
    name
        Name of the part.
    results
        Results of the parts by name; those that come later do not count.

    Returns
    -------
    RunResult
        Result of the part.

    Raises
    ------
    DataError, FitError
        The part cannot be analysed.

    Examples
    --------
    >>> from labrig.analyse import analyse_part
    >>> analyse_part(context, "decay", result.parts).kind  # doctest: +SKIP
    'decay'
    """
    inputs = {"": context.inputs}
    for link in context.protocol.chain():
        known = inputs.get(link.sample, inputs[""])
        if link.name == name:
            return _analysed(context, link, known)
        if link.name in results:
            inputs[link.sample] = known.updated_by(results[link.name])
    raise DataError(f"{context.run.folder}: expected a chain with a part '{name}', it has none")


def _analysed(context: AnalysisContext, link: Any, known: Inputs) -> RunResult:
    """Return the result of a part of a chain."""
    kind = link.protocol.protocol
    result: RunResult = measurement(kind, str(context.run.folder)).load("analysis")(
        AnalysisContext(
            context.run.part(link.name),
            link.protocol,
            context.rig,
            context.overrides,
            known,
            context.run.without_part(link.name) if link.sample else None,
        )
    )
    return result
