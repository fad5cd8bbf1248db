"""Glow over reflected light, photographed and rendered, and the colours of both."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from labrig.compare.glow import GlowComparison, compare_scaled, glow_sigma
from labrig.compare.photographed_room import SAMPLE, PhotographedRoom, ReflectedLight
from labrig.compare.rendered_states import MEASURED, FittedGlow, SeenPatch
from labrig.compare.run import MeasuredPatch
from labrig.compare.viewing import Viewing
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import Material
from labrig.results import Series

#: Lightness of the photographed patch.
LIGHTNESS = 50.0


@dataclass(frozen=True, eq=False)
class GlowRatio:
    """Glow over reflected light in one channel, photographed and rendered.

    Attributes
    ----------
    channel
        Name of the channel, in which the glow is brightest.
    reflected_by
        What was lit by the lamp: the sample or the grey card.
    photographed, photographed_sigma
        Ratio of each photograph and σ, shape (n,).
    rendered, rendered_sigma
        Ratio of each rendering by name and σ by the σ of its material or fit, shape (n,).
    """

    channel: str
    reflected_by: str
    photographed: FloatArray
    photographed_sigma: FloatArray
    rendered: Mapping[str, FloatArray]
    rendered_sigma: Mapping[str, FloatArray]

    def excess(self, name: str) -> FloatArray:
        """Return rendered over photographed ratio − 1, shape (n,)."""
        return np.asarray(self.rendered[name] / self.photographed - 1)

    def in_sigma(self, name: str) -> FloatArray:
        """Return the difference of the two ratios in σ, shape (n,)."""
        sigma = np.hypot(self.photographed_sigma, self.rendered_sigma[name])
        return np.asarray((self.rendered[name] - self.photographed) / sigma)


@dataclass(frozen=True, eq=False)
class RenderedPatch:
    """A patch, photographed and rendered.

    Attributes
    ----------
    each
        Comparison in which every photograph has L* = 50, and its rendering the same factor.
    common
        Comparison in which one factor for all brings the brightest photograph to L* = 50.
    matched
        As `each`, but each channel of a rendering has one factor for all times that brings it
        nearest to the photographs. What is left is noise and the course over time; what it takes
        away is of the measured spectrum and of the curves of the camera.
    ratio
        Glow over reflected light.
    """

    each: GlowComparison
    common: GlowComparison
    matched: GlowComparison
    ratio: GlowRatio


def compare_patch(
    patch: MeasuredPatch,
    measured: SeenPatch,
    fitted: FittedGlow,
    conversion: Viewing,
    room: PhotographedRoom,
    *,
    is_same_camera: bool,
) -> RenderedPatch:
    """Compare photographs of a patch with the renderings, in the photographs' unit."""
    series = patch.series
    if not measured.reflected:
        raise UsageError(
            f"{patch.name}: expected a photograph of reflected light beside the glow, got none; "
            "photograph the sample under the lamp (daylight: true), or behind a door the grey card "
            "(labrig run irradiance)"
        )
    # The channels' ratios are those of the card under the known lamp.
    white, as_rendered = measured.reflected[-1]
    gain = white.values / as_rendered
    rendered = {MEASURED: gain * measured.glow}
    own = glow_sigma(patch.material, series, is_same_camera=is_same_camera)
    if measured.reflected[0][0].name == SAMPLE:
        own = np.hypot(own, _albedo_sigma(patch.material))
    sigma = {MEASURED: own}
    for name, glow in fitted.glow.items():
        values = gain * glow
        rendered[name] = values * (np.sum(values * series.values) / np.sum(values**2))
        sigma[name] = fitted.relative_sigma[name]
    luminance = np.maximum(series.values @ conversion.to_xyz[1], 1e-300)
    target = ((LIGHTNESS + 16) / 116) ** 3
    brightest = np.full_like(luminance, luminance.max())
    factor_each, factor_common = (
        target / factor[:, np.newaxis] for factor in (luminance, brightest)
    )
    matched = {name: _matched(values, series, patch.flicker) for name, values in rendered.items()}
    each, common, by_colour = (
        compare_scaled(series, values, conversion, patch.flicker, factor)
        for values, factor in (
            (rendered, factor_each),
            (rendered, factor_common),
            (matched, factor_each),
        )
    )
    light, lit = measured.reflected[0]
    ratio = _ratio(patch, light, gain * lit, rendered, sigma, room)
    return RenderedPatch(each, common, by_colour, ratio)


def _matched(values: FloatArray, series: Series, flicker: float) -> FloatArray:
    """Return a rendering with a factor of each channel by weighted least squares, shape (n, C)."""
    variance = np.square(np.nan_to_num(series.sigma)) + np.square(flicker * values)
    weight = 1 / (variance + np.finfo(float).eps * np.max(values**2))
    factor = np.sum(weight * values * series.values, axis=0) / np.sum(weight * values**2, axis=0)
    return np.asarray(factor * values)


def _albedo_sigma(material: Material) -> float:
    """Return the relative σ of the light that a material reflects, the mean over its albedo."""
    albedo = material.albedo
    if albedo is None or albedo.sigma is None:
        return 0.0
    return float(np.sum(albedo.sigma) / np.sum(albedo.value))


def _ratio(
    patch: MeasuredPatch,
    light: ReflectedLight,
    reference: FloatArray,
    rendered: Mapping[str, FloatArray],
    sigma: Mapping[str, FloatArray],
    room: PhotographedRoom,
) -> GlowRatio:
    """Return glow over reflected light in the channel in which the glow is brightest."""
    series = patch.series
    channel = int(np.argmax(series.values.sum(axis=0)))
    photographed = series.values[:, channel] / light.values[channel]
    noise = np.nan_to_num(series.sigma[:, channel]) / light.values[channel]
    shutter = np.array([room.shutter_sigma(exposure_s) for exposure_s in series.exposure_s])
    common = np.sqrt(patch.flicker**2 + light.relative_sigma**2 + shutter**2)
    ratios = {name: values[:, channel] / reference[channel] for name, values in rendered.items()}
    return GlowRatio(
        channel=series.channels[channel],
        reflected_by=light.name,
        photographed=photographed,
        photographed_sigma=np.hypot(noise, common * np.abs(photographed)),
        rendered=ratios,
        rendered_sigma={name: sigma[name] * np.abs(ratio) for name, ratio in ratios.items()},
    )
