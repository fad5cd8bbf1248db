"""Check that a run is as it was recorded: journal, frames, and the result made of them."""

from dataclasses import dataclass
from pathlib import Path

from labrig.errors import DataError, UsageError
from labrig.process.provenance import PROVENANCE, Provenance
from labrig.record import damaged_frames, read_run
from labrig.yaml_file import read_model


@dataclass(frozen=True)
class Verification:
    """Outcome of the check of a run.

    Attributes
    ----------
    intact
        What is as it was recorded, in lines for people.
    changed
        What is not, in lines for people.
    """

    intact: tuple[str, ...]
    changed: tuple[str, ...]

    @property
    def is_intact(self) -> bool:
        """True if nothing was changed."""
        return not self.changed


def verify_run(folder: Path) -> Verification:
    """Check the journal of a run, its frames and the provenance of its result.

    The journal is sealed by the SHA-256 of each line in the next one, frames by theirs in the
    journal, and a result by that of the journal's last line. All three can be forged together:
    who needs more than a check against mistakes keeps the printed seal elsewhere.

    Parameters
    ----------
    folder
        Run folder.

    Returns
    -------
    Verification
        What is intact, with the journal's seal, and what was changed.

    Raises
    ------
    DiskError
        Something cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.process import verify_run
    >>> verify_run(Path("runs/decay")).is_intact
    True
    """
    try:
        run = read_run(folder)
    except DataError as error:
        return Verification((), (str(error),))
    files = [file for attempt in run.attempts for file in attempt.files]
    damaged = damaged_frames(folder, files, trust=False)
    changed = [f"{file.path} {damage}" for file, damage in damaged.items()]
    intact = [
        f"journal: every line follows the one before; seal {run.seal}",
        f"frames: {len(files) - len(damaged)} of {len(files)} have the checksums of the journal",
    ]
    path = folder / "result" / PROVENANCE
    if path.exists():
        try:
            is_of_journal = read_model(path, Provenance).journal == run.seal
        except UsageError as error:
            changed.append(str(error))
        else:
            text = f"{path.parent}: the result is of this journal"
            other = f"{path.parent}: the result is of another journal; labrig process {folder}"
            (intact if is_of_journal else changed).append(text if is_of_journal else other)
    return Verification(tuple(intact), tuple(changed))
