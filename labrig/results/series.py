"""Time series of one patch of the sample, frame by frame."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.notebook_views import CsvTable, NotebookViews
from labrig.foundation.result_warning import ResultWarning
from labrig.results.table_clock import TableClock
from labrig.results.text_files import write_csv

#: Columns of series.csv that are not channels.
TIME, EXPOSURE, SIGMA_SUFFIX = "t_s", "exposure_s", "_sigma"
RESERVED = ("iso", "f_number", "frame", "unit", "region", "flag")
#: Flags of rows that a fit must leave out, and the sign that joins the flags of one row.
EXCLUDING = frozenset({"clipped", "excluded", "afterglow"})
FLAG_JOINER = "+"
#: Values and their σ are no larger: squares of what is larger exceed floating-point numbers.
LARGEST = 1e100


@dataclass(frozen=True, eq=False)
class Series(NotebookViews):
    """Values of one patch over n frames and C channels.

    Parameters
    ----------
    t_s
        Start of each exposure in seconds after lamp off, or by another `clock`, shape (n,).
    exposure_s
        Exposure times in seconds, shape (n,); 0 if unknown.
    values
        Signal in DN/s, black and dark subtracted and divided by the exposure time, shape (n, C).
        Read from another program's table, it is in the table's unit.
    sigma
        Standard uncertainty in the unit of `values` by photon, read and dark noise of each frame,
        shape (n, C); NaN where unknown. Flicker of lamp, shutter and aperture is not in it: it is
        common to all channels of a frame, and the fit measures it.
    dark_sigma
        Standard uncertainty in DN/s of the subtracted dark level, common to all frames, shape (C,):
        the prior of a fit's offset. 0 if a background region was subtracted in each frame, NaN if
        unknown. Not a column of series.csv.
    channels
        Names of the C channels, such as `("R", "G", "B")`.
    iso, f_number
        ISO and f-number of each frame, shape (n,); NaN where unknown.
    frame, unit
        File name and unit of the run of each frame.
    flag
        Flags of each frame such as `clipped`, `late` or `excluded`, joined by `+`; empty without
        any.
    region
        Name of the patch.
    correlation
        Correlation of the channels' noise in one frame, shape (C, C); None if unknown. Not a column
        of series.csv.
    dark_correlation
        Correlation of the channels' dark levels, whose σ is `dark_sigma`, shape (C, C); None if
        unknown. Not a column of series.csv.
    value_unit
        Unit of `values`, which their columns in series.csv have in brackets; empty if unknown.
    warnings
        Limits of the rows that were read, such as those left out. Not in series.csv.
    clock
        Clock by which the table counts that was read. Not a column of series.csv.
    """

    t_s: FloatArray
    exposure_s: FloatArray
    values: FloatArray
    sigma: FloatArray
    dark_sigma: FloatArray
    channels: tuple[str, ...]
    iso: FloatArray
    f_number: FloatArray
    frame: tuple[str, ...]
    unit: tuple[str, ...]
    flag: tuple[str, ...]
    region: str = ""
    correlation: FloatArray | None = None
    dark_correlation: FloatArray | None = None
    value_unit: str = "DN/s"
    warnings: tuple[ResultWarning, ...] = ()
    clock: TableClock = field(default=TableClock())

    def __post_init__(self) -> None:
        _check_shapes(self)
        _check_numbers(self)
        _check_texts(self)

    @property
    def usable(self) -> npt.NDArray[np.bool_]:
        """Whether no flag excludes a row, shape (n,)."""
        return np.array([is_usable(flag) for flag in self.flag])

    def take(self, rows: npt.NDArray[np.intp], region: str | None = None) -> "Series":
        """Return the given rows in that order, renamed to `region` if that is given."""
        return Series(
            t_s=self.t_s[rows],
            exposure_s=self.exposure_s[rows],
            values=self.values[rows],
            sigma=self.sigma[rows],
            dark_sigma=self.dark_sigma,
            channels=self.channels,
            iso=self.iso[rows],
            f_number=self.f_number[rows],
            frame=tuple(self.frame[row] for row in rows),
            unit=tuple(self.unit[row] for row in rows),
            flag=tuple(self.flag[row] for row in rows),
            region=self.region if region is None else region,
            correlation=self.correlation,
            dark_correlation=self.dark_correlation,
            value_unit=self.value_unit,
            warnings=self.warnings,
            clock=self.clock,
        )

    def by_unit(self) -> list["Series"]:
        """Return one series per unit, in order of appearance."""
        units = np.array(self.unit)
        return [self.take(np.flatnonzero(units == unit)) for unit in dict.fromkeys(self.unit)]

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the table `series.csv`; `read_series` reads the same numbers back."""
        return {"series.csv": _table([self])}


def write_series(path: Path, series: Sequence[Series]) -> None:
    """Write the series of several patches into one CSV file, one below the other.

    Parameters
    ----------
    path
        Path of the file.
    series
        Series of patches with the same channels.

    Raises
    ------
    DataError
        The patches have different channels.
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.results import write_series
    >>> left = labrig.read_series("series.csv")[0]
    >>> right = replace(left, region="right", values=1.1 * left.values)
    >>> write_series(Path("two-patches.csv"), [left, right])
    >>> [series.region for series in labrig.read_series("two-patches.csv")]
    ['sample', 'right']
    """
    table = _table(series)
    write_csv(path, table.head, table.rows)


def _table(series: Sequence[Series]) -> CsvTable:
    channels = {(part.channels, part.value_unit) for part in series}
    if len(channels) != 1:
        raise DataError(f"expected series of the same channels and unit, got {sorted(channels)}")
    names, unit = channels.pop()
    in_unit = f" ({unit})" if unit else ""
    columns = [
        column for name in names for column in (name + in_unit, name + SIGMA_SUFFIX + in_unit)
    ]
    rows = (row for part in series for row in _rows(part))
    return CsvTable((TIME, EXPOSURE, *columns, *RESERVED), rows)


def _rows(series: Series) -> Iterator[list[str]]:
    for i in range(len(series.t_s)):
        pairs = zip(series.values[i], series.sigma[i], strict=True)
        yield [
            _number(series.t_s[i]),
            _number(series.exposure_s[i]),
            *(_number(number) for pair in pairs for number in pair),
            _number(series.iso[i]),
            _number(series.f_number[i]),
            series.frame[i],
            series.unit[i],
            series.region,
            series.flag[i],
        ]


def _number(value: np.float64) -> str:
    """Return the shortest text that reads back as the same number; empty for NaN."""
    return "" if np.isnan(value) else repr(float(value))


def _check_shapes(series: Series) -> None:
    n, c = len(series.t_s), len(series.channels)
    if n == 0 or c == 0:
        raise DataError(f"expected rows and channels, got {n} rows of {c} channels")
    if series.values.shape != (n, c) or series.sigma.shape != (n, c):
        raise DataError(
            f"expected values and sigma of shape {(n, c)}, got {series.values.shape} "
            f"and {series.sigma.shape}"
        )
    numbers = [len(column) for column in (series.exposure_s, series.iso, series.f_number)]
    texts = [len(column) for column in (series.frame, series.unit, series.flag)]
    if {*numbers, *texts} != {n} or series.dark_sigma.shape != (c,):
        raise DataError(f"expected {n} entries in every column and {c} dark_sigma")


def _check_numbers(series: Series) -> None:
    for name, column in (
        (TIME, series.t_s),
        (EXPOSURE, series.exposure_s),
        ("values", series.values),
    ):
        if not np.isfinite(column).all():
            raise DataError(f"expected finite numbers in {name}, got NaN or infinity")
    for name, column in (("values", series.values), ("sigma", series.sigma)):
        if (largest := np.abs(column).max(initial=0.0, where=~np.isnan(column))) > LARGEST:
            raise DataError(f"expected {name} up to {LARGEST:g}, got {largest:g}")
    if (series.exposure_s < 0).any():
        raise DataError("expected exposures of 0 s or more, got a negative one")
    if np.isinf(series.sigma).any() or (series.sigma <= 0).any():
        raise DataError(
            "expected sigma above 0 (a value without uncertainty would outweigh all others), got "
            "0, less or infinity; leave it empty where it is not known"
        )


def _check_texts(series: Series) -> None:
    reserved = {TIME, EXPOSURE, *RESERVED}
    for name in series.channels:
        if not name or name in reserved or name.endswith(SIGMA_SUFFIX) or not _is_plain(name):
            raise DataError(f"{name!r} cannot name a channel; rename it")
        reserved.add(name)
    for text in {*series.frame, *series.unit, *series.flag, series.region}:
        if not _is_plain(text):
            raise DataError(f"expected a text on one line without outer spaces, got {text!r}")


def _is_plain(text: str) -> bool:
    return text.isprintable() and text == text.strip()


def is_usable(flag: str) -> bool:
    """Return whether no flag excludes its row from a fit.

    Parameters
    ----------
    flag
        Flags of a row, joined by `+`; empty if there are none.

    Returns
    -------
    bool
        False if `clipped`, `excluded` or `afterglow` is among the flags.

    Examples
    --------
    >>> from labrig.results import is_usable
    >>> is_usable(""), is_usable("late"), is_usable("late+clipped")
    (True, True, False)
    """
    return EXCLUDING.isdisjoint(flag.split(FLAG_JOINER))


def add_flag(flag: str, word: str) -> str:
    """Add a flag to those of a row, once.

    Parameters
    ----------
    flag
        Flags of the row, joined by `+`; empty if there are none.
    word
        The flag to add.

    Returns
    -------
    str
        The flags with `word` among them.

    Examples
    --------
    >>> from labrig.results import add_flag
    >>> add_flag("late", "clipped"), add_flag("late+clipped", "clipped")
    ('late+clipped', 'late+clipped')
    """
    words = [part for part in flag.split(FLAG_JOINER) if part]
    return FLAG_JOINER.join(dict.fromkeys([*words, word]))
