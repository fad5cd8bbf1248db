"""Closure: charging predicted from the rates of each band against that measured under the lamp."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.material import dark_concentration, lit_concentration, mean_emission
from labrig.results import Closure, spans_decades

#: Number of points of the predicted curve.
POINTS = 200
#: Least κ in 1/s: no state gets so little light that it matters.
MIN_KAPPA = 1e-12


@dataclass(frozen=True, eq=False)
class Charging:
    """Rates and levels of a sample under the lamp.

    Attributes
    ----------
    k_e_per_s, k_r_per_s
        Excitation rates (m, b) and re-radiation rates (m,) in 1/s.
    full_level
        Level of each state at r = 1, shape (m,).
    irradiance
        Normalised irradiance of each band, shape (b,).
    kinetic_order
        Kinetic orders, shape (m,).
    """

    k_e_per_s: FloatArray
    k_r_per_s: FloatArray
    full_level: FloatArray
    irradiance: FloatArray
    kinetic_order: FloatArray

    def __post_init__(self) -> None:
        m, b = len(self.k_r_per_s), len(self.irradiance)
        each = (self.full_level.shape, self.kinetic_order.shape)
        if self.k_e_per_s.shape != (m, b) or each != ((m,), (m,)):
            raise DataError(
                f"closure: expected k_e of shape {(m, b)}, {m} full levels and kinetic orders, got "
                f"{self.k_e_per_s.shape}, {each[0]} and {each[1]}"
            )

    def level(
        self, charge_s: FloatArray, r0: FloatArray, dark_s: FloatArray, exposure_s: FloatArray
    ) -> FloatArray:
        """Return levels after charges from `r0` (n, m); all other arguments are (n,).

        Of P sites with `r0` (P, n, m) the levels are averaged.
        """
        kappa = np.maximum(self.k_e_per_s @ self.irradiance, MIN_KAPPA)
        k_r, order = self.k_r_per_s, self.kinetic_order
        charged = lit_concentration(r0, kappa, k_r, order, charge_s[:, np.newaxis])
        begins = dark_concentration(charged, k_r, order, dark_s[:, np.newaxis])
        emitted = mean_emission(begins, k_r, order, exposure_s[:, np.newaxis]).value
        return np.asarray((emitted @ self.full_level).reshape(-1, len(charge_s)).mean(axis=0))


def closure(
    charge_s: ArrayLike,
    level: ArrayLike,
    sigma: ArrayLike,
    *,
    irradiance: ArrayLike,
    k_e_per_s: ArrayLike,
    k_r_per_s: ArrayLike,
    full_level: ArrayLike,
    r0: ArrayLike = 0.0,
    dark_s: ArrayLike = 0.0,
    exposure_s: ArrayLike = 0.0,
    kinetic_order: ArrayLike = 1.0,
) -> Closure:
    """Predict levels after charges of different lengths and compare them with measured ones.

    With m states, b bands and n charges: κ_i = Σ_j k_e,ij E_j, r_i after the charge by the rate
    equation of its kinetic order b, and level = Σ_i full_level_i r_iᵇ averaged over an exposure
    that begins after a time in the dark.

    Parameters
    ----------
    charge_s, level, sigma
        Durations of the charges in s (turn-off transients as equivalent time at full light), levels
        measured after them, and σ of the difference to the prediction, shape (n,).
    irradiance
        Irradiance of the lamp in the norm to which `k_e_per_s` belongs, shape (b,).
    k_e_per_s, k_r_per_s
        Excitation rates (m, b) and re-radiation rates (m,) in 1/s.
    full_level
        Level of each state at r = 1, given by Λ_i k_r,i, shape (m,).
    r0
        Concentrations before each charge: a scalar, (m,) or (n, m), or (P, n, m) of P sites whose
        levels are averaged.
    dark_s, exposure_s
        Time from lamp off to the start of the exposure, and its length, in s: a scalar or (n,).
    kinetic_order
        Kinetic order b of each state: a scalar or (m,).

    Raises
    ------
    DataError
        Shapes disagree, numbers are not finite, or a σ is not above 0.
    """
    k_r = _floats(k_r_per_s)
    order = np.broadcast_to(_floats(kinetic_order), k_r.shape)
    sample = Charging(_floats(k_e_per_s), k_r, _floats(full_level), _floats(irradiance), order)
    charge, measured, noise = map(_floats, (charge_s, level, sigma))
    if not (charge.ndim == 1 and charge.shape == measured.shape == noise.shape and charge.size):
        raise DataError("closure: expected as many levels and σ as charges, at least one")
    n, m = len(charge), len(sample.k_r_per_s)
    starts = _floats(r0)
    starts = np.broadcast_to(starts, (*starts.shape[:-2], n, m))
    dark, exposure = (np.broadcast_to(_floats(column), n) for column in (dark_s, exposure_s))
    if not all(
        np.isfinite(column).all() for column in (charge, measured, noise, starts, dark, exposure)
    ):
        raise DataError("closure: expected finite numbers, got NaN or infinity")
    if not (noise > 0).all():
        raise DataError("closure: expected σ above 0")
    predicted = sample.level(charge, starts, dark, exposure)
    by_length, line_s = np.argsort(charge, kind="stable"), _line(charge)

    def along(column: FloatArray) -> FloatArray:
        return np.interp(line_s, charge[by_length], column[by_length])

    along_starts = np.apply_along_axis(along, -2, starts)
    line = sample.level(line_s, along_starts, along(dark), along(exposure))
    return Closure(charge, measured, noise, predicted, line_s, line)


def _floats(values: ArrayLike) -> FloatArray:
    return np.asarray(values, dtype=np.float64)


def _line(charge_s: FloatArray) -> FloatArray:
    low, high = float(charge_s.min()), float(charge_s.max())
    if spans_decades(charge_s):
        return np.geomspace(low, high, POINTS)
    return np.linspace(min(low, 0.0), high, POINTS)
