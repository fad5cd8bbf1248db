"""Section on the calibrations that a run found beside the runs or the rig file."""

from labrig.foundation.yaml_file import read_yaml
from labrig.record import CALIBRATIONS_FILE, RunRecord
from labrig.report.sections import Section, Table

TEXT = (
    "The rig file names none of these: they were found beside the runs or the rig file, the newest "
    "ones of this bench."
)


def calibration_sections(run: RunRecord) -> tuple[Section, ...]:
    """Return the section on calibrations that were found beside the runs.

    Parameters
    ----------
    run
        A recorded run.

    Returns
    -------
    tuple of Section
        A table of their files and ages; empty if there were none.

    Raises
    ------
    UsageError
        The run's record of them is malformed.

    Examples
    --------
    >>> import labrig
    >>> from labrig.report import calibration_sections
    >>> calibration_sections(labrig.read_run("runs/decay"))
    ()
    """
    path = run.folder / CALIBRATIONS_FILE
    if not path.is_file():
        return ()
    found = read_yaml(path)
    rows = tuple(
        (kind.replace("_", " "), *(str(entry.get(key, "")) for key in ("made", "age", "file")))
        for kind, entry in found.items()
        if isinstance(entry, dict)
    )
    table = Table(("Calibration", "Made", "Age when the run began", "File"), rows)
    return (Section("Calibrations", (TEXT,), tables=(table,)),)
