"""Cramér-Rao bound of the rates of a decay, from the simulated sensor's true noise.

The Cramér–Rao bound, shared with neither labrig's noise estimates nor its fits: photo-electrons of
all pixels of a patch, with crosstalk, read noise, noise that rows share, rounding, and flicker;
amplitudes, channel weights and the dark level of each channel unknown, this one known from the
run's dark frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.region import Region, region_pixels
from labrig.results import Series
from labrig.sim.sensor import BAYER_RGGB, gain_electrons_per_dn, read_noise_electrons

NODES, FRACTIONS = np.polynomial.legendre.leggauss(24)


@dataclass(frozen=True)
class Noise:
    """Noise of the simulated sensor; names as in `SensorSettings`."""

    width: int
    height: int
    flicker: float = 0.007
    crosstalk: float = 0.0
    row_noise: float = 0.0


@dataclass(frozen=True)
class PatchNoise:
    """Covariance in DN² of a patch's means of R, G and B in one frame.

    Attributes
    ----------
    mixing
        (3, 3) what of the light on pixels of each colour (column) is seen in each mean (row).
    photon
        (3, 3, 3) covariance for one electron expected in each pixel of the last axis' colour, in
        electrons².
    dark
        (3, 3) without light, DN².
    gain
        Electrons per DN.
    """

    mixing: FloatArray
    photons: FloatArray
    dark: FloatArray
    gain: float

    @classmethod
    def of(cls, noise: Noise, region: Region, iso: float) -> "PatchNoise":
        """Return the noise of a patch in a frame."""
        x, y, wide, high = region_pixels(region, noise.width, noise.height)
        rows, columns = np.arange(y - 1, y + high + 1), np.arange(x - 1, x + wide + 1)
        colour = np.array(BAYER_RGGB).reshape(2, 2)[rows[:, None] % 2, columns % 2]
        inside = np.zeros(colour.shape)
        inside[1:-1, 1:-1] = 1.0
        means = np.stack([inside * (colour == c) for c in range(3)])
        means /= means.sum(axis=(1, 2), keepdims=True)
        seen = (1 - 4 * noise.crosstalk) * means + noise.crosstalk * sum(
            np.roll(means, step, axis) for axis in (1, 2) for step in (-1, 1)
        )
        of_colour = np.stack([colour == c for c in range(3)]).astype(float)
        gain = gain_electrons_per_dn(iso)
        read = read_noise_electrons(iso) / gain
        by_row = means.sum(axis=2)
        dark = (read**2 + 1 / 12) * np.diag((means**2).sum(axis=(1, 2)))
        return cls(
            mixing=np.einsum("cyx,eyx->ce", seen, of_colour),
            photons=np.einsum("cyx,dyx,eyx->cde", seen, seen, of_colour),
            dark=dark + (noise.row_noise * read) ** 2 * by_row @ by_row.T,
            gain=gain,
        )

    def covariance(self, signal_dn: FloatArray) -> FloatArray:
        """(n, 3, 3) in DN² of means (n, 3) of `signal_dn`, flicker left out."""
        electrons = np.linalg.solve(self.mixing, signal_dn.T * self.gain)
        photons = np.einsum("cde,ef->fcd", self.photons, electrons) / self.gain**2
        return np.asarray(self.dark + photons)


def rate_bound(
    series: Series,
    dark_exposure_s: Sequence[float],
    rates_per_s: Sequence[float],
    noise: Noise,
    region: Region,
) -> FloatArray:
    """Least σ that any unbiased estimate of the true `rates_per_s` can have, in 1/s.

    Amplitudes and weights of the truth are taken from the series, of whose noise so little gets
    into them that the bound moves by parts of a percent.
    """
    patch = PatchNoise.of(noise, region, float(series.iso[0]))
    exposure_s = series.exposure_s
    rates = np.array(rates_per_s)
    middle = (series.t_s + exposure_s / 2)[:, None] + exposure_s[:, None] / 2 * NODES
    decayed = np.exp(-np.multiply.outer(rates, middle))
    means = np.einsum("kfq,q->fk", decayed, FRACTIONS / 2) * exposure_s[:, None]
    slopes = np.einsum("kfq,fq,q->fk", decayed, -middle, FRACTIONS / 2) * exposure_s[:, None]
    values = series.values * exposure_s[:, None]
    amplitudes = np.linalg.lstsq(means, values)[0]
    u, s, vt = np.linalg.svd(amplitudes, full_matrices=False)
    a, weights = s[0] * u[:, 0], vt[0]
    signal = np.multiply.outer(means @ a, weights)
    covariance = patch.covariance(np.maximum(signal, 0.0))
    covariance += noise.flicker**2 * signal[:, :, None] * signal[:, None, :]
    # d signal / d (rates, amplitudes, weights of R and B, dark levels); the weight of G is held.
    n, n_states = len(signal), len(rates)
    jacobian = np.zeros((n, 3, 2 * n_states + 5))
    jacobian[:, :, :n_states] = (slopes * a)[:, None, :] * weights[:, None]
    jacobian[:, :, n_states : 2 * n_states] = means[:, None, :] * weights[:, None]
    for column, channel in enumerate((0, 2), start=2 * n_states):
        jacobian[:, channel, column] = means @ a
    jacobian[:, :, -3:] = np.eye(3)
    information = np.einsum("fci,fcj->ij", jacobian, np.linalg.solve(covariance, jacobian))
    information[-3:, -3:] += np.linalg.inv(
        patch.dark * _dark_fraction(np.array(dark_exposure_s), float(exposure_s[0]))
    )
    # Columns of like size: amplitudes in DN stand beside rates of a hundredth.
    scale = 1 / np.sqrt(np.diag(information))
    bound = scale * np.sqrt(np.diag(np.linalg.inv(information * np.multiply.outer(scale, scale))))
    return np.asarray(bound[:n_states])


def _dark_fraction(dark_exposure_s: FloatArray, exposure_s: float) -> float:
    """Variance of the dark level at `exposure_s`, of a line through dark frames, over a frame's."""
    design = np.stack([np.ones_like(dark_exposure_s), dark_exposure_s], axis=1)
    at = np.array([1.0, exposure_s])
    return float(at @ np.linalg.inv(design.T @ design) @ at)
