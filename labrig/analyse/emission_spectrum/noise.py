"""Noise of what the filter's places show, told by all of them together.

A place on a small sensor is a few pixels wide, too few to tell their noise, and its surroundings
are brighter or darker. But all pixels of a channel are alike: variance = a + b · level (photon
transfer; Janesick 2007). Pairs of successive frames, one scaled to the other, tell a and b: what
stands still cancels.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from labrig.analyse.hot_pixels import hot_pixels_of
from labrig.reduce import PixelMask, RawFrame, SeriesFrame, read_raw
from labrig.reduce.noise import ROUNDING_VARIANCE
from labrig.reduce.pairs import STRIPS
from labrig.region import Region, region_pixels

FloatArray = NDArray[np.float64]

#: Rounds in which the weights follow the line.
ROUNDS = 8
#: A scatter so many times what it should be is none of noise.
OUTLIER = 10.0
#: Strips from which a place tells its noise.
FEWEST_STRIPS = 2
#: A place in which so many of its pixels clip is no measurement.
CLIPPED = 0.001


@dataclass(frozen=True, eq=False)
class PixelNoise:
    """Photon-transfer line of a pixel of each channel: (C,) DN² at level 0 and DN² per DN."""

    at_black: FloatArray
    per_dn: FloatArray

    def sigma_dn(self, level_dn: FloatArray, pixels: FloatArray) -> FloatArray:
        """Of means (…, C) over so many pixels (…, C), their level in DN above black."""
        variance = self.at_black + self.per_dn * np.maximum(level_dn, 0.0)
        return np.asarray(np.sqrt(np.maximum(variance, ROUNDING_VARIANCE) / pixels))


@dataclass(frozen=True, eq=False)
class Seen:
    """One frame of `width` × `height` pixels in all places.

    Attributes
    ----------
    level_dn, pixels
        (p, C) means above black, NaN where a place clips; over so many pixels.
    strips
        (p, C, s) means of strips over the width of a place, less its own; NaN where it has fewer.
    """

    frame: SeriesFrame
    width: int
    height: int
    level_dn: FloatArray
    pixels: FloatArray
    strips: FloatArray

    def take(self, places: Sequence[int]) -> "Seen":
        """Some of the places."""
        some = list(places)
        return replace(
            self, level_dn=self.level_dn[some], pixels=self.pixels[some], strips=self.strips[some]
        )


def seen(
    frames: Sequence[SeriesFrame], places: Sequence[Region], darks: Sequence[SeriesFrame]
) -> list[Seen]:
    """Every frame in every place, hot pixels left out."""
    hot = hot_pixels_of(darks)
    return [_seen(frame, read_raw(frame.path), places, hot) for frame in frames]


def pixel_noise(groups: Sequence[Sequence[Seen]]) -> PixelNoise:
    """From groups of frames that show the same, brighter or darker, in order of time."""
    levels, scatters = zip(*(pair for group in groups for pair in _pairs(group)), strict=True)
    level, scatter = np.concatenate(levels), np.concatenate(scatters)
    at_black, per_dn = [], []
    for channel in range(level.shape[1]):
        known = np.isfinite(scatter[:, channel])
        line = _line(level[known, channel], scatter[known, channel])
        at_black.append(line[0])
        per_dn.append(line[1])
    return PixelNoise(np.array(at_black), np.array(per_dn))


def _seen(
    frame: SeriesFrame, raw: RawFrame, regions: Sequence[Region], hot: PixelMask | None
) -> Seen:
    side = raw.cfa_side
    cell = np.array([raw.channels.index(letter) for letter in raw.cfa]).reshape(side, side)
    tiling = (-(-raw.height // side), -(-raw.width // side))
    channel = np.tile(cell, tiling)[: raw.height, : raw.width]
    black = np.tile(np.reshape(raw.black, (side, side)), tiling)[: raw.height, : raw.width]
    level, pixels, strips = [], [], []
    for region in regions:
        x, y, width, height = region_pixels(region, raw.width, raw.height)
        here = np.s_[y : y + height, x : x + width]
        light, clips = raw.mosaic[here] - black[here], raw.mosaic[here] >= raw.white
        starts = np.arange(min(STRIPS, height // side)) * height // min(STRIPS, height // side)
        means, totals, counts = [], [], []
        for number in range(len(raw.channels)):
            own = channel[here] == number
            if hot is not None:
                own &= ~hot[here]
            count = np.add.reduceat(own.sum(axis=1), starts)
            total = np.add.reduceat(np.sum(light, axis=1, where=own), starts)
            means.append(total / np.maximum(count, 1))
            clipped = np.count_nonzero(clips & own) > CLIPPED * count.sum()
            totals.append(np.nan if clipped else total.sum())
            counts.append(max(count.sum(), 1))
        level.append(np.array(totals) / counts)
        pixels.append(counts)
        strips.append(np.array(means))
    deviations = np.full((len(regions), len(raw.channels), STRIPS), np.nan)
    for place, one in enumerate(strips):
        deviations[place, :, : one.shape[1]] = one - one.mean(axis=1, keepdims=True)
    counted = np.array(pixels, dtype=np.float64)
    return Seen(frame, raw.width, raw.height, np.array(level), counted, deviations)


def _pairs(group: Sequence[Seen]) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Level that a pair's noise belongs to and its variance per pixel, each (p, C)."""
    for one, other in pairwise(group):
        # Brought to the same brightness all over, as nearly as the noisiest place allows.
        a, b = np.nan_to_num(one.level_dn), np.nan_to_num(other.level_dn)
        both = np.isfinite(one.level_dn) & np.isfinite(other.level_dn)
        scale = np.sum(a * b, where=both, axis=0) / np.maximum(np.sum(a * a, where=both, axis=0), 1)
        scale = np.clip(scale, 0.0, 1e3)
        difference = other.strips - scale[:, np.newaxis] * one.strips
        strips = np.isfinite(difference).sum(axis=2)
        few = strips < FEWEST_STRIPS
        scatter = np.nansum(np.square(difference), axis=2) / np.maximum((strips - 1) * strips, 1)
        scatter = np.where(few, np.nan, scatter * one.pixels)
        # a + b L of the one times scale², of the other times 1.
        share = 1 + scale**2
        level = (b + scale**2 * a) / share
        yield np.where(both, level, np.nan), np.where(both, scatter / share, np.nan)


def _line(level: FloatArray, scatter: FloatArray) -> FloatArray:
    """The a and b ≥ 0 of scatter = a + b · level, every scatter as uncertain as it is large."""
    level = np.maximum(level, 0.0)
    design = np.stack([np.ones_like(level), level], axis=1)
    # Medians begin, so that a hot pixel or a cosmic ray cannot.
    dark = level <= np.median(level)
    at_black = float(np.median(scatter[dark]))
    rise = (scatter[~dark] - at_black) / np.maximum(level[~dark], 1.0)
    line = np.array([at_black, max(float(np.median(rise)) if rise.size else 0.0, 0.0)])
    for _ in range(ROUNDS):
        expected = np.maximum(design @ line, ROUNDING_VARIANCE)
        kept = scatter < OUTLIER * expected
        weighted = design[kept] / expected[kept, np.newaxis]
        line, _ = nnls(weighted, scatter[kept] / expected[kept])
    return np.asarray(line, dtype=np.float64)
