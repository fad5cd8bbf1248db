"""From means over pixels to means over the sites of the filter.

A slice of the strip consists of whole pixels, and some of a colour filter array's colours lie in
every other column only: a channel's mean belongs to a place up to a pixel beside the site's middle,
and to another width. Along the filter the glow may change by a factor of two from site to site, so
that this matters wherever sites are a few pixels wide. The glow of a channel is taken for a cubic
spline whose means over the channel's pixels are those measured; its means over the sites are linear
in them.
"""

import numpy as np
from scipy.interpolate import CubicSpline

from labrig.analyse.strip import Slices, tilt_offset
from labrig.calibration import IrradianceFile
from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.reduce import SensorLayout

#: Weight from which a site is not known where another one is not.
DEPENDS = 0.01


def site_weights(slices: Slices, irradiance: IrradianceFile, layout: SensorLayout) -> FloatArray:
    """Return the weights (C, P, P) of the slices' means in those of the sites.

    Parameters
    ----------
    slices
        Regions in which the means were measured.
    irradiance
        Positions of the sites' middles along the filter.
    layout
        Size and colours of the sensor.
    """
    strip, position = irradiance.lvf_strip(), np.array(irradiance.position)
    rising = np.argsort(position)
    integral = CubicSpline(position[rising], np.eye(len(position))[rising]).antiderivative()
    half = 0.5 / len(position)
    of_sites = (integral(position + half) - integral(position - half)) / (2 * half)
    left, right = strip.left[0] * layout.width, strip.right[0] * layout.width
    of_slices = np.empty((len(layout.channels), *of_sites.shape))
    offsets = tilt_offset(strip, slices, layout)
    for number, (region, offset) in enumerate(zip(slices.values(), offsets, strict=True)):
        first, weights = layout.column_weights(region)
        edges = (np.arange(first, first + weights.shape[1] + 1) - left) / (right - left) + offset
        along = edges if strip.rising else 1 - edges
        of_columns = np.diff(integral(along), axis=0) / np.diff(along)[:, None]
        of_slices[:, number] = weights @ of_columns
    return np.asarray(of_sites @ np.linalg.inv(of_slices))


def site_means(
    values: FloatArray, sigma: FloatArray, usable: BoolArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return means over sites and their σ, shape (n, P, C) each; NaN where they are not known.

    Parameters
    ----------
    values, sigma
        Means over slices and their σ, shape (n, P, C).
    usable
        Whether a slice must be used, shape (n, P).
    weights
        Weights of the slices by `site_weights`.
    """
    means = np.einsum("cpq,fqc->fpc", weights, values)
    mean_sigma = np.sqrt(np.einsum("cpq,fqc->fpc", weights**2, sigma**2))
    depends = (np.abs(weights) > DEPENDS).any(axis=0)
    is_known = (usable[:, None, :] | ~depends).all(axis=2, keepdims=True)
    return np.where(is_known, means, np.nan), np.where(is_known, mean_sigma, np.nan)
