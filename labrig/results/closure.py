"""Charging under the whole lamp, as measured and as predicted from rates band by band."""

from dataclasses import dataclass

import numpy as np

from labrig.results.arrays import FloatArray

#: Charges whose longest is so many times the shortest go along a logarithmic axis.
MANY_TIMES = 20.0


def spans_decades(charge_s: FloatArray) -> bool:
    """Whether charges are so different that they go along a logarithmic axis."""
    low = float(charge_s.min())
    return low > 0 and float(charge_s.max()) > MANY_TIMES * low


@dataclass(frozen=True, eq=False)
class Closure:
    """Levels after n charges in DN/s, measured against predicted; nothing is fitted to them.

    Attributes
    ----------
    charge_s
        (n,) how long the lamp shone; its fade counts as so much longer at full light.
    measured, predicted
        (n,) levels.
    sigma
        (n,) by how much the two may differ.
    curve_charge_s, curve
        (m,) charges from the shortest to the longest, and the levels predicted after them.
    """

    charge_s: FloatArray
    measured: FloatArray
    sigma: FloatArray
    predicted: FloatArray
    curve_charge_s: FloatArray
    curve: FloatArray

    @property
    def rms_percent(self) -> float:
        """RMS deviation in % of the RMS of the predicted levels."""
        full = max(_rms(self.predicted), np.finfo(float).tiny)
        return 100 * _rms(self.measured - self.predicted) / full

    @property
    def rms_sigma(self) -> float:
        """RMS deviation in σ: about 1 if noise and what the prediction may be off by explain it."""
        return _rms((self.measured - self.predicted) / self.sigma)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
