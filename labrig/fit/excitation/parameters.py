"""Parameters of an excitation fit and their layout in θ."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import helmert

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.material import MAX_ORDER
from labrig.results import ChargingSeries

#: Amplitudes over the largest value: of a state which is not there, and of one so far from
#: saturation that its amplitude is without influence.
MIN_AMPLITUDE, MAX_AMPLITUDE = 1e-9, 1e9
#: Rate in 1/s below every one that a charge can tell from none; its logarithm is finite.
MIN_RATE_PER_S = 1e-30


class Rates(NamedTuple):
    """Parameters of the fit by name.

    Attributes
    ----------
    k_r_per_s, amplitude, k_e_per_s
        Re-radiation rates in 1/s (N,), amplitudes (N,) and excitation rates in 1/s (N, B).
    weights
        Weights of the channels, that of the reference 1, shape (C,).
    log_scale
        Logarithm of each series' irradiance over its nominal value, shape (S,); 0 for the one that
        defines E.
    log_brightness
        Logarithm of the lamp's brightness over its nominal value at every charge of every series,
        (K,).
    lacking
        Relative deficit of the cold lamp, shape (1,), or (0,) if it is not fitted.
    off
        Amplitudes z of `ChargingSeries.site_modes`, series by series, shape (M,).
    offset
        Dark level that was not subtracted, shape (C,), or (0,) if it is not fitted.
    veil
        Fraction of the frame's light that lies over every site, followed by amplitudes of
        `ChargingSeries.veil_shapes`, shape (1 + K,), or (0,) if it is not fitted.
    evenness
        Brightness of every site after the same glow over that of the values, shape (P,), or (1,) if
        it is not fitted.
    start
        Concentration of every state when the first charge of the first series begins, shape (N,),
        or (0,) if the sample is dark then.
    order
        Kinetic orders b, shape (N,).
    gain
        (A/S)^(1/b) with the unit S of θ, shape (N,).
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
    veil: FloatArray
    evenness: FloatArray
    start: FloatArray
    order: FloatArray
    gain: FloatArray


@dataclass(frozen=True)
class RelativeSigmas:
    """Further sources of scatter as relative standard uncertainties.

    Attributes
    ----------
    flicker
        Relative flicker ρ common to all values of an exposure.
    lamp
        Relative scatter of the lamp's brightness from charge to charge.
    least_lamp
        Least scatter of the lamp's brightness that the fit may find.
    cold_deficit
        Relative σ of the deficit of a lamp that was just switched on; 0 is expected.
    scale
        Relative σ of the irradiance of every other series over that of the one that defines E.
    defining
        Number, from 0, of the series whose irradiance defines E, to which k_e belongs.
    offset
        σ of the subtracted dark level in the values' unit, common to all of them, shape (C,).
    common_mode
        Scatter of the dark level from exposure to exposure in the values' unit, shape (C,): an
        exposing sensor warms.
    veil
        σ of the fraction of the frame's light that lies over every site, by glare of the lens and
        by surfaces that light one another; 0 is expected. Fitted where the light of the frames is
        known.
    veil_shape
        σ of the amplitude of each of the shapes by which that differs from site to site; with 0 it
        does not.
    evenness
        Relative σ of the brightness of every site after the same glow, common to all photographs of
        all series, beside the mean of the sites, which belongs to the amplitudes. Fitted where all
        series have the same sites, several of them.
    start
        σ of the concentration of every state when the first charge of the first series begins, the
        same at all sites; 0 is expected.
    irradiance
        Relative σ of E in every band, a scalar or (B,), common to all series: the fit cannot
        constrain it.
    largest_factor
        Factor up to which the fit finds the size of `lamp` and of each kind of the sites' error
        modes, relative to that given; 0 if they are known.
    """

    flicker: float = 0.0
    lamp: float = 0.0
    least_lamp: float = 0.0
    cold_deficit: float = 0.0
    scale: float = 0.0
    defining: int = 0
    offset: tuple[float, ...] = ()
    common_mode: tuple[float, ...] = ()
    veil: float = 0.0
    veil_shape: float = 0.0
    evenness: float = 0.0
    start: float = 0.0
    irradiance: float | tuple[float, ...] = 0.0
    largest_factor: float = 0.0


class ParameterLayout(NamedTuple):
    """Slices of θ = [ln k_r, 1/A, A k_e, weights, orders, parameters with a prior].

    The glow y of a state obeys dy/dt = A k_e E (1 − y/A) − k_r y. A weakly charged sample
    determines how fast it grows, A k_e, far better than A and k_e, and of A hardly more than that
    it is large. With A k_e as parameter the search need not follow the hyperbola on which A and k_e
    trade off; with 1/A it finds its way back from amplitudes without end, where the model is flat
    in A. The slice of a parameter that is not fitted is empty.

    Of order b the glow is S yᵇ with the unit S and y = G r, G = (A/S)^(1/b): dy/dt = G k_e E (1 −
    y/G) − k_r G^(1 − b) yᵇ. So G takes the place of A, and k_r G^(1 − b), the rate where the glow
    is S, that of k_r. S is 1 where the orders are held, else the brightest value.
    """

    k_r: slice
    inverse_gain: slice
    growth: slice
    weights: slice
    order: slice
    scale: slice
    brightness: slice
    lacking: slice
    off: slice
    offset: slice
    veil: slice
    evenness: slice
    start: slice


def is_fitted(place: slice) -> bool:
    """Return whether θ contains the parameter."""
    return bool(place.start < place.stop)


class Parameters:
    """Conversion between `Rates` and θ.

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

    Attributes
    ----------
    states, bands
        Numbers N of states and B of bands.
    others
        Indices of the channels whose weights are fitted.
    scaled
        Numbers of the series whose scale is fitted.
    order
        Kinetic order of all states, None where they are fitted.
    columns
        Layout of θ.
    prior_sigma
        Prior σ of the last h parameters of θ, all expected to be 0, shape (h,).
    unevenness
        Contrasts of the sites' logarithmic brightness, of which θ has the amplitudes, orthonormal
        and without a mean, shape (P − 1, P); (0, 1) if it is not fitted.
    """

    def __init__(
        self,
        series: Sequence[ChargingSeries],
        states: int,
        reference: int,
        uncertain: RelativeSigmas,
        order: float | None = 1.0,
    ) -> None:
        self.states, self.bands, self._series = states, bands_of(series), len(series)
        channels = series[0].values.shape[2]
        brightest = max(float(np.nanmax(charging.values)) for charging in series)
        self.order = order
        self._unit = brightest if order is None else 1.0
        self._least_gain = MIN_AMPLITUDE * brightest / self._unit
        self._largest_gain = MAX_AMPLITUDE * brightest / self._unit
        self.others = [channel for channel in range(channels) if channel != reference]
        is_scaled = uncertain.scale > 0
        self.scaled = [
            number for number in range(len(series)) if is_scaled and number != uncertain.defining
        ]
        self._first_charge = _begins([len(charging.charges) for charging in series])
        self._first_mode = _begins(
            [0 if charging.site_modes is None else len(charging.site_modes) for charging in series]
        )
        counts = [
            len(self.scaled),
            self._first_charge[-1] if uncertain.lamp > 0 else 0,
            1 if uncertain.cold_deficit > 0 else 0,
            self._first_mode[-1],
        ]
        sigmas = [uncertain.scale, uncertain.lamp, uncertain.cold_deficit, 1.0]
        is_veiled = all(charging.frame_light is not None for charging in series)
        veils = [uncertain.veil] if uncertain.veil > 0 and is_veiled else []
        if veils and uncertain.veil_shape > 0:
            shapes = max(0 if one.veil_shapes is None else len(one.veil_shapes) for one in series)
            veils += shapes * [uncertain.veil_shape]
        sites = {charging.sites for charging in series}
        is_uneven = uncertain.evenness > 0 and len(sites) == 1
        self.unevenness: FloatArray = np.asarray(helmert(max(sites) if is_uneven else 1))
        uneven = len(self.unevenness) * [uncertain.evenness]
        begins = states * [uncertain.start] if uncertain.start > 0 else []
        self.prior_sigma: FloatArray = np.concatenate(
            [np.repeat(sigmas, counts), uncertain.offset, veils, uneven, begins]
        )
        free_counts = [
            states,
            states,
            states * self.bands,
            len(self.others),
            states if order is None else 0,
        ]
        lengths = [len(sigma) for sigma in (uncertain.offset, veils, uneven, begins)]
        ends = _begins([*free_counts, *counts, *lengths])
        self.columns = ParameterLayout(*(slice(*limits) for limits in pairwise(ends)))
        self.count = ends[-1]

    @property
    def is_first_order(self) -> bool:
        """Whether all states are held at first order."""
        return self.order == 1

    def charges(self, number: int) -> slice:
        """Return the slice of a series' charges among those of all series."""
        return slice(*self._first_charge[number : number + 2])

    def modes(self, number: int) -> slice:
        """Return the slice of a series' irradiance modes among those of all series."""
        return slice(*self._first_mode[number : number + 2])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return bounds of θ: rates, weights, veil and start ≥ 0, amplitudes in their range."""
        lower, upper = np.full(self.count, -np.inf), np.full(self.count, np.inf)
        lower[self.columns.k_r] = np.log(MIN_RATE_PER_S)
        lower[self.columns.growth.start : self.columns.weights.stop] = 0.0
        lower[self.columns.inverse_gain] = 1 / self._largest_gain
        upper[self.columns.inverse_gain] = 1 / self._least_gain
        lower[self.columns.order], upper[self.columns.order] = 1.0, MAX_ORDER
        if is_fitted(self.columns.veil):
            lower[self.columns.veil.start] = 0.0
        lower[self.columns.start] = 0.0
        return lower, upper

    def as_stated(
        self,
        k_r_per_s: FloatArray,
        amplitude: FloatArray,
        k_e_per_s: FloatArray,
        weights: FloatArray,
        order: FloatArray,
    ) -> FloatArray:
        """Return θ of some rates, with all parameters that have a prior at 0."""
        theta = np.zeros(self.count)
        columns = self.columns
        gain = np.clip(
            (amplitude / self._unit) ** (1 / order), self._least_gain, self._largest_gain
        )
        theta[columns.k_r] = np.log(k_r_per_s) + (1 - order) * np.log(gain)
        theta[columns.inverse_gain] = 1 / gain
        theta[columns.growth] = (gain[:, None] * k_e_per_s).ravel()
        theta[columns.weights] = weights[self.others]
        if is_fitted(columns.order):
            theta[columns.order] = order
        return theta

    def unpack(self, theta: FloatArray) -> Rates:
        """Return the parameters in θ by name."""
        columns = self.columns
        gain = 1 / theta[columns.inverse_gain]
        order = theta[columns.order] if self.order is None else np.full(self.states, self.order)
        weights = np.ones(len(self.others) + 1)
        weights[self.others] = theta[columns.weights]
        log_scale, log_brightness = np.zeros(self._series), np.zeros(self._first_charge[-1])
        if is_fitted(columns.scale):
            log_scale[self.scaled] = theta[columns.scale]
        if is_fitted(columns.brightness):
            log_brightness[:] = theta[columns.brightness]
        return Rates(
            np.exp(theta[columns.k_r]) * gain ** (order - 1),
            self._unit * gain**order,
            theta[columns.growth].reshape(self.states, self.bands) / gain[:, None],
            weights,
            log_scale,
            log_brightness,
            theta[columns.lacking],
            theta[columns.off],
            theta[columns.offset],
            theta[columns.veil],
            np.exp(theta[columns.evenness] @ self.unevenness),
            theta[columns.start],
            order,
            gain,
        )

    def stated_slopes(self, rates: Rates) -> FloatArray:
        """Return the derivatives by θ of θ with k_r, A and k_e for its own parameters of these."""
        columns, slopes = self.columns, np.eye(self.count)
        gain, order = rates.gain, rates.order
        inverse = columns.inverse_gain
        slopes[columns.k_r, columns.k_r] = np.diag(rates.k_r_per_s)
        slopes[columns.k_r, inverse] = np.diag((1 - order) * rates.k_r_per_s * gain)
        slopes[inverse, inverse] = -np.diag(order * rates.amplitude * gain)
        growth = np.arange(columns.growth.start, columns.growth.stop)
        state = np.repeat(np.arange(self.states), self.bands)
        slopes[growth, growth] = 1 / gain[state]
        slopes[growth, inverse.start + state] = (gain[:, None] * rates.k_e_per_s).ravel()
        if is_fitted(columns.order):
            slopes[columns.k_r, columns.order] = np.diag(rates.k_r_per_s * np.log(gain))
            slopes[inverse, columns.order] = np.diag(rates.amplitude * np.log(gain))
        return slopes


def bands_of(series: Sequence[ChargingSeries]) -> int:
    """Return the number of bands, equal in all series.

    Raises
    ------
    FitError
        There is no series, or they differ in bands or channels.
    """
    shapes = {(charging.irradiance.shape[1], charging.values.shape[2]) for charging in series}
    if len(shapes) != 1:
        raise FitError(
            f"expected series with the same bands and channels, got {sorted(shapes) or 'none'}"
        )
    bands, _ = shapes.pop()
    return int(bands)


def _begins(counts: Sequence[int]) -> list[int]:
    """Return the start of each of several blocks, and the end of the last one."""
    ends: list[int] = np.cumsum([0, *counts]).tolist()
    return ends
