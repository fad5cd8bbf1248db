"""What the decays of a saturation run say."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.saturation.level import Level
from labrig.analyse.saturation.shared_rates import Curve, RatesTest
from labrig.fit import DecayFit

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Saturation:
    """What a patch's decays say.

    Attributes
    ----------
    fit
        Of the decay after the longest charge under the full light.
    charges_s
        (d,) as they were, by light; rows of `amplitude` and `sigma` (d, s), states by falling rate.
    curves, test
        All decays by their unit, and what sharing the rates costs.
    levels
        r(0) of every state after that charge; none without a weaker light.
    """

    fit: DecayFit
    charges_s: Mapping[str, FloatArray]
    amplitude: Mapping[str, FloatArray]
    sigma: Mapping[str, FloatArray]
    curves: Mapping[str, Curve]
    test: RatesTest
    levels: tuple[Level, ...]
