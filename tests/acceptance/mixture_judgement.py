"""How far surfaces of few numbers are from measured ones, and how far repeats are from each other.

Labsphere BFC-450 matrices of fluorescent materials and two Post-It notes, and 13 days of
measurements of ceramic tiles, by the same instrument, which tell how well one measurement repeats.
"""

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from labrig.foundation.errors import DataError
from labrig.material import (
    ReradiationMatrix,
    compare_colours,
    corrected,
    matrix_files,
    read_reradiation,
    reradiates,
)
from labrig.optics import read_light
from tests.acceptance.mixture_colours import LIGHTS, MIN_FRACTION
from tests.acceptance.mixture_peer_methods import Target
from tests.real_data import SHARED

Floats = npt.NDArray[np.float64]

BISPECTRAL = SHARED / "bispectral"
POSTITS = ("yellow", "green")
#: Reflectances of one tile on two days differ by less; some files have another tile's name.
SAME_TILE = 0.05
#: Differences of repeats that are added to each material.
REPEATS_EACH = 5
SPECTRA = [read_light(name) for name in LIGHTS]

Pair = tuple[ReradiationMatrix, ReradiationMatrix]


@dataclass(frozen=True, eq=False)
class Tried:
    """What one method makes of all materials, or how far repeats are apart; NaN where it failed.

    Attributes
    ----------
    components
        Size of what was fitted: components or rank; 0 if nothing was.
    numbers
        Numbers that are stored.
    seconds
        Processor time of the fit.
    mse, delta_e, xyz_error
        Masked error, and colour differences under the lights.
    """

    name: str
    components: int = 0
    numbers: list[int] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    mse: list[float] = field(default_factory=list)
    delta_e: list[list[float]] = field(default_factory=list)
    xyz_error: list[list[float]] = field(default_factory=list)

    @property
    def label(self) -> str:
        return f"{self.name} {self.components}" if self.components else self.name

    def judge(self, surface: ReradiationMatrix, reference: ReradiationMatrix, mse: float) -> None:
        """Compare a surface with a reference."""
        found = compare_colours(surface, reference, SPECTRA)
        self.mse.append(mse)
        self.delta_e.append([one.delta_e for one in found])
        self.xyz_error.append([one.xyz_error for one in found])

    def judge_none(self) -> None:
        """Note that there is no surface."""
        self.mse.append(np.nan)
        self.delta_e.append([np.nan] * len(LIGHTS))
        self.xyz_error.append([np.nan] * len(LIGHTS))


def fluorescent(folder: Path) -> Iterator[ReradiationMatrix]:
    """Yield the matrices that re-radiate more than their noise, corrected."""
    files = matrix_files(folder / "rit_bfc450")
    notes = [folder / f"art_postit/fluorescent_{colour}.csv" for colour in POSTITS]
    for path in [*files, *notes]:
        measured = read_reradiation(path)
        if measured.reradiated_fraction.max() <= MIN_FRACTION:
            continue
        whole = corrected(measured)
        if reradiates(whole):
            yield replace(whole, name=path.stem)


def repeats(folder: Path) -> Iterator[Pair]:
    """Yield measurements of the same tile on one day and on the next that has one, corrected."""
    by_tile: dict[tuple[str, ...], dict[str, Path]] = defaultdict(dict)
    for path in sorted((folder / "rit_bfc450/bcra_repeats").glob("*/*.BFC")):
        named = re.fullmatch(r"BCR?([A-Z]{2})\d+(W[RO])", path.stem)
        if named:
            by_tile[named.groups()].setdefault(path.parent.name, path)
    for days in by_tile.values():
        measured = []
        for path in days.values():
            try:
                measured.append(corrected(read_reradiation(path)))
            except DataError:
                continue  # some files of the folder lack rows
        for first, second in pairwise(measured):
            is_same_tile = np.abs(second.reflectance - first.reflectance).max() < SAME_TILE
            # Some files are there under two names.
            if is_same_tile and stokes_mse(first, second) > 0:
                yield first, second


def noise_floors(targets: Sequence[Target], pairs: Sequence[Pair]) -> list[Tried]:
    """Return what the threshold does by itself, and how far repeats are apart."""
    threshold, kept = Tried("threshold alone"), Tried("noise of kept entries")
    of_materials, of_tiles = Tried("materials, another day"), Tried("tiles, another day")
    for first, second in pairs:
        of_tiles.judge(second, first, stokes_mse(first, second))
    rng = np.random.default_rng(18)
    for target in targets:
        matrix = target.matrix
        threshold.judge(with_values(matrix, target.values), matrix, 0.0)
        assert matrix.reradiation_sigma is not None
        sigma = (matrix.reradiation_sigma * matrix.output_width_nm[:, np.newaxis])[matrix.is_stokes]
        kept.mse.append(float(np.square(sigma[target.entries.is_kept]).sum() / len(sigma)))
        for index in rng.choice(len(pairs), REPEATS_EACH, replace=False):
            again = another_day(matrix, pairs[index])
            of_materials.judge(again, matrix, stokes_mse(matrix, again))
    return [threshold, kept, of_materials, of_tiles]


def another_day(matrix: ReradiationMatrix, pair: Pair) -> ReradiationMatrix:
    """Return a matrix whose re-radiation differs as that of a tile does between two days."""
    first, second = pair
    change = second.reradiation - first.reradiation
    return replace(matrix, reradiation=matrix.reradiation + change)


def with_values(matrix: ReradiationMatrix, values: Floats) -> ReradiationMatrix:
    """Return a matrix with other re-radiation, given per band."""
    return replace(matrix, reradiation=values / matrix.output_width_nm[:, np.newaxis])


def stokes_mse(first: ReradiationMatrix, second: ReradiationMatrix) -> float:
    """Return the mean squared difference per band on the Stokes side."""
    off = (second.reradiation - first.reradiation) * first.output_width_nm[:, np.newaxis]
    return float(np.square(off[first.is_stokes]).mean())


def quantiles(values: Sequence[float] | Floats, *chances: float) -> list[float]:
    """Return quantiles of the values that are known."""
    known = np.asarray(values)[np.isfinite(values)]
    return [float(np.quantile(known, chance)) if len(known) else np.nan for chance in chances]
