"""Concentrations of states at sites of a sample, with their derivatives."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.material import phi1, phi2


class Levels(NamedTuple):
    """Concentrations of N states at P sites, and their derivatives.

    Attributes
    ----------
    value
        Concentrations r, or light over that of full states rᵇ, mean over each exposure, shape (n,
        P, N).
    by_k_r
        Derivatives by the state's own k_r in s, shape (n, P, N).
    by_k_e
        Derivatives by the state's own k_e of every band in s, shape (n, P, N, B).
    by_order
        Derivatives by the state's own kinetic order, shape (n, P, N); 0 where it is held at 1.
    by_before
        Derivatives by the concentration that the charge before has left when its lamp was dark, or
        by that at the start, shape (n, P, N); 0 where there was neither.
    """

    value: FloatArray
    by_k_r: FloatArray
    by_k_e: FloatArray
    by_order: FloatArray
    by_before: FloatArray

    def of(self, which: NDArray[np.intp]) -> "Levels":
        """Return the levels at some indices, in their order."""
        return Levels(*(part[which] for part in self))

    def followed_by(self, later: "Levels") -> "Levels":
        """Return the levels, and later ones after them."""
        return Levels(*(np.concatenate(parts) for parts in zip(self, later, strict=True)))

    def meaned(self, places: int) -> "Levels":
        """Average over `places` per site, given all sites for one place after the other."""
        parts = (part.reshape(len(part), places, -1, *part.shape[2:]) for part in self)
        return Levels(*(part.mean(axis=1) for part in parts))

    def decayed(self, k_r_per_s: FloatArray, t_s: FloatArray, exposure_s: FloatArray) -> "Levels":
        """Return the levels in the dark of first order.

        They are averaged over exposures that begin `t_s` later, shape (n,).
        """
        t, x = t_s[:, None, None], exposure_s[:, None, None] * k_r_per_s
        mean = phi1(x)
        decay = np.exp(-k_r_per_s * t) * mean
        slope = exposure_s[:, None, None] * (phi2(x) - mean) / mean - t
        return Levels(
            self.value * decay,
            (self.by_k_r + self.value * slope) * decay,
            self.by_k_e * decay[..., None],
            self.by_order,
            self.by_before * decay,
        )


def mean_levels(of_parts: Sequence[Levels]) -> Levels:
    """Return the levels of a sample whose parts, each as large, have these."""
    return Levels(*(sum(values) / len(values) for values in zip(*of_parts, strict=True)))
