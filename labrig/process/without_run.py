"""Description and files of a page about something that is no run: a table, a matrix, a study."""

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from labrig.errors import DiskError
from labrig.process.provenance import library_versions
from labrig.record import RunDescription
from labrig.report import Report, write_report


def describe_without_run(
    title: str, protocol: str, source: str, sample: Sequence[tuple[str, str]]
) -> RunDescription:
    """Return the description of what was made from `source`, without time, rig and devices."""
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
    """Write a result and its page into a folder, made if there is none; return the page's path.

    Raises
    ------
    DiskError
        A file cannot be written.
    """
    page = folder / "report.html"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(content + "\n", encoding="utf-8")
    except OSError as error:
        raise DiskError(f"{folder}: cannot be written ({error.strerror})") from None
    write_report(page, report)
    return page
