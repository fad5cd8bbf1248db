"""Analysis of the parts of a chain, each with the results of those before it."""

from collections.abc import Mapping
from dataclasses import dataclass

from labrig.analyse.inputs import Inputs, Part
from labrig.foundation.errors import DataError, FitError
from labrig.foundation.plugins import measurement
from labrig.results import RunResult


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
    warnings: tuple[str, ...]


def analyse_parts(part: Part) -> AnalysedParts:
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
    warnings: list[str] = []
    inputs = {"": part.inputs}
    for link in part.protocol.chain():
        kind = link.protocol.protocol
        analyse_link = measurement(kind, str(part.run.folder)).load("analysis")
        known = inputs.get(link.sample, inputs[""])
        link_part = Part(
            part.run.part(link.name),
            link.protocol,
            part.rig,
            part.overrides,
            known,
            part.run.beside(link.name) if link.sample else None,
        )
        try:
            result: RunResult = analyse_link(link_part)
            if result.failures():
                raise FitError("; ".join(result.failures()))
        except (DataError, FitError) as error:
            failures[link.name] = error
            warnings.append(f"{link.name}: {error}")
            continue
        results[link.name] = result
        warnings += [f"{link.name}: {warning}" for warning in result.warnings]
        inputs[link.sample] = known.updated_by(result)
    if not results:
        raise next(iter(failures.values()))
    failed = {name: str(error) for name, error in failures.items()}
    return AnalysedParts(results, failed, inputs, tuple(warnings))
