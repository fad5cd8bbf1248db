"""Cameras that subtract their black level and cut off at 0 what noise has below it.

In the dark, half of the pixels of such a file (Nikon's D700 and its kin, many industrial cameras)
are exactly 0. A mean over them is too large, by 0.4 of the read noise s in the dark and by ever
less the more light there is: pixels about a level μ average M(μ) = E[max(0, N(μ, s))] instead. A
decay that is measured with it fades too slowly, and never to zero.

Two steps undo it, both by the noise of the camera alone, s² = r² + g μ (read noise, photons):

- each number of the file is given the value that it stands for, of which a mean over pixels of any
  levels above black is right to 1 % of s: 0 stands for −s or so, numbers far above the noise for
  themselves. What is then done with pixels may ignore the cut-off;
- the rest of M is undone in the mean over a region, whose pixels are nearly alike.

The noise is that of each frame's small tiles: their means, variances and fractions of pixels that
are cut off lie on a curve that r and g determine, with light or without.

References
----------
A. C. Cohen, *Truncated and Censored Samples* (1991), on normal variates below a limit of detection.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from labrig.reduce.plane_noise import TILE, Floats, Mosaic, tiles, variances_by_differences

#: Pixels, and fraction of the frame's pixels, at its lowest level that are no chance or damage.
_MIN_PIXELS, _MIN_FRACTION = 20, 2e-4
#: Pixels at a lowest level above 0 over those at any of the levels next above it: at 0 numbers end.
_STANDS_OUT, _LEVELS_ABOVE = 2.0, 3
#: Most tiles across a plane.
_TILES_ACROSS = 64
#: Tiles of similar brightness that are taken together, and the most groups of them.
_GROUP_TILES, _MAX_GROUPS = 3, 16
#: Multiple of the median variance from which a tile has structure or a hot pixel, and of the
#: variance by differences from which its pixels are not about one level: an edge lies in it.
_ROUGH, _UNEVEN = 4.0, 2.0
#: Multiple of the read noise up to which a level tells the noise near black.
_NEAR_BLACK = 12.0
#: Fraction of its pixels at the lowest number from which a group is near black.
_NEAR_FRACTION = 0.05
#: Relative variance of a variance of n pixels by differences along halves of tiles, times n; those
#: of noise that is cut off scatter by more than those of normal noise.
_VARIANCE_OF_VARIANCE = 10.0
#: σ of a fraction at the lowest number by structure within tiles.
_STRUCTURE = 0.01
#: Read noise in photo-electrons where the frame does not tell it, and its σ in logarithms.
_USUAL_ELECTRONS, _LOG_SIGMA = 5.0, 1.0
#: Read noise in steps of the camera's numbers below which there is none to be seen.
_MIN_NOISE = 0.3
#: Difference to the expected fraction of pixels at the lowest level that belies the model.
_WRONG_FRACTION = 0.1
#: Fraction of cut-off pixels above which their level cannot be told: it is 2 s below black or more.
TOO_MANY = 0.98

#: Levels in read noise between which `_values` weighs errors of a mean, and weight below black.
_LOWEST, _HIGHEST, _WEIGHT_BELOW = -0.5, 9.0, 0.3
#: Level in read noise from which a number stands for itself, and supports below.
_ITSELF, _SUPPORTS = 6.0, 25
#: Weight of the noise against that of errors: it is then hardly larger than without a cut-off.
_WEIGHT_OF_NOISE = 0.03


@dataclass(frozen=True)
class Noise:
    """Noise of a pixel, in steps of the camera's numbers.

    Attributes
    ----------
    read
        Standard deviation r without light.
    photon
        Photons' variance g by the level.
    """

    read: float
    photon: float

    def sigma(self, level: Floats) -> Floats:
        """Return the standard deviation at levels above black."""
        return np.sqrt(self.read**2 + self.photon * np.maximum(level, 0.0))

    def probabilities(self, level: Floats) -> Floats:
        """Return how probable each number is at n levels, shape (n, numbers)."""
        # Not above: it takes longer to load than a plan to be printed.
        from scipy.special import ndtr

        sigma = self.sigma(level)
        numbers = np.arange(int(level.max() + 6 * self.sigma(level.max())) + 3)
        up_to = ndtr((numbers + 0.5 - level[:, np.newaxis]) / sigma[:, np.newaxis])
        up_to[:, -1] = 1.0
        return np.diff(up_to, axis=1, prepend=0.0)


@dataclass(frozen=True, eq=False)
class BlackCutOff:
    """Values for which the numbers of a frame stand whose noise is cut off at the lowest of them.

    Levels, means and values are in DN above that number.

    Attributes
    ----------
    lowest_dn
        The number at which pixels are cut off, in DN.
    noise
        Noise of pixels in steps; a sensor's colours share their electronics.
    step_dn
        Step of the camera's numbers in DN.
    one_sigma_off
        The noise when it is one standard uncertainty off, in two independent ways.
    """

    lowest_dn: int
    noise: Noise
    step_dn: float
    one_sigma_off: tuple[Noise, ...] = ()

    @property
    def read_dn(self) -> float:
        """Read noise in DN."""
        return self.noise.read * self.step_dn

    @cached_property
    def values_dn(self) -> Floats:
        """Values in DN that the lowest numbers stand for, shape (k,); others stand for themselves.

        Of all values v it is those with the least Σ_μ (E[v] − μ)² + w E[(v − n)²].
        """
        level = np.linspace(_LOWEST, _HIGHEST, 121) * self.noise.read
        expected = self.noise.probabilities(level)
        numbers = np.arange(expected.shape[1])
        last = max(int(np.ceil(_ITSELF * self.noise.read)), 1)
        supports = np.unique(np.rint(np.linspace(0, last, _SUPPORTS)))
        basis = np.stack(
            [np.interp(numbers, supports, row) for row in np.eye(len(supports))[:-1]], axis=1
        )
        weights = np.where(level < 0, _WEIGHT_BELOW, 1.0)
        means = expected @ basis
        noise = _WEIGHT_OF_NOISE * expected.mean(axis=0)
        change = np.linalg.solve(
            means.T @ (weights[:, np.newaxis] * means) + basis.T @ (noise[:, np.newaxis] * basis),
            means.T @ (weights * (level - expected @ numbers)),
        )
        lowest = numbers[: last + 1]
        return np.asarray(self.step_dn * (lowest + basis[: last + 1] @ change))

    @cached_property
    def _means(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Levels in DN, and mean, its σ by the noise's, and variance of values about each."""
        level = np.linspace(-3.0, _HIGHEST, 241) * self.noise.read
        expected = self.noise.probabilities(level)
        values = self.step_dn * np.arange(expected.shape[1])
        values[: len(self.values_dn)] = self.values_dn
        mean = expected @ values
        variance = expected @ np.square(values) - np.square(mean)
        sigma = np.zeros_like(mean)
        for other in self.one_sigma_off:
            by_other = other.probabilities(level)
            common = min(expected.shape[1], by_other.shape[1])
            change = by_other[:, :common] - expected[:, :common]
            sigma = np.hypot(sigma, change @ values[:common])
        return self.step_dn * level, np.maximum.accumulate(mean), sigma, variance

    def file_levels_dn(self, pixels: npt.NDArray[np.integer]) -> Floats:
        """Return the values in DN for which pixels of the file stand, black level in them."""
        numbers = np.arange(65536.0)
        low = self.lowest_dn + np.arange(len(self.values_dn)) * int(self.step_dn)
        low = low[low < len(numbers)]
        numbers[low] = self.lowest_dn + self.values_dn[: len(low)]
        return np.asarray(numbers[pixels])

    def level_dn(self, mean_dn: Floats) -> Floats:
        """Return the level of pixels, alike but for noise, whose values have a mean, in DN."""
        level, mean, *_ = self._means
        return np.where(mean_dn < mean[-1], np.interp(mean_dn, mean, level), mean_dn)

    def sensitivity(self, mean_dn: float) -> float:
        """Return by how much the level changes when the mean of the values does."""
        level, mean, *_ = self._means
        if mean_dn >= mean[-1]:
            return 1.0
        return float(
            np.interp(mean_dn, mean, np.gradient(level) / np.gradient(mean + 1e-9 * level))
        )

    def level_dn_sigma(self, mean_dn: float) -> float:
        """Return σ of `level_dn` in DN by the uncertainty of the noise."""
        _, mean, sigma, _ = self._means
        if mean_dn >= mean[-1]:
            return 0.0
        return float(np.interp(mean_dn, mean, sigma)) * self.sensitivity(mean_dn)

    def noise_ratio(self, level_dn: float) -> float:
        """Return the noise of pixels over that of the values for which they stand, at a level."""
        level, _, _, variance = self._means
        if level_dn >= level[-1]:
            return 1.0
        uncut = self.step_dn * self.noise.sigma(np.asarray(level_dn / self.step_dn))
        return float(uncut / np.sqrt(np.interp(level_dn, level, variance)))


def find_cut_off(planes: Sequence[Mosaic]) -> BlackCutOff | None:
    """Find whether a frame's noise is cut off at its lowest number, and its noise if so.

    Parameters
    ----------
    planes
        Pixels of each CFA position of the whole frame in DN.

    Returns
    -------
    BlackCutOff or None
        The cut-off; None where no noise reaches the lowest number.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reduce import find_cut_off
    >>> noise = np.rint(np.random.default_rng(1).normal(0.0, 5.0, (300, 300)))
    >>> dark = np.maximum(noise, 0).astype(np.uint16)
    >>> print(f"{dark.mean():.1f} DN; read noise {find_cut_off([dark]).read_dn:.1f} DN")
    2.0 DN; read noise 5.0 DN
    >>> find_cut_off([(1024 + noise).astype(np.uint16)]) is None
    True
    """
    lowest = min(int(plane.min()) for plane in planes)
    at_lowest = sum(int(np.count_nonzero(plane == lowest)) for plane in planes)
    if at_lowest < max(_MIN_PIXELS, _MIN_FRACTION * sum(plane.size for plane in planes)):
        return None
    if min(min(plane.shape) for plane in planes) < TILE:
        return None
    if lowest and not _stands_out(planes, lowest, at_lowest):
        return None
    return _cut_off(planes, lowest)


def _stands_out(planes: Sequence[Mosaic], lowest: int, at_lowest: int) -> bool:
    counts = np.zeros(65536, np.int64)
    for plane in planes:
        counts += np.bincount(plane.ravel(), minlength=len(counts))
    above = counts[lowest + 1 :]
    next_above = above[above > 0][:_LEVELS_ABOVE]
    return len(next_above) == _LEVELS_ABOVE and at_lowest >= _STANDS_OUT * next_above.max()


def _cut_off(planes: Sequence[Mosaic], lowest: int) -> BlackCutOff | None:
    """Return the cut-off at a number; None if tiles near it show no noise that is cut off."""
    cut = np.concatenate([tiles(plane, _TILES_ACROSS) - lowest for plane in planes])
    step = float(np.gcd.reduce(cut.astype(np.int64), axis=None))
    even = cut.var(axis=(1, 2)) <= _UNEVEN * variances_by_differences(cut)
    if not step or not even.any():
        return None
    cut = cut[even]
    groups = _Groups.of(cut / step)
    start = np.sqrt(np.quantile(groups.variance[groups.at_lowest >= _some(groups.at_lowest)], 0.75))
    groups = groups.below(_NEAR_BLACK * start)
    if not start > _MIN_NOISE or not groups.mean.size:
        return None

    def misfit(logarithms: Floats) -> Floats:
        noise = _noise(logarithms)
        mean, variance, at_lowest = _moments(noise, groups.mean.max())
        relative = np.sqrt(_VARIANCE_OF_VARIANCE / groups.pixels)
        # A mean too large by chance comes with too few pixels at the lowest number.
        slope = np.gradient(at_lowest) / np.gradient(mean)
        scatter = at_lowest * (1 - at_lowest) + slope * (slope * variance + 2 * at_lowest * mean)
        fraction_sigma = np.hypot(
            np.sqrt(np.interp(groups.mean, mean, np.maximum(scatter, 0.0)) / groups.pixels),
            np.hypot(1 / groups.pixels, _STRUCTURE),
        )
        # The logarithm of a measured variance is too small by half of its own variance on average.
        log_ratio = np.log(groups.variance / np.interp(groups.mean, mean, variance))
        return np.concatenate(
            [
                log_ratio / relative + relative / 2,
                (groups.at_lowest - np.interp(groups.mean, mean, at_lowest)) / fraction_sigma,
                [(logarithms[1] + np.log(_USUAL_ELECTRONS)) / _LOG_SIGMA],
            ]
        )

    from scipy.optimize import least_squares

    bounds = (np.log(start) - 1.5, np.log(1e-3)), (np.log(start) + 1.5, np.log(10.0))
    fit = least_squares(
        misfit,
        (np.log(start), -np.log(_USUAL_ELECTRONS)),
        bounds=bounds,
        loss="soft_l1",
        f_scale=3.0,
        diff_step=[1e-3, 1e-3],
    )
    noise = _noise(fit.x)
    mean, _, at_lowest = _moments(noise, groups.mean.max())
    expected_fraction = np.interp(groups.mean, mean, at_lowest)
    if noise.read < _MIN_NOISE or (
        np.median(np.abs(groups.at_lowest - expected_fraction)) > _WRONG_FRACTION
    ):
        return None
    jacobian: Floats = np.asarray(fit.jac, dtype=np.float64)
    deviations = np.linalg.cholesky(np.linalg.inv(jacobian.T @ jacobian))
    return BlackCutOff(lowest, noise, step, tuple(_noise(fit.x + off) for off in deviations.T))


def _some(at_lowest: Floats) -> float:
    """Return the fraction at the lowest number from which groups are near it."""
    return min(_NEAR_FRACTION, float(at_lowest.max()))


def _noise(logarithms: Floats) -> Noise:
    """Return the noise by ln r and ln(g/r), which is −ln of the read noise in electrons."""
    read = float(np.exp(logarithms[0]))
    return Noise(read, read * float(np.exp(logarithms[1])))


def _moments(noise: Noise, highest: float) -> tuple[Floats, Floats, Floats]:
    """Return mean and variance of the numbers, and the fraction at the lowest, at rising levels."""
    level = np.linspace(-3.0, max(6.0, 1.2 * highest / noise.read + 1.0), 80) * noise.read
    expected = noise.probabilities(level)
    numbers = np.arange(expected.shape[1])
    mean = expected @ numbers
    return mean, expected @ np.square(numbers) - np.square(mean), expected[:, 0]


@dataclass(frozen=True, eq=False)
class _Groups:
    """Mean, variance and fraction at the lowest number of groups of tiles alike, shape (k,).

    Tiles are sorted by one half of their pixels and averaged over the other, so that the noise of
    those that are averaged does not choose their group.
    """

    mean: Floats
    variance: Floats
    at_lowest: Floats
    pixels: Floats

    @classmethod
    def of(cls, cut: Floats) -> "_Groups":
        """Return the groups of n tiles in steps above the lowest number, shape (n, side, side)."""
        half = cut.shape[2] // 2
        sides = cut[:, :, :half], cut[:, :, -half:]
        rows = []
        for chosen, averaged in (sides, sides[::-1]):
            rising = np.argsort(chosen.mean(axis=(1, 2)), kind="stable")
            mean, variance = averaged.mean(axis=(1, 2)), variances_by_differences(averaged)
            at_lowest = (averaged == 0).mean(axis=(1, 2))
            groups = max(1, min(_MAX_GROUPS, len(cut) // _GROUP_TILES))
            for group in np.array_split(rising, groups):
                kept = group[variance[group] <= _ROUGH * np.median(variance[group])]
                rows.append(
                    (
                        mean[kept].mean(),
                        variance[kept].mean(),
                        at_lowest[kept].mean(),
                        len(kept) * averaged[0].size,
                    )
                )
        return cls(*np.array(rows).T)

    def below(self, mean: float) -> "_Groups":
        """Return the groups with noise whose mean is below a number."""
        kept = (self.mean < mean) & (self.variance > 0)
        return _Groups(
            self.mean[kept], self.variance[kept], self.at_lowest[kept], self.pixels[kept]
        )
