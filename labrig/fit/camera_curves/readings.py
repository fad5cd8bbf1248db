"""Readings that tell a camera's curves: a chart's patches, a grey card through a variable filter.

Each kind gives its design, linear in the curves, and the covariance of its errors for given curves:
noise, and what is not known of chart, light and filter.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from labrig.fit.camera_curves.family import GRID_NM, correlation
from labrig.foundation.arrays import FloatArray
from labrig.optics import Lvf, Transmittance

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
