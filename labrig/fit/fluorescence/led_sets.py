"""Sets of LEDs: their places on the wavelength axis, and how well they estimate known surfaces."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from labrig.fit.fluorescence.estimate import JointEstimator
from labrig.fit.fluorescence.system import Exposure, fluorescence_system
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
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


#: Peaks in nm of the sets found by `moved_leds` over 44 measured matrices that re-radiate.
RECOMMENDED_NM: Mapping[int, tuple[float, ...]] = MappingProxyType(
    {
        6: (380, 440, 490, 550, 600, 650),
        9: (370, 390, 420, 450, 490, 530, 570, 610, 650),
        12: (365, 385, 405, 430, 450, 475, 500, 525, 555, 590, 620, 650),
    }
)
#: Usual full width at half maximum in nm by the peak in nm, from LEDs' data sheets.
USUAL_WIDTH_NM = ((365, 460, 520, 560, 590, 660), (12, 22, 33, 38, 18, 20))
#: Ends of an even placement, least and largest peak, and the search's step, in nm.
EVEN_NM, LIMITS_NM, PLACEMENT_STEP_NM = (380.0, 640.0), (350.0, 700.0), 10.0

#: Least and largest number of LEDs of a set.
NUMBERS = (3, 24)
#: Quantiles over the surfaces whose mean the search lowers.
JUDGED = (0.5, 0.9)


@dataclass(frozen=True, eq=False)
class LedSet:
    """A set of LEDs, and how well it estimates surfaces that are known.

    Attributes
    ----------
    placement
        How the peaks were chosen, such as `recommended`.
    peaks_nm
        Peaks in nm.
    study
        The colour differences.
    """

    placement: str
    peaks_nm: tuple[float, ...]
    study: LedStudy

    @property
    def judged(self) -> float:
        """Mean ΔE2000 over the lights of the median and the 90 % quantile: what a search lowers."""
        return float(np.mean([self.study.quantile(part) for part in JUDGED]))


def usual_led(peak_nm: float) -> Spectrum:
    """Return an LED of Gaussian shape that is as wide as LEDs of its colour are.

    Parameters
    ----------
    peak_nm
        Wavelength of its maximum in nm.

    Returns
    -------
    Spectrum
        Power per nm, 1 at the maximum.

    Examples
    --------
    >>> from labrig.fit.fluorescence import usual_led
    >>> usual_led(460.0).at([460.0, 471.0]).round(3).tolist()
    [1.0, 0.5]
    """
    return gaussian_led(peak_nm, float(np.interp(peak_nm, *USUAL_WIDTH_NM)))


def even_peaks_nm(number: int) -> tuple[float, ...]:
    """Return peaks in nm of evenly spaced LEDs from 380 nm to 640 nm, rounded to 10 nm.

    Parameters
    ----------
    number
        Number of LEDs, 3 to 24.

    Returns
    -------
    tuple
        Rising wavelengths in nm.

    Raises
    ------
    UsageError
        There are too few or too many.

    Examples
    --------
    >>> from labrig.fit.fluorescence import even_peaks_nm
    >>> even_peaks_nm(6)
    (380.0, 430.0, 480.0, 540.0, 590.0, 640.0)
    """
    if not NUMBERS[0] <= number <= NUMBERS[1]:
        raise UsageError(f"expected {NUMBERS[0]} to {NUMBERS[1]} LEDs, got {number}")
    even = np.linspace(*EVEN_NM, number)
    return tuple((PLACEMENT_STEP_NM * np.round(even / PLACEMENT_STEP_NM)).tolist())


def require_peaks(peaks_nm: Sequence[float]) -> None:
    """Refuse a set of LEDs that is not one.

    Parameters
    ----------
    peaks_nm
        Peaks in nm.

    Raises
    ------
    UsageError
        They are fewer than 3, more than 24, the same, or not from 350 nm to 700 nm.

    Examples
    --------
    >>> from labrig.fit.fluorescence import require_peaks
    >>> require_peaks((420, 470, 530))
    """
    low, high = LIMITS_NM
    if (
        not NUMBERS[0] <= len(peaks_nm) <= NUMBERS[1]
        or len(set(peaks_nm)) < len(peaks_nm)
        or not all(low <= peak <= high for peak in peaks_nm)
    ):
        raise UsageError(
            f"expected {NUMBERS[0]} to {NUMBERS[1]} different wavelengths of LEDs from {low:g} nm "
            f"to {high:g} nm, got {' '.join(f'{peak:g}' for peak in peaks_nm)}"
        )


def study_set(
    placement: str,
    peaks_nm: Sequence[float],
    camera: CameraResponse,
    surfaces: Sequence[ReradiationMatrix],
    lights: Sequence[Spectrum],
) -> LedSet:
    """Judge LEDs at some wavelengths by known surfaces.

    Parameters
    ----------
    placement
        How the peaks were chosen.
    peaks_nm
        Different peaks in nm, 3 to 24 from 350 nm to 700 nm.
    camera
        The camera.
    surfaces
        Matrices of the surfaces, of reflectance and re-radiation in 1/nm.
    lights
        Lights under which the colours are compared.

    Returns
    -------
    LedSet
        The set with its study.

    Raises
    ------
    UsageError
        Peaks are too few, too many, the same, or out of range.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.fit.fluorescence import study_set
    >>> from labrig.material import ReradiationMatrix
    >>> from labrig.optics import read_light
    >>> nm = np.arange(380.0, 781.0, 10.0)
    >>> grey = ReradiationMatrix.from_bands("grey", nm, nm, np.diag(np.full(41, 0.4)))
    >>> camera = labrig.read_camera("canon_eos_5d_mark_ii")
    >>> found = study_set("mine", (420, 470, 530, 590, 640), camera, [grey], [read_light("D65")])
    >>> found.judged < 2
    True
    """
    require_peaks(peaks_nm)
    leds = [usual_led(peak) for peak in peaks_nm]
    return LedSet(placement, tuple(sorted(peaks_nm)), study_leds(leds, camera, surfaces, lights))


def moved_leds(
    start: LedSet, study: Callable[[Sequence[float]], LedSet], sweeps: int = 2
) -> Iterator[LedSet]:
    """Move one LED after another by 10 nm as long as that lowers the error.

    Parameters
    ----------
    start
        The set from which the search begins.
    study
        Function that judges peaks in nm.
    sweeps
        Largest number of times that each LED is moved.

    Yields
    ------
    LedSet
        The best set up to now, after each try.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.fluorescence import LedSet, LedStudy, moved_leds
    >>> def study(peaks_nm):
    ...     off_nm = np.abs(np.array(peaks_nm) - [400, 500, 610]).sum()
    ...     return LedSet("found", tuple(peaks_nm), LedStudy(("a",), ("D65",), off_nm[None, None]))
    >>> *_, best = moved_leds(study((400, 490, 600)), study)
    >>> best.peaks_nm
    (400, 500, 610)
    """
    best = start
    for _ in range(sweeps):
        before = best
        for number in range(len(start.peaks_nm)):
            for step_nm in (-PLACEMENT_STEP_NM, PLACEMENT_STEP_NM):
                peaks_nm = list(best.peaks_nm)
                peaks_nm[number] += step_nm
                if len(set(peaks_nm)) < len(peaks_nm) or not (
                    LIMITS_NM[0] <= peaks_nm[number] <= LIMITS_NM[1]
                ):
                    continue
                moved = study(peaks_nm)
                is_better = moved.judged < best.judged
                best = moved if is_better else best
                yield best
                if is_better:
                    break
        if best is before:
            return
