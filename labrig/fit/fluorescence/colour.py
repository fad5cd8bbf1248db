"""Colours of an estimated surface under a light, with their uncertainty."""

from dataclasses import dataclass

import numpy as np

from labrig.fit.fluorescence.result import FluorescenceFit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import appearance
from labrig.optics import (
    CIE_1931,
    Spectrum,
    band_integrals,
    edges_from_centres,
    hat_functions,
    lab,
    observer,
    quadrature,
)


@dataclass(frozen=True, eq=False)
class PredictedColour:
    """Colour of an estimated surface under a light, for the CIE 1931 2° observer.

    Attributes
    ----------
    light
        Name of the light.
    xyz, xyz_covariance
        X, Y, Z, where a perfect white under the light has Y = 1, (3,), and their covariance (3, 3).
    lab, lab_covariance
        CIELAB with the perfect white under the light, (3,), and its covariance (3, 3).
    """

    light: str
    xyz: FloatArray
    xyz_covariance: FloatArray
    lab: FloatArray
    lab_covariance: FloatArray

    @property
    def lab_sigma(self) -> FloatArray:
        """One standard deviation of L*, a*, b*, shape (3,)."""
        return np.sqrt(np.diag(self.lab_covariance))


def predicted_colour(fit: FluorescenceFit, light: Spectrum) -> PredictedColour:
    """Return the colour of an estimated surface under a light.

    Parameters
    ----------
    fit
        An estimate with its uncertainty.
    light
        Irradiance per nm, in any unit.

    Returns
    -------
    PredictedColour
        The colour of the matrix, as `labrig.material.appearance` has it, and the covariance of the
        drawn surfaces' colours: the σ of the matrix' entries alone would give a wrong one, since
        their errors are anything but independent.

    Raises
    ------
    UsageError
        The estimate has no uncertainty.
    DataError
        No eye sees the light.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.fit.fluorescence import (
    ...     Exposure, JointEstimator, fluorescence_system, predicted_colour
    ... )
    >>> from labrig.optics import read_light
    >>> lights = [Exposure(read_light(f"{nm}nm")) for nm in (420, 450, 480, 520, 560, 600, 640)]
    >>> system = fluorescence_system(lights, labrig.read_camera("canon_eos_5d_mark_ii"))
    >>> value = system.values(np.full(41, 0.3), np.zeros((41, 49)))
    >>> fit = JointEstimator(system).fit("grey", value, (0.001 * value) ** 2 + 1e-12)
    >>> colour = predicted_colour(fit, read_light("A"))
    >>> bool(abs(colour.lab[0] - 61.65) < 1 and 0 < colour.lab_sigma[0] < 1)
    True
    """
    if fit.surfaces is None:
        raise UsageError(
            f"expected an estimate with its uncertainty, got one by '{fit.method}'; use 'joint'"
        )
    matrix = fit.matrix
    found = appearance(matrix, light)
    eye = observer(CIE_1931)
    nodes, weights = quadrature(
        *eye.wavelength_nm[[0, -1]], eye.wavelength_nm, light.wavelength_nm, matrix.output_nm
    )
    power = weights * light.at(nodes)
    functions = np.array([np.interp(nodes, eye.wavelength_nm, f) for f in eye.functions.T])
    hats = hat_functions(matrix.output_nm, np.clip(nodes, *matrix.output_nm[[0, -1]]))
    white_y = float((functions @ power)[1])
    absorbed = light.in_bands(edges_from_centres(matrix.input_nm)) * matrix.input_width_nm
    by_band = band_integrals(eye.wavelength_nm, eye.functions, matrix.output_edges_nm)
    xyz = fit.surfaces.reflectance @ ((functions * power) @ hats).T
    xyz += (fit.surfaces.reradiation @ absorbed) @ by_band
    xyz /= white_y
    labs = lab(xyz, found.white)
    return PredictedColour(
        light.name,
        found.xyz,
        np.cov(xyz, rowvar=False),
        found.lab,
        np.cov(labs, rowvar=False),
    )
