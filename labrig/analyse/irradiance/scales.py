"""How strongly the lamp lights every place behind the LVF, from card pictures in three colours."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from labrig.errors import DataError
from labrig.fit.spectrum import CurveError
from labrig.fit.spectrum.system import curve_modes
from labrig.optics import CameraResponse, Lvf, Spectrum, Transmittance
from labrig.optics.piecewise import quadrature

FloatArray = NDArray[np.float64]

#: Along a strip, what it lets through in all runs as a parabola, in logarithms, but for this,
UNEVEN = 0.04
#: over such a distance.
UNEVEN_OVER_NM = 60.0
#: What is known of the parabola beforehand: bend and slope from the middle to the ends, height.
PARABOLA = (0.2, 0.3, 10.0)
#: What every position scatters by on its own, besides what is known of it: strips are not smooth.
ROUGH = 0.02
#: Factors have logarithms; no light at all is so much.
LEAST = 1e-6
#: Steps of derivatives by a band's figures, in their σ.
_STEP = 0.5


@dataclass(frozen=True, eq=False)
class Ratio:
    """Light of a card through the LVF over that of the lamp by itself.

    Attributes
    ----------
    value, sigma
        (p, channels); NaN where it was not measured. σ without what is common to all.
    """

    value: FloatArray
    sigma: FloatArray


@dataclass(frozen=True, eq=False)
class Scales:
    """What the LVF leaves, over what its calibration lets expect.

    Attributes
    ----------
    value, covariance
        (p,) and (p, p) of their logarithms.
    measured, measured_sigma
        (p,) each position by itself, before neighbours had their say; σ relative.
    """

    value: FloatArray
    covariance: FloatArray
    measured: FloatArray
    measured_sigma: FloatArray


def scales(
    ratio: Ratio,
    lvf: Lvf,
    lamp: Spectrum,
    card: Transmittance,
    camera: CameraResponse,
    curve_error: CurveError = CurveError(),  # noqa: B008 (frozen)
) -> Scales:
    """One factor for each position, such that lamp × LVF explains what the card shows.

    The camera's curves say how bright a narrow band looks against the whole lamp, and are wrong by
    some per cent, more in the violet. What a strip lets through runs smoothly along it; both are
    weighed by their covariances.

    Raises
    ------
    DataError
        A position at which no colour was measured.
    """
    low, high = float(camera.wavelength_nm[0]), float(camera.wavelength_nm[-1])
    nodes, weights = quadrature(
        low, high, camera.wavelength_nm, lamp.wavelength_nm, card.wavelength_nm
    )
    light = weights * lamp.at(nodes) * card.at(nodes)
    passed = lvf.transmission(nodes) * light
    sensitivity = camera.at(nodes)
    whole = light @ sensitivity
    expected = passed @ sensitivity / whole
    modes = curve_modes(curve_error, nodes, sensitivity, camera.sensitivity.max(axis=0))
    # (modes, p, channels) of the expected ratio.
    wrong = np.stack([passed @ mode / whole - expected * (light @ mode / whole) for mode in modes])
    shifted = _by_figures(lvf, nodes, light) @ sensitivity / whole
    value, noise, by_curves = np.empty(len(expected)), np.empty(len(expected)), []
    for k in range(len(expected)):
        used = np.isfinite(ratio.value[k]) & (expected[k] > 0)
        if not used.any():
            raise DataError(f"position p{k:02d}: no light was measured; expose longer")
        seen, unsure, of_curves = ratio.value[k, used], ratio.sigma[k, used], wrong[:, k, used]
        weight = _weights(seen, expected[k, used], unsure, of_curves)
        value[k] = max(float(weight @ seen), LEAST)
        of_noise = (weight**2) @ unsure**2 / value[k] ** 2
        of_figures = ((shifted[:, k, used] @ weight) ** 2).sum()
        noise[k] = float(np.sqrt(of_noise + of_figures + ROUGH**2))
        by_curves.append(of_curves @ weight)
    curves = np.array(by_curves)
    return _smoothed(value, np.diag(noise**2) + curves @ curves.T, lvf)


def _weights(
    seen: FloatArray, expected: FloatArray, unsure: FloatArray, of_curves: FloatArray
) -> FloatArray:
    """(channels,) by which what was seen of a position adds up to its factor.

    By generalised least squares: noise, and curves that are wrong by so much (modes, channels).
    """
    start = max(float(seen @ expected / (expected @ expected)), LEAST)
    covariance = np.diag(unsure**2) + start**2 * of_curves.T @ of_curves
    weight = np.linalg.solve(covariance, expected)
    weights: FloatArray = weight / (weight @ expected)
    return weights


def _by_figures(lvf: Lvf, nodes: FloatArray, light: FloatArray) -> FloatArray:
    """(figures, p, q) light let through, by one σ of a band's place, width and shape at its area.

    What is let through in all is measured here; how it is spread is as the calibration says.
    """
    if lvf.sigma is None:
        return np.zeros((1, len(lvf.position), len(nodes)))
    changes = []
    for name in ("centre_nm", "fwhm_nm", "skew", "leakage"):
        moved = getattr(lvf.bands, name) + _STEP * getattr(lvf.sigma, name)
        bands = replace(lvf.bands, **{name: moved})
        bands = replace(bands, peak=bands.peak * lvf.bands.fwhm_nm / bands.fwhm_nm)
        change = bands.transmission(nodes) - lvf.bands.transmission(nodes)
        changes.append(change * light / _STEP)
    return np.array(changes)


def _smoothed(value: FloatArray, covariance: FloatArray, lvf: Lvf) -> Scales:
    """Weigh logarithms of light through every place against a smooth course of them."""
    centre = lvf.bands.centre_nm
    area = np.log(lvf.bands.peak * lvf.bands.fwhm_nm)
    apart = (centre[:, np.newaxis] - centre) / UNEVEN_OVER_NM
    powers = np.vander((centre - centre.mean()) / np.ptp(centre) * 2, 3)
    parabola = (powers * np.square(PARABOLA)) @ powers.T
    before = UNEVEN**2 * np.exp(-(apart**2) / 2) + parabola
    gain = np.linalg.solve(before + covariance, before).T
    course = gain @ (np.log(value) + area)
    after = before - gain @ before
    return Scales(
        np.exp(course - area),
        (after + after.T) / 2,
        value,
        np.sqrt(np.diag(covariance)),
    )


def in_bands(lvf: Lvf, lamp: Spectrum, edges_nm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """∫ L T_p dλ over bands, (p, bands), and one σ by what is not known of the filter's bands.

    The height of a band is left out: `scales` measures it.
    """
    value = _in_bands(lvf, lamp, edges_nm)
    if lvf.sigma is None:
        return value, np.zeros_like(value)
    variance = np.zeros_like(value)
    for name in ("centre_nm", "fwhm_nm", "skew", "leakage"):
        moved = getattr(lvf.bands, name) + _STEP * getattr(lvf.sigma, name)
        other = replace(lvf, bands=replace(lvf.bands, **{name: moved}))
        variance += ((_in_bands(other, lamp, edges_nm) - value) / _STEP) ** 2
    return value, np.sqrt(variance)


def _in_bands(lvf: Lvf, lamp: Spectrum, edges_nm: FloatArray) -> FloatArray:
    rows = []
    for low, high in pairwise(edges_nm):
        nodes, weights = quadrature(low, high, lamp.wavelength_nm, lvf.remainder_nm)
        rows.append(lvf.transmission(nodes) @ (weights * lamp.at(nodes)))
    return np.stack(rows, axis=1)
