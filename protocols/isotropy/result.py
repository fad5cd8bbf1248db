"""Result of an isotropy run: the glow of a sample by its angle."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from labrig.foundation.arrays import FloatArray, IntArray
from labrig.foundation.notebook_views import CsvTable
from labrig.results.budget import Budget, named
from labrig.results.measured import Measured
from labrig.results.run_result import RunResult

#: Largest fluctuation of the paper's samples (section 4).
PAPER_FLUCTUATION = 0.05
#: Significance in σ of a deviation beyond that.
SIGMAS = 2.0


def is_within_paper(ratio: Measured) -> bool:
    """Return whether a ratio of two views deviates from 1 by no more than the paper's samples do.

    The paper's samples fluctuate by 5 % at most (section 4); a deviation beyond that counts if it
    is significant by 2 σ.

    Parameters
    ----------
    ratio
        Radiance of a view relative to the straight view, with its standard uncertainty.

    Returns
    -------
    bool
        True if the deviation is within 5 % and 2 σ.

    Examples
    --------
    >>> from labrig.results import Measured
    >>> from labrig.protocols.isotropy.result import is_within_paper
    >>> is_within_paper(Measured(0.93, 0.02)), is_within_paper(Measured(0.93, 0.005))
    (True, False)
    """
    return abs(ratio.value - 1) < PAPER_FLUCTUATION + SIGMAS * ratio.sigma


@dataclass(frozen=True, eq=False)
class AngularGlow:
    """Glow of a patch at n angles relative to the straight view at the same time.

    Attributes
    ----------
    angle_deg
        Angles against the camera's axis in degrees, rising, shape (n,).
    ratio, ratio_sigma
        Radiance relative to that of the straight view and its standard uncertainty, shape (n,); 1
        if the emission is isotropic.
    drift
        Ratio of the straight views after and before all others; it is divided out of `ratio`.
    """

    angle_deg: IntArray
    ratio: FloatArray
    ratio_sigma: FloatArray
    drift: Measured

    @property
    def worst(self) -> Measured:
        """Ratio with the largest deviation from 1."""
        return Measured(
            float(self.ratio[self._worst_index]), float(self.ratio_sigma[self._worst_index])
        )

    @property
    def worst_angle_deg(self) -> int:
        """Angle of the largest deviation in degrees."""
        return int(self.angle_deg[self._worst_index])

    @property
    def _worst_index(self) -> int:
        return int(np.argmax(np.abs(self.ratio - 1)))


@dataclass(frozen=True, eq=False, kw_only=True)
class IsotropyResult(RunResult):
    """Radiance over angle.

    Attributes
    ----------
    patches
        Angular glow of each patch by its name.
    encloses_sample
        Whether the patches enclose the whole sample, so that its intensity was divided by the
        cosine of the angle; else they lie inside of it and show its radiance.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for glow in result.patches.values():
    ...     print(dict(zip(glow.angle_deg, glow.ratio)), glow.worst.value)
    """

    kind: ClassVar[str] = "isotropy"

    patches: Mapping[str, AngularGlow]
    encloses_sample: bool

    def budgets(self) -> dict[str, Budget]:
        """Return the budget of each patch's view that deviates most from the straight one."""
        return {
            named(name, f"glow at {glow.worst_angle_deg}° over that at 0°"): Budget.of(
                glow.worst, left_out=("the angle's own error",)
            )
            for name, glow in self.patches.items()
        }

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the table `isotropy.csv`."""
        rows = (
            (name, angle_deg, f"{ratio:.6g}", f"{sigma:.6g}")
            for name, glow in self.patches.items()
            for angle_deg, ratio, sigma in zip(
                glow.angle_deg, glow.ratio, glow.ratio_sigma, strict=True
            )
        )
        head = ("patch", "angle_deg", "ratio", "ratio_sigma")
        return {"isotropy.csv": CsvTable(head, rows)}
