"""Result and report of a mixture that stands for a re-radiation matrix."""

import hashlib
from pathlib import Path

from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes
from labrig.process.without_run import describe_without_run, write_with_report
from labrig.report import FittedMatrix, mixture_report


def report_mixture(file: Path, fitted: FittedMatrix, command: str, folder: Path) -> Path:
    """Write `fit.json` and the report of a mixture into a folder.

    Parameters
    ----------
    file
        Path of the matrix's file.
    fitted
        The matrix and its mixture.
    command
        Command that does the same again.
    folder
        Folder, made if there is none; earlier files of the same names are replaced.

    Returns
    -------
    Path
        Path of the report.

    Raises
    ------
    DiskError
        A file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.fit import fit_mixture
    >>> from labrig.material import read_reradiation
    >>> from labrig.process import report_mixture
    >>> from labrig.report import FittedMatrix
    >>> paper = read_reradiation("paper.csv")
    >>> fitted = FittedMatrix(paper, fit_mixture(paper, 2, threshold=1e-3))
    >>> command = "labrig fit mixture paper.csv --components 2 --threshold 0.001"
    >>> report_mixture(Path("paper.csv"), fitted, command, Path("mixture")).as_posix()
    'mixture/report.html'
    """
    sample = [
        ("SHA-256", hashlib.sha256(read_bytes(file, MAX_TEXT_BYTES)).hexdigest()),
        ("Command", command),
    ]
    about = describe_without_run(fitted.matrix.name, "mixture", file.name, sample)
    return write_with_report(folder, "fit.json", fitted.to_json(), mixture_report(fitted, about))
