"""Page and result of several tables with shared rates."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes
from labrig.process.without_run import describe_without_run, write_with_report
from labrig.report import shared_decay_report
from labrig.results import Series, SharedDecay


def report_shared_decay(
    tables: Sequence[Path],
    fit: SharedDecay,
    series: Sequence[Series],
    command: str,
    folder: Path,
) -> Path:
    """Write `fit.json` and the page of several tables with shared rates.

    Parameters
    ----------
    tables
        Paths of the tables.
    fit, series
        Their fit and series, by `labrig.analyse.fit_shared_tables`.
    command
        Command that does the same again.
    folder
        Folder, made if there is none; earlier files of the same names in its `result` are replaced.

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
    >>> import numpy as np
    >>> from labrig.analyse import TableFitOptions, fit_shared_tables
    >>> from labrig.process import report_shared_decay
    >>> t_s, rng = np.linspace(0, 50, 60), np.random.default_rng(1)
    >>> paths = [Path("dim.csv"), Path("bright.csv")]
    >>> for path, level in zip(paths, (100, 400)):
    ...     values = level * np.exp(-0.1 * t_s) + rng.standard_normal(60)
    ...     table = np.transpose([t_s, values])
    ...     np.savetxt(path, table, delimiter=",", header="t_s,y", comments="")
    >>> fit, tables = fit_shared_tables(paths, TableFitOptions())
    >>> series = [table.series for table in tables]
    >>> report_shared_decay(paths, fit, series, "labrig fit decay", Path("both")).as_posix()
    'both/result/report.html'
    """
    sample = [
        *(
            (
                f"SHA-256 of {table.name}",
                hashlib.sha256(read_bytes(table, MAX_TEXT_BYTES)).hexdigest(),
            )
            for table in tables
        ),
        ("Command", command),
    ]
    names = ", ".join(table.name for table in tables)
    about = describe_without_run(f"{len(tables)} tables with shared rates", "decay", names, sample)
    report = shared_decay_report(fit, series, about)
    return write_with_report(folder / "result", "fit.json", fit.to_json(), report)
