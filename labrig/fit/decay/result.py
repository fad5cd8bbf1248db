"""What a decay fit found, and what it left over."""

from dataclasses import dataclass

from labrig.fit.least_squares import FloatArray
from labrig.results import FittedDecay


@dataclass(frozen=True)
class DecayFit(FittedDecay):
    """A decay's result with the residuals of its fit.

    Attributes
    ----------
    residuals, normalised_residuals
        Value − model, one row per frame in the order given, one column per channel: in the values'
        units, and whitened (independent, unit variance if the noise is as assumed).
    """

    residuals: FloatArray
    normalised_residuals: FloatArray
