"""Result and report of a mixture that stands for a re-radiation matrix."""

import hashlib
from importlib.metadata import version
from pathlib import Path

from labrig.errors import DiskError
from labrig.process.provenance import library_versions
from labrig.record import RunDescription
from labrig.report import FittedMatrix, mixture_report, write_report


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
    about = RunDescription(
        title=fitted.matrix.name,
        protocol="mixture",
        run=file.name,
        started="",
        ended="",
        rig="",
        simulated=False,
        labrig_version=version("labrig"),
        libraries=tuple(library_versions().items()),
        sample=(
            ("SHA-256", hashlib.sha256(file.read_bytes()).hexdigest()),
            ("Command", command),
        ),
    )
    report = folder / "report.html"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "fit.json").write_text(fitted.to_json() + "\n", encoding="utf-8")
    except OSError as error:
        raise DiskError(f"{folder}: cannot be written ({error.strerror})") from None
    write_report(report, mixture_report(fitted, about))
    return report
