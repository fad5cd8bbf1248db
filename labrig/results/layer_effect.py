"""Range that the thickness of a sample leaves to rates that were fitted as those of a surface."""

from dataclasses import dataclass
from enum import StrEnum

from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import rounded

#: Name of the cause in budgets.
THICKNESS = "thickness"
#: Largest optical density where nothing was measured: the back gets 1 % of the light.
PRIOR_DENSITY = 2.0


class DensityBasis(StrEnum):
    """Origin of the largest optical density that a sample may have."""

    PRIOR = "not measured"
    STATED = "as stated"
    REFLECTANCE = "by its reflectance, if it does not scatter"


@dataclass(frozen=True, eq=False)
class LayerEffect:
    """Range of k_e and Λ of a layer over those of a surface with the same glow.

    It is a range of what may be, and no standard uncertainty.

    Attributes
    ----------
    optical_density
        Least and largest decadic optical density that the charges leave, in the band of which it is
        largest.
    basis
        Origin of the largest one that was tried.
    k_e_factor
        Least and largest k_e over the fitted, of light as it falls on the surface, shape (2, N, B).
    reradiation_factor
        Least and largest Λ over the fitted, shape (2, N).
    """

    optical_density: tuple[float, float]
    basis: DensityBasis
    k_e_factor: FloatArray
    reradiation_factor: FloatArray

    @property
    def is_shown(self) -> bool:
        """True if the charges themselves contradict a surface."""
        return self.optical_density[0] > 0

    def __str__(self) -> str:
        """Return the statement in words."""
        low, high = (rounded(end, 2) for end in self.optical_density)
        shown = "by the charges themselves" if self.is_shown else self.basis
        k_e, whole = (_times(factor) for factor in (self.k_e_factor, self.reradiation_factor))
        return f"optical density {low} to {high} ({shown}): true k_e {k_e}, Λ {whole} those stated"


def _times(factor: FloatArray) -> str:
    low, high = (rounded(end, 3) for end in (float(factor.min()), float(factor.max())))
    return f"{low} to {high} times"
