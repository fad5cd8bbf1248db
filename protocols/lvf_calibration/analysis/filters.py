"""Colour filters over a grey card: test that each was in its place, and joint calibration."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.fit.lvf import LvfCalibration, calibrate_lvf
from labrig.fit.spectrum import CurveError
from labrig.foundation.arrays import FloatArray
from labrig.optics import (
    CameraResponse,
    Lvf,
    Spectrum,
    Transmittance,
    WavelengthMap,
    nominal_lvf,
    quadrature,
)
from labrig.protocols.lvf_calibration.result import FilterMisfit
from labrig.reduce import FLICKER
from labrig.results import SliceValues

#: Root mean square error expected of transmittances along a strip: by the map, bands of another
#: shape, a filter that differs from its table.
EXPECTED = 0.05
#: Factor by which another filter must explain a frame better to be taken for the one in place.
BETTER = 3.0
#: Root mean square error beyond which no known filter is in place.
FAR_OFF = 0.15
#: Light of the places that identify a filter, as a fraction of the brightest one's.
BRIGHT = 0.25
#: Relative deviation of a gel from its table, and of a table of few points from the curve.
TABLE = 0.02
#: Error model of the camera's curves, which are worst at the ends of the spectrum and where a
#: channel is nearly blind; neighbouring bands constrain these errors if they are allowed for. A
#: tenth of a curve is 0.04 rms over the visible, as three laboratories disagree.
CURVES = CurveError(relative=0.1, added=0.03)
#: Significance in σ of a place's value without a filter from which its transmittance is defined.
CLEAR = 30.0

NO_FILTER = Transmittance("none", np.array([300.0, 900.0]), np.ones(2))


@dataclass(frozen=True, eq=False)
class FilterScenes:
    """Frames through the strip with each filter.

    Attributes
    ----------
    position
        Positions along the strip, rising, shape (p,).
    filters
        Transmittances of the f filters; the first is `NO_FILTER`.
    values
        Slice values with each filter, in the same order.
    card
        Slice values of the card at the same places without the strip.
    """

    position: FloatArray
    filters: Sequence[Transmittance]
    values: Sequence[SliceValues]
    card: SliceValues

    def without(self, names: set[str]) -> "FilterScenes":
        """Return the scenes without the filters of these names."""
        kept = [
            number
            for number, transmittance in enumerate(self.filters)
            if transmittance.name not in names
        ]
        return replace(
            self,
            filters=[self.filters[number] for number in kept],
            values=[self.values[number] for number in kept],
        )


@dataclass(frozen=True)
class Bench:
    """Known spectra on the light's path.

    Attributes
    ----------
    lamp
        Spectrum of the lamp.
    card
        Reflectance of the card.
    camera
        Curves of the camera.
    """

    lamp: Spectrum
    card: Transmittance
    camera: CameraResponse

    def card_values(self) -> FloatArray:
        """Return ∫ L R S_c dλ, the signal of the card itself, shape (channels,)."""
        nodes, light = self._light()
        values: FloatArray = light @ self.camera.at(nodes)
        return values

    def relative(self, lvf: Lvf, filters: Sequence[Transmittance]) -> FloatArray:
        """Return values relative to those without a filter, shape (filters, p, channels)."""
        nodes, light = self._light(*(transmittance.wavelength_nm for transmittance in filters))
        through_strip = lvf.transmission(nodes) * light
        sensitivity = self.camera.at(nodes)
        unfiltered = through_strip @ sensitivity
        transmitted = [
            (through_strip * transmittance.at(nodes)) @ sensitivity for transmittance in filters
        ]
        relative: FloatArray = np.stack(transmitted) / np.maximum(
            unfiltered, 1e-12 * unfiltered.max()
        )
        return relative

    def _light(self, *knots: FloatArray) -> tuple[FloatArray, FloatArray]:
        curves = (self.camera.wavelength_nm, self.lamp.wavelength_nm, self.card.wavelength_nm)
        low, high = float(curves[0][0]), float(curves[0][-1])
        nodes, weights = quadrature(low, high, *curves, *knots)
        return nodes, weights * self.lamp.at(nodes) * self.card.at(nodes)


def misfits(scenes: FilterScenes, bench: Bench, wavelengths: WavelengthMap) -> list[FilterMisfit]:
    """Return the misfit of every filter but the first.

    The nominal bands of the maker suffice: the test is where along the strip a filter absorbs, and
    the camera's curves cancel in the ratio to the frame without it.
    """
    lvf = nominal_lvf(wavelengths, wavelengths.wavelength_nm(scenes.position))
    expected = bench.relative(lvf, scenes.filters)
    unfiltered = scenes.values[0].value
    # In its brightest colour a place sees its band, in the others and at dim ends what leaks.
    fraction = np.nan_to_num(unfiltered / scenes.card.value)
    brightest = np.argmax(fraction, axis=1)
    bright = fraction.max(axis=1) > BRIGHT * fraction.max()
    places = np.flatnonzero(bright), brightest[bright]
    filter_misfits = []
    for number, scene in enumerate(scenes.values[1:], start=1):
        ratio = scene.value[places] / unfiltered[places]
        deviation = np.sqrt(np.nanmean((expected[:, *places] - ratio) ** 2, axis=1))
        best = int(np.argmin(deviation))
        name = scenes.filters[number].name
        best_name = scenes.filters[best].name
        is_other_filter = best_name != name and deviation[number] > BETTER * deviation[best]
        is_left_out = deviation[number] > FAR_OFF or (
            deviation[number] > EXPECTED and is_other_filter
        )
        filter_misfits.append(
            FilterMisfit(
                name, float(deviation[number]), float(deviation[best]), best_name, bool(is_left_out)
            )
        )
    return filter_misfits


def left_out_text(misfit: FilterMisfit) -> str:
    """Return a warning about a filter that was not in its place."""
    likeness = "it looks like none of the others"
    if misfit.like != misfit.name and misfit.own > BETTER * misfit.best:
        best_name = "no filter" if misfit.like == NO_FILTER.name else misfit.like
        likeness = f"it looks like {best_name} ({misfit.best:.3f})"
    return (
        f"colour filter {misfit.name}: its picture is off its transmittance by {misfit.own:.3f} "
        f"(rms along the strip), {likeness}; it was not in its place, and is left out (put it in "
        "and take its unit again, or correct its file)"
    )


def fit_bands(scenes: FilterScenes, bench: Bench, wavelengths: WavelengthMap) -> LvfCalibration:
    """Fit T_p(λ) at every position, in units of the card seen without the strip.

    The effect of lens, lamp and card on a place is divided out by the frame of the card itself, and
    so is the ratio of the camera's channels under this lamp.
    """
    reference = bench.card_values() / scenes.card.value
    value = np.stack([scene.value * reference for scene in scenes.values], axis=1)
    sigma = [
        np.hypot(scene.sigma, (FLICKER if transmittance is NO_FILTER else TABLE) * scene.value)
        * reference
        for transmittance, scene in zip(scenes.filters, scenes.values, strict=True)
    ]
    calibration = calibrate_lvf(
        scenes.position,
        value,
        np.stack(sigma, axis=1),
        filters=scenes.filters,
        lamp=bench.lamp,
        card=bench.card,
        camera=bench.camera,
        wavelengths=wavelengths,
        curve_error=CURVES,
    )
    return replace(calibration, camera=_balanced(calibration.camera, bench, scenes.card))


def _balanced(camera: CameraResponse, bench: Bench, card: SliceValues) -> CameraResponse:
    """Return the curves in the ratios in which this camera's channels see the card.

    The fit is in units of the card, channel by channel, so that its curves keep the ratios of those
    it began with: another camera's, by which a glow would be up to a tenth too blue or too red.
    """
    is_known = np.isfinite(card.value).all(axis=1)
    if not is_known.any():
        return camera
    seen = replace(bench, camera=camera).card_values()
    # A place is as bright in all channels as lens and lamp make it.
    places = card.value[is_known] / card.value[is_known].mean(axis=1, keepdims=True)
    sensitivity = camera.sensitivity * (places.mean(axis=0) / seen)
    return replace(camera, sensitivity=sensitivity / sensitivity.max())


def residuals(scenes: FilterScenes, bench: Bench, lvf: Lvf) -> FloatArray:
    """Return measured transmittance minus that of the calibrated strip, shape (filters, p).

    It is the mean of the channels weighted by their light; NaN where it is undetermined.
    """
    expected = bench.relative(lvf, scenes.filters)
    unfiltered = scenes.values[0]
    is_clear = unfiltered.value > CLEAR * unfiltered.sigma
    weight = np.where(is_clear, unfiltered.value, 0.0)
    total = weight.sum(axis=1)
    rows = []
    for scene, expected_ratio in zip(scenes.values, expected, strict=True):
        residual = np.where(
            is_clear, scene.value / np.where(is_clear, unfiltered.value, 1.0) - expected_ratio, 0.0
        )
        mean = (weight * np.nan_to_num(residual)).sum(axis=1) / np.where(total > 0, total, 1.0)
        rows.append(np.where(total > 0, mean, np.nan))
    return np.array(rows)
