"""Summary of a result for people: its most important numbers, as they stood in the terminal."""

from collections.abc import Sequence
from pathlib import Path

from labrig.foundation.errors import LabrigError
from labrig.foundation.input_file import read_text
from labrig.foundation.output_file import write_text

SUMMARY = "summary.txt"
#: Small picture of the sample in a result folder, where a frame shows it.
SAMPLE_PICTURE = "sample.png"


def write_summary(folder: Path, lines: Sequence[str]) -> None:
    """Write the most important numbers of a result for people.

    Parameters
    ----------
    folder
        Folder of the result.
    lines
        Texts of one line or more; the first line is what a list of runs shows.

    Raises
    ------
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.results import read_summary, write_summary
    >>> write_summary(Path("."), ["albedo 0.80(1) at 450 nm", "0.84(1) at 550 nm"])
    >>> read_summary(Path("."))
    ('albedo 0.80(1) at 450 nm', '0.84(1) at 550 nm')
    """
    write_text(folder / SUMMARY, "".join(f"{line}\n" for line in lines))


def read_summary(folder: Path) -> tuple[str, ...]:
    """Return the lines of a result's summary.

    Parameters
    ----------
    folder
        Folder of the result.

    Returns
    -------
    tuple of str
        Lines; none if there is no summary, or it cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.results import read_summary
    >>> read_summary(Path("runs/decay/result"))[1]
    'state  k / s⁻¹      1/k / s    amplitude / (DN/s)'
    >>> read_summary(Path("nowhere"))
    ()
    """
    try:
        return tuple(read_text(folder / SUMMARY).splitlines())
    except LabrigError:
        return ()
