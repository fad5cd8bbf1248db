"""Why two runs cannot be compared: unlike kinds, or one without a result yet."""

from pathlib import Path

from labrig.catalogue.summarising import summarise
from labrig.catalogue.unfinished import unfinished
from labrig.foundation.errors import DataError, LabrigError, UsageError
from labrig.results import read_result

_INSTEAD = "the values of all runs stand side by side in: labrig runs list --csv"


def not_comparable(a: Path, b: Path, has_fits: tuple[bool, bool]) -> LabrigError | None:
    """Return the error of two runs that cannot be compared; None if both have fitted decays.

    Parameters
    ----------
    a, b
        Folders of the runs.
    has_fits
        Whether each has a fitted decay in its result.
    """
    lacking = [run for run, has_fit in zip((a, b), has_fits, strict=True) if not has_fit]
    for run in lacking:
        if reason := _without_result(run):
            return DataError(f"not comparable: {run}: {reason}")
    if not lacking:
        return None
    kinds = [summarise(run).protocol for run in (a, b)]
    if kinds[0] == kinds[1] and len(lacking) == 2:
        reason = f"both are runs of {kinds[0]}, which fits no decay"
    else:
        reason = (
            f"{a} is a run of {kinds[0]}, {b} one of {kinds[1]}, and "
            f"{' and '.join(map(str, lacking))} {'has' if len(lacking) == 1 else 'have'} no fitted "
            "decay"
        )
    return UsageError(
        f"not comparable: {reason}; expected two runs with fitted decays, such as of decay or "
        f"phosphor; {_INSTEAD}"
    )


def _without_result(run: Path) -> str:
    """Return why a run has no result, and what to do; empty if it has one."""
    summary = summarise(run)
    if lines := unfinished(summary):
        return "; ".join((summary.status, *lines))
    if summary.status == "running":
        return "it is being recorded now; compare it when it is processed"
    try:
        failures = read_result(run).failures()
    except LabrigError as error:
        return str(error)
    report = run / "result" / "report.html"
    return f"{'; '.join(failures)}; see {report}" if failures else ""
