"""The light on every place behind the filter: how it may be off, and how it runs across a place."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from labrig.calibration.irradiance_file import IrradianceFile

FloatArray = NDArray[np.float64]

#: Of the light on a place alone, whatever its file says: bands are calibrated place by place, and
#: their flanks are rough by so much. Smooth errors alone would have to bend for it.
LEAST_SITE_SIGMA = 0.03
#: Of a filter's wavelengths.
WAVELENGTH_SIGMA_NM = 1.0
#: Errors of places so many parts of the filter apart have nothing in common: some 40 nm.
SMOOTH_MODES = 9
#: Light of which less is known than this is taken for known so well: logarithms are to be linear.
WORST = 1.0
#: Less light than this share of the most has no logarithm worth the name.
LEAST_LIGHT = 1e-6


def site_modes(irradiance: IrradianceFile) -> FloatArray:
    """(M, P, B): what is said of each place's light, alike for neighbours, and a little of its own.

    Camera curves, the filter's wavelengths, its widths and what it leaks are wrong smoothly along
    the filter. The first are the same in all bands, the second move light from band to band, the
    others change it at a band's edges and far from it.
    """
    through, sigma = np.array(irradiance.through), np.array(irradiance.through_sigma)
    told = _told(irradiance)[:, None]
    position = np.array(irradiance.position)
    knots = np.linspace(position[0], position[-1], SMOOTH_MODES)
    share = np.clip(1 - np.abs(position - knots[:, None]) / (knots[1] - knots[0]), 0.0, None)
    smooth = np.sin(np.pi / 2 * share)[..., None]
    nm = np.ptp(irradiance.bands_nm) * (position - position[0]) / np.ptp(position)
    by_nm = np.gradient(np.log(_some(through)), nm, axis=0)
    beyond = np.sqrt(np.clip((sigma / _some(through)) ** 2 - told**2, 0.0, WORST**2))
    bands = np.ones(through.shape[1])
    alone = LEAST_SITE_SIGMA * np.eye(len(position))[..., None]
    return np.concatenate(
        [
            smooth * told * bands,
            smooth * WAVELENGTH_SIGMA_NM * by_nm,
            smooth * beyond,
            alone * bands,
        ]
    )


def across_sites(irradiance: IrradianceFile) -> FloatArray:
    """(2, P, B) light at two places within each one, over its mean, by its run along the filter.

    The two are Gauss's: with them a mean over a place is right up to third order.
    """
    position, through = np.array(irradiance.position), _some(np.array(irradiance.through))
    course = PchipInterpolator(position, np.log(through), axis=0)
    off = np.gradient(position)[:, None] / 2 / np.sqrt(3)
    here, slope = course(position), course(position, 1)
    # At the ends there is nothing to look up beyond the last place's middle.
    pair: FloatArray = np.exp(np.stack([here - slope * off, here + slope * off]))
    mean: FloatArray = pair.mean(axis=0)
    return pair / mean


def band_sigma(irradiance: IrradianceFile) -> tuple[float, ...]:
    """Relative, of the lamp's own light in each band: wrong there, it is wrong at all places.

    What else is not known of the light on a place is said by `site_modes`.
    """
    direct = np.array(irradiance.direct_sigma) / np.maximum(np.array(irradiance.direct), 1e-300)
    return tuple(direct.tolist())


def scale_sigma(irradiance: IrradianceFile) -> float:
    """Relative, of the light on all places together over that of the lamp by itself.

    What is not known even of the place that is known best, all places have in common: how bright
    the camera sees a narrow band against the lamp's whole light.
    """
    return float(np.hypot(irradiance.scale_sigma, _told(irradiance).min()))


def _told(irradiance: IrradianceFile) -> FloatArray:
    """(P,) relative σ of all light on each place."""
    through, sigma = np.array(irradiance.through), np.array(irradiance.through_sigma)
    told: FloatArray = np.sqrt((sigma**2).sum(axis=1)) / np.maximum(through.sum(axis=1), 1e-300)
    return told


def _some(light: FloatArray) -> FloatArray:
    some: FloatArray = np.maximum(light, LEAST_LIGHT * light.max())
    return some
