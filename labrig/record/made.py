"""The time at which a run folder was made, by the PC's clock."""

from datetime import UTC, datetime
from pathlib import Path

from labrig.foundation.errors import LabrigError
from labrig.foundation.input_file import read_text

MADE = "made.txt"


def made_text(time_s: float) -> str:
    """Return the content of `made.txt` for a time in seconds since 1970."""
    return datetime.fromtimestamp(time_s, UTC).isoformat(timespec="microseconds") + "\n"


def time_made(run: Path) -> datetime:
    """Return when a run folder was made.

    It orders the runs of a folder. The journal cannot: a simulated run has the times of its room,
    a copy has its own times of change, and a name can be changed by anybody.

    Parameters
    ----------
    run
        Run folder.

    Returns
    -------
    datetime
        Time in UTC from the run's `made.txt`; where that is missing or damaged, the time at which
        `protocol.yaml` was written.

    Raises
    ------
    OSError
        If there is no `protocol.yaml` either.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.record import time_made
    >>> time_made(Path("runs/decay")).tzname()
    'UTC'
    """
    try:
        made = datetime.fromisoformat(read_text(run / MADE).strip())
        return made.astimezone(UTC)
    except (LabrigError, ValueError, OverflowError):
        return datetime.fromtimestamp((run / "protocol.yaml").stat().st_mtime, UTC)
