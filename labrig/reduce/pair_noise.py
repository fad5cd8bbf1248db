"""Temporal noise of a patch's mean, from pairs of successive frames.

Two frames of the same patch differ by their noise, apart from their brightness: everything static
cancels (the sample's structure, its edges, each pixel's own response). A pair therefore resolves
what a single frame (`labrig.reduce.plane_noise`) cannot: noise that the pixels of a row share, and
the noise of a patch too small to be estimated from its surroundings. It is the photon transfer from
pairs of Janesick (2007) and EMVA 1288, on strips as wide as the patch instead of single pixels: the
scatter of a strip contains the correlation of all pixels in it. Dark frames of similar exposure are
pairs, too: they determine the read noise, which of a decay only the faintest frames do.

Deviations of the strips may be correlated between channels: rows that are read together, charge
that strays into the neighbour of another colour. The same differences determine that correlation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from labrig.reduce.channels import PixelMask
from labrig.reduce.dark import same_exposure
from labrig.reduce.photon_transfer import NoiseModel, variance_terms
from labrig.reduce.plane_noise import Floats
from labrig.reduce.raw import RawFrame
from labrig.region import Region, region_pixels

#: Number of strips of a patch, if it has that many rows of each colour.
STRIPS = 16
#: Degrees of freedom from which pairs replace each frame's own estimate: σ is then known to 10 %.
FEWEST_DOF = 50
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
    """

    exposure_s: Floats
    deviations: Floats
    light: Floats
    sigma: Floats

    def take(self, rows: npt.NDArray[np.intp]) -> "PatchFrames":
        """Return the given frames."""
        return PatchFrames(
            self.exposure_s[rows], self.deviations[rows], self.light[rows], self.sigma[rows]
        )

    def concatenate(self, others: "PatchFrames") -> "PatchFrames":
        """Return these frames followed by `others`."""
        return PatchFrames(
            np.append(self.exposure_s, others.exposure_s),
            np.concatenate([self.deviations, others.deviations]),
            np.concatenate([self.light, others.light]),
            np.concatenate([self.sigma, others.sigma]),
        )

    def pairs_of_like_exposure(self) -> list[tuple[int, int]]:
        """Return pairs of frames that differ by noise only, whatever the dark current's pattern."""
        rising = np.argsort(self.exposure_s, kind="stable").tolist()
        return [
            (first, second)
            for first, second in pairwise(rising)
            if same_exposure(self.exposure_s[first], self.exposure_s[second])
        ]


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
        light = plane.sum(axis=1, dtype=np.int64, where=kept) - raw.black[position] * pixels
        starts = np.arange(strips) * len(plane) // strips
        channel = raw.channels.index(letter)
        total[channel] += np.add.reduceat(light, starts)
        count[channel] += np.add.reduceat(pixels, starts)
    means = total / np.maximum(count, 1)
    return np.asarray(means - means.mean(axis=1, keepdims=True))


def paired_noise(
    frames: PatchFrames,
    t_s: Floats,
    unit: Sequence[str],
    usable: npt.NDArray[np.bool_],
    darks: Mapping[str, PatchFrames],
) -> PatchNoise:
    """Estimate the noise of the means of a patch, σ unit by unit.

    Where there are too few pairs, σ of each frame alone is kept, the channels then independent.

    Parameters
    ----------
    frames
        The patch in n frames.
    t_s
        Begin of each exposure in seconds, shape (n,).
    unit
        Unit of each frame.
    usable
        Whether the frame can be in a pair, shape (n,).
    darks
        Dark frames at the ISO of each unit, where there are any.
    """
    sigma = frames.sigma.copy()
    channels = sigma.shape[1]
    products = MIN_PRODUCT * np.eye(channels)
    for name in dict.fromkeys(unit):
        rows = np.array([row for row, row_unit in enumerate(unit) if row_unit == name])
        paired = np.flatnonzero(usable[rows])
        paired = paired[np.argsort(t_s[rows[paired]], kind="stable")]
        pairs = list(pairwise(paired.tolist()))
        if len(pairs) * (frames.deviations.shape[2] - 1) < FEWEST_DOF:
            continue
        part = frames.take(rows)
        if name in darks:
            dark_pairs = darks[name].pairs_of_like_exposure()
            pairs += [(len(rows) + first, len(rows) + second) for first, second in dark_pairs]
            part = part.concatenate(darks[name])
        first, second = np.array(pairs).T
        for channel in range(channels):
            sigma[rows, channel] = _sigma_of_means(part, channel, first, second)[: len(rows)]
        light = second < len(rows)
        products += _cross_products(frames.take(rows), sigma[rows], first[light], second[light])
    length = np.sqrt(np.diag(products))
    return PatchNoise(sigma, products / np.outer(length, length))


def paired_dark_sigma(darks: PatchFrames) -> Floats:
    """Return the standard uncertainty of the means of a patch in dark frames in DN, shape (n, C).

    It is estimated from pairs of similar exposure, or from each frame alone where these are too
    few.
    """
    pairs = darks.pairs_of_like_exposure()
    if len(pairs) * (darks.deviations.shape[2] - 1) < FEWEST_DOF:
        return darks.sigma
    first, second = np.array(pairs).T
    channels = range(darks.sigma.shape[1])
    return np.stack([_sigma_of_means(darks, c, first, second) for c in channels], axis=1)


def _cross_products(
    frames: PatchFrames, sigma: Floats, first: npt.NDArray[np.intp], second: npt.NDArray[np.intp]
) -> Floats:
    """Sum products of the channels' normalised differences over paired frames, shape (C, C)."""
    scales, differences = _differences(frames, sigma, first, second)
    expected = np.square(sigma[second]) + np.square(scales * sigma[first])
    normal = differences / np.sqrt(expected)[..., np.newaxis]
    products: Floats = np.einsum("pcs,pds->cd", normal, normal)
    return products


def _differences(
    frames: PatchFrames, sigma: Floats, first: npt.NDArray[np.intp], second: npt.NDArray[np.intp]
) -> tuple[Floats, Floats]:
    """Return scales and differences of p pairs of frames.

    The scale of the first frame to the second has shape (p, C), the difference of their s strips
    (p, C, s). A frame that is nothing but noise is not scaled.
    """
    light = np.maximum(frames.light, 0)
    is_bright = light[first] > SCALED_SIGMAS * sigma[first]
    scales = np.where(is_bright, light[second] / np.where(is_bright, light[first], 1.0), 1.0)
    return scales, frames.deviations[second] - scales[..., np.newaxis] * frames.deviations[first]


def _sigma_of_means(
    frames: PatchFrames, channel: int, first: npt.NDArray[np.intp], second: npt.NDArray[np.intp]
) -> Floats:
    """Return σ of the means of one channel in DN, shape (n,), from pairs of frames.

    The uneven part is proportional to the light but not common to the patch. A frame much brighter
    than all pairs keeps the σ by itself alone: scaled to a dark frame, it leaves none of its noise
    in the difference.
    """
    scales, differences = _differences(frames, frames.sigma, first, second)
    scale, difference, sigma = scales[:, channel], differences[:, channel], frames.sigma[:, channel]
    strips = difference.shape[1]
    light = frames.light[:, channel]
    scatter = np.square(difference).sum(axis=1) / (strips - 1) / strips
    terms = variance_terms(light)
    pair_terms = terms[second] + np.square(scale)[:, np.newaxis] * terms[first]
    variance = np.square(sigma)
    least = MIN_FRACTION**2 * variance
    for _ in range(REWEIGHTINGS):
        expected = variance[second] + np.square(scale) * variance[first]
        noise = NoiseModel.fit(pair_terms, scatter, sigma_dn2=expected)
        variance = np.maximum(noise.variance_dn2(light), least)
    pair_light = (light[second] + np.square(scale) * light[first]) / (1 + np.square(scale))
    is_bright = light > SCALED_SIGMAS * sigma
    is_beyond = is_bright & (light > MAX_EXTRAPOLATION * pair_light.max())
    return np.where(is_beyond, sigma, np.sqrt(variance))
