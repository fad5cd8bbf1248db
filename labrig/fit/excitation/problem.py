"""Residuals of all series together: of rates, amplitudes and what is only half known.

The signal of a site is w_c Σ_i A_i r_i: one amplitude A_i = Λ* k_r,i for every state, the signal of
a fully charged sample in the brightest channel, and one weight per channel.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from labrig.fit.excitation.levels import levels
from labrig.fit.excitation.series import ChargingSeries, bands_of
from labrig.fit.least_squares import FloatArray


class Rates(NamedTuple):
    """The parameters, apart.

    Attributes
    ----------
    k_r_per_s, amplitude, k_e_per_s
        (N,), (N,) and (N, B).
    weights
        (C,) of the channels; that of the one held is 1.
    log_scale
        (S,) ln of each series' irradiance over what was stated; 0 for the first, which defines E.
    log_brightness
        (K,) ln of the lamp's brightness at every charge of every series over what was stated.
    lacking
        (1,) what the cold lamp lacks, or (0,) if it is not fitted.
    off
        (M,) z of `ChargingSeries.site_modes`, series by series.
    offset
        (C,) level in the dark that was not subtracted, or (0,) if it is not fitted.
    """

    k_r_per_s: FloatArray
    amplitude: FloatArray
    k_e_per_s: FloatArray
    weights: FloatArray
    log_scale: FloatArray
    log_brightness: FloatArray
    lacking: FloatArray
    off: FloatArray
    offset: FloatArray


@dataclass(frozen=True)
class Uncertain:
    """What else scatters, relative standard uncertainties.

    Attributes
    ----------
    flicker
        ρ common to all values of a photograph.
    lamp
        Of its brightness from charge to charge.
    cold
        What a lamp lacks that was just switched on; 0 is expected.
    scale
        Of the irradiance of every series but the first over that of the first.
    offset
        (C,) of the dark level that was subtracted, in the values' unit; the same in all of them.
    irradiance
        Of E in every band, one number or (B,), in all series alike: nothing measured here tells.
    """

    flicker: float = 0.0
    lamp: float = 0.0
    cold: float = 0.0
    scale: float = 0.0
    offset: tuple[float, ...] = ()
    irradiance: float | tuple[float, ...] = 0.0


class ExcitationProblem:
    """Least-squares problem in θ = [ln k_r, A, k_e, weights, and what is half known].

    Half known are ln scales, ln brightness, what the cold lamp lacks and z of the sites' light.

    Parameters
    ----------
    series
        The first one defines E.
    states
        N.
    reference
        Channel whose weight is 1.
    uncertain
        What else scatters.
    """

    def __init__(
        self, series: Sequence[ChargingSeries], states: int, reference: int, uncertain: Uncertain
    ) -> None:
        self.series = tuple(series)
        self.bands = bands_of(series)
        self.states = states
        channels = self.series[0].values.shape[2]
        self._others = [c for c in range(channels) if c != reference]
        self._reference = reference
        charges = sum(len(one.charges) for one in self.series)
        self._scales = len(self.series) - 1 if uncertain.scale > 0 else 0
        self._brightness = charges if uncertain.lamp > 0 else 0
        self._lacking = 1 if uncertain.cold > 0 else 0
        #: Channels whose dark level is uncertain.
        self.offsets = len(uncertain.offset)
        modes = [0 if one.site_modes is None else len(one.site_modes) for one in self.series]
        #: Where each series' ways begin in which its sites' light may be off.
        self._first_mode = np.cumsum([0, *modes])
        self.prior_sigma = np.concatenate(
            [
                np.full(self._scales, uncertain.scale),
                np.full(self._brightness, uncertain.lamp),
                np.full(self._lacking, uncertain.cold),
                np.ones(sum(modes)),
                uncertain.offset,
            ]
        )
        self._flicker = uncertain.flicker
        self._inverse_sigma = [
            np.where(np.isfinite(one.values) & np.isfinite(one.sigma), 1 / one.sigma, 0.0)
            for one in self.series
        ]
        self._values = [np.nan_to_num(one.values) for one in self.series]
        #: Along which every photograph scatters by the flicker; none until `rewhitened`.
        self._along: list[FloatArray] | None = None

    @property
    def n_values(self) -> int:
        """Values measured."""
        return sum(int(np.count_nonzero(one)) for one in self._inverse_sigma)

    @property
    def site_modes(self) -> int:
        """Ways in which the light on the sites may be off, of all series."""
        return int(self._first_mode[-1])

    def pack(self, rates: Rates) -> FloatArray:
        """θ."""
        scale = rates.log_scale[1 : 1 + self._scales]
        return np.concatenate(
            [
                np.log(rates.k_r_per_s),
                rates.amplitude,
                rates.k_e_per_s.ravel(),
                rates.weights[self._others],
                scale,
                rates.log_brightness[: self._brightness],
                rates.lacking[: self._lacking],
                rates.off,
                rates.offset,
            ]
        )

    def lower(self) -> FloatArray:
        """Bounds of θ: amplitudes, excitation rates and weights are not negative."""
        n, others = self.states, len(self._others)
        free = np.full(n, -np.inf)
        half_known = np.full(len(self.prior_sigma), -np.inf)
        return np.concatenate([free, np.zeros(n + n * self.bands + others), half_known])

    def unpack(self, theta: FloatArray) -> Rates:
        """What `pack` put together; what is not fitted is as stated."""
        n, bands = self.states, self.bands
        half_known = (self._scales, self._brightness, self._lacking, self.site_modes)
        ends = np.cumsum([n, n, n * bands, len(self._others), *half_known])
        log_k_r, amplitude, k_e, others, scale, brightness, lacking, off, offset = np.split(
            theta, ends
        )
        weights = np.ones(len(self._others) + 1)
        weights[self._others] = others
        log_scale = np.zeros(len(self.series))
        log_scale[1 : 1 + len(scale)] = scale
        charges = sum(len(one.charges) for one in self.series)
        return Rates(
            np.exp(log_k_r),
            amplitude,
            k_e.reshape(n, bands),
            weights,
            log_scale,
            brightness if len(brightness) else np.zeros(charges),
            lacking,
            off,
            offset,
        )

    def signal(self, theta: FloatArray) -> list[FloatArray]:
        """(n, P, C) of every series."""
        rates = self.unpack(theta)
        return [
            np.multiply.outer(
                levels(one, rates.k_r_per_s, rates.k_e_per_s).value @ rates.amplitude,
                rates.weights,
            )
            + (rates.offset if len(rates.offset) else 0.0)
            for one in self.lit(rates)
        ]

    def plain_residuals(self, theta: FloatArray) -> tuple[FloatArray, ...]:
        """(n, P, C) of every series: value − model in σ, NaN where nothing was measured."""
        return tuple(
            np.where(inverse > 0, (values - signal) * inverse, np.nan)
            for values, inverse, signal in zip(
                self._values, self._inverse_sigma, self.signal(theta), strict=True
            )
        )

    def rewhiten(self, theta: FloatArray) -> None:
        """Take the flicker's covariance from the signal at θ."""
        if self._flicker > 0:
            self._along = [
                self._flicker * (signal * inverse).reshape(len(signal), -1)
                for signal, inverse in zip(self.signal(theta), self._inverse_sigma, strict=True)
            ]

    def residuals(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Whitened model − values, then priors; and the Jacobian."""
        rates = self.unpack(theta)
        first_charge = 0
        residuals, jacobians = [], []
        for number, one in enumerate(self.lit(rates)):
            misfit, slopes = self._of_series(number, one, rates, first_charge, len(theta))
            first_charge += len(one.charges)
            residuals.append(misfit)
            jacobians.append(slopes)
        half_known = len(self.prior_sigma)
        if half_known:
            residuals.append(theta[-half_known:] / self.prior_sigma)
            jacobians.append(np.eye(half_known, len(theta), len(theta) - half_known))
            jacobians[-1] /= self.prior_sigma[:, None]
        return np.concatenate(residuals), np.concatenate(jacobians)

    def lit(self, rates: Rates) -> list[ChargingSeries]:
        """The series with irradiance and brightness as θ has them."""
        lit, first = [], 0
        for number, (one, log_scale) in enumerate(zip(self.series, rates.log_scale, strict=True)):
            last = first + len(one.charges)
            cold = np.array([charge.cold for charge in one.charges])
            brightness = np.exp(rates.log_brightness[first:last] - rates.lacking.sum() * cold)
            charges = tuple(
                replace(charge, brightness=charge.brightness * float(factor))
                for charge, factor in zip(one.charges, brightness, strict=True)
            )
            scaled = one.irradiance * float(np.exp(log_scale))
            if one.site_modes is not None:
                own = rates.off[slice(*self._first_mode[number : number + 2])]
                scaled = scaled * np.exp(np.tensordot(own, one.site_modes, axes=1))
            lit.append(replace(one, charges=charges, irradiance=scaled))
            first = last
        return lit

    def _of_series(
        self, number: int, one: ChargingSeries, rates: Rates, first_charge: int, width: int
    ) -> tuple[FloatArray, FloatArray]:
        level = levels(one, rates.k_r_per_s, rates.k_e_per_s)
        n, bands = self.states, self.bands
        shots, sites = level.value.shape[:2]
        glow = level.value @ rates.amplitude
        # By θ of the glow, before channels come into it.
        by_k_e = level.by_k_e * rates.amplitude[:, None]
        slopes = np.zeros((shots, sites, width))
        slopes[..., :n] = level.by_k_r * rates.amplitude * rates.k_r_per_s
        slopes[..., n : 2 * n] = level.value
        slopes[..., 2 * n : 2 * n + n * bands] = by_k_e.reshape(shots, sites, -1)
        first_weight = 2 * n + n * bands
        first_scale = first_weight + len(self._others)
        by_light = np.einsum("fpnb,nb->fp", by_k_e, rates.k_e_per_s)
        if self._scales and number:
            slopes[..., first_scale + number - 1] = by_light
        first = first_scale + self._scales
        shot = 0
        for place, charge in enumerate(one.charges, start=first + first_charge):
            # The little that a charge leaves to the next one is neglected here.
            own = slice(shot, shot + len(charge.start_s))
            if self._brightness:
                slopes[own, :, place] = by_light[own]
            if self._lacking:
                slopes[own, :, first + self._brightness] = -charge.cold * by_light[own]
            shot = own.stop
        if one.site_modes is not None:
            place = first + self._brightness + self._lacking + self._first_mode[number]
            by_band = np.einsum("fpnb,nb->fpb", by_k_e, rates.k_e_per_s)
            slopes[..., place : place + len(one.site_modes)] = np.einsum(
                "fpb,mpb->fpm", by_band, one.site_modes
            )
        jacobian = slopes[:, :, None, :] * rates.weights[:, None]
        for place, channel in enumerate(self._others, start=first_weight):
            jacobian[:, :, channel, place] = glow
        signal = np.multiply.outer(glow, rates.weights)
        if len(rates.offset):
            signal = signal + rates.offset
            for channel in range(len(rates.offset)):
                jacobian[:, :, channel, width - len(rates.offset) + channel] = 1.0
        inverse = self._inverse_sigma[number]
        misfit = (signal - self._values[number]) * inverse
        jacobian *= inverse[..., None]
        return self._whitened(number, misfit.reshape(shots, -1), jacobian.reshape(shots, -1, width))

    def _whitened(
        self, number: int, misfit: FloatArray, jacobian: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Multiplied by (1 + u uᵀ)^(−1/2) photograph by photograph."""
        if self._along is not None:
            u = self._along[number]
            root = np.sqrt(1 + np.einsum("fv,fv->f", u, u))
            shrink = u / (root * (1 + root))[:, None]
            misfit = misfit - shrink * np.einsum("fv,fv->f", u, misfit)[:, None]
            along = np.einsum("fv,fvq->fq", u, jacobian)
            jacobian = jacobian - shrink[..., None] * along[:, None, :]
        return misfit.ravel(), jacobian.reshape(-1, jacobian.shape[-1])
