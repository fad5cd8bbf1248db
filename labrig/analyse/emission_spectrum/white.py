"""What a picture of a known light says about the system that spectra are found with.

A camera's curves from another laboratory are off by some per cent, and so is every spectrum found
with them. A grey card under a known lamp, seen through the same filter, shows by how much in every
position and channel: the errors that the system may have are known ones from then on.
"""

import numpy as np
from numpy.typing import NDArray

from labrig.fit.spectrum import SpectralSystem
from labrig.optics import Spectrum

FloatArray = NDArray[np.float64]

#: What is not known of a lamp's spectrum whose file says nothing, relative.
LAMP_SIGMA = 0.01
#: How bright the picture is may be anything.
ANY_BRIGHTNESS = 1e3


def taught_by(
    system: SpectralSystem,
    value: FloatArray,
    sigma: FloatArray,
    light: Spectrum,
    expected: FloatArray,
) -> SpectralSystem:
    """The system after a picture of a known light.

    With value = g (expected + Σ_k z_k modes_k · light) + noise, z and g normal, this is the mean
    and covariance of z given the picture.

    Parameters
    ----------
    value, sigma
        (m,) of the picture, in any unit; NaN where it clips.
    light
        What was photographed.
    expected
        (m,) what the system's own curves make of it, wavelengths beyond its knots included.
    """
    known = np.isfinite(value) & np.isfinite(sigma)
    gain = float(expected[known] @ value[known] / (expected[known] @ expected[known]))
    y, s = value[known] / gain, sigma[known] / gain
    seen = system.modes[:, known] @ light.at(system.knots_nm)
    levers = np.vstack([seen, ANY_BRIGHTNESS * expected[known]])
    noise = np.hypot(s, LAMP_SIGMA * expected[known])
    whitened = levers / noise
    precision = np.eye(len(levers)) + whitened @ whitened.T
    mean = np.linalg.solve(precision, whitened @ ((y - expected[known]) / noise))
    # Rows of the root of the covariance: independent again, each of unit variance.
    root = np.linalg.inv(np.linalg.cholesky(precision))[:, :-1]
    design = system.design + np.tensordot(mean[:-1], system.modes, axes=1)
    return SpectralSystem(
        system.knots_nm, np.maximum(design, 0.0), np.tensordot(root, system.modes, axes=1)
    )
