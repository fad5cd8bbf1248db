"""A result as its report describes it, with the run to which it belongs."""

import re
from dataclasses import dataclass
from typing import Any

from labrig.analyse import FittedTable
from labrig.foundation.result_warning import ResultWarning, as_warnings
from labrig.process import rendered_result
from labrig.record import RunRecord, read_run
from labrig.report import Section, sections_of
from labrig.results import DecayPatch, RunResult


@dataclass(frozen=True)
class Description:
    """A result as its report describes it.

    Attributes
    ----------
    kind
        Kind of the result.
    title, run
        Names of the sample and of the run; empty if unknown.
    warnings
        Limits of the result.
    sections
        Sections of the report.
    """

    kind: str
    title: str
    run: str
    warnings: tuple[ResultWarning, ...]
    sections: tuple[Section, ...]


def describe(result: Any) -> Description:
    """Describe a result; that of a run as its report does, any other one by its type."""
    kind = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(result).__name__).lower()
    title = run = ""
    if isinstance(result, FittedTable):
        fit = result.fit
        residuals = fit.normalised_residuals
        result = DecayPatch(
            region=None, series=result.series, fit=fit, normalised_residuals=residuals
        )
    if isinstance(result, RunResult):
        kind = result.kind
    record = _record(result)
    if record is not None:
        title, run = record.began_with("sample"), record.name
    of_run = isinstance(result, RunResult) and record is not None
    sections = rendered_result(result).sections if of_run else sections_of(result)
    of_fit = getattr(getattr(result, "fit", None), "warnings", ())
    warnings = getattr(result, "warnings", of_fit)
    return Description(kind, title, run, as_warnings(warnings), tuple(sections))


def _record(result: Any) -> RunRecord | None:
    """Return the run to which a result belongs."""
    if isinstance(result, RunRecord):
        return result
    if isinstance(result, RunResult) and result.run_folder is not None:
        return read_run(result.run_folder)
    return None
