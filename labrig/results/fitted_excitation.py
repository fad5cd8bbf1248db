"""Fit of an excitation: rates of states and bands, closure, and the range that thickness leaves."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from labrig.foundation.arrays import BoolArray, FloatArray, IntArray
from labrig.foundation.detection import RATE_LIMIT_SIGMA
from labrig.foundation.notebook_views import NotebookViews
from labrig.foundation.number_format import rounded
from labrig.foundation.result_warning import ResultWarning
from labrig.material import MAX_ORDER
from labrig.results.interval import ProfileInterval
from labrig.results.measured import Measured, OneSided

#: Name of the cause in budgets.
THICKNESS = "thickness"
#: Largest optical density where nothing was measured: the back gets 1 % of the light.
PRIOR_DENSITY = 2.0


class DensityBasis(StrEnum):
    """Origin of the largest optical density that a sample may have."""

    PRIOR = "not measured"
    STATED = "as stated"
    REFLECTANCE = "by its reflectance, if it does not scatter"


@dataclass(frozen=True, eq=False)
class LayerEffect:
    """Range of k_e and Λ of a layer over those of a surface with the same glow.

    It is a range of what may be, and no standard uncertainty.

    Attributes
    ----------
    optical_density
        Least and largest decadic optical density that the charges leave, in the band of which it is
        largest.
    basis
        Origin of the largest one that was tried.
    k_e_factor
        Least and largest k_e over the fitted, of light as it falls on the surface, shape (2, N, B).
    reradiation_factor
        Least and largest Λ over the fitted, shape (2, N).
    """

    optical_density: tuple[float, float]
    basis: DensityBasis
    k_e_factor: FloatArray
    reradiation_factor: FloatArray

    @property
    def is_shown(self) -> bool:
        """True if the charges themselves contradict a surface."""
        return self.optical_density[0] > 0

    def __str__(self) -> str:
        """Return the statement in words."""
        low, high = (rounded(end, 2) for end in self.optical_density)
        shown = "by the charges themselves" if self.is_shown else self.basis
        k_e, whole = (_times(factor) for factor in (self.k_e_factor, self.reradiation_factor))
        return f"optical density {low} to {high} ({shown}): true k_e {k_e}, Λ {whole} those stated"


def _times(factor: FloatArray) -> str:
    low, high = (rounded(end, 3) for end in (float(factor.min()), float(factor.max())))
    return f"{low} to {high} times"


#: Standard deviations of a one-sided 95 % limit.
UPPER_SIGMAS = 1.645
#: Significance level of differences between exciting bands, as of all misfit tests.
DIFFERENT = 5e-4
#: Significance in σ from which a layer is optically thick.
THICK_SIGMAS = 3.5


@dataclass(frozen=True, eq=False)
class ExcitedState:
    """Rates of one state; σ are standard uncertainties.

    Attributes
    ----------
    k_r_per_s, k_r_per_s_sigma
        Re-radiation rate in 1/s, that of a full state.
    amplitude, amplitude_sigma
        Glow Λ* k_r of a fully charged sample in the brightest channel, in the unit of the values.
    k_e_per_s, k_e_per_s_sigma
        Excitation rates in 1/s per unit of the irradiance E, of the series that defines it, shape
        (B,).
    kinetic_order, kinetic_order_sigma
        Kinetic order b; its σ is 0 where it is held.
    is_level_known
        Whether the charge is known from both sides: light enough that the state saturates. Else
        amplitude, k_r and k_e of an order other than 1 are not known apart.
    """

    k_r_per_s: float
    k_r_per_s_sigma: float
    amplitude: float
    amplitude_sigma: float
    k_e_per_s: FloatArray
    k_e_per_s_sigma: FloatArray
    kinetic_order: float = 1.0
    kinetic_order_sigma: float = 0.0
    is_level_known: bool = True

    @property
    def is_first_order(self) -> bool:
        """Whether the state decays as an exponential, whatever its charge."""
        return self.kinetic_order == 1

    @property
    def order(self) -> Measured:
        """Kinetic order b, one-sided where it is fitted and at its bound."""
        b, sigma = self.kinetic_order, self.kinetic_order_sigma
        if sigma > 0 and b in (1.0, MAX_ORDER):
            return OneSided.held(b, sigma, 0.0, is_upper=b > 1)
        return Measured(b, sigma)

    @property
    def is_apart(self) -> bool:
        """Whether k_r, k_e, r(0) and Λ are known apart, as always of the first order."""
        return self.is_first_order or self.is_level_known

    @property
    def exponent(self) -> Measured | None:
        """Exponent p = b/(b − 1) of the decay; None of the first order, an exponential."""
        beyond = self.kinetic_order - 1
        if beyond == 0:
            return None
        return Measured(self.kinetic_order / beyond, self.kinetic_order_sigma / beyond**2)

    @property
    def seen(self) -> BoolArray:
        """Whether excitation by each band is detected, shape (B,); else k_e is an upper limit."""
        return self.k_e_per_s > RATE_LIMIT_SIGMA * self.k_e_per_s_sigma

    @property
    def k_e_upper_per_s(self) -> FloatArray:
        """Upper limit of k_e in 1/s with 95 % probability, shape (B,)."""
        return self.k_e_per_s + UPPER_SIGMAS * self.k_e_per_s_sigma


def order_fields(order: Measured) -> dict[str, float | None]:
    """Return a fitted kinetic order as the fields of a material's state.

    Parameters
    ----------
    order
        The order, one-sided where it is at its bound; σ is 0 where it was held.

    Returns
    -------
    dict
        `kinetic_order`, its σ and its limit, None where there is none.

    Examples
    --------
    >>> from labrig.results import Measured, OneSided, order_fields
    >>> order_fields(Measured(1.0, 0.0))
    {'kinetic_order': 1.0, 'kinetic_order_sigma': None, 'kinetic_order_limit_95': None}
    >>> order_fields(OneSided.held(1.0, 0.1, pull=0.0))["kinetic_order_limit_95"]
    1.1645
    """
    limit = None
    if isinstance(order, OneSided) and math.isfinite(order.limit):
        limit = min(max(order.limit, 1.0), MAX_ORDER)
    return {
        "kinetic_order": order.value,
        "kinetic_order_sigma": order.sigma if 0 < order.sigma < math.inf else None,
        "kinetic_order_limit_95": limit,
    }


@dataclass(frozen=True)
class ExcitationModel:
    """A model that was tried.

    Attributes
    ----------
    states
        Number of its states.
    order
        Kinetic order of all states; None where each has its own.
    n_parameters
        Number of fitted parameters, without those of the light, which all models share.
    reduced_chi2
        χ² per degree of freedom.
    bic
        Bayesian information criterion, with the noise enlarged to the misfit of the best model.
    """

    states: int
    order: float | None
    n_parameters: int
    reduced_chi2: float
    bic: float

    @property
    def label(self) -> str:
        """The model in words."""
        number = f"{self.states} state{'s' if self.states > 1 else ''}"
        if self.order is None:
            return f"{number} of general order"
        return f"{number} of {'first order' if self.order == 1 else f'order {self.order:g}'}"


@dataclass(frozen=True, eq=False)
class ConcentrationAtOff:
    """Charge of the N states at a lamp off, extrapolated back in the dark.

    Attributes
    ----------
    series, charge, site
        Name of the series, and numbers of charge and site from 0.
    r0, r0_sigma
        Concentrations, shape (N,).
    amplitude, amplitude_sigma
        Amplitudes a = Λ* k_r r(0)ᵇ of the decay from there, which are better determined than their
        factors, shape (N,).
    decay_time_s, decay_time_s_sigma
        τ of the decay from there, a (1 + t/τ)^(−b/(b − 1)) with τ = 1/((b − 1) k_r r(0)^(b − 1)),
        as `labrig fit charge` states it; 1/k_r of the first order, shape (N,).
    """

    series: str
    charge: int
    site: int
    r0: FloatArray
    r0_sigma: FloatArray
    amplitude: FloatArray
    amplitude_sigma: FloatArray
    decay_time_s: FloatArray
    decay_time_s_sigma: FloatArray


@dataclass(frozen=True, eq=False)
class BandQuantity:
    """Quantity of the glow by the band that excites it, relative to the fit's common one.

    Attributes
    ----------
    deviation, sigma
        Logarithm of the quantity over the common one, and its standard uncertainty, with all
        parameters of the fit free, shape (q, G): q values, such as of each channel, in G bands.
    p_value
        Probability of such deviations where the quantity is the same in all bands.
    """

    deviation: FloatArray
    sigma: FloatArray
    p_value: float

    @property
    def differs(self) -> bool:
        """Whether the quantity depends on the exciting band."""
        return self.p_value < DIFFERENT


@dataclass(frozen=True, eq=False)
class BandTests:
    """Tests of one glow for all exciting light, as a thin layer of first order has it.

    Attributes
    ----------
    bands
        Numbers of the G bands, from 0, that excite some sites more than all others do, shape (G,).
    light_variance
        Variance of the exciting light over the depth of the layer, relative to its squared mean, of
        the light that is absorbed most: (D ln 10)²/12 of a layer of optical density D < 1.
    charged_glow_by_variance
        Relative change of the fitted glow of the fully charged sample by that variance, over it:
        negative, since a thick layer saturates at its surface first. r(0) changes inversely.
    amplitude
        Glow of the fully charged sample, by the curvature of its charging.
    rate
        Rates of the decay after a charge.
    hue
        Channels relative to the brightest one; None if there is one channel only.
    """

    bands: IntArray
    light_variance: Measured
    charged_glow_by_variance: float
    amplitude: BandQuantity
    rate: BandQuantity
    hue: BandQuantity | None

    @property
    def optical_density(self) -> float:
        """Optical density D of a layer with this variance of the light, where it is below 1."""
        return float(np.sqrt(12 * max(self.light_variance.value, 0.0)) / np.log(10))

    @property
    def is_thick(self) -> bool:
        """Whether light is absorbed so much that it charges the surface more than the depth."""
        return self.light_variance.value > THICK_SIGMAS * self.light_variance.sigma


@dataclass(frozen=True, eq=False)
class FittedExcitation(NotebookViews):
    """Rates of all states and bands, from all series together.

    Attributes
    ----------
    states
        States by falling rate.
    channel_weights, channel_weights_sigma
        Weights of the channels, 1 of the brightest, shape (C,).
    at_off
        Charge at lamp off of every series, at the charge and site of the brightest glow.
    chi2, dof
        Sum of squared whitened residuals, and its degrees of freedom.
    covariance
        Covariance of the `covariance_parameters`.
    warnings
        Limits of the fit and remedies.
    residuals
        Residuals of every series in σ without flicker, shape (n, P, C) each.
    order_gain
        Fall of χ² that is expected if the kinetic orders, held at 1, were fitted; 0 where they are
        not held at 1.
    models
        Models that were tried, of which this is one.
    layer
        What the sample's thickness may do to k_e and Λ, beside all σ; None if it was not looked at.
    by_band
        Tests whether all bands excite the same glow; None if the sites are excited by one band.
    veil
        Fraction of the frame's light that lies over every site; None if it was not fitted.
    lamp_sigma
        Relative scatter of the lamp's brightness from charge to charge, found or as given.
    site_sizes
        Size of each kind of the sites' error modes relative to that given, as found.
    evenness
        Brightness of every site after the same glow over that of the values, its geometric mean 1,
        shape (P,); 1 if it was not fitted.
    intervals
        Intervals by profile likelihood, where ±σ misses them by more than 20 % or where they were
        asked for, by the names in `covariance_parameters`.
    """

    states: tuple[ExcitedState, ...]
    channel_weights: FloatArray
    channel_weights_sigma: FloatArray
    at_off: tuple[ConcentrationAtOff, ...]
    chi2: float
    dof: int
    covariance: FloatArray
    warnings: tuple[ResultWarning, ...]
    residuals: tuple[FloatArray, ...]
    by_band: BandTests | None
    veil: Measured | None
    lamp_sigma: float
    site_sizes: tuple[float, ...] = ()
    evenness: FloatArray = field(default_factory=lambda: np.ones(1))
    order_gain: float = 0.0
    models: tuple[ExcitationModel, ...] = ()
    layer: LayerEffect | None = None
    intervals: Mapping[str, ProfileInterval] = field(default_factory=dict)

    @property
    def is_first_order(self) -> bool:
        """Whether all states are of first order."""
        return all(state.is_first_order for state in self.states)

    @property
    def are_orders_fitted(self) -> bool:
        """Whether the kinetic orders are parameters of the fit."""
        states, bands = self.k_e().shape
        return bool(len(self.covariance) > states * (2 + bands))

    @property
    def reduced_chi2(self) -> float:
        """χ² per degree of freedom; NaN if there are none."""
        return self.chi2 / self.dof if self.dof > 0 else float("nan")

    @property
    def covariance_parameters(self) -> tuple[str, ...]:
        """Names of the rows of `covariance`.

        They are k_r of all states, amplitudes, k_e of all bands and, where they are fitted, kinetic
        orders.
        """
        states = range(1, len(self.states) + 1)
        bands = range(1, self.k_e().shape[1] + 1)
        orders = states if self.are_orders_fitted else ()
        return (
            *(f"k_r_per_s {state}" for state in states),
            *(f"amplitude_at_full_charge {state}" for state in states),
            *(f"k_e_per_s {state} {band}" for state in states for band in bands),
            *(f"kinetic_order {state}" for state in orders),
        )

    def orders(self) -> FloatArray | None:
        """Return the kinetic orders of all states, shape (N,); None if all are 1."""
        if self.is_first_order:
            return None
        return np.array([state.kinetic_order for state in self.states])

    def relative_k_e(self, number: int) -> tuple[FloatArray, FloatArray]:
        """Return k_e of a state over its largest, and σ, which level and light do not enter, (B,).

        Parameters
        ----------
        number
            Number of the state, from 0.
        """
        states, bands = self.k_e().shape
        rows = 2 * states + number * bands + np.arange(bands)
        k_e = self.states[number].k_e_per_s
        largest = int(np.argmax(k_e))
        relative = k_e / k_e[largest]
        slopes = np.eye(bands)
        slopes[:, largest] -= relative
        of_state = self.covariance[np.ix_(rows, rows)]
        if not np.isfinite(of_state).all():
            return relative, np.where(np.arange(bands) == largest, 0.0, np.inf)
        variance = np.diag(slopes @ of_state @ slopes.T) / k_e[largest] ** 2
        return relative, np.sqrt(np.maximum(variance, 0.0))

    def k_e_range(self, number: int) -> FloatArray:
        """Return least and largest k_e of a state in 1/s by thickness, without σ, shape (2, B).

        Parameters
        ----------
        number
            Number of the state, from 0.
        """
        k_e = self.states[number].k_e_per_s
        return (
            np.stack([k_e, k_e]) if self.layer is None else k_e * self.layer.k_e_factor[:, number]
        )

    def k_e(self) -> FloatArray:
        """Return the excitation rates of all states in 1/s, shape (N, B)."""
        return np.array([state.k_e_per_s for state in self.states])


#: Ratio of the longest to the shortest charge from which an axis is logarithmic.
MANY_TIMES = 20.0


def spans_decades(charge_s: FloatArray) -> bool:
    """Return whether charge durations differ so much that a logarithmic axis suits them.

    Parameters
    ----------
    charge_s
        Duration of each charge in seconds, shape (n,).

    Returns
    -------
    bool
        True if the shortest is above 0 s and the longest is more than 20 times as long.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.results import spans_decades
    >>> spans_decades(np.array([1.0, 10.0, 100.0])), spans_decades(np.array([10.0, 20.0]))
    (True, False)
    """
    low = float(charge_s.min())
    return low > 0 and float(charge_s.max()) > MANY_TIMES * low


@dataclass(frozen=True, eq=False)
class Closure:
    """Measured against predicted levels after n charges; nothing is fitted to them.

    Attributes
    ----------
    charge_s
        Duration of each charge in seconds, corrected for the lamp's transients, shape (n,).
    measured, predicted
        Levels in DN/s, shape (n,).
    sigma
        Standard uncertainty of their difference in DN/s, shape (n,).
    curve_charge_s, curve
        Durations in seconds from the shortest to the longest charge, and predicted levels in DN/s
        after them, shape (m,).
    """

    charge_s: FloatArray
    measured: FloatArray
    sigma: FloatArray
    predicted: FloatArray
    curve_charge_s: FloatArray
    curve: FloatArray

    @property
    def rms_percent(self) -> float:
        """RMS deviation in % of the RMS of the predicted levels."""
        full = max(_rms(self.predicted), np.finfo(float).tiny)
        return 100 * _rms(self.measured - self.predicted) / full

    @property
    def rms_sigma(self) -> float:
        """RMS deviation in σ: about 1 if noise and the uncertainty of the prediction explain it."""
        return _rms((self.measured - self.predicted) / self.sigma)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
