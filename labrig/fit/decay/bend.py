"""A sensor that bends: whether channels fall short of proportion where they are bright.

In a frame all channels have flicker and decay in common: only their ratios are compared. A sensor
that shows s (1 + β s) of a level s changes them in proportion to the level. With c the column of
that bend, across the signal in every frame, and J that of the channels' weights and offsets,
q = c − J J⁺c is what only the bend explains, and β = −q·r/q² ± 1/|q|. What it does to the fitted
parameters is −β J⁺c, with J and c in full, along the signal, too.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from labrig.fit.decay.diagnostics import MISFIT_LEVEL
from labrig.fit.decay.states import StatesFit
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.foundation.arrays import FloatArray
from labrig.results import with_uncertainty

#: Significance of a bend in σ, a chance of 6 in 100,000 without one.
BEND_SIGMAS = 4.0
#: Change of a fitted parameter in its σ from which a bend matters.
MATTERS_SIGMAS = 0.5
#: Part of the bend that weights and offsets must leave over; less is rounding.
LEAST_OWN = 1e-4
#: Smallest slope of the parameters that counts as dependent.
RCOND = 1e-10


@dataclass(frozen=True)
class Bend:
    """Deviation from proportion, and what it does.

    Attributes
    ----------
    at_brightest, sigma
        Relative deviation at the highest level, negative if it falls short, and σ.
    effect_sigmas
        Largest change of a fitted rate or amplitude, in its σ.
    rest_chi2, dof
        χ² between the channels beside the bend, and its degrees of freedom.
    """

    at_brightest: float
    sigma: float
    effect_sigmas: float
    rest_chi2: float
    dof: float

    @property
    def is_evident(self) -> bool:
        """Whether there is one that matters, and nothing else changes the channels' ratios."""
        is_significant = abs(self.at_brightest) > BEND_SIGMAS * self.sigma
        explains = chdtrc(max(self.dof, 1), self.rest_chi2) > MISFIT_LEVEL
        return bool(is_significant and explains and self.effect_sigmas > MATTERS_SIGMAS)


def bend(data: WhitenedSeries, fit: StatesFit, covariance: FloatArray) -> Bend | None:
    """Return the bend of the sensor as the channels' ratios tell it; None if they do not.

    Parameters
    ----------
    data
        The series in units of its noise.
    fit
        The fit at its minimum.
    covariance
        Covariance of the fitted parameters, shape (p, p).
    """
    series, joint = data.series, fit.joint
    unit = data.constant(joint.weights)
    if len(series.channels) < 2 or not np.isfinite(covariance).all():
        return None
    level = np.maximum(fit.signal(series), 0.0) * _exposures(series.exposure)[:, None]
    column = np.zeros(len(data.target))
    bent = np.einsum("fcd,fd->fc", data.matrices, fit.signal(series) * level / level.max())
    column[: unit.size] = bent.ravel()
    jacobian, residuals = joint.least_squares.jacobian, joint.least_squares.residuals
    shape = len(joint.shape)
    of_ratios = _across(np.column_stack([jacobian[:, shape:], column, residuals]), unit)
    nuisance, own, rest = of_ratios[:, :-2], of_ratios[:, -2], of_ratios[:, -1]
    own = own - nuisance @ _solved(nuisance, own)
    own2 = float(own @ own)
    if own2 <= LEAST_OWN**2 * float(column @ column):
        return None
    rest = rest - nuisance @ _solved(nuisance, rest)
    found = -float(own @ rest) / own2
    left = rest + found * own
    dof = series.n_values - series.n_frames - np.linalg.matrix_rank(nuisance) - 1
    rest_chi2 = float(left @ left)
    effect = found * _solved(jacobian, column)
    sigma = np.sqrt(np.diag(covariance)[:shape])
    return Bend(
        at_brightest=found,
        sigma=own2**-0.5,
        effect_sigmas=float(np.max(np.abs(effect[:shape]) / np.where(sigma > 0, sigma, np.inf))),
        rest_chi2=rest_chi2,
        dof=dof,
    )


def bend_warnings(found: Bend | None) -> list[str]:
    """Return a warning where a bend of the sensor matters."""
    if found is None or not found.is_evident:
        return []
    percent = with_uncertainty(100 * abs(found.at_brightest), 100 * found.sigma)
    how = "fall short of" if found.at_brightest < 0 else "exceed"
    return [
        f"bright values {how} proportion, by {percent} % at the brightest: the channels' ratios "
        "change with their level, as of a sensor that is not linear, which moves rates and "
        f"amplitudes by up to {found.effect_sigmas:.2g} σ; expose for less, or it is the states "
        "that differ in colour: fit the channels one by one"
    ]


def _exposures(exposure: FloatArray) -> FloatArray:
    """Return the exposure times, or ones where the values are no means over exposures."""
    return exposure if exposure.min() > 0 else np.ones_like(exposure)


def _across(rows: FloatArray, unit: FloatArray) -> FloatArray:
    """Return rows (n C + p, q), those of frames without their part along the signal (n, C)."""
    length = np.linalg.norm(unit, axis=1)
    direction = unit / np.where(length > 0, length, 1.0)[:, None]
    across = rows.copy()
    frames = across[: unit.size].reshape(*unit.shape, -1)
    frames -= direction[:, :, None] * np.einsum("fc,fcq->fq", direction, frames)[:, None, :]
    return across


def _solved(design: FloatArray, target: FloatArray) -> FloatArray:
    """Return the least-squares solution; columns of rounding have none of it."""
    norms = np.linalg.norm(design, axis=0)
    scale = np.where(norms > 0, norms, 1.0)
    solution: FloatArray = np.linalg.lstsq(design / scale, target, rcond=RCOND)[0] / scale
    return solution
