"""Temporal noise of one colour plane, estimated from a single frame.

The quantity estimated is the variance of a *mean over pixels* under photon and read noise alone:
the sample's structure, vignetting and the lamp's gradient must not count, hot pixels must not
count, and noise that neighbouring pixels share must count more. Small tiles spread over the plane
serve for all three:

- the second difference across rows and columns, [1 −2 1]ᵀ[1 −2 1]/6, removes every structure of
  the form f(x) + g(y) and keeps white noise (Immerkær, CVIU 64, 1996);
- its outliers are trimmed in each tile (hot pixels), and tiles that are rougher than others of
  the same brightness are left out (edges of the sample);
- the residual of a cubic surface in each tile gives the autocovariance C(h) of the noise at
  short lags h, from which Var(mean) = Σ_h C(h)/n; it is used only if it is significant, alike
  in all tiles and gone at longer lags: structure varies and reaches far, shared noise does not.

A single frame has two limits. Structure as fine as a pixel all over the region counts as noise:
the variance comes out too large. Noise shared by whole rows does not: too small. Pairs of frames
resolve both (`labrig.reduce.pair_noise`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from labrig.reduce.photon_transfer import NoiseModel
from labrig.reduce.rounding import ROUNDING_VARIANCE

Floats: TypeAlias = npt.NDArray[np.float64]
Mosaic: TypeAlias = npt.NDArray[np.uint16]
NumberArray = TypeVar("NumberArray", npt.NDArray[np.float64], npt.NDArray[np.intp])

#: Side of a tile in pixels of one colour: a cubic describes smooth light over 24 sensor pixels.
TILE = 12
#: Tiles per plane and direction: 256 tiles determine the variance to 2 %.
TILES_ACROSS = 16
#: Pixels per direction from which the brightness of a plane is estimated.
_SAMPLES_ACROSS = 256
#: Lags (row, column) of one half-plane at which noise may be correlated.
_NEAR = tuple((y, x) for y in range(3) for x in range(-2, 3) if (y, x) >= (0, 0))
#: Lags at which only structure is correlated.
_FAR = tuple(lag for far in (3, 4, 5, 6) for lag in ((0, far), (far, 0)))
#: Significance in standard deviations from which a correlation is corrected for.
_SIGNIFICANT = 4.0
#: Correlation with some neighbour below which no correction is made.
_CLEAR = 0.05
#: Spread over the tiles of ln(C(0)/variance by differences). Shared noise raises it alike in all
#: (0.2 to 0.6 with synthetic noise), detail of a scene does not (1.6 to 2.9 in photos).
_UNIFORM = 1.0
#: Fraction of the nearest neighbours' correlation that may remain at the far lags.
_FAR_FRACTION = 0.15
#: Multiple of the line's variance from which a tile has structure; noise scatters it by a quarter.
_ROUGH = 2.0
#: |ln| of a tile's variance over the line's at which its misfit is capped.
_MISFIT_CAP = 1.0


@dataclass(frozen=True)
class PlaneNoise:
    """Noise of one colour plane.

    Parameters
    ----------
    darkest_level
        Mean of the darkest tile in DN.
    above_darkest
        Temporal variance of a pixel in DN² by its level in DN above that of the darkest tile.
    mean_variance
        n · Var(mean over n pixels) in DN²: the variance of the pixels times `correlation`.
    correlation
        Factor by which correlated noise raises the variance of a mean: 1 where pixels are
        independent.
    """

    darkest_level: float
    above_darkest: NoiseModel
    mean_variance: float
    correlation: float

    def variance_at(self, level: Floats) -> Floats:
        """Return the temporal variance of pixels at `level` in DN², at least that of rounding."""
        line = self.above_darkest
        rise = line.photon_dn * (level - self.darkest_level)
        return np.maximum(line.read_dn2 + rise, ROUNDING_VARIANCE)


def plane_noise(planes: Sequence[Mosaic | Floats]) -> list[PlaneNoise]:
    """Estimate the noise of each of several colour planes.

    The planes are processed together: many small planes cost little more than one.

    Parameters
    ----------
    planes
        Pixels of one colour in DN, shape (rows, columns) ≥ (3, 3) each.
    """
    cut = [tiles(plane) for plane in planes]
    noises: dict[int, PlaneNoise] = {}
    for shape in {plane_tiles.shape[1:] for plane_tiles in cut}:
        same_shape = [
            index for index, plane_tiles in enumerate(cut) if plane_tiles.shape[1:] == shape
        ]
        stacked = np.concatenate([cut[index] for index in same_shape])
        level, variance = stacked.mean(axis=(1, 2)), _second_difference_variance(stacked)
        covariances = _autocovariance(stacked) if shape == (TILE, TILE) else None
        end = 0
        for index in same_shape:
            start, end = end, end + len(cut[index])
            noises[index] = _noise_of_plane(
                level[start:end],
                variance[start:end],
                None
                if covariances is None
                else (covariances[0][start:end], covariances[1][start:end]),
                _brightness(planes[index]),
            )
    return [noises[index] for index in range(len(planes))]


def _noise_of_plane(
    level: Floats,
    variance: Floats,
    covariances: tuple[Floats, npt.NDArray[np.bool_]] | None,
    brightness: float,
) -> PlaneNoise:
    """Estimate the noise of a plane from its n tiles.

    Parameters
    ----------
    level
        Mean of each tile in DN, shape (n,).
    variance
        Variance of each tile by second differences in DN², shape (n,).
    covariances
        Autocovariance of each tile, and whether it is clean; None of tiles that are too small.
    brightness
        Mean of the plane in DN.
    """
    darkest = float(level.min())
    above = level - darkest
    line = _photon_line(above, variance)
    correlation = 1.0
    if covariances is not None:
        # Only tiles on the line show shared noise: the others are dominated by the sample.
        by_line = line.variance_dn2(above)
        on_line = variance <= _ROUGH * by_line
        autocovariance, clean = covariances
        correlation = _correlation(autocovariance[on_line & clean], by_line[on_line & clean])
        if correlation > 1:
            # Differences of pixels that share noise are too small: take C(0) itself.
            variance = np.where(on_line, autocovariance[:, 0], np.inf)
            line = _photon_line(above[on_line], variance[on_line])
    expected = line.variance_dn2(above)
    smooth = np.where(variance <= _ROUGH * expected, variance, expected)
    # Few tiles may miss how much of the plane is bright, thousands of single pixels do not.
    correction = line.photon_dn * (brightness - float(level.mean()))
    mean_variance = max(float(smooth.mean()) + correction, 0.0) * correlation
    return PlaneNoise(darkest, line, mean_variance, correlation)


def tiles(plane: Mosaic | Floats, across: int = TILES_ACROSS) -> Floats:
    """Cut tiles of a plane, spread evenly from border to border.

    Parameters
    ----------
    plane
        Pixels of one colour in DN, shape (rows, columns).
    across
        Most tiles in each direction.

    Returns
    -------
    ndarray
        The tiles, shape (n, side, side); lower or narrower of a plane that is.
    """
    rows, columns = (_tile_pixels(side, across) for side in plane.shape)
    cut = plane[rows[:, np.newaxis, :, np.newaxis], columns[:, np.newaxis, :]]
    return cut.reshape(-1, rows.shape[1], columns.shape[1]).astype(np.float64)


def _brightness(plane: Mosaic | Floats) -> float:
    """Return the mean of `plane` from evenly spread pixels."""
    down, right = (-(-side // _SAMPLES_ACROSS) for side in plane.shape)
    return float(plane[::down, ::right].mean())


@cache
def _tile_pixels(side: int, across: int) -> npt.NDArray[np.intp]:
    """Return the indices of the pixels of each tile along a side, shape (tiles, pixels)."""
    pixels = min(TILE, side)
    starts = np.linspace(0, side - pixels, min(across, side // pixels))
    return np.rint(starts).astype(np.intp)[:, np.newaxis] + np.arange(pixels)


def variances_by_differences(cut: Floats) -> Floats:
    """Return the variance of each tile's noise and outliers in DN², shape (n,)."""
    return np.asarray(np.square(_second_differences(cut)).mean(axis=1))


def _second_difference_variance(cut: Floats) -> Floats:
    """Return the variance of each tile's noise in DN², shape (n,)."""
    return _trimmed_mean_square(np.abs(_second_differences(cut)), 4.0)


def _second_differences(cut: Floats) -> Floats:
    across = cut[:, :-2] - 2 * cut[:, 1:-1] + cut[:, 2:]
    both = (across[:, :, :-2] - 2 * across[:, :, 1:-1] + across[:, :, 2:]) / 6
    return np.asarray(both.reshape(len(cut), -1))


def _trimmed_mean_square(magnitude: Floats, sigmas: float) -> Floats:
    """Return the mean square along the last axis of values within `sigmas` robust deviations."""
    limit = sigmas * np.sqrt(_robust_variance(magnitude) + ROUNDING_VARIANCE)
    kept = magnitude <= limit[..., np.newaxis]
    return np.asarray(np.sum(np.square(magnitude), axis=-1, where=kept) / kept.sum(axis=-1))


def _robust_variance(magnitude: Floats) -> Floats:
    """Return the variance of a zero-mean normal from the median of |x| along the last axis."""
    return np.square(1.4826 * _median(magnitude))


def _median(values: Floats) -> Floats:
    """Return the median along the last axis, faster than `np.median` for few values."""
    low, high = (values.shape[-1] - 1) // 2, values.shape[-1] // 2
    rising = np.sort(values, axis=-1)
    return np.asarray((rising[..., low] + rising[..., high]) / 2)


def _photon_line(level: Floats, variance: Floats) -> NoiseModel:
    """Fit the photon-transfer line that most tiles lie on.

    Of the lines through the medians of two groups of similar brightness (or flat through one), it
    is the one with the least capped misfit, in logarithms: unlike in a least-squares fit, tiles
    with structure, however many at one brightness and however rough, pull no more than the cap.
    """
    groups = max(1, min(16, len(level) // 6))
    if groups == 1:
        return NoiseModel(float(_median(variance)), 0.0)
    x, y = _medians_of_groups(level, variance, groups)
    first, second = np.triu_indices(len(x), k=1)
    rising = (x[second] > x[first]) & (y[second] > y[first])
    first, second = first[rising], second[rising]
    slope = np.append((y[second] - y[first]) / (x[second] - x[first]), np.zeros(len(x)))
    intercept = np.append(y[first], y) - slope * np.append(x[first], x)
    slope, intercept = slope[intercept >= 0], intercept[intercept >= 0]
    line = intercept[:, np.newaxis] + slope[:, np.newaxis] * level
    misfit = np.log((variance + ROUNDING_VARIANCE) / (line + ROUNDING_VARIANCE))
    best = int(np.argmin(np.minimum(np.abs(misfit), _MISFIT_CAP).sum(axis=1)))
    return NoiseModel(float(intercept[best]), float(slope[best]))


def _medians_of_groups(level: Floats, variance: Floats, groups: int) -> tuple[Floats, Floats]:
    """Return medians of level and variance in groups of similar level and size, shape (groups,)."""
    rising = np.argsort(level, kind="stable")
    sizes = np.full(groups, len(level) // groups)
    sizes[: len(level) % groups] += 1
    within = variance[rising][np.lexsort((variance[rising], np.repeat(np.arange(groups), sizes)))]
    first = np.cumsum(sizes) - sizes
    low, high = first + (sizes - 1) // 2, first + sizes // 2
    return (level[rising][low] + level[rising][high]) / 2, (within[low] + within[high]) / 2


def _autocovariance(tiles: Floats) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Return the covariance of each tile's noise at the near, then the far lags, shape (n, lags).

    The second array, shape (n,), states whether the tile is free of outliers.
    """
    basis, inverse = _cubic_surface()
    flat = tiles.reshape(len(tiles), -1)
    flat = flat - flat.mean(axis=1, keepdims=True)
    residual = flat - (flat @ basis) @ basis.T
    magnitude = np.abs(residual)
    limit = 5 * np.sqrt(_robust_variance(magnitude) + ROUNDING_VARIANCE)
    clean = magnitude.max(axis=1) <= limit
    square = residual.reshape(-1, TILE, TILE)
    products = [
        np.einsum("nyx,nyx->n", a, b) / (a.shape[1] * a.shape[2]) for a, b in _lagged_pairs(square)
    ]
    covariance = np.stack(products, axis=1)
    return covariance @ inverse.T, clean


def _correlation(autocovariance: Floats, line: Floats) -> float:
    """Return the factor by which shared noise raises the variance of a mean; 1 if none is evident.

    `line`, shape (n,), is each tile's variance by differences of neighbours.
    """
    counts = autocovariance[:, 0] > ROUNDING_VARIANCE
    noisy = autocovariance[counts]
    if len(noisy) < 3:
        return 1.0
    ratio = np.log(noisy[:, 0] / np.maximum(line[counts], ROUNDING_VARIANCE))
    if np.sqrt(_robust_variance(np.abs(ratio - _median(ratio)))) > _UNIFORM:
        return 1.0
    lags = _median((noisy / noisy[:, :1]).T)
    near, far = lags[1 : len(_NEAR)], lags[len(_NEAR) :].reshape(-1, 2).mean(axis=1)
    # A lag in a tile of white noise scatters by 1/TILE, the median of n tiles by √(π/2n) of that.
    scatter = np.sqrt(np.pi / 2 / len(noisy)) / TILE
    excess = 2 * float(near.sum())
    significant = excess > _SIGNIFICANT * 2 * scatter * np.sqrt(len(near)) and near.max() > _CLEAR
    reaches_far = np.abs(far).max() > max(_FAR_FRACTION * near.max(), 3 * scatter)
    return 1 + excess if significant and not reaches_far else 1.0


def _lagged_pairs(square: NumberArray) -> list[tuple[NumberArray, NumberArray]]:
    """Return both factors of the autocovariance of `square`, shape (…, TILE, TILE), by lag."""
    pairs = []
    for down, right in _NEAR + _FAR:
        first = square[..., : TILE - down, max(0, -right) : TILE - max(0, right)]
        second = square[..., down:, max(0, right) : TILE - max(0, -right)]
        pairs.append((first, second))
    return pairs


@cache
def _cubic_surface() -> tuple[Floats, Floats]:
    """Return orthonormal cubics of a tile, and the inverse of their effect on autocovariances.

    With R = 1 − QQᵀ the residual of noise of covariance Σ_h C(h) S_h (S_h: the shift by h and
    back) has the autocovariances A = M C, M_gh = tr(R S_g R S_h)/(2 N_g); the inverse of M is
    returned, so that removing a surface does not bias C.
    """
    y, x = np.mgrid[:TILE, :TILE].reshape(2, -1) / ((TILE - 1) / 2) - 1
    powers = [x**i * y**j for i in range(4) for j in range(4 - i)]
    basis = np.linalg.qr(np.stack(powers, axis=1))[0]
    remover = np.eye(TILE**2) - basis @ basis.T
    pixel = np.arange(TILE**2).reshape(TILE, TILE)
    shifts, counts = [], []
    for first, second in _lagged_pairs(pixel):
        shift = np.zeros((TILE**2, TILE**2))
        shift[first.ravel(), second.ravel()] = 1
        shift[second.ravel(), first.ravel()] = 1
        shifts.append(shift)
        counts.append(shift.sum())
    filtered = [remover @ shift @ remover for shift in shifts]
    effect = [
        [float(np.sum(s * h)) / n for h in shifts] for s, n in zip(filtered, counts, strict=True)
    ]
    return np.asarray(basis, dtype=np.float64), np.linalg.inv(np.array(effect))
