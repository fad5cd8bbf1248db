"""Reduction of frames through the LVF to DN/s at its places: noise, dark and vignetting.

A place on a small sensor is a few pixels wide, too few to measure their noise, and its surroundings
are brighter or darker. But all pixels of a channel are alike, so one photon transfer holds for all.
It is measured on pairs of successive frames, one scaled to the other: everything static cancels.
"""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from labrig.calibration import CameraFile
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.reduce import (
    ROUNDING_VARIANCE,
    STRIPS,
    TWO_DEGREES,
    DarkModel,
    HotPixels,
    LinearFrame,
    NoiseModel,
    RawFrame,
    SeriesFrame,
    fit_dark,
    hot_pixels_of,
    reduce_frames,
    variance_terms,
)
from labrig.results import FilterFrames, is_usable

Patch = TypeVar("Patch", bound=Hashable)

#: Iterations of the weights by the line.
ROUNDS = 8
#: Scatter relative to the expected one from which it is not noise.
OUTLIER = 10.0
#: Fewest strips that determine the noise of a place.
MIN_STRIPS = 2


def sigma_dn(noise: Sequence[NoiseModel], level_dn: FloatArray, pixels: FloatArray) -> FloatArray:
    """Return σ of means (…, C) over so many pixels (…, C) by the noise of each channel's pixels."""
    variance = [model.variance_dn2(level_dn[..., number]) for number, model in enumerate(noise)]
    least = np.maximum(np.stack(variance, axis=-1), ROUNDING_VARIANCE)
    return np.asarray(np.sqrt(least / pixels))


@dataclass(frozen=True, eq=False)
class PlaceLevels:
    """Light of one frame in p places; the attributes are those of `MeasuredPlaces`."""

    width: int
    height: int
    level_dn: FloatArray
    pixels: FloatArray
    strips: FloatArray


@dataclass(frozen=True, eq=False)
class MeasurePlaces:
    """Measurement of one frame in several places.

    Attributes
    ----------
    regions
        Regions of the places in fractions of the frame.
    hot
        Hot pixels to leave out; None leaves out none.
    """

    regions: tuple[Region, ...]
    hot: HotPixels | None

    def __call__(self, frames: Iterator[RawFrame]) -> PlaceLevels:
        """Measure the frame in each place."""
        raw = next(frames)
        linear = LinearFrame(raw, hot=None if self.hot is None else self.hot.mask)
        sums = [linear.region_sums(region) for region in self.regions]
        deviations = np.full((len(sums), len(raw.channels), STRIPS), np.nan)
        for region_deviations, region_sums in zip(deviations, sums, strict=True):
            means = region_sums.strip_means_dn(min(STRIPS, len(region_sums.pixels) // raw.cfa_side))
            region_deviations[:, : len(means)] = (means - means.mean(axis=0)).T
        level = np.array(
            [np.where(region_sums.is_clipped, np.nan, region_sums.mean_dn) for region_sums in sums]
        )
        pixels = np.array([np.maximum(region_sums.pixels.sum(axis=0), 1.0) for region_sums in sums])
        return PlaceLevels(raw.width, raw.height, level, pixels, deviations)


@dataclass(frozen=True, eq=False)
class MeasuredPlaces:
    """Measurement of one frame in p places.

    Attributes
    ----------
    frame
        The frame.
    width, height
        Size of the frame in pixels.
    level_dn
        Means above black in DN, shape (p, C); NaN where a place clips.
    pixels
        Number of pixels of each mean, shape (p, C).
    strips
        Deviations of strips across a place from its mean in DN, shape (p, C, s); NaN where it has
        fewer strips.
    """

    frame: SeriesFrame
    width: int
    height: int
    level_dn: FloatArray
    pixels: FloatArray
    strips: FloatArray

    def take(self, places: Sequence[int]) -> "MeasuredPlaces":
        """Return the measurement of the given places."""
        indices = list(places)
        return replace(
            self,
            level_dn=self.level_dn[indices],
            pixels=self.pixels[indices],
            strips=self.strips[indices],
        )


@dataclass(frozen=True, eq=False)
class PatchReduction:
    """All frames in all places of one patch.

    Attributes
    ----------
    frames
        Measurement of each frame.
    slices
        Regions of the places.
    holder
        Dark regions of the frame beside the filter, measured after the places.
    camera
        Calibration of the camera; None if there is none.
    noise
        Noise of the pixels of each channel.
    dark
        Dark level of each place.
    """

    frames: Sequence[MeasuredPlaces]
    slices: Mapping[str, Region]
    holder: Mapping[str, Region]
    camera: CameraFile | None
    noise: Sequence[NoiseModel]
    dark: Sequence[DarkModel]

    def of_unit(self, unit: str) -> FilterFrames:
        """Return the frames of a unit, without those the user excludes."""
        rows = [
            measured
            for measured in self.frames
            if measured.frame.unit == unit and is_usable(measured.frame.flag)
        ]
        if not rows:
            raise DataError(f"expected frames of {unit}, got none that are not excluded")
        columns = [self._reduce(measured) for measured in rows]
        value, sigma, dark_sigma = (np.stack(column) for column in zip(*columns, strict=True))
        middles_s = [measured.frame.t_s + measured.frame.exposure_s / 2 for measured in rows]
        return FilterFrames(np.array(middles_s), value, sigma, dark_sigma)

    def _reduce(self, measured: MeasuredPlaces) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return signal, σ and common-mode σ of a frame in DN/s, (places · channels,) each."""
        frame, camera, exposure_s = measured.frame, self.camera, measured.frame.exposure_s
        levels = [model.dark_level(exposure_s) for model in self.dark]
        level, level_sigma = (np.array(column) for column in zip(*levels, strict=True))
        light, sigma = (
            measured.level_dn - level,
            sigma_dn(self.noise, measured.level_dn, measured.pixels),
        )
        # A sensor that has warmed since the dark frames is off in all places together.
        common_sigma = TWO_DEGREES * np.abs(np.array([m.current(exposure_s) for m in self.dark]))
        count = len(self.slices)
        if self.holder:
            fraction = measured.pixels[count:] / measured.pixels[count:].sum(axis=0)
            light = light - np.sum(fraction * light[count:], axis=0)
            common_sigma = np.broadcast_to(
                np.sqrt(np.sum((fraction * sigma[count:]) ** 2, axis=0)), light.shape
            )
        sigma = np.where(np.isnan(light), np.nan, np.hypot(sigma, level_sigma))
        per_dn = np.full(
            light.shape, exposure_s if camera is None else camera.exposure_s(exposure_s)[0]
        )
        if camera is not None:
            per_dn[:count] *= [
                camera.flat(frame.f_number, region, measured.width, measured.height)
                for region in self.slices.values()
            ]
        columns = (light, sigma, common_sigma)
        value, sigma, common_sigma = ((column / per_dn)[:count].ravel() for column in columns)
        return value, sigma, common_sigma


def reduce_places(
    frames: Sequence[SeriesFrame],
    darks: Sequence[SeriesFrame],
    patches: Mapping[Patch, Mapping[str, Region]],
    camera: CameraFile | None,
    holder: Mapping[str, Region] | None = None,
) -> dict[Patch, PatchReduction]:
    """Read every frame once, in every place of each patch.

    The light of the holder is subtracted.

    Raises
    ------
    DataError
        There are no dark frames, or some are at another ISO.
    """
    isos = {frame.iso for frame in (*frames, *darks)}
    if not darks or len(isos) > 1:
        raise DataError(
            f"expected dark frames at the one ISO of all frames, got {len(darks)} and ISO "
            f"{', '.join(f'{iso:g}' for iso in sorted(filter(None, isos)))}"
        )
    holder_regions = dict(holder or {})
    regions = [region for slices in patches.values() for region in slices.values()]
    measure = MeasurePlaces((*regions, *holder_regions.values()), hot_pixels_of(darks))
    lit, dark = (_measure_frames(selected, measure) for selected in (frames, darks))
    rising = sorted(dark, key=lambda measured: measured.frame.exposure_s)
    groups = [
        [measured for measured in lit if measured.frame.unit == unit]
        for unit in {measured.frame.unit: None for measured in lit}
    ]
    places, first = {}, 0
    for patch, slices in patches.items():
        after = first + len(slices)
        # The holder's places come last.
        places[patch] = [
            *range(first, after),
            *range(len(regions), len(regions) + len(holder_regions)),
        ]
        first = after
    # Patches fade differently: the frames of a pair are brought to the same brightness in each.
    noise = pixel_noise(
        [
            [measured.take(place_numbers) for measured in group]
            for place_numbers in places.values()
            for group in (*groups, rising)
        ]
    )
    return {
        patch: _patch_reduction(
            [measured.take(place_numbers) for measured in lit],
            [measured.take(place_numbers) for measured in dark],
            patches[patch],
            holder_regions,
            camera,
            noise,
        )
        for patch, place_numbers in places.items()
    }


def _patch_reduction(
    lit: Sequence[MeasuredPlaces],
    dark: Sequence[MeasuredPlaces],
    slices: Mapping[str, Region],
    holder: Mapping[str, Region],
    camera: CameraFile | None,
    noise: Sequence[NoiseModel],
) -> PatchReduction:
    exposure_s = np.array([measured.frame.exposure_s for measured in dark])
    level = np.stack([np.nan_to_num(measured.level_dn) for measured in dark])
    sigma = np.stack([sigma_dn(noise, measured.level_dn, measured.pixels) for measured in dark])
    models = [
        fit_dark(exposure_s, level[:, place], np.nan_to_num(sigma[:, place], nan=np.inf))
        for place in range(level.shape[1])
    ]
    return PatchReduction(lit, slices, holder, camera, noise, models)


def _measure_frames(frames: Sequence[SeriesFrame], measure: MeasurePlaces) -> list[MeasuredPlaces]:
    """Measure every frame in every place."""
    return [
        MeasuredPlaces(
            frame, levels.width, levels.height, levels.level_dn, levels.pixels, levels.strips
        )
        for frame, levels in zip(frames, reduce_frames(frames, measure), strict=True)
    ]


def pixel_noise(groups: Sequence[Sequence[MeasuredPlaces]]) -> list[NoiseModel]:
    """Fit the noise of each channel's pixels.

    Parameters
    ----------
    groups
        Groups of frames by time that show one scene at different brightness.
    """
    levels, scatters = zip(
        *(pair for group in groups for pair in _pair_scatters(group)), strict=True
    )
    level, scatter = np.concatenate(levels), np.concatenate(scatters)
    is_finite = np.isfinite(scatter)
    return [
        _fit_line(level[is_finite[:, c], c], scatter[is_finite[:, c], c])
        for c in range(level.shape[1])
    ]


def _pair_scatters(group: Sequence[MeasuredPlaces]) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Iterate over a pair's level in DN and the variance per pixel at it in DN², (p, C) each."""
    for first, second in pairwise(group):
        # Brought to the same brightness all over, as nearly as the noisiest place allows.
        first_level, second_level = np.nan_to_num(first.level_dn), np.nan_to_num(second.level_dn)
        in_both = np.isfinite(first.level_dn) & np.isfinite(second.level_dn)
        scale = np.sum(first_level * second_level, where=in_both, axis=0) / np.maximum(
            np.sum(first_level * first_level, where=in_both, axis=0), 1
        )
        scale = np.clip(scale, 0.0, 1e3)
        difference = second.strips - scale[:, np.newaxis] * first.strips
        strips = np.isfinite(difference).sum(axis=2)
        few = strips < MIN_STRIPS
        scatter = np.nansum(np.square(difference), axis=2) / np.maximum((strips - 1) * strips, 1)
        scatter = np.where(few, np.nan, scatter * first.pixels)
        # a + b L of the one times scale², of the other times 1.
        fraction = 1 + scale**2
        level = (second_level + scale**2 * first_level) / fraction
        yield np.where(in_both, level, np.nan), np.where(in_both, scatter / fraction, np.nan)


def _fit_line(level: FloatArray, scatter: FloatArray) -> NoiseModel:
    """Fit read and photon noise to scatters whose uncertainty is proportional to their size."""
    level = np.maximum(level, 0.0)
    terms = variance_terms(level)[:, :2]
    # Medians begin, so that a hot pixel or a cosmic ray cannot.
    is_dark = level <= np.median(level)
    at_black = float(np.median(scatter[is_dark]))
    rise = (scatter[~is_dark] - at_black) / np.maximum(level[~is_dark], 1.0)
    noise = NoiseModel(at_black, max(float(np.median(rise)) if rise.size else 0.0, 0.0))
    for _ in range(ROUNDS):
        expected = np.maximum(noise.variance_dn2(level), ROUNDING_VARIANCE)
        kept = scatter < OUTLIER * expected
        noise = NoiseModel.fit(terms[kept], scatter[kept], sigma_dn2=expected[kept])
    return noise
