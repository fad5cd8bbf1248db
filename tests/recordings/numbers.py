"""The numbers in a result folder, and by how many σ two such folders differ."""

import csv
import json
import math
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.quick_yaml import read_quickly

#: What changes of labrig that do not say otherwise may move a number by: in σ, or relative to it.
#: Linear algebra for other processors moves covariances that nearly cancel by up to 4e-8.
MAX_SIGMAS, MAX_RELATIVE = 1e-6, 1e-6
#: Which program made a result is no number of it.
_LEFT_OUT = "provenance.yaml"
#: Repeats what other files say, where there are others.
_SUMMARY = "result.json"


@dataclass(frozen=True)
class Difference:
    """A number of a result that is not as it was recorded.

    Parameters
    ----------
    place
        File and keys: `fit.json states 0 k_r_per_s`.
    recorded, now
        The number; None where there is none.
    sigma
        Its recorded standard uncertainty; NaN where it has none.
    """

    place: str
    recorded: float | None
    now: float | None
    sigma: float

    @property
    def sigmas(self) -> float:
        """The difference in σ; NaN where the number has no σ or is on one side only."""
        if self.recorded is None or self.now is None or not self.sigma > 0:
            return math.nan
        return (self.now - self.recorded) / self.sigma

    @property
    def relative(self) -> float:
        """The difference relative to the recorded number; infinite if that is 0 or on one side."""
        if self.recorded is None or self.now is None or self.recorded == 0:
            return math.inf
        return (self.now - self.recorded) / abs(self.recorded)

    @property
    def matters(self) -> bool:
        """Whether it is more than a change that keeps the numbers may make."""
        if math.isfinite(self.sigmas):
            return abs(self.sigmas) > MAX_SIGMAS
        return not abs(self.relative) <= MAX_RELATIVE

    def __str__(self) -> str:
        """A line for people."""
        size = (
            f"{self.sigmas:+.2g} σ" if math.isfinite(self.sigmas) else f"{self.relative:+.2g} of it"
        )
        return f"{self.place}: {self.recorded} → {self.now} ({size})"


def differences(recorded: Path, now: Path) -> list[Difference]:
    """All numbers that differ at all between two result folders, the furthest first."""
    before, after = _numbers(recorded), _numbers(now)
    found = [
        Difference(place, value, after.get(place, (None, 0.0))[0], sigma)
        for place, (value, sigma) in before.items()
        if not _same(value, after.get(place, (None, 0.0))[0])
    ]
    found += [Difference(p, None, after[p][0], math.nan) for p in after if p not in before]
    return sorted(found, key=lambda one: (not one.matters, -abs(one.relative)))


def keep_numbers(result: Path, kept: Path) -> None:
    """Copy the files of a result folder that hold numbers, in place of those kept before."""
    shutil.rmtree(kept, ignore_errors=True)
    for file in _number_files(result):
        (kept / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(result / file, kept / file)


def _number_files(folder: Path) -> list[Path]:
    """The files in a result folder that hold numbers, relative to it."""
    files = sorted(
        path.relative_to(folder)
        for path in folder.rglob("*")
        if path.suffix in _READERS and path.name != _LEFT_OUT
    )
    return [file for file in files if file.name != _SUMMARY] or files


def _same(one: float, other: float | None) -> bool:
    return one == other or (other is not None and math.isnan(one) and math.isnan(other))


def _numbers(folder: Path) -> dict[str, tuple[float, float]]:
    """Place → number and its σ."""
    return {
        f"{file.as_posix()} {place}": number
        for file in _number_files(folder)
        for place, number in _leaves(_READERS[file.suffix](folder / file), math.nan)
    }


def _leaves(content: Any, sigma: Any) -> Iterator[tuple[str, tuple[float, float]]]:
    """Every number in `content` by its keys, with the part of `sigma` that lies where it lies."""
    if isinstance(content, Mapping):
        for key, value in content.items():
            for place, number in _leaves(value, _sigma_beside(content, key)):
                yield f"{key} {place}".strip(), number
    elif isinstance(content, list):
        for index, value in enumerate(content):
            part = sigma[index] if isinstance(sigma, list) and index < len(sigma) else sigma
            for place, number in _leaves(value, part):
                yield f"{index} {place}".strip(), number
    elif isinstance(content, int | float) and not isinstance(content, bool):
        known = isinstance(sigma, int | float)
        yield "", (float(content), float(sigma) if known else math.nan)


def _sigma_beside(content: Mapping[str, Any], key: str) -> Any:
    """The value of the key that names the σ of `key`: `k_r_per_s_sigma` beside `k_r_per_s`."""
    if key == "value":
        return content.get("sigma", math.nan)
    for other, value in content.items():
        if "_sigma" in other and other.replace("_sigma", "", 1) == key:
            return value
    return math.nan


def _read_csv(path: Path) -> dict[str, list[float]]:
    """Columns of numbers; other columns are left out."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    columns: dict[str, list[float]] = {}
    for name in rows[0] if rows else ():
        try:
            columns[name] = [float(row[name]) for row in rows]
        except ValueError:
            continue
    return columns


def _read_json(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def _read_yaml(path: Path) -> Any:
    return read_quickly(path.read_text(encoding="utf-8"))


_READERS = {".csv": _read_csv, ".json": _read_json, ".yaml": _read_yaml}
