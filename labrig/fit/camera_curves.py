"""Curves of an unknown camera: the likeliest of the family that explain a chart's patches.

Values are linear in the curves, and the family of cameras is their prior, so that mean and
covariance of the posterior are closed forms. Two factors are found with them, by their evidence:
how unusual the camera is among the family, and how much more the values err than they should.

Jiang et al. describe a channel by its mean and a few principal components. Here all components are
kept, each weighed by its variance, and channels vary together, since lens and infrared filter are
common to them. What some tens of cameras cannot show is added as a smooth random difference.

Each kind of readings gives its design, linear in the curves, and the covariance of its errors for
given curves: noise, and what is not known of chart, light and filter.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import eigh

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.optics import CHANNELS, CameraResponse, Lvf, Spectrum, Transmittance

#: Wavelengths in nm of estimated curves.
GRID_NM: FloatArray = np.arange(380.0, 781.0, 5.0)
#: Part of the variance between cameras that is a smooth difference of no other camera, and the
#: distance in nm at which it is independent. Both were chosen by leaving out each shipped camera.
OWN_SHARE, OWN_NM = 0.08, 12.0
#: Relative prior σ of the scale of each channel, which the chart's own greys tell better.
SCALE_SIGMA = 0.1
#: Fewest cameras that tell how cameras differ.
FEWEST = 8


@dataclass(frozen=True, eq=False)
class CurveFamily:
    """Normal density of the curves of cameras, each channel scaled by its response to a grey.

    Attributes
    ----------
    mean
        Mean curves on `GRID_NM`, shape (k, n).
    covariance
        Covariance of all k · n values, channel by channel.
    count
        Number of cameras.
    """

    mean: FloatArray
    covariance: FloatArray
    count: int


def camera_family(cameras: Sequence[CameraResponse], grey_light: FloatArray) -> CurveFamily:
    """Return mean and covariance of the curves of some cameras.

    Parameters
    ----------
    cameras
        Measured cameras of the same channels.
    grey_light
        Light of a grey surface per cell of `GRID_NM`, to which every channel responds by 1, (n,).

    Raises
    ------
    ValueError
        There are too few cameras.
    """
    if len(cameras) < FEWEST:
        raise ValueError(f"expected {FEWEST} or more cameras, got {len(cameras)}")
    curves = np.stack([camera.at(GRID_NM).T for camera in cameras]).clip(0.0)
    curves = curves / (curves @ grey_light)[:, :, np.newaxis]
    mean = curves.mean(axis=0)
    differences = (curves - mean).reshape(len(cameras), -1)
    between = differences.T @ differences / (len(cameras) - 1)
    sigma = np.sqrt(np.diag(between))
    smooth = np.kron(np.eye(len(mean)), correlation(OWN_NM))
    own = sigma[:, np.newaxis] * smooth * sigma
    covariance = (1 - OWN_SHARE) * between + OWN_SHARE * own
    for channel in range(len(mean)):
        scaled = np.zeros_like(mean)
        scaled[channel] = SCALE_SIGMA * mean[channel]
        covariance += np.outer(scaled, scaled)
    return CurveFamily(mean, covariance, len(cameras))


def correlation(distance_nm: float) -> FloatArray:
    """Return the correlation (n, n) on `GRID_NM` of a smooth random function."""
    off = (GRID_NM[:, np.newaxis] - GRID_NM) / distance_nm
    return np.asarray(np.exp(-(off**2) / 2))


#: Relative σ of a patch of one's own chart against the published means: its level and, smooth over
#: so many nm, its course; and what is added to every reflectance, as by a dusty black.
LEVEL, COURSE, ADDED, COURSE_NM = 0.02, 0.015, 0.002, 60.0
#: Relative σ of the brightness of a scene against another one.
BRIGHTNESS = 0.05
#: Relative σ of a filter's transmittance, smooth over so many nm: its calibration rests on other
#: curves of the camera; and of a single place.
TRANSMITTANCE, TRANSMITTANCE_NM, ROUGH = 0.1, 60.0, 0.02


@dataclass(frozen=True, eq=False)
class ChartReadings:
    """Readings of p patches in k channels.

    Attributes
    ----------
    value, sigma
        Values in DN/s and σ by noise, shape (p, k).
    reflectance
        Reflectances on `GRID_NM`, shape (p, n).
    place
        Places of the patches, from −1 to 1 across and down the chart, shape (p, 2).
    unevenness
        Relative σ of the light at the chart's edge against its middle.
    """

    value: FloatArray
    sigma: FloatArray
    reflectance: FloatArray
    place: FloatArray
    unevenness: float

    def design(self, light: FloatArray) -> FloatArray:
        """Return responses (p, n) per unit of a curve under light per cell of the grid (n,)."""
        return np.asarray(self.reflectance * light)

    def errors(self, light: FloatArray, curves: FloatArray) -> FloatArray:
        """Return the covariance (p, k, p, k) of errors of chart and light for curves (k, n)."""
        seen = curves * light
        by_patch = self.reflectance[:, np.newaxis, :] * seen
        smooth = correlation(COURSE_NM)
        relative = LEVEL**2 + COURSE**2 * smooth
        added = ADDED**2 * seen @ smooth @ seen.T
        p, k = self.value.shape
        covariance = np.zeros((p, k, p, k))
        for patch, part in enumerate(by_patch):
            covariance[patch, :, patch, :] = part @ relative @ part.T + added
        predicted = by_patch.sum(axis=2)
        modes = [BRIGHTNESS * predicted]
        modes += [self.unevenness * across[:, np.newaxis] * predicted for across in self.place.T]
        for mode in modes:
            covariance += np.multiply.outer(mode, mode)
        return covariance


@dataclass(frozen=True, eq=False)
class FilterReadings:
    """Readings of a grey card through a variable filter before the camera, at p places.

    Attributes
    ----------
    value, sigma
        Values in DN/s and σ by noise, shape (p, k); NaN where a value is missing.
    lvf
        The filter at these places.
    card
        Reflectance of the card.
    """

    value: FloatArray
    sigma: FloatArray
    lvf: Lvf
    card: Transmittance

    @cached_property
    def _passed(self) -> FloatArray:
        return np.asarray(self.lvf.transmission(GRID_NM) * self.card.at(GRID_NM))

    def design(self, light: FloatArray) -> FloatArray:
        """Return responses (p, n) per unit of a curve under light per cell of the grid (n,)."""
        return np.asarray(self._passed * light)

    def errors(self, light: FloatArray, curves: FloatArray) -> FloatArray:
        """Return the covariance (p, k, p, k) of errors of filter and light for curves (k, n)."""
        seen = curves * light
        predicted = self._passed @ seen.T
        centre_nm = self.lvf.bands.centre_nm
        off = (centre_nm[:, np.newaxis] - centre_nm) / TRANSMITTANCE_NM
        gain = TRANSMITTANCE**2 * np.exp(-(off**2) / 2) + ROUGH**2 * np.eye(len(centre_nm))
        # One factor for the whole scene is open: the filter's scale is not known.
        covariance = np.einsum("pk,pq,ql->pkql", predicted, gain + 1.0, predicted)
        if self.lvf.sigma is not None:
            slope = -np.gradient(self._passed, GRID_NM, axis=1) @ seen.T
            shift = self.lvf.sigma.centre_nm[:, np.newaxis] * slope
            for place, change in enumerate(shift):
                covariance[place, :, place, :] += np.outer(change, change)
        return np.asarray(covariance)


#: Relative σ of a lamp's spectrum whose file has none, and the distance in nm over which it errs.
LAMP_SIGMA, LAMP_NM = 0.01, 60.0
#: Factors of the family's covariance and of the errors' that are tried, and how firmly both are
#: expected to be 1: degrees of freedom of an inverse χ².
UNUSUAL = np.geomspace(0.1, 40.0, 25)
MISFITS = np.geomspace(0.4, 60.0, 18)
UNUSUAL_DOF, MISFIT_DOF = 4.0, 12.0
#: Iterations in which errors relative to the curves follow the curves.
ROUNDS = 4
#: Reflectances from which a patch tells the scale of the channels, and their largest relative range
#: over the wavelengths of a grey.
GREY_REFLECTANCE, GREY_RANGE = 0.15, 0.25
#: Wavelengths in nm between which a reflectance's range is that of a grey.
GREY_NM = (450.0, 700.0)


@dataclass(frozen=True, eq=False)
class CameraCurvesFit:
    """Estimated curves of a camera.

    Attributes
    ----------
    camera
        The curves, the highest value 1, and σ of each value; a factor common to all is not in σ.
    covariance
        Covariance of all k · n values, channel by channel.
    family_mean
        Mean curves of the family at this camera's ratios between channels, shape (n, k).
    chart
        Values of the chart by these curves, in the unit of its readings, shape (p, k).
    chart_sigma
        σ of the difference of readings and `chart` by noise and by errors of the chart, shape
        (p, k).
    unusualness
        How far the camera is from the family's mean, 1 for a usual one.
    misfit
        Factor by which the values err more than noise, chart, lamp and filter explain; where it is
        above 1, σ is larger by it.
    """

    camera: CameraResponse
    covariance: FloatArray
    family_mean: FloatArray
    chart: FloatArray
    chart_sigma: FloatArray
    unusualness: float
    misfit: float


def fit_camera_curves(
    chart: ChartReadings,
    lamp: Spectrum,
    cameras: Sequence[CameraResponse],
    through: FilterReadings | None = None,
    *,
    name: str = "camera",
) -> CameraCurvesFit:
    """Estimate the spectral sensitivities of a camera that is not among some measured ones.

    Parameters
    ----------
    chart
        Readings of a colour chart under the lamp.
    lamp
        Relative spectrum of the lamp, with σ where it is known.
    cameras
        Measured cameras of the same channels, in any scale.
    through
        Readings of a grey card under the same lamp through a variable filter.
    name
        Name of the camera.

    Returns
    -------
    CameraCurvesFit
        Curves from 380 nm to 780 nm with σ.

    Raises
    ------
    FitError
        No patch is grey, or some value is missing.

    References
    ----------
    J. Jiang, D. Liu, J. Gu, S. Süsstrunk, *What is the space of spectral sensitivity functions for
    digital color cameras?*, IEEE Workshop on Applications of Computer Vision (2013).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.camera_curves import GRID_NM, ChartReadings, fit_camera_curves
    >>> from labrig.optics import Spectrum, read_camera, read_colour_chart, shipped_cameras
    >>> cameras = [read_camera(camera.path) for camera in shipped_cameras()]
    >>> unknown = cameras.pop(40)
    >>> lamp = Spectrum("lamp", GRID_NM, GRID_NM / 780)
    >>> patches = np.array([patch.at(GRID_NM) for patch in read_colour_chart("colorchecker")])
    >>> value = 500 * patches @ (lamp.value[:, np.newaxis] * unknown.at(GRID_NM))
    >>> chart = ChartReadings(value, 0.003 * value, patches, np.zeros((24, 2)), unevenness=0.0)
    >>> fit = fit_camera_curves(chart, lamp, cameras)
    >>> bool(np.abs(fit.camera.sensitivity - unknown.at(GRID_NM)).max() < 0.15)
    True
    """
    light = lamp.at(GRID_NM) * float(GRID_NM[1] - GRID_NM[0])
    greys = _greys(chart.reflectance)
    grey_value = chart.value[greys].mean(axis=0)
    if not (np.isfinite(chart.value).all() and (grey_value > 0).all()):
        raise FitError("expected a value of every patch of the chart, got none of some")
    grey_light = light * chart.reflectance[greys].mean(axis=0)
    family = camera_family(cameras, grey_light)
    problem = _Problem.of(chart, through, lamp, light, grey_value, family)
    posterior = problem.solve()
    # Less than nothing is not seen; σ, which reaches there, stays.
    curves = np.maximum(posterior.mean, 0.0).reshape(family.mean.shape)
    scaled = curves * grey_value[:, np.newaxis]
    scale = np.repeat(grey_value, len(GRID_NM))
    covariance = _without_common_factor(scaled, posterior.covariance * scale[:, np.newaxis] * scale)
    highest = float(scaled.max())
    sigma = np.sqrt(np.diag(covariance)).reshape(scaled.shape).T / highest
    camera = CameraResponse(name, GRID_NM, scaled.T / highest, CHANNELS, sigma)
    predicted, predicted_sigma = problem.chart_values(curves, posterior.misfit)
    return CameraCurvesFit(
        camera=camera,
        covariance=covariance / highest**2,
        family_mean=(family.mean * grey_value[:, np.newaxis]).T / highest,
        chart=predicted * grey_value,
        chart_sigma=predicted_sigma * grey_value,
        unusualness=posterior.unusualness,
        misfit=posterior.misfit,
    )


@dataclass(frozen=True, eq=False)
class _Posterior:
    """Mean and covariance of the curves relative to the greys, and the two factors."""

    mean: FloatArray
    covariance: FloatArray
    unusualness: float
    misfit: float


@dataclass(frozen=True, eq=False)
class _Problem:
    """The linear system of all readings, each channel over its value of the chart's greys.

    Attributes
    ----------
    blocks
        Readings whose errors are told by themselves.
    design
        Responses of all values to all curves, (m, k · n); the values are ordered by block, place
        and channel.
    value, noise
        All values, and their variances by noise, shape (m,).
    is_used
        Values that are not missing, shape (m,).
    """

    blocks: tuple[ChartReadings | FilterReadings, ...]
    design: FloatArray
    value: FloatArray
    noise: FloatArray
    is_used: np.ndarray
    light: FloatArray
    lamp_covariance: FloatArray
    family: CurveFamily

    @classmethod
    def of(
        cls,
        chart: ChartReadings,
        through: FilterReadings | None,
        lamp: Spectrum,
        light: FloatArray,
        grey_value: FloatArray,
        family: CurveFamily,
    ) -> "_Problem":
        blocks = (chart,) if through is None else (chart, through)
        channels, count = family.mean.shape
        designs, values, variances = [], [], []
        for block in blocks:
            rows = np.einsum("pn,kl->pkln", block.design(light), np.eye(channels))
            value, sigma = block.value / grey_value, block.sigma / grey_value
            if isinstance(block, FilterReadings):
                # One factor is open; the mean camera tells it well enough to begin with.
                expected = block.design(light) @ family.mean.T
                value_used = np.nan_to_num(value)
                factor = float((expected**2).sum() / (expected * value_used).sum())
                value, sigma = value * factor, sigma * factor
            designs.append(rows.reshape(-1, channels * count))
            values.append(value.ravel())
            variances.append(np.square(sigma.ravel()))
        value, noise = np.concatenate(values), np.concatenate(variances)
        is_used = np.isfinite(value) & np.isfinite(noise)
        relative = (
            np.full(count, LAMP_SIGMA)
            if lamp.sigma is None
            else np.interp(GRID_NM, lamp.wavelength_nm, lamp.sigma)
            / np.maximum(lamp.at(GRID_NM), 1e-3 * lamp.value.max())
        )
        lamp_covariance = relative[:, np.newaxis] * correlation(LAMP_NM) * relative
        return cls(
            blocks, np.concatenate(designs), value, noise, is_used, light, lamp_covariance, family
        )

    def errors(self, curves: FloatArray) -> FloatArray:
        """Return the covariance of the values' errors for curves (k, n), shape (m, m)."""
        sizes = [block.value.size for block in self.blocks]
        covariance = np.diag(np.where(self.is_used, self.noise, 1.0))
        start = 0
        for block, size in zip(self.blocks, sizes, strict=True):
            part = slice(start, start + size)
            covariance[part, part] += block.errors(self.light, curves).reshape(size, size)
            start += size
        seen = [
            (block.design(self.light)[:, np.newaxis, :] * curves).reshape(-1, len(GRID_NM))
            for block in self.blocks
        ]
        by_lamp = np.concatenate(seen)
        return np.asarray(covariance + by_lamp @ self.lamp_covariance @ by_lamp.T)

    def solve(self) -> _Posterior:
        """Return the posterior of the curves."""
        used, family = self.is_used, self.family
        design, prior = self.design[used], family.covariance
        mean = family.mean.ravel()
        spread = design @ prior
        signal = spread @ design.T
        residual = self.value[used] - design @ mean
        curves = mean
        for _ in range(ROUNDS):
            errors = self.errors(curves.reshape(family.mean.shape).clip(0.0))
            # Values in these directions err independently, whatever the two factors.
            variance, directions = eigh(signal, errors[np.ix_(used, used)])
            variance = np.maximum(variance, 0.0)
            projected = directions.T @ residual
            weights, unusual, misfit = _weighed(variance, projected)
            total = unusual[:, np.newaxis] * variance + misfit[:, np.newaxis]
            steps = unusual[:, np.newaxis] * projected / total
            step = weights @ steps
            towards = directions.T @ spread
            curves = mean + step @ towards
        told = weights @ (np.square(unusual)[:, np.newaxis] / total)
        among = (steps - step).T * weights @ (steps - step)
        covariance = (weights @ unusual) * prior + towards.T @ (among - np.diag(told)) @ towards
        return _Posterior(
            curves,
            (covariance + covariance.T) / 2,
            float(np.sqrt(weights @ unusual)),
            float(np.sqrt(weights @ misfit)),
        )

    def chart_values(self, curves: FloatArray, misfit: float) -> tuple[FloatArray, FloatArray]:
        """Return values of the chart, as bright as the readings, and σ of readings less values.

        The shape of both is (p, k).
        """
        shape, size = self.blocks[0].value.shape, self.blocks[0].value.size
        errors = misfit**2 * self.errors(curves)[:size, :size]
        values = self.design[:size] @ curves.ravel()
        weight = values / np.diag(errors)
        keep = np.eye(size) - np.outer(values, weight) / (weight @ values)
        values = (values * (weight @ self.value[:size]) / (weight @ values)).reshape(shape)
        errors = keep @ errors @ keep.T
        return values, np.sqrt(np.diag(errors)).reshape(shape)


def _weighed(
    variance: FloatArray, projected: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return probabilities of pairs of factors, and the factors of family and errors, (f,) each.

    Parameters
    ----------
    variance
        Variances of independent values by the family, in units of those by errors, shape (m,).
    projected
        These values less those of the family's mean, in σ of their errors, shape (m,).
    """
    total = UNUSUAL[:, np.newaxis, np.newaxis] * variance + MISFITS[np.newaxis, :, np.newaxis]
    log_evidence = -(np.log(total) + np.square(projected) / total).sum(axis=2) / 2
    log_evidence -= UNUSUAL_DOF / 2 * (np.log(UNUSUAL) + 1 / UNUSUAL)[:, np.newaxis]
    log_evidence -= MISFIT_DOF / 2 * (np.log(MISFITS) + 1 / MISFITS)
    weights = np.exp(log_evidence - log_evidence.max())
    unusual, misfit = np.meshgrid(UNUSUAL, MISFITS, indexing="ij")
    return (weights / weights.sum()).ravel(), unusual.ravel(), misfit.ravel()


def _without_common_factor(curves: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the covariance of curves (k, n) that are brought to one scale by least squares.

    Each channel counts relative to its peak.
    """
    weight = (curves / np.square(curves.max(axis=1, keepdims=True))).ravel()
    flat = curves.ravel()
    keep = np.eye(flat.size) - np.outer(flat, weight) / (weight @ flat)
    return np.asarray(keep @ covariance @ keep.T)


def _greys(reflectance: FloatArray) -> np.ndarray:
    """Return which patches are grey and bright enough to tell the channels' scale, shape (p,)."""
    inside = (GREY_NM[0] <= GRID_NM) & (GREY_NM[1] >= GRID_NM)
    low, high = reflectance[:, inside].min(axis=1), reflectance[:, inside].max(axis=1)
    greys = (low > GREY_REFLECTANCE) & (high - low < GREY_RANGE * low)
    if not greys.any():
        raise FitError("expected a chart with grey patches, found none among its reflectances")
    return np.asarray(greys)
