"""Each light by itself, as the thesis does it (chapter 4.3): two Gaussians for three values.

Under light m the surface's spectrum is a₁ g(μ₁, σ₁) + a₂ g(μ₂, σ₂), g a Gaussian of height 1: what
is reflected, about the light's wavelength λ_m, and what is re-radiated (equation 4.4). Six numbers
explain three values, so that they depend on where the search starts: μ₂ scatters by tens of nm. It
is here to be compared with.

Corrected are: s_m ≈ a(λ_m) ∫ l_m (the thesis divides), the merged width √((σ₁² + σ₂²)/2), and
reflectance and excitation, which are ratios of areas, not heights. The thesis leaves open on which
scale a₁ > 0.1 holds: here a₁ is relative to the light's own height.
"""

import contextlib
import math
from dataclasses import dataclass

import nlopt
import numpy as np
from numpy.typing import ArrayLike

from labrig.fit.fluorescence.result import EstimatedFluorophore, FluorescenceFit
from labrig.fit.fluorescence.system import FluorescenceSystem, checked_values, require_scale
from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix
from labrig.optics import Spectrum, band_means, edges_from_centres

#: ε of equation 4.5, and distance below which two peaks are one, in nm.
EPSILON_NM, MERGED_NM = 15.0, 30.0
#: Least a₁, and largest a₁ and a₂, relative to the light's height.
MIN_HEIGHT, MAX_HEIGHT = 0.1, 20.0
#: Bounds of σ₂ in nm.
EMISSION_SIGMA_NM = (10.0, 40.0)
#: Start: a₁, a₂, μ₂ − λ_m and σ₂.
START = (0.5, 0.1, 60.0, 25.0)
STEP_NM = 1.0
TOLERANCE = 1e-10
MAX_EVALUATIONS = 500
AREA = math.sqrt(2 * math.pi)


@dataclass(frozen=True)
class _Peaks:
    """Two Gaussians under one light: heights relative to the light's, means and σ in nm."""

    height: tuple[float, float]
    mean_nm: tuple[float, float]
    sigma_nm: tuple[float, float]

    def merged(self) -> "_Peaks":
        """Return one re-radiated Gaussian for two that are close."""
        first, second = self.mean_nm
        if abs(second - first) >= MERGED_NM:
            return self
        sigma = math.hypot(*self.sigma_nm) / math.sqrt(2)
        return _Peaks(
            (0.0, sum(self.height)),
            (first, (first + second) / 2),
            (self.sigma_nm[0], sigma),
        )


def fit_per_led(
    name: str, value: ArrayLike, variance: ArrayLike, system: FluorescenceSystem
) -> FluorescenceFit:
    """Estimate the matrix of a surface by two Gaussians under each light.

    Parameters
    ----------
    name
        Name of the surface.
    value, variance
        Values under each light and their variances, shape (m, k). The thesis weighs all channels
        alike: the variances only tell by how much the result misses them.
    system
        Lights and camera. Its errors are not used.

    Returns
    -------
    FluorescenceFit
        The matrix, without σ.

    Raises
    ------
    UsageError
        Shapes disagree, a value is not finite, a variance is not above 0, or no light has a known
        brightness.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.fit.fluorescence import Exposure, fit_per_led, fluorescence_system
    >>> from labrig.optics import read_light
    >>> lights = [Exposure(read_light(f"{nm}nm")) for nm in (420, 450, 480, 520, 560, 600, 640)]
    >>> system = fluorescence_system(lights, labrig.read_camera("canon_eos_5d_mark_ii"))
    >>> value = system.values(np.full(41, 0.3), np.zeros((41, 49)))
    >>> fit = fit_per_led("grey", value, np.full(value.shape, 1e-6), system)
    >>> fit.method, fit.matrix.reradiation_sigma is None
    ('per-led', True)
    """
    require_scale(system)
    values, variances = checked_values(system, value, variance)
    scale = system.brightness[:, np.newaxis]
    ends = edges_from_centres(system.output_nm)[[0, -1]]
    nodes = np.arange(ends[0], ends[1], STEP_NM) + STEP_NM / 2
    curves = STEP_NM * system.camera.at(nodes)
    # Without its brightness, a light tells heights on no scale.
    used = np.flatnonzero(~system.is_loose)
    lights = [_Light.of(system.exposures[number].light) for number in used]
    widths = [light.sigma_nm for light in lights]
    peaks = [
        _fitted(row, light, (min(widths), max(widths)), nodes, curves).merged()
        for row, light in zip((values / scale)[used], lights, strict=True)
    ]
    order = sorted(range(len(peaks)), key=lambda number: peaks[number].mean_nm[0])
    means = np.array([peaks[number].mean_nm[0] for number in order])
    areas = np.array(
        [
            [
                height * sigma * AREA * lights[number].height
                for height, sigma in zip(peaks[number].height, peaks[number].sigma_nm, strict=True)
            ]
            for number in order
        ]
    )
    emission_nm = float(np.median([peak.mean_nm[1] for peak in peaks]))
    sigma_nm = float(np.median([peak.sigma_nm[1] for peak in peaks]))
    bell = np.exp(-(((nodes - emission_nm) / sigma_nm) ** 2) / 2) / (sigma_nm * AREA)
    emission = band_means(nodes, bell, edges_from_centres(system.output_nm))
    excitation = np.interp(system.input_nm, means, areas[:, 1])
    matrix = ReradiationMatrix(
        name,
        system.input_nm,
        system.output_nm,
        np.interp(system.output_nm, means, areas[:, 0]),
        np.outer(emission, excitation) * system.is_stokes,
    )
    predicted = system.values(matrix.reflectance, matrix.reradiation) * scale
    pull = (values - predicted) / np.sqrt(variances)
    dye = EstimatedFluorophore(
        Spectrum("emission 1", system.output_nm, emission),
        Spectrum("excitation 1", system.input_nm, excitation),
        math.nan,
        math.nan,
    )
    return FluorescenceFit(
        method="per-led",
        matrix=matrix,
        is_extrapolated=~system.is_lit,
        fluorophores=(dye,),
        numbers=(),
        predicted=predicted,
        pull=pull,
        reduced_chi2=math.nan,
        facts=(),
        surfaces=None,
    )


@dataclass(frozen=True)
class _Light:
    """Mean and σ in nm of a light of unit power, and its height in 1/nm."""

    mean_nm: float
    sigma_nm: float
    height: float

    @classmethod
    def of(cls, light: Spectrum) -> "_Light":
        """Return the Gaussian about the light's maximum that has its power."""
        grid = np.arange(light.wavelength_nm[0], light.wavelength_nm[-1] + STEP_NM, STEP_NM)
        power = light.resampled(grid).value
        height = float(power.max() / (power.sum() * STEP_NM))
        return cls(float(grid[power.argmax()]), 1 / (height * AREA), height)


@dataclass
class _Least:
    """Parameters of the lowest misfit so far."""

    x: FloatArray
    misfit: float

    def take(self, x: FloatArray, misfit: float) -> None:
        """Keep the parameters if their misfit is lower."""
        if misfit < self.misfit:
            self.x, self.misfit = x.copy(), misfit


def _fitted(
    value: FloatArray,
    light: _Light,
    sigmas_nm: tuple[float, float],
    nodes_nm: FloatArray,
    curves: FloatArray,
) -> _Peaks:
    """Return the two Gaussians that explain the values (k,) of one light (equation 4.5)."""
    size, least = float(np.abs(value).max()) or 1.0, _Least(np.empty(6), math.inf)

    def objective(x: FloatArray, gradient: FloatArray) -> float:
        bells, slopes = [], []
        for height, mean, sigma in x.reshape(2, 3):
            away = (nodes_nm - mean) / sigma
            bell = light.height * np.exp(-(away**2) / 2)
            bells.append(height * bell)
            slopes += [bell, height * bell * away / sigma, height * bell * away**2 / sigma]
        residual = ((bells[0] + bells[1]) @ curves - value) / size
        least.take(x, float(residual @ residual))
        if gradient.size:
            gradient[:] = 2 * (np.array(slopes) @ curves / size) @ residual
        return float(residual @ residual)

    start_height, start_emission, shift_nm, start_sigma = START
    low = [MIN_HEIGHT, light.mean_nm - EPSILON_NM, sigmas_nm[0]]
    low += [0.0, light.mean_nm + EPSILON_NM, EMISSION_SIGMA_NM[0]]
    high = [MAX_HEIGHT, light.mean_nm + EPSILON_NM, sigmas_nm[1]]
    high += [MAX_HEIGHT, float(nodes_nm[-1]), EMISSION_SIGMA_NM[1]]
    start = [start_height, light.mean_nm, light.sigma_nm, start_emission]
    start += [min(light.mean_nm + shift_nm, high[4]), start_sigma]
    search = nlopt.opt(nlopt.LD_SLSQP, 6)
    search.set_min_objective(objective)
    search.set_lower_bounds(low)
    search.set_upper_bounds([max(pair) for pair in zip(low, high, strict=True)])
    search.set_ftol_rel(TOLERANCE)
    search.set_maxeval(MAX_EVALUATIONS)
    # A search that rounding stops, or that cannot go on, has been at the best that it found.
    with contextlib.suppress(nlopt.RoundoffLimited, nlopt.runtime_error):
        search.optimize(np.clip(start, low, high))
    first, second = least.x.reshape(2, 3).tolist()
    return _Peaks((first[0], second[0]), (first[1], second[1]), (first[2], second[2]))
