"""The rendered comparison of a run in its report, as long as it is of the report's own result."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from markupsafe import escape

from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes, read_text
from labrig.foundation.output_file import make_folder_in, write_text
from labrig.record import RunLock
from labrig.report import Section, section_page, with_later

#: Lock of the process that makes the result; acquisition has another one.
LOCK = ".process.lock"
FOLDER, PART, RESULT, REPORT = "comparison", "section.html", "result.json", "report.html"


def show_comparison(run: Path, sections: Sequence[Section]) -> bool:
    """Write a comparison into a run's folder `comparison`, and show it in the run's report.

    Parameters
    ----------
    run
        Run folder with a result.
    sections
        The comparison, made of that result.

    Returns
    -------
    bool
        Whether the report shows it; one of an earlier labrig has no place for it.

    Raises
    ------
    UsageError
        Another labrig is processing the run.
    DiskError
        A file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.process import process_and_report, show_comparison
    >>> from labrig.report import Section
    >>> report = process_and_report("runs/decay").report
    >>> show_comparison(Path("runs/decay"), [Section("Compared", text=("They agree.",))])
    True
    >>> "They agree." in report.read_text(encoding="utf-8")
    True
    """
    folder, result = run / FOLDER, run / "result"
    with RunLock(run / LOCK, "processing this run"):
        make_folder_in(run, FOLDER)
        part = section_page(sections, folder, f"../{FOLDER}")
        write_text(folder / PART, f"<!-- of {_checksum(result)} -->\n{part}\n")
        return include_comparison(run, result)


def include_comparison(run: Path, result: Path) -> bool:
    """Show a run's comparison in the report of a result, or say that it is of another result.

    Returns whether the report has a place for it, or needs none.
    """
    path, report = run / FOLDER / PART, result / REPORT
    if not path.is_file():
        return True
    head, _, part = read_text(path).partition("\n")
    if head != f"<!-- of {_checksum(result)} -->":
        part = (
            '<section><h2>Rendered comparison</h2>\n<p class="text">The comparison with '
            "rendered pictures is of another result of this run. Make it again: "
            f"<code>labrig reproduce {escape(run.name)} --rendered</code></p></section>"
        )
    page = with_later(read_text(report), part.strip())
    if page is None:
        return False
    write_text(report, page)
    return True


def _checksum(result: Path) -> str:
    return hashlib.sha256(read_bytes(result / RESULT, MAX_TEXT_BYTES)).hexdigest()
