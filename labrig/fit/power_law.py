"""Power law of a quantity, such as that of an amplitude over the dose that excited it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from labrig.foundation.errors import FitError
from labrig.foundation.notebook_views import NotebookViews
from labrig.results import Measured

#: Fewest different places that tell a slope and whether there is one.
FEWEST = 3


@dataclass(frozen=True)
class PowerLaw(NotebookViews):
    """Fitted power law y ∝ xⁿ.

    Attributes
    ----------
    exponent
        Exponent n: the slope in a plot with logarithmic axes.
    p_value
        Chance of values that lie further from one slope.
    """

    exponent: Measured
    p_value: float


def fit_power_law(x: ArrayLike, values: Sequence[Measured], common_sigma: float = 0.0) -> PowerLaw:
    """Fit y ∝ xⁿ, a line in logarithms, to measured quantities.

    Parameters
    ----------
    x
        Places, > 0, in any unit, shape (n,).
    values
        Quantities there, > 0, with finite σ > 0, one of each place.
    common_sigma
        Part of their relative σ that all have in common, such as that of a scale: it cancels.

    Returns
    -------
    PowerLaw
        Exponent and whether one describes the values.

    Raises
    ------
    FitError
        There are fewer than three different places, or something is not positive.

    Examples
    --------
    >>> from labrig.fit import fit_power_law
    >>> from labrig.results import Measured
    >>> print(fit_power_law([1, 4, 16], [Measured(y, 0.02 * y) for y in (10, 20, 40)]).exponent)
    0.500(10)
    """
    places = np.asarray(x, dtype=np.float64)
    value = np.array([each.value for each in values], dtype=np.float64)
    sigma = np.array([each.sigma for each in values], dtype=np.float64)
    if len(places) != len(value) or len(np.unique(places)) < FEWEST:
        raise FitError(
            f"expected values at {FEWEST} different places or more, got {len(value)} at "
            f"{len(np.unique(places))}; measure at more"
        )
    is_usable = (places > 0) & (value > 0) & (sigma > 0) & np.isfinite(places * value * sigma)
    if not is_usable.all():
        row = int(np.argmin(is_usable))
        raise FitError(
            f"expected places, values and σ above 0, got {value[row]:g} ± {sigma[row]:g} at "
            f"{places[row]:g}; leave it out"
        )
    own2 = (sigma / value) ** 2 - common_sigma**2
    if own2.min() <= 0:
        raise FitError(
            f"expected relative σ above the common one of {common_sigma:g}, got "
            f"{float((sigma / value).min()):g}"
        )
    log_x, log_y, weight = np.log(places), np.log(value), 1 / own2
    from_mean = log_x - np.average(log_x, weights=weight)
    information = float(weight @ from_mean**2)
    exponent = float(weight @ (from_mean * log_y)) / information
    residual = log_y - np.average(log_y, weights=weight) - exponent * from_mean
    p_value = float(chdtrc(len(value) - 2, float(weight @ residual**2)))
    return PowerLaw(Measured(exponent, 1 / math.sqrt(information)), p_value)
