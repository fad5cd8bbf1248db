"""Residuals of all series as a function of rates, amplitudes and parameters with a prior.

The signal of a site is e_p w_c Σ_i A_i r_iᵇ with b = 1 of the first order: one amplitude A_i = Λ*
k_r,i for every state, the signal of a fully charged sample in the brightest channel, one weight per
channel, and the evenness e_p of the sites.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from labrig.fit.excitation.levels import Levels, levels, levels_and_slopes
from labrig.fit.excitation.parameters import Parameters, Rates, RelativeSigmas, is_fitted
from labrig.foundation.arrays import FloatArray
from labrig.results import ChargingSeries


class ExcitationProblem:
    """Least-squares problem in the θ of `Parameters`.

    Parameters
    ----------
    series
        Charging series; `uncertain` says which one defines E.
    states
        Number N of states.
    reference
        Index of the channel whose weight is 1.
    uncertain
        Further sources of scatter.
    order
        Kinetic order of all states; None fits one of each.
    """

    def __init__(
        self,
        series: Sequence[ChargingSeries],
        states: int,
        reference: int,
        uncertain: RelativeSigmas,
        order: float | None = 1.0,
    ) -> None:
        self.series = tuple(series)
        self.parameters = Parameters(series, states, reference, uncertain, order)
        self._before = [_number_before(self.series, number) for number in range(len(self.series))]
        self._flicker = uncertain.flicker
        self._inverse_sigma = [
            np.where(
                np.isfinite(charging.values) & np.isfinite(charging.sigma), 1 / charging.sigma, 0.0
            )
            for charging in self.series
        ]
        self._values = [np.nan_to_num(charging.values) for charging in self.series]
        common_mode = np.array(uncertain.common_mode)
        self._common_mode = [
            [_flat(common_mode * inverse)] if len(common_mode) else []
            for inverse in self._inverse_sigma
        ]
        #: Common-mode directions of each exposure's values, by series.
        self._common = [_successive_whitenings(vectors) for vectors in self._common_mode]

    @property
    def n_values(self) -> int:
        """Number of values measured."""
        return sum(int(np.count_nonzero(inverse_sigma)) for inverse_sigma in self._inverse_sigma)

    def signal(self, theta: FloatArray) -> list[FloatArray]:
        """Return the model of every series, shape (n, P, C) each."""
        rates = self.parameters.unpack(theta)
        return [
            _signal(self.glow(charging, rates), rates, charging)
            for charging in self.illuminated_series(rates)
        ]

    def plain_residuals(self, theta: FloatArray) -> tuple[FloatArray, ...]:
        """Return value − model in σ of every series, shape (n, P, C), NaN where not measured."""
        return tuple(
            np.where(inverse > 0, (values - signal) * inverse, np.nan)
            for values, inverse, signal in zip(
                self._values, self._inverse_sigma, self.signal(theta), strict=True
            )
        )

    def rewhiten(self, theta: FloatArray) -> None:
        """Take the flicker's covariance from the signal at θ."""
        if self._flicker > 0:
            self._common = [
                _successive_whitenings([_flat(self._flicker * signal * inverse), *common_mode])
                for signal, inverse, common_mode in zip(
                    self.signal(theta), self._inverse_sigma, self._common_mode, strict=True
                )
            ]

    def whiten_as(self, other: Self) -> None:
        """Take the flicker's covariance of a problem with the same values."""
        self._common = other._common

    def residuals(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return whitened model − values, followed by priors, and the Jacobian."""
        rates = self.parameters.unpack(theta)
        parts = [
            self._series_residuals(number, charging, rates)
            for number, charging in enumerate(self.illuminated_series(rates))
        ]
        sigma = self.parameters.prior_sigma
        if len(sigma):
            first_prior = len(theta) - len(sigma)
            slopes = np.eye(len(sigma), len(theta), first_prior) / sigma[:, None]
            parts.append((theta[first_prior:] / sigma, slopes))
        residuals, jacobians = zip(*parts, strict=True)
        return np.concatenate(residuals), np.concatenate(jacobians)

    def illuminated_series(self, rates: Rates) -> list[ChargingSeries]:
        """Return the series with the irradiance and the brightness of θ."""
        illuminated: list[ChargingSeries] = []
        for number, (charging, log_scale) in enumerate(
            zip(self.series, rates.log_scale, strict=True)
        ):
            cold_deficit = np.array([charge.cold_deficit for charge in charging.charges])
            log_brightness = rates.log_brightness[self.parameters.charges(number)]
            brightness = np.exp(log_brightness - rates.lacking.sum() * cold_deficit)
            charges = tuple(
                replace(charge, brightness=charge.brightness * float(factor))
                for charge, factor in zip(charging.charges, brightness, strict=True)
            )
            scaled = charging.irradiance * float(np.exp(log_scale))
            if charging.site_modes is not None:
                amplitudes = rates.off[self.parameters.modes(number)]
                scaled = scaled * np.exp(np.tensordot(amplitudes, charging.site_modes, axes=1))
            earlier, before = charging.earlier, self._before[number]
            if earlier is not None and before is not None:
                # The charges before have one light, whichever series looks at what they left.
                lit = illuminated[before]
                earlier = replace(earlier, charges=lit.charges, irradiance=lit.irradiance)
            is_begun = len(rates.start) and (number == 0 or before is not None)
            start = rates.start if is_begun else None
            illuminated.append(
                replace(charging, charges=charges, irradiance=scaled, earlier=earlier, start=start)
            )
        return illuminated

    def levels(self, charging: ChargingSeries, rates: Rates) -> Levels:
        """Return the light of all exposures of a series over that of full states."""
        return levels(charging, *self._of_levels(rates))

    def _of_levels(self, rates: Rates) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """Return k_r, k_e and kinetic orders; None if all are 1."""
        order = None if self.parameters.is_first_order else rates.order
        return rates.k_r_per_s, rates.k_e_per_s, order

    def glow(self, charging: ChargingSeries, rates: Rates) -> FloatArray:
        """Return the glow (n, P) of a series in the brightest channel."""
        return np.asarray(self.levels(charging, rates).value @ rates.amplitude * rates.evenness)

    def by_light_at_off(self, number: int, charging: ChargingSeries, rates: Rates) -> FloatArray:
        """Return what the light's parameters and the start change of the levels at lamp off.

        Parameters
        ----------
        number, charging, rates
            A series in the light of θ, and θ by name.

        Returns
        -------
        ndarray
            Derivatives by θ of the light rᵇ of every state at every lamp off, shape (K, P, N, p).
        """
        at_off = tuple(
            replace(charge, start_s=np.array([charge.off_s]), exposure_s=np.zeros(1))
            for charge in charging.charges
        )
        level, by_light, by_start = levels_and_slopes(
            replace(charging, charges=at_off, across=None), *self._of_levels(rates)
        )
        start = self.parameters.columns.start
        slopes = np.zeros((*level.value.shape, self.parameters.count))
        for state, alone in enumerate(np.eye(len(rates.amplitude))):
            own, of_state = slopes[:, :, state], rates._replace(amplitude=alone)
            self._set_light_derivatives(number, charging, of_state, by_light, own)
            if is_fitted(start):
                own[..., start.start + state] = by_start[..., state]
        return slopes

    def _series_residuals(
        self, number: int, charging: ChargingSeries, rates: Rates
    ) -> tuple[FloatArray, FloatArray]:
        level, by_light, by_start = levels_and_slopes(charging, *self._of_levels(rates))
        shots, sites = level.value.shape[:2]
        columns = self.parameters.columns
        glow = level.value @ rates.amplitude * rates.evenness
        # By θ of the glow, before evenness and channels come into it.
        slopes = np.zeros((shots, sites, self.parameters.count))
        amplitude, order, gain = rates.amplitude, rates.order, rates.gain
        slopes[..., columns.k_r] = level.by_k_r * (amplitude * rates.k_r_per_s)
        # G k_e and k_r G^(1 − b) are held where 1/G is varied, and k_e and k_r with it.
        by_gain = order * level.value - np.einsum("fpnb,nb->fpn", level.by_k_e, rates.k_e_per_s)
        by_gain += (order - 1) * rates.k_r_per_s * level.by_k_r
        slopes[..., columns.inverse_gain] = -(amplitude * gain) * by_gain
        by_growth = (amplitude / gain)[:, None] * level.by_k_e
        slopes[..., columns.growth] = by_growth.reshape(shots, sites, -1)
        if is_fitted(columns.order):
            by_log_gain = level.value + rates.k_r_per_s * level.by_k_r
            slopes[..., columns.order] = amplitude * (level.by_order + np.log(gain) * by_log_gain)
        self._set_light_derivatives(number, charging, rates, by_light, slopes)
        if is_fitted(columns.start):
            slopes[..., columns.start] = by_start * amplitude
        slopes *= rates.evenness[:, None]
        if is_fitted(columns.evenness):
            slopes[..., columns.evenness] = glow[..., None] * self.parameters.unevenness.T
        inverse = self._inverse_sigma[number]
        jacobian = slopes[:, :, None, :] * (rates.weights * inverse)[..., None]
        for place, channel in enumerate(self.parameters.others, start=columns.weights.start):
            jacobian[:, :, channel, place] = glow * inverse[..., channel]
        for channel in range(len(rates.offset)):
            jacobian[:, :, channel, columns.offset.start + channel] = inverse[..., channel]
        if charging.frame_light is not None and is_fitted(columns.veil):
            veils = _veils(charging, len(rates.veil))
            jacobian[..., columns.veil] = (charging.frame_light * inverse)[..., None] * veils
        misfit = (_signal(glow, rates, charging) - self._values[number]) * inverse
        return self._whitened(number, misfit.reshape(shots, -1), jacobian)

    def _set_light_derivatives(
        self,
        number: int,
        charging: ChargingSeries,
        rates: Rates,
        by_light: FloatArray,
        slopes: FloatArray,
    ) -> None:
        """Set the derivatives by all parameters of the light, from those by the light.

        What a bright light has left may be most of the glow after a dim one, and more than what a
        short charge has added.

        Parameters
        ----------
        number, charging, rates
            A series in the light of θ, and θ by name.
        by_light
            Derivatives of its levels, shape (n, K, P, N, B), by ln E of every charge.
        slopes
            Derivatives (n, P, p) of its glow by θ.
        """
        columns = self.parameters.columns
        by_band = np.einsum("fkpnb,n->fkpb", by_light, rates.amplitude)
        earlier = by_band.shape[1] - len(charging.charges)
        parts = [(number, by_band[:, earlier:])]
        before = self._before[number]
        if before is not None:
            parts.append((before, by_band[:, :earlier]))
        for of, by_its_bands in parts:
            lit, charges = self.series[of], self.parameters.charges(of)
            by_charge = by_its_bands.sum(axis=3)
            if of in self.parameters.scaled:
                place = columns.scale.start + self.parameters.scaled.index(of)
                slopes[..., place] = by_charge.sum(axis=1)
            if is_fitted(columns.brightness):
                first = columns.brightness.start
                own = slice(first + charges.start, first + charges.stop)
                slopes[..., own] = np.moveaxis(by_charge, 1, 2)
            if is_fitted(columns.lacking):
                cold_deficit = np.array([charge.cold_deficit for charge in lit.charges])
                lacking = np.tensordot(by_charge, cold_deficit, axes=(1, 0))
                slopes[..., columns.lacking.start] -= lacking
            if lit.site_modes is None:
                continue
            modes, first = self.parameters.modes(of), columns.off.start
            if lit.is_by_light:
                lights = [charge.light or 0 for charge in lit.charges]
                by_modes = np.einsum("fkpb,mkb->fpm", by_its_bands, lit.site_modes[:, lights])
            else:
                by_modes = np.einsum("fpb,mpb->fpm", by_its_bands.sum(axis=1), lit.site_modes)
            slopes[..., first + modes.start : first + modes.stop] = by_modes

    def whitened(self, number: int, columns: FloatArray) -> FloatArray:
        """Return changes (n, P, C, k) of a series' signal in whitened σ, shape (n P C, k)."""
        columns = columns * self._inverse_sigma[number][..., None]
        columns = columns.reshape(len(columns), -1, columns.shape[-1])
        for common in self._common[number]:
            common.whiten(columns)
        return columns.reshape(-1, columns.shape[-1])

    def _whitened(
        self, number: int, misfit: FloatArray, jacobian: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Multiply by a W with Wᵀ W = (1 + Σ u uᵀ)⁻¹, exposure by exposure."""
        misfit, jacobian = misfit[..., None], jacobian.reshape(*misfit.shape, -1)
        for common in self._common[number]:
            common.whiten(misfit)
            common.whiten(jacobian)
        return misfit.ravel(), jacobian.reshape(-1, jacobian.shape[-1])


def _number_before(series: Sequence[ChargingSeries], number: int) -> int | None:
    """Return the number of the series of the charges before a series, if it is fitted, too."""
    earlier = series[number].earlier
    if earlier is None:
        return None
    on_s = [charge.on_s for charge in earlier.charges]
    for before in range(number):
        if [charge.on_s for charge in series[before].charges] == on_s:
            return before
    return None


class _Common(NamedTuple):
    """Common-mode direction u (n, PC) of each exposure, and u over √(1 + u²) (1 + √(1 + u²))."""

    u: FloatArray
    shrunk: FloatArray

    @classmethod
    def along(cls, u: FloatArray) -> Self:
        """Return the whitening along u: (1 + u uᵀ)^(−1/2) = 1 − shrunk uᵀ."""
        root = np.sqrt(1 + np.einsum("fv,fv->f", u, u))
        return cls(u, u / (root * (1 + root))[:, None])

    def whiten(self, columns: FloatArray) -> None:
        """Whiten columns (n, PC, k) in place."""
        columns -= self.shrunk[..., None] * (self.u[:, None, :] @ columns)


def _successive_whitenings(vectors: Sequence[FloatArray]) -> list[_Common]:
    """Factor a covariance 1 + Σ u uᵀ: each u is whitened by those before it."""
    whitenings: list[_Common] = []
    for vector in vectors:
        column = vector[..., None].copy()
        for common in whitenings:
            common.whiten(column)
        whitenings.append(_Common.along(column[..., 0]))
    return whitenings


def _flat(values: FloatArray) -> FloatArray:
    """Reshape (n, P, C) to (n, PC)."""
    return values.reshape(len(values), -1)


def _signal(glow: FloatArray, rates: Rates, charging: ChargingSeries) -> FloatArray:
    """Return the signal (n, P, C) of a glow (n, P) in the brightest channel."""
    signal: FloatArray = np.multiply.outer(glow, rates.weights)
    if charging.frame_light is not None and len(rates.veil):
        signal += charging.frame_light * (_veils(charging, len(rates.veil)) @ rates.veil)
    return signal + rates.offset if len(rates.offset) else signal


def _veils(charging: ChargingSeries, count: int) -> FloatArray:
    """Return the even veil and its shapes along the sites, shape (P, 1, count)."""
    veils = np.zeros((charging.values.shape[1], 1, count))
    veils[..., 0] = 1.0
    if charging.veil_shapes is not None and count > 1:
        veils[:, 0, 1:] = charging.veil_shapes.T
    return veils
