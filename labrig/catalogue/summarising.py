"""Making of a run's summary from the files of its folder."""

from pathlib import Path

from labrig.acquire import read_run_protocol
from labrig.catalogue.run_summary import RunStatus, RunSummary, status_of, utc
from labrig.foundation.errors import LabrigError
from labrig.record import plan_content, read_run, time_made
from labrig.results import fits_by_folder, headline_values, read_fitted_decay, read_summary


def summarise(folder: Path) -> RunSummary:
    """Summarise the run in a folder.

    Parameters
    ----------
    folder
        Run folder; its files may be incomplete or damaged.

    Returns
    -------
    RunSummary
        Sample, protocol, status, number of frames and what decays follow.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.catalogue import summarise
    >>> summary = summarise(Path("runs/decay"))
    >>> summary.sample, summary.status, summary.frames
    ('sample', 'processed', 37)
    """
    sample, protocol, units = _protocol_summary(folder)
    number = None if units is None else len(units)
    made = time_made(folder)
    try:
        record = read_run(folder)
    except LabrigError:  # damaged, or another user's
        has_journal = (folder / "journal.jsonl").exists()
        status: RunStatus = "damaged" if has_journal else "interrupted"
        return RunSummary(folder, sample, protocol, made, None, status, 0, number, 0, {}, {})
    # The files beside it may have been edited since.
    sample = record.began_with("sample") or sample
    protocol = record.began_with("protocol") or protocol
    completed = record.completed()
    status = status_of(record, is_complete=units is not None and set(units) <= set(completed))
    try:
        parameters = {
            place: read_fitted_decay(path).parameters
            for place, path in fits_by_folder(folder / "result").items()
        }
    except LabrigError:
        status, parameters = "damaged", {}
    return RunSummary(
        folder=folder,
        sample=sample,
        protocol=protocol,
        made=made,
        began=utc(record.attempts[0].start["time"]) if record.attempts else None,
        status=status,
        done=len(completed),
        units=number,
        frames=sum(len(attempt.frames) for attempt in completed.values()),
        parameters=parameters,
        values=headline_values(folder / "result"),
        headline=next(iter(read_summary(folder / "result")), ""),
    )


def _protocol_summary(folder: Path) -> tuple[str, str, tuple[str, ...] | None]:
    """Return sample, protocol and names of the units from the protocol file of a run.

    The names are None if the protocol is not installed.
    """
    try:
        protocol = read_run_protocol(folder)
        units = tuple(unit.name for unit in protocol.units())
    except LabrigError:
        return *_names_in(folder), None
    return protocol.sample.name, protocol.protocol, units


def _names_in(folder: Path) -> tuple[str, str]:
    """Return sample and protocol of a run that no installed protocol reads, `?` if it has none."""
    try:
        content = plan_content(folder, "protocol.yaml")
    except LabrigError:
        return "?", "?"
    sample = content.get("sample")
    name = sample.get("name", "?") if isinstance(sample, dict) else "?"
    return str(name), str(content.get("protocol", "?"))
