"""Description and files of a page about something that is no run: a table, a matrix, a study."""

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from labrig.foundation.output_file import make_folder, write_text
from labrig.process.provenance import library_versions
from labrig.record import RunDescription
from labrig.report import Report, write_report


def describe_without_run(
    title: str, protocol: str, source: str, sample: Sequence[tuple[str, str]]
) -> RunDescription:
    """Return the description of what was made from `source`, without time, rig and devices.

    Parameters
    ----------
    title
        Title of the page.
    protocol
        Kind of what was made, in place of a protocol.
    source
        Name of what it was made from.
    sample
        Names and values of properties.

    Returns
    -------
    RunDescription
        Description with the versions of labrig and its libraries.

    Examples
    --------
    >>> from labrig.process import describe_without_run
    >>> describe_without_run("paint", "table", "paint.csv", ()).run
    'paint.csv'
    """
    return RunDescription(
        title=title,
        protocol=protocol,
        run=source,
        started="",
        ended="",
        rig="",
        simulated=False,
        labrig_version=version("labrig"),
        libraries=tuple(library_versions().items()),
        sample=tuple(sample),
    )


def write_with_report(folder: Path, name: str, content: str, report: Report) -> Path:
    """Write a result and its page into a folder, made if there is none.

    Parameters
    ----------
    folder
        The folder.
    name
        Name of the result's file.
    content
        Text of the result.
    report
        The page.

    Returns
    -------
    Path
        Path of the page.

    Raises
    ------
    DiskError
        A file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.process import describe_without_run, write_with_report
    >>> from labrig.report import Report
    >>> about = describe_without_run("paint", "table", "paint.csv", ())
    >>> write_with_report(Path("paint"), "paint.json", "{}", Report(about)).as_posix()
    'paint/report.html'
    """
    page = folder / "report.html"
    make_folder(folder)
    write_text(folder / name, content + "\n")
    write_report(page, report)
    return page
