"""From a camera's values to colours, by its curves."""

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.optics import CIE_1931, CameraResponse, Spectrum, observer

#: Reflectances that a camera's matrix is for: smooth, σ of their level and course, and distance in
#: nm at which they are independent.
LEVEL_SIGMA, COURSE_SIGMA, COURSE_NM = 0.5, 0.25, 50.0
#: Width in nm of the structure of emissions.
EMISSION_NM = 20.0
STEP_NM = 5.0


def camera_matrix(camera: CameraResponse, light: Spectrum | None) -> FloatArray:
    """Return the matrix (3, k) from values to X, Y, Z, best for what may come back of a light.

    It minimises the mean squared error over smooth reflectances of a normal density; without a
    light, over spectra as dyes emit.
    """
    nm = np.arange(camera.wavelength_nm[0], camera.wavelength_nm[-1] + STEP_NM / 2, STEP_NM)
    power = np.ones_like(nm) if light is None else light.at(nm)
    eye = observer(CIE_1931)
    seen = power * np.array([np.interp(nm, eye.wavelength_nm, f) for f in eye.functions.T])
    counted = power * camera.at(nm).T
    level, course_nm = (0.0, EMISSION_NM) if light is None else (LEVEL_SIGMA, COURSE_NM)
    off = (nm[:, np.newaxis] - nm) / course_nm
    covariance = level**2 + COURSE_SIGMA**2 * np.exp(-(off**2) / 2)
    matrix = np.linalg.solve(counted @ covariance @ counted.T, counted @ covariance @ seen.T).T
    return np.asarray(matrix)
