"""A kind of calibration: its protocol, its file and its key in rig files."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import BaseModel

from labrig.foundation.errors import UsageError
from labrig.foundation.plugins import measurements
from labrig.foundation.yaml_file import read_model, write_yaml

FileT = TypeVar("FileT", bound=BaseModel)


@dataclass(frozen=True)
class CalibrationKind(Generic[FileT]):
    """Description of one kind of calibration.

    Parameters
    ----------
    name
        Value of the file's key `kind`, and name of the input of analyses.
    protocol
        Name of the protocol that measures it; the analysis of that name fits it.
    optics_key
        Key under `optics:` in a rig file that names its file or its run.
    file_name
        Name of its file in the result of a run.
    model
        Content of its file.
    of_bench
        Whether it describes the bench, so that later runs of any sample find it beside theirs; a
        calibration of samples does not hold for others.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.calibration import LVF_KIND
    >>> lvf = LVF_KIND.read(Path("lvf.yaml"))
    >>> wavelength_nm = lvf.wavelengths.map().wavelength_nm([0.0, 0.5, 1.0])
    >>> [f"{nm:.0f} nm" for nm in wavelength_nm]
    ['391 nm', '554 nm', '704 nm']
    """

    name: str
    protocol: str
    optics_key: str
    file_name: str
    model: type[FileT]
    of_bench: bool = True

    def read(self, path: Path) -> FileT:
        """Read the file at `path`, or the one in the result of a run or chained run at `path`.

        Raises
        ------
        UsageError
            The file is missing or malformed, or the run has none or several.
        """
        if not path.is_dir():
            return read_model(path, self.model)
        paths = [*path.glob(f"result/{self.file_name}"), *path.glob(f"result/*/{self.file_name}")]
        if len(paths) != 1:
            raise UsageError(
                f"{path}: expected a run with one {self.file_name} in its result, got "
                f"{len(paths)}; process it first, or name the file itself"
            )
        return read_model(paths[0], self.model)

    def write(self, folder: Path, file: FileT) -> None:
        """Write `file` into a folder, such as a run's result, under the kind's file name."""
        write_yaml(folder / self.file_name, file)


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
    ['blank', 'camera', 'fade', 'irradiance', 'leds', 'lvf', 'reference', 'reflectance']
    """
    loaded = (registered.load("calibration") for _, registered in measurements())
    return tuple(sorted((kind for kind in loaded if kind is not None), key=lambda kind: kind.name))
