"""How well some set of LEDs estimates surfaces that are known: a comparison of sets."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.fit.fluorescence.joint import JointEstimator
from labrig.fit.fluorescence.system import Exposure, fluorescence_system
from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix, compare_colours
from labrig.optics import CameraResponse, Spectrum

#: Relative noise of a value, and relative to the largest value under the same LED.
RELATIVE_NOISE, ABSOLUTE_NOISE = 2e-3, 5e-4
FWHM_OVER_SIGMA = 2 * np.sqrt(2 * np.log(2))
STEP_NM = 1.0


@dataclass(frozen=True, eq=False)
class LedStudy:
    """Colour differences between surfaces and their estimates.

    Attributes
    ----------
    surfaces, lights
        Names of the surfaces and of the lights under which they are compared.
    delta_e
        ΔE2000 as `compare_colours` has it, shape (surfaces, lights).
    """

    surfaces: tuple[str, ...]
    lights: tuple[str, ...]
    delta_e: FloatArray

    def quantile(self, fraction: float) -> FloatArray:
        """Return a quantile over the surfaces, one for each light, without undefined ones."""
        return np.asarray(np.nanquantile(self.delta_e, fraction, axis=0))


def gaussian_led(centre_nm: float, fwhm_nm: float) -> Spectrum:
    """Return an LED of Gaussian shape.

    Parameters
    ----------
    centre_nm, fwhm_nm
        Wavelength of its maximum and full width at half maximum in nm.

    Returns
    -------
    Spectrum
        Power per nm, 1 at the maximum.

    Examples
    --------
    >>> from labrig.fit.fluorescence import gaussian_led
    >>> gaussian_led(450.0, 20.0).at([450.0, 460.0]).round(3).tolist()
    [1.0, 0.5]
    """
    reach_nm = np.ceil(2 * fwhm_nm)
    grid = centre_nm + np.arange(-reach_nm, reach_nm + STEP_NM, STEP_NM)
    sigma = fwhm_nm / FWHM_OVER_SIGMA
    return Spectrum(f"{centre_nm:g} nm", grid, np.exp(-(((grid - centre_nm) / sigma) ** 2) / 2))


def study_leds(
    leds: Sequence[Spectrum],
    camera: CameraResponse,
    surfaces: Sequence[ReradiationMatrix],
    lights: Sequence[Spectrum],
    seed: int = 0,
) -> LedStudy:
    """Photograph known surfaces under some LEDs, estimate them, and compare the colours.

    LEDs and camera are known exactly; a value has 0.2 % noise and 0.05 % of the largest one.

    Parameters
    ----------
    leds
        Spectra of the LEDs.
    camera
        The camera.
    surfaces
        Matrices of the surfaces, of reflectance and re-radiation in 1/nm.
    lights
        Lights under which the colours are compared.
    seed
        Seed of the noise.

    Returns
    -------
    LedStudy
        The colour differences.

    Raises
    ------
    UsageError
        As from `fluorescence_system`.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.fit.fluorescence import gaussian_led, study_leds
    >>> from labrig.material import ReradiationMatrix
    >>> from labrig.optics import read_light
    >>> nm = np.arange(380.0, 781.0, 10.0)
    >>> grey = ReradiationMatrix.from_bands("grey", nm, nm, np.diag(np.full(41, 0.4)))
    >>> leds = [gaussian_led(nm, 25.0) for nm in (410, 450, 490, 530, 570, 610, 650)]
    >>> camera = labrig.read_camera("canon_eos_5d_mark_ii")
    >>> study = study_leds(leds, camera, [grey], [read_light("D65")])
    >>> bool(study.delta_e[0, 0] < 1)
    True
    """
    system = fluorescence_system([Exposure(led) for led in leds], camera)
    estimator = JointEstimator(system)
    rng = np.random.default_rng(seed)
    differences = []
    for surface in surfaces:
        same = surface.rebinned(system.input_nm, system.output_nm)
        reradiation = np.where(same.is_stokes, np.nan_to_num(same.reradiation), 0.0)
        exact = system.values(_filled(same.reflectance), reradiation)
        sigma = np.hypot(RELATIVE_NOISE * exact, ABSOLUTE_NOISE * exact.max(axis=1, keepdims=True))
        value = exact + sigma * rng.standard_normal(exact.shape)
        found = estimator.fit(surface.name, value, sigma**2)
        differences.append([one.delta_e for one in compare_colours(found.matrix, same, lights)])
    return LedStudy(
        tuple(surface.name for surface in surfaces),
        tuple(light.name for light in lights),
        np.array(differences),
    )


def _filled(reflectance: FloatArray) -> FloatArray:
    """Return a reflectance that goes on where it was not measured, as `appearance` has it."""
    measured = np.flatnonzero(~np.isnan(reflectance))
    return np.interp(np.arange(len(reflectance)), measured, reflectance[measured])
