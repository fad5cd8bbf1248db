"""Calibrations that are kept beside the runs: a folder `calibrations`, one folder in it a run."""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from labrig.calibration.kind import kinds
from labrig.calibration.reference_file import REFERENCE_KIND, ReferenceFile
from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes
from labrig.foundation.output_file import make_folder_in, write_durably

#: Name of the folder beside the run folders.
FOLDER = "calibrations"


@dataclass(frozen=True)
class KeptCalibration:
    """The files of one calibration run.

    Attributes
    ----------
    folder
        Folder of the files.
    reference
        The bench to which they belong.
    """

    folder: Path
    reference: ReferenceFile

    def files(self) -> dict[str, Path]:
        """Return the calibration files that there are, by the names of their kinds."""
        paths = {kind.name: self.folder / kind.file_name for kind in kinds()}
        return {name: path for name, path in paths.items() if path.is_file()}


def keep_calibration(run: Path, reference: ReferenceFile | None = None) -> Path | None:
    """Copy the calibration files of a run's result to the calibrations beside the run.

    Parameters
    ----------
    run
        Folder of a run that has a result.
    reference
        The bench, where the result has no reference file: that of a run which measures one kind of
        calibration of the bench. None: there is none to keep.

    Returns
    -------
    Path or None
        Folder of the copies, of the run's name; None if the result is not that of a calibration.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.calibration import keep_calibration
    >>> keep_calibration(Path("runs/decay")) is None
    True
    """
    result = run / "result"
    if reference is None and not (result / REFERENCE_KIND.file_name).is_file():
        return None
    folder = make_folder_in(run.resolve().parent, FOLDER) / run.resolve().name
    new = folder.with_name(f"{folder.name}.part")
    shutil.rmtree(new, ignore_errors=True)
    new.mkdir()
    for kind in kinds():
        for path in [*result.glob(kind.file_name), *result.glob(f"*/{kind.file_name}")]:
            write_durably(new / kind.file_name, read_bytes(path, MAX_TEXT_BYTES))
    if reference is not None:
        REFERENCE_KIND.write(new, reference)
    if folder.exists():
        shutil.rmtree(folder)
    new.rename(folder)
    return folder


def kept_calibrations(*beside: Path) -> list[KeptCalibration]:
    """Return the calibrations that are kept in folders, the newest first.

    Parameters
    ----------
    *beside
        Folders that have a folder `calibrations`: that of the run folders, that of the rig file.

    Returns
    -------
    list of KeptCalibration
        The calibrations of all benches; empty if there are none.

    Raises
    ------
    UsageError
        A reference file is malformed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.calibration import kept_calibrations
    >>> kept_calibrations(Path("runs"))
    []
    """
    paths = {path.resolve(): None for folder in beside for path in _references(folder)}
    kept = (KeptCalibration(path.parent, REFERENCE_KIND.read(path)) for path in paths)
    return sorted(kept, key=lambda each: (each.reference.made, each.folder.name), reverse=True)


def _references(beside: Path) -> Iterator[Path]:
    for path in sorted((beside / FOLDER).glob(f"*/{REFERENCE_KIND.file_name}")):
        if path.parent.suffix != ".part":
            yield path
