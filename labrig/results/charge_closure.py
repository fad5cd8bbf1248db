"""Test of a charge that the fit did not use."""

from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray

#: Ratio of the longest to the shortest charge from which an axis is logarithmic.
MANY_TIMES = 20.0


def spans_decades(charge_s: FloatArray) -> bool:
    """Return whether charge durations differ so much that a logarithmic axis suits them.

    Parameters
    ----------
    charge_s
        Duration of each charge in seconds, shape (n,).

    Returns
    -------
    bool
        True if the shortest is above 0 s and the longest is more than 20 times as long.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.results import spans_decades
    >>> spans_decades(np.array([1.0, 10.0, 100.0])), spans_decades(np.array([10.0, 20.0]))
    (True, False)
    """
    low = float(charge_s.min())
    return low > 0 and float(charge_s.max()) > MANY_TIMES * low


@dataclass(frozen=True, eq=False)
class Closure:
    """Measured against predicted levels after n charges; nothing is fitted to them.

    Attributes
    ----------
    charge_s
        Duration of each charge in seconds, corrected for the lamp's transients, shape (n,).
    measured, predicted
        Levels in DN/s, shape (n,).
    sigma
        Standard uncertainty of their difference in DN/s, shape (n,).
    curve_charge_s, curve
        Durations in seconds from the shortest to the longest charge, and predicted levels in DN/s
        after them, shape (m,).
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
        """RMS deviation in σ: about 1 if noise and the uncertainty of the prediction explain it."""
        return _rms((self.measured - self.predicted) / self.sigma)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
