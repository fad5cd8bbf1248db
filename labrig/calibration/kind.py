"""A kind of calibration: which protocol measures it, how its file is called, who names it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Generic, TypeVar

from labrig import plugins
from labrig.errors import UsageError

FileT = TypeVar("FileT")


@dataclass(frozen=True)
class CalibrationKind(Generic[FileT]):
    """What labrig knows of one kind of calibration.

    Parameters
    ----------
    name
        As the file's `kind` says, and what analyses call it among their inputs.
    protocol
        Measures it. The analysis that is registered under that name fits it.
    optics_key
        Names its file, or its run, under `optics:` in a rig file.
    file_name
        In the result of a run.
    read, write
        Of its file.
    """

    name: str
    protocol: str
    optics_key: str
    file_name: str
    read: Callable[[Path], FileT]
    write: Callable[[Path, FileT], None]

    def read_named(self, path: Path) -> FileT:
        """The file itself, or the one in a run folder's result, be it one part of a chain.

        Raises
        ------
        UsageError
            It is missing or malformed, or the run has none or several.
        """
        if not path.is_dir():
            return self.read(path)
        found = [*path.glob(f"result/{self.file_name}"), *path.glob(f"result/*/{self.file_name}")]
        if len(found) != 1:
            raise UsageError(
                f"{path}: expected a run with one {self.file_name} in its result, got "
                f"{len(found)}; process it first, or name the file itself"
            )
        return self.read(found[0])

    def write_into(self, folder: Path, file: FileT) -> None:
        """Write `file` into a result's folder, by the kind's name for it."""
        self.write(folder / self.file_name, file)


@cache
def kinds() -> tuple[CalibrationKind[Any], ...]:
    """Return every kind of calibration, the shipped ones and those of installed packages.

    Returns
    -------
    tuple of CalibrationKind
        Sorted by name. Rig files have the key of each under `optics:`.

    Raises
    ------
    UsageError
        A package's kind cannot be imported.

    Examples
    --------
    >>> from labrig.calibration import kinds
    >>> [kind.name for kind in kinds()]
    ['blank', 'camera', 'fade', 'irradiance', 'lvf']
    """
    names = plugins.names(plugins.CALIBRATIONS)
    return tuple(plugins.load(plugins.CALIBRATIONS, name, "calibrations") for name in names)
