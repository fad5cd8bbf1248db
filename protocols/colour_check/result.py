"""Result of a check of colours: a ColorChecker as published and as measured."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import CsvTable
from labrig.results.budget import Budget
from labrig.results.run_result import RunResult


@dataclass(frozen=True, eq=False)
class CheckedColour:
    """A patch as measured.

    Attributes
    ----------
    lab
        L*, a*, b* with a perfect white under the lamp, shape (3,).
    xyz
        X, Y, Z for a picture, in which that white is a screen's, shape (3,).
    delta_e
        ΔE2000 from the published colour.
    allowed
        ΔE2000 that errors of chart, camera, lamp, filter and noise exceed in one case of twenty.
    """

    lab: FloatArray
    xyz: FloatArray
    delta_e: float
    allowed: float


@dataclass(frozen=True, eq=False)
class ColourSummary:
    """All patches that were measured in one way.

    Attributes
    ----------
    mean, largest
        Mean and largest ΔE2000.
    allowed
        Mean ΔE2000 that errors exceed in one case of two hundred.
    worst
        Name of the patch whose ΔE2000 is largest.
    beyond
        Names of patches that are beyond what is allowed to each.
    verdict
        Whether the mean is within what is allowed.
    """

    mean: float
    largest: float
    allowed: float
    worst: str
    beyond: tuple[str, ...]
    verdict: Literal["agrees", "differs"]


@dataclass(frozen=True, eq=False)
class CheckedPatch:
    """A patch of the chart.

    Attributes
    ----------
    published_lab, published_xyz
        Published colour under the lamp, as `CheckedColour.lab` and `.xyz`.
    plain
        The colour in the plain photograph, by the camera's curves.
    through
        The colour by the spectrum through the variable filter; None where it was not seen so.
    """

    published_lab: FloatArray
    published_xyz: FloatArray
    plain: CheckedColour
    through: CheckedColour | None


@dataclass(frozen=True, eq=False, kw_only=True)
class ColourCheckResult(RunResult):
    """A ColorChecker as published and as measured on this bench.

    Attributes
    ----------
    camera, lamp, chart
        Names of the curves, of the lamp's spectrum and of the chart's reflectances.
    patches
        The 24 patches by name, row by row.
    plain, through
        Summary of the plain photograph, and of the patches through the filter; None without these.
    channels
        Names of the k channels.
    card_balance, card_balance_sigma
        Values of the grey card over those by curves and lamp, relative to their mean, and σ, shape
        (k,).
    card_misfit
        Root of χ² per degree of freedom of the card through the filter; None without it.
    filter_shift_nm
        Shift of the filter's strip along itself since its calibration, in nm; None without it.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> print(f"{result.plain.mean:.1f}", result.plain.verdict)
    """

    kind: ClassVar[str] = "colour_check"

    camera: str
    lamp: str
    chart: str
    patches: Mapping[str, CheckedPatch]
    plain: ColourSummary
    through: ColourSummary | None
    channels: tuple[str, ...]
    card_balance: FloatArray
    card_balance_sigma: FloatArray
    card_misfit: float | None
    filter_shift_nm: float | None

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of the mean ΔE2000, of which no σ but a limit is known."""
        ways = {"plain": self.plain, "through the filter": self.through}
        return {
            f"mean ΔE2000, {way}": Budget(summary.mean)
            for way, summary in ways.items()
            if summary is not None
        }

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return a table of the patches, `colour_check.csv`."""
        labs = [f"{what}_{axis}" for what in ("published", "plain", "through") for axis in "Lab"]
        deltas = [
            f"{what}_{kind}" for what in ("plain", "through") for kind in ("delta_e", "allowed")
        ]
        rows = ((name, *_cells(patch)) for name, patch in self.patches.items())
        return {"colour_check.csv": CsvTable(("patch", *labs, *deltas), rows)}


def _cells(patch: CheckedPatch) -> list[str]:
    nothing = CheckedColour(np.full(3, np.nan), np.full(3, np.nan), np.nan, np.nan)
    through = patch.through or nothing
    numbers = [*patch.published_lab, *patch.plain.lab, *through.lab]
    numbers += [patch.plain.delta_e, patch.plain.allowed, through.delta_e, through.allowed]
    return ["" if np.isnan(number) else f"{number:.4f}" for number in numbers]
