"""Result and page of trap depths."""

from collections.abc import Sequence
from pathlib import Path

from labrig.process.without_run import describe_without_run, write_with_report
from labrig.report import trap_depth_report
from labrig.results import StateDepth, trap_depths_json


def report_trap_depths(depths: Sequence[StateDepth], runs: Sequence[str], folder: Path) -> Path:
    """Write `trap_depth.json` and the page of trap depths into a folder.

    Parameters
    ----------
    depths
        Depths of the states; not empty.
    runs
        Names of the runs that they were made of.
    folder
        Folder, made if there is none; earlier files of the same names are replaced.

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
    >>> from labrig.fit import fit_trap_depth
    >>> from labrig.process import report_trap_depths
    >>> from labrig.results import StateDepth
    >>> depth = fit_trap_depth([15, 21, 27], [0.030, 0.048, 0.074], [0.001, 0.001, 0.002])
    >>> report_trap_depths([StateDepth("", 1, depth)], ["a", "b", "c"], Path("depth")).as_posix()
    'depth/report.html'
    """
    about = describe_without_run("Trap depths", "trap_depth", ", ".join(runs), ())
    content = trap_depths_json(tuple(depths), tuple(runs))
    return write_with_report(folder, "trap_depth.json", content, trap_depth_report(depths, about))
