"""Temporal noise of a patch's mean, from pairs of successive frames.

Two frames of the same patch differ by their noise, apart from their brightness: everything static
cancels (the sample's structure, its edges, each pixel's own response). A pair therefore resolves
what a single frame (`labrig.reduce.plane_noise`) cannot: noise that the pixels of a row share, and
the noise of a patch too small to be estimated from its surroundings. It is the photon transfer from
pairs of Janesick (2007) and EMVA 1288, on strips as wide as the patch instead of single pixels: the
scatter of a strip contains the correlation of all pixels in it. Dark frames of similar exposure are
pairs, too: they determine the read noise, which of a decay only the faintest frames do.

Patches of too few pairs are taken together: the noise of a pixel at some level is that of the
sensor, whatever patch it lies in. So narrow places side by side have the right noise, where a
single frame would mix it with that of their surroundings.

Deviations of the strips may be correlated between channels: rows that are read together, charge
that strays into the neighbour of another colour. The same differences determine that correlation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from labrig.foundation.region import Region, region_pixels
from labrig.reduce.dark import same_exposure
from labrig.reduce.photon_transfer import NoiseModel, variance_terms
from labrig.reduce.plane_noise import Floats
from labrig.reduce.raw import RawFrame
from labrig.reduce.region_levels import PixelMask
from labrig.reduce.rounding import ROUNDING_VARIANCE

#: Number of strips of a patch, if it has that many rows of each colour.
STRIPS = 16
#: Degrees of freedom from which pairs replace each frame's own estimate: σ is then known to 10 %.
MIN_DOF = 50
#: Brightness in σ of the mean from which the frames of a pair are scaled to each other; below it
#: their structure is within the noise.
SCALED_SIGMAS = 5.0
#: Least fraction of the σ by a frame alone: frames without noise are no measurement of it.
MIN_FRACTION = 0.1
#: Multiple of the brightness in the pairs up to which their noise tells that of a brighter frame.
MAX_EXTRAPOLATION = 2.0
#: Iterations of the weights by the fitted noise.
REWEIGHTINGS = 4
#: Regularisation that keeps a correlation below 1.
MIN_PRODUCT = 1e-6


@dataclass(frozen=True, eq=False)
class PatchNoise:
    """Noise of the means of a patch.

    Attributes
    ----------
    sigma
        Standard uncertainty of each frame's means in DN, shape (n, C).
    correlation
        Correlation of the channels of one frame, shape (C, C); common-mode flicker is not in it.
    """

    sigma: Floats
    correlation: Floats


@dataclass(frozen=True, eq=False)
class PatchFrames:
    """A patch in n frames of C channels, to be paired.

    Attributes
    ----------
    exposure_s
        Exposure times in seconds, shape (n,).
    deviations
        Deviations of the strips by `strip_deviations` in DN, shape (n, C, strips).
    light
        Means in DN above those of zero exposure, dark current included, shape (n, C).
    sigma
        Standard uncertainty of the means by each frame alone in DN, shape (n, C).
    pixels
        Number of pixels of each channel, shape (C,).
    """

    exposure_s: Floats
    deviations: Floats
    light: Floats
    sigma: Floats
    pixels: Floats

    def take(self, rows: npt.NDArray[np.intp]) -> "PatchFrames":
        """Return the given frames."""
        return replace(
            self,
            exposure_s=self.exposure_s[rows],
            deviations=self.deviations[rows],
            light=self.light[rows],
            sigma=self.sigma[rows],
        )

    def concatenate(self, others: "PatchFrames") -> "PatchFrames":
        """Return these frames followed by `others`."""
        return replace(
            self,
            exposure_s=np.append(self.exposure_s, others.exposure_s),
            deviations=np.concatenate([self.deviations, others.deviations]),
            light=np.concatenate([self.light, others.light]),
            sigma=np.concatenate([self.sigma, others.sigma]),
        )


def strip_deviations(raw: RawFrame, region: Region, hot: PixelMask | None) -> Floats:
    """Return the means of strips across a region minus the region's mean in DN, shape (C, strips).

    Parameters
    ----------
    raw
        The RAW frame.
    region
        Region of the patch in fractions of the frame.
    hot
        Hot pixels to leave out, shape (height, width).
    """
    x, y, width, height = region_pixels(region, raw.width, raw.height)
    side = raw.cfa_side
    strips = max(1, min(STRIPS, height // side))
    total, count = np.zeros((2, len(raw.channels), strips))
    for position, letter in enumerate(raw.cfa):
        row, column = divmod(position, side)
        slices = (
            slice(y + (row - y) % side, y + height, side),
            slice(x + (column - x) % side, x + width, side),
        )
        plane = raw.mosaic[slices]
        if len(plane) < strips:
            continue
        kept = np.ones(plane.shape, bool) if hot is None else ~hot[slices]
        pixels = kept.sum(axis=1)
        if raw.cut_off is None:
            level = plane.sum(axis=1, dtype=np.int64, where=kept)
        else:
            level = raw.levels_dn(plane).sum(axis=1, where=kept)
        light = level - raw.black[position] * pixels
        starts = np.arange(strips) * len(plane) // strips
        channel = raw.channels.index(letter)
        total[channel] += np.add.reduceat(light, starts)
        count[channel] += np.add.reduceat(pixels, starts)
    means = total / np.maximum(count, 1)
    return np.asarray(means - means.mean(axis=1, keepdims=True))


@dataclass(frozen=True, eq=False)
class PatchPairs:
    """Frames of a patch that differ by noise only.

    Attributes
    ----------
    frames
        The patch in frames of light, followed by dark ones.
    first, second
        Frames of each pair, shape (p,).
    """

    frames: PatchFrames
    first: npt.NDArray[np.intp]
    second: npt.NDArray[np.intp]

    @property
    def dof(self) -> int:
        """Degrees of freedom of the differences in one channel."""
        return int(len(self.first) * (self.frames.deviations.shape[2] - 1))

    @classmethod
    def of_unit(
        cls,
        frames: PatchFrames,
        t_s: Floats,
        usable: npt.NDArray[np.bool_],
        darks: PatchFrames | None = None,
    ) -> "PatchPairs":
        """Return successive usable frames of a unit as pairs, and like dark frames.

        Parameters
        ----------
        frames
            The patch in the n frames of a unit.
        t_s
            Start of each exposure in seconds, shape (n,).
        usable
            Whether the frame can be in a pair, shape (n,).
        darks
            Dark frames at the ISO of the unit.
        """
        rows = np.flatnonzero(usable)
        rows = rows[np.argsort(t_s[rows], kind="stable")]
        light = cls(frames, rows[:-1], rows[1:])
        if darks is None:
            return light
        dark = cls.of_like_exposure(darks)
        return cls(
            frames.concatenate(darks),
            np.append(light.first, len(t_s) + dark.first),
            np.append(light.second, len(t_s) + dark.second),
        )

    @classmethod
    def of_like_exposure(cls, frames: PatchFrames) -> "PatchPairs":
        """Return pairs of dark frames that differ by noise only, whatever the current's pattern."""
        rising = np.argsort(frames.exposure_s, kind="stable")
        first, second = rising[:-1], rising[1:]
        like = [
            same_exposure(*frames.exposure_s[[one, two]])
            for one, two in zip(first, second, strict=True)
        ]
        return cls(frames, first[like], second[like])


@dataclass(frozen=True, eq=False)
class SensorNoise:
    """Noise of single pixels, from pairs of frames in many patches.

    Attributes
    ----------
    models
        Variance of a pixel of each channel.
    brightest
        Brightness of the brightest pair of each channel in DN, shape (C,).
    """

    models: Sequence[NoiseModel]
    brightest: Floats

    @classmethod
    def of_patches(cls, patches: Sequence[PatchPairs]) -> "SensorNoise | None":
        """Return the noise that all pairs have in common; None if they are too few."""
        if sum(pairs.dof for pairs in patches) < MIN_DOF:
            return None
        channels = range(patches[0].frames.light.shape[1])
        return cls(
            [_pixel_noise(patches, channel) for channel in channels],
            np.max([_pair_light(pairs).max(axis=0) for pairs in patches if pairs.dof], axis=0),
        )

    def sigma(self, frames: PatchFrames) -> Floats:
        """Return σ of the means of a patch in DN, shape (n, C); that of each frame if brighter."""
        variance = np.column_stack(
            [
                model.variance_dn2(light)
                for model, light in zip(self.models, frames.light.T, strict=True)
            ]
        )
        is_beyond = _is_bright(frames) & (frames.light > MAX_EXTRAPOLATION * self.brightest)
        sigma = np.maximum(np.sqrt(variance / frames.pixels), MIN_FRACTION * frames.sigma)
        return np.where(is_beyond, frames.sigma, sigma)


def paired_noise(
    frames: PatchFrames,
    t_s: Floats,
    unit: Sequence[str],
    usable: npt.NDArray[np.bool_],
    darks: Mapping[str, PatchFrames],
    together: Mapping[str, SensorNoise | None],
) -> PatchNoise:
    """Estimate the noise of the means of a patch, σ unit by unit.

    Where a unit has too few pairs, σ is that of all patches together; if these have too few, that
    of each frame alone. The channels are then independent.

    Parameters
    ----------
    frames
        The patch in n frames.
    t_s
        Start of each exposure in seconds, shape (n,).
    unit
        Unit of each frame.
    usable
        Whether the frame can be in a pair, shape (n,).
    darks
        Dark frames at the ISO of each unit, where there are any.
    together
        Noise of the pixels of all patches, for each unit.
    """
    sigma = frames.sigma.copy()
    channels = sigma.shape[1]
    products = MIN_PRODUCT * np.eye(channels)
    for name, rows in rows_of_units(unit).items():
        part = frames.take(rows)
        light = PatchPairs.of_unit(part, t_s[rows], usable[rows])
        shared = together.get(name)
        if light.dof < MIN_DOF:
            if shared is not None:
                sigma[rows] = shared.sigma(part)
            continue
        pairs = PatchPairs.of_unit(part, t_s[rows], usable[rows], darks.get(name))
        for channel in range(channels):
            sigma[rows, channel] = _sigma_of_means(pairs, channel)[: len(rows)]
        products += _cross_products(light, sigma[rows])
    length = np.sqrt(np.diag(products))
    return PatchNoise(sigma, products / np.outer(length, length))


def rows_of_units(unit: Sequence[str]) -> dict[str, npt.NDArray[np.intp]]:
    """Return the rows of the frames of each unit, by its name."""
    return {
        name: np.flatnonzero([row_unit == name for row_unit in unit])
        for name in dict.fromkeys(unit)
    }


def paired_dark_sigma(darks: PatchFrames) -> Floats:
    """Return the standard uncertainty of the means of a patch in dark frames in DN, shape (n, C).

    It is estimated from pairs of similar exposure, or from each frame alone where these are too
    few.
    """
    pairs = PatchPairs.of_like_exposure(darks)
    if pairs.dof < MIN_DOF:
        return darks.sigma
    channels = range(darks.sigma.shape[1])
    return np.stack([_sigma_of_means(pairs, channel) for channel in channels], axis=1)


def _cross_products(pairs: PatchPairs, sigma: Floats) -> Floats:
    """Sum products of the channels' normalised differences over paired frames, shape (C, C)."""
    scales, differences = _differences(pairs, sigma)
    expected = np.square(sigma[pairs.second]) + np.square(scales * sigma[pairs.first])
    normal = differences / np.sqrt(expected)[..., np.newaxis]
    products: Floats = np.einsum("pcs,pds->cd", normal, normal)
    return products


def _differences(pairs: PatchPairs, sigma: Floats) -> tuple[Floats, Floats]:
    """Return scales and differences of p pairs of frames.

    The scale of the first frame to the second has shape (p, C), the difference of their s strips
    (p, C, s). A frame that is nothing but noise is not scaled.
    """
    frames, first, second = pairs.frames, pairs.first, pairs.second
    light = np.maximum(frames.light, 0)
    is_bright = light[first] > SCALED_SIGMAS * sigma[first]
    scales = np.where(is_bright, light[second] / np.where(is_bright, light[first], 1.0), 1.0)
    return scales, frames.deviations[second] - scales[..., np.newaxis] * frames.deviations[first]


def _sigma_of_means(pairs: PatchPairs, channel: int) -> Floats:
    """Return σ of the means of one channel in DN, shape (n,), from pairs of frames.

    The uneven part is proportional to the light but not common to the patch. A frame much brighter
    than all pairs keeps the σ by itself alone: scaled to a dark frame, it leaves none of its noise
    in the difference.
    """
    frames, first, second = pairs.frames, pairs.first, pairs.second
    sigma, light = frames.sigma[:, channel], frames.light[:, channel]
    scatter, pair_terms, scale = _scatter(pairs, channel)
    variance = np.square(sigma)
    least = MIN_FRACTION**2 * variance
    for _ in range(REWEIGHTINGS):
        expected = variance[second] + np.square(scale) * variance[first]
        noise = NoiseModel.fit(pair_terms, scatter, sigma_dn2=expected)
        variance = np.maximum(noise.variance_dn2(light), least)
    is_beyond = _is_bright(frames)[:, channel] & (
        light > MAX_EXTRAPOLATION * _pair_light(pairs)[:, channel].max()
    )
    return np.where(is_beyond, sigma, np.sqrt(variance))


def _pixel_noise(patches: Sequence[PatchPairs], channel: int) -> NoiseModel:
    """Return the noise of a pixel of one channel from the pairs of all patches."""
    parts = [(pairs, *_scatter(pairs, channel)) for pairs in patches if pairs.dof]
    pixels = np.concatenate(
        [np.full(len(scatter), pairs.frames.pixels[channel]) for pairs, scatter, _, _ in parts]
    )
    scatter = pixels * np.concatenate([scatter for _, scatter, _, _ in parts])
    terms = np.concatenate([terms for _, _, terms, _ in parts])
    dof = np.concatenate(
        [np.full(len(scatter), pairs.dof / len(scatter)) for pairs, scatter, _, _ in parts]
    )
    expected = np.maximum(scatter, max(float(scatter.mean()), ROUNDING_VARIANCE))
    for _ in range(REWEIGHTINGS):
        noise = NoiseModel.fit(terms, scatter, sigma_dn2=expected / np.sqrt(dof))
        parts_dn2 = terms @ [noise.read_dn2, noise.photon_dn, noise.uneven]
        expected = np.maximum(parts_dn2, ROUNDING_VARIANCE)
    return noise


def _scatter(pairs: PatchPairs, channel: int) -> tuple[Floats, Floats, Floats]:
    """Return the variance of each pair's difference of means, its terms (p, 3), and its scale."""
    scales, differences = _differences(pairs, pairs.frames.sigma)
    scale, difference = scales[:, channel], differences[:, channel]
    strips = difference.shape[1]
    scatter = np.square(difference).sum(axis=1) / max(strips - 1, 1) / strips
    terms = variance_terms(pairs.frames.light[:, channel])
    return (
        scatter,
        terms[pairs.second] + np.square(scale)[:, np.newaxis] * terms[pairs.first],
        scale,
    )


def _pair_light(pairs: PatchPairs) -> Floats:
    """Return the brightness of each pair in DN, shape (p, C)."""
    light = pairs.frames.light
    square = np.square(_differences(pairs, pairs.frames.sigma)[0])
    return np.asarray((light[pairs.second] + square * light[pairs.first]) / (1 + square))


def _is_bright(frames: PatchFrames) -> npt.NDArray[np.bool_]:
    return np.asarray(frames.light > SCALED_SIGMAS * frames.sigma)
