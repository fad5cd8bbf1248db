"""Which LED a camera's channel ratios belong to, by the spectra of all of them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from labrig.fit.leds.brightness import (
    CLEAR,
    CURVES_OF_MODEL,
    EXPOSURE_SIGMA,
    SKEW_SIGMA,
    WIDTH_SIGMA,
    changed_spectrum,
)
from labrig.fit.spectrum import CurveError, camera_modes
from labrig.foundation.arrays import FloatArray
from labrig.optics import CameraResponse, Spectrum, Transmittance

#: Standard uncertainty in nm of an LED's wavelengths by its data sheet.
SHEET_NM = 2.0
#: χ² (2 degrees of freedom) from which ratios are not those of a light: one in 10⁵ by chance.
ODD = 23.0
#: Steps of derivatives: in nm, and relative ones.
SHIFT_STEP_NM, WIDTH_STEP, SKEW_STEP = 0.5, 0.05, 0.05
#: Least response to an LED relative to that to the strongest one: to seem as bright as another,
#: LEDs are not ten times as strong.
DIM = 0.1
#: Least part of the stronger LED's light that the weaker of two has.
MIN_PART = 0.05


@dataclass(frozen=True)
class ChannelMatch:
    """Agreement of a camera's channel ratios with the light of LEDs.

    Attributes
    ----------
    chi2
        χ² with the light of each LED, by its name.
    pair
        The other LED with whose light, beside the LED's own, the ratios agree; None if there is
        none, or the LED's own light suffices.
    """

    chi2: Mapping[str, float]
    pair: str | None

    def is_odd(self, name: str) -> bool:
        """Return whether the ratios are not those of an LED."""
        return self.chi2[name] > ODD

    def other(self, name: str) -> str | None:
        """Return the LED whose light it is rather than that of the one named; None if none."""
        best = min(self.chi2, key=lambda one: self.chi2[one])
        return best if self.is_odd(name) and not self.is_odd(best) else None


def match_channels(
    name: str,
    value: FloatArray,
    variance: FloatArray,
    lights: Mapping[str, Spectrum],
    camera: CameraResponse,
    card: Transmittance,
    curve_error: CurveError = CURVES_OF_MODEL,
) -> ChannelMatch:
    """Compare a white reference under one LED with the light of all LEDs of a bank.

    Parameters
    ----------
    name
        Name of the LED that should be lit.
    value, variance : ndarray, shape (channels,)
        Values of the white reference and their variances.
    lights
        Spectra of all LEDs by their names, as their data sheets have them.
    camera, card, curve_error
        The camera's curves, the reflectance of the white reference, and the curves' error.

    Returns
    -------
    ChannelMatch
        Which LED's light it may be.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.fit.leds import match_channels
    >>> from labrig.optics import Transmittance, read_light
    >>> camera = labrig.read_camera("canon_eos_5d_mark_ii")
    >>> lights = {name: read_light(name) for name in ("450nm", "530nm", "630nm")}
    >>> white = Transmittance("white", np.array([300.0, 800.0]), np.ones(2))
    >>> green = np.array([0.3138, 1.9785, 0.2227])
    >>> match = match_channels("630nm", green, np.full(3, 1e-6), lights, camera, white)
    >>> match.other("630nm")
    '530nm'
    """
    matcher = _Matcher(value, variance, lights, camera, card, curve_error)
    chi2 = {led: matcher.chi2([led]) for led in lights if led == name or matcher.sees(led)}
    if not matcher.sees(name):
        return ChannelMatch({name: 0.0}, None)
    pair = None
    if chi2[name] > ODD and min(chi2.values()) > ODD:
        pairs = {led: matcher.chi2([name, led]) for led in chi2 if led != name}
        best = min(pairs, key=lambda led: pairs[led], default=None)
        pair = best if best is not None and pairs[best] < ODD else None
    return ChannelMatch(chi2, pair)


class _Matcher:
    def __init__(
        self,
        value: FloatArray,
        variance: FloatArray,
        lights: Mapping[str, Spectrum],
        camera: CameraResponse,
        card: Transmittance,
        curve_error: CurveError,
    ) -> None:
        self._value, self._variance = value, variance
        nodes = np.arange(camera.wavelength_nm[0], camera.wavelength_nm[-1] + 1.0, 1.0)
        curves = camera.at(nodes)
        by_curves = camera_modes(camera, nodes, curve_error)
        sensitivities = np.array([curves, *by_curves]) * card.at(nodes)[:, np.newaxis]
        self._seen = {}
        for name, light in lights.items():
            changes = (
                (0.0, 1.0, 0.0),
                (SHIFT_STEP_NM, 1.0, 0.0),
                (0.0, 1.0 + WIDTH_STEP, 0.0),
                (0.0, 1.0, SKEW_STEP),
            )
            parts = [
                changed_spectrum(light, *change).resampled(nodes).value / change[1]
                for change in changes
            ]
            scale = max(float(parts[0].sum()), 1e-300)
            rows = np.asarray(parts[0] / scale @ sensitivities)
            shapes = np.array(
                [
                    SHEET_NM * (parts[1] - parts[0]) / SHIFT_STEP_NM,
                    WIDTH_SIGMA * (parts[2] - parts[0]) / WIDTH_STEP,
                    SKEW_SIGMA * (parts[3] - parts[0]) / SKEW_STEP,
                ]
            )
            self._seen[name] = np.concatenate([rows, shapes / scale @ sensitivities[0]])

    def sees(self, name: str) -> bool:
        """Return whether some channel sees an LED beyond the errors of curves and shape."""
        rows = self._seen[name]
        if rows[0].max() < DIM * max(other[0].max() for other in self._seen.values()):
            return False
        error = np.linalg.norm(rows[1:], axis=0)
        return bool((rows[0] > CLEAR * np.maximum(error, 1e-12)).any())

    def chi2(self, names: list[str]) -> float:
        """Return χ² of the values with the light of some LEDs; infinite if one takes no part."""
        rows = np.array([self._seen[name] for name in names])  # (n, 1 + modes, k)
        weight = np.ones(len(names)) * self._value.max() / max(rows[:, 0].max(), 1e-300)
        covariance = np.diag(self._variance)
        for _ in range(8):
            change = np.einsum("n,nzk->zk", weight, rows[:, 1:])
            covariance = change.T @ change + np.diag(self._variance)
            covariance += EXPOSURE_SIGMA**2 * np.outer(self._value, self._value)
            precision = np.linalg.inv(covariance)
            normal = rows[:, 0] @ precision @ rows[:, 0].T
            weight = np.linalg.lstsq(normal, rows[:, 0] @ precision @ self._value, rcond=None)[0]
            weight = np.maximum(weight, 0.0)
        if len(names) > 1 and weight.min() < MIN_PART * weight.max():
            return math.inf
        residual = self._value - weight @ rows[:, 0]
        return float(residual @ precision @ residual)
