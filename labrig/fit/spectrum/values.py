"""Values that a spectrum can be fitted to."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.fit.spectrum.system import SpectralSystem
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError

FEWEST_VALUES = 3


def measured(
    value: ArrayLike, sigma: ArrayLike, system: SpectralSystem
) -> tuple[NDArray[np.bool_], SpectralSystem, FloatArray, FloatArray]:
    """Return which values are usable, the system of those, their values and σ.

    Raises
    ------
    FitError
        There are too few values, none above its noise, or a σ of 0.
    """
    values, sigmas = np.asarray(value, dtype=np.float64), np.asarray(sigma, dtype=np.float64)
    used = np.isfinite(values) & np.isfinite(sigmas) & system.design.any(axis=1)
    if (sigmas[used] <= 0).any():
        raise FitError("expected every σ above 0, got some of 0; give the noise of every value")
    if used.sum() < FEWEST_VALUES:
        raise FitError(
            f"expected {FEWEST_VALUES} or more values that are neither clipped nor missing, got "
            f"{used.sum()}; expose shorter or light more of the filter"
        )
    part = system.of(used)
    if not values[used] @ part.design.sum(axis=1) > 0:
        raise FitError("expected values above 0, got none above their noise; expose longer")
    return used, part, values[used], sigmas[used]
