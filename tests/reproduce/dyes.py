"""A dye for scenes."""

import numpy as np

from labrig.material import (
    ReradiationMixture,
)

INPUT_NM, OUTPUT_NM = np.arange(305.0, 780, 10), np.arange(385.0, 780, 10)

DYE = ReradiationMixture(
    15.0,
    np.array([0.7, 0.3]),
    np.array([[400.0, 560.0], [450.0, 620.0]]),
    np.array([[[900.0, 100.0], [100.0, 600.0]], [[700.0, -50.0], [-50.0, 900.0]]]),
)
