"""Why a run is not finished, since when, and the command that goes on."""

from collections.abc import Iterator

from labrig.catalogue.run_summary import RunSummary, utc
from labrig.foundation.errors import DataError, DiskError
from labrig.foundation.signals import name_of
from labrig.record import JOURNAL, RunRecord, lost_files, read_run

CUT_OFF = "labrig was cut off: killed, or this PC lost power"


def unfinished(summary: RunSummary) -> tuple[str, ...]:
    """Return why a run has no result yet, and how to go on.

    Parameters
    ----------
    summary
        Summary of the run.

    Returns
    -------
    tuple of str
        Lines for people; none of a run that is processed, or is being recorded.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.catalogue import summarise, unfinished
    >>> unfinished(summarise(Path("runs/decay")))
    ()
    """
    if summary.status in ("processed", "running"):
        return ()
    return tuple(_lines(summary))


def _lines(summary: RunSummary) -> Iterator[str]:
    folder = summary.folder
    if summary.status == "recorded":
        yield f"all units are recorded; go on with: labrig process {folder}"
        return
    has_journal = (folder / JOURNAL).exists()
    try:
        record = read_run(folder) if has_journal else None
    except (DataError, DiskError) as error:
        yield str(error)
        return
    if lost := lost_files(folder, record.attempts if record else ()):
        yield (
            f"its journal {'was cut' if has_journal else 'is gone'}: {len(lost)} frames have no "
            f"line in it, {lost[0]} to {lost[-1]}; restore it from a copy, or record them again: "
            f"labrig resume {folder} --yes"
        )
        return
    if record is None:
        yield f"nothing was recorded; go on with: labrig resume {folder}"
        return
    if summary.status == "damaged":
        yield f"its result cannot be read; make it anew with: labrig process {folder}"
        return
    yield f"{_ended(record)}; go on with: labrig resume {folder}"


def _ended(record: RunRecord) -> str:
    """Return when and why the last attempt ended."""
    if not record.attempts:
        return "nothing was recorded"
    last = record.attempts[-1]
    time = last.stop_time or record.last_time
    when = f"{utc(time):%Y-%m-%d %H:%M} UTC"
    if last.exit_status is None:
        return f"stopped in {last.unit}, after {when}: {CUT_OFF}"
    if last.completed:
        return f"stopped after {last.unit}, at {when}: {CUT_OFF}"
    return f"stopped in {last.unit}, at {when}: {_reason(last.reason) or last.exit_status}"


def _reason(reason: str) -> str:
    """Return the reason of a RunStop, a signal by its name."""
    number = reason.removeprefix("signal ")
    return f"by {name_of(int(number))}" if number != reason and number.isdecimal() else reason
