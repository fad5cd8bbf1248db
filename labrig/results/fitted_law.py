"""Fitted laws of decay that are no sum of a few exponentials, and their table."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.number_format import aligned, rounded
from labrig.foundation.quantity import duration_text
from labrig.material import DECAY_LAWS, exponential_means
from labrig.results.measured import (
    ONE_SIDED_SIGMAS,
    Measured,
    OneSided,
    measured_number,
    with_uncertainty,
)

#: Names of the sums of exponentials among the laws: a few, and a smooth spectrum of many.
EXPONENTIALS, RATE_SPECTRUM = "exponentials", "rate-spectrum"
#: Name of the choice by the data.
AUTO = "auto"
#: Names of the laws that a decay can be fitted with.
LAW_NAMES = (EXPONENTIALS, *DECAY_LAWS, RATE_SPECTRUM)
#: What can be asked for.
LAW_CHOICES = (*LAW_NAMES, AUTO)
#: Name of each law in sentences.
LAW_LABELS = {
    EXPONENTIALS: "exponentials",
    **{law.name: law.label for law in DECAY_LAWS.values()},
    RATE_SPECTRUM: "smooth spectrum of rates",
}


#: Symbols and units of the parameters of laws; τ belongs to the charge.
LAW_SYMBOLS = {
    "decay_time_s": ("τ", "s"),
    "exponent": ("exponent", ""),
    "kinetic_order": ("b", ""),
    "retrapping": ("retrapping", ""),
}


def parameter_text(name: str, number: str) -> str:
    """Return the text of a parameter of `FittedDecay.parameters`, for a line of several.

    Parameters
    ----------
    name
        Name of the parameter.
    number
        Its value with σ, or its limit, as text.

    Returns
    -------
    str
        Symbol, value and unit; of a rate the value.

    Examples
    --------
    >>> from labrig.results import parameter_text
    >>> parameter_text("decay_time_s", "12.3(4)"), parameter_text("k_r_per_s 1", "0.0500(3)")
    ('τ = 12.3(4) s', '0.0500(3)')
    """
    if name not in LAW_SYMBOLS:
        return number
    symbol, unit = LAW_SYMBOLS[name]
    is_limit = number[:1] in ("<", ">")
    return f"{symbol} {'' if is_limit else '= '}{number} {unit}".rstrip()


#: Symbols and units of quantities that each state has.
STATE_SYMBOLS = {"k_r_per_s": ("k", "s⁻¹"), "lifetime_s": ("1/k", "s")}


def interval_name(name: str) -> str:
    """Return the head of the row of `FittedDecay.intervals` in a table.

    Parameters
    ----------
    name
        Name of the parameter, with the number of its state.

    Returns
    -------
    str
        Symbol, number of the state and unit.

    Examples
    --------
    >>> from labrig.results import interval_name
    >>> interval_name("lifetime_s 2"), interval_name("exponent")
    ('1/k 2 / s', 'exponent')
    """
    quantity, _, state = name.partition(" ")
    symbol, unit = (STATE_SYMBOLS | LAW_SYMBOLS)[quantity]
    label = f"{symbol} {state}".rstrip()
    return f"{label} / {unit}" if unit else label


def require_law(name: str) -> None:
    """Refuse what is no name of a law, nor `auto`.

    Parameters
    ----------
    name
        Name of a law as on a command line.

    Raises
    ------
    UsageError
        There is no such law.

    Examples
    --------
    >>> from labrig.results import require_law
    >>> require_law("becquerel")
    """
    if name not in LAW_CHOICES:
        raise UsageError(f"--law: expected one of {', '.join(LAW_CHOICES)}, got '{name}'")


@dataclass(frozen=True, eq=False)
class FittedLaw:
    """A law of `labrig.material.DECAY_LAWS`, fitted to a decay.

    Attributes
    ----------
    name
        Name of the law.
    amplitude, rate_per_s, shape
        Signal at lamp off in the brightest channel, in the unit of the values, rate in 1/s and
        shape, as `labrig.material.DECAY_LAWS` defines them. All are of *this* charge.
    covariance
        Covariance of amplitude, rate, shape and the offset of the brightest channel, shape (4, 4);
        inf where undetermined.
    channel_weights, offsets
        Weights of the channels, whose maximum is 1, and their offsets.
    reduced_chi2, bic
        χ² per degree of freedom, NaN if there are none, and Bayesian information criterion.
    """

    name: str
    amplitude: float
    rate_per_s: float
    shape: float
    covariance: FloatArray
    channel_weights: tuple[float, ...]
    offsets: tuple[float, ...]
    reduced_chi2: float
    bic: float

    @property
    def parameters(self) -> dict[str, Measured]:
        """The law's own parameters by name; those that the data leave open are missing.

        Of Becquerel's law `decay_time_s` τ, `exponent` p and, for p > 1, `kinetic_order` b; of one
        trap `decay_time_s` 1/k, that of the light at lamp off, and `retrapping`; of a stretched
        exponential `decay_time_s` τ and `exponent` β. What a bound of the law holds is one-sided.
        """
        _, rate_sigma, shape_sigma, _ = np.sqrt(np.diag(self.covariance))
        shape = Measured(self.shape, float(shape_sigma))
        if shape_sigma > 0 and self.shape in DECAY_LAWS[self.name].shapes:
            is_upper = self.shape == DECAY_LAWS[self.name].shapes[1]
            shape = OneSided.held(self.shape, float(shape_sigma), 0.0, is_upper=is_upper)
        time = Measured(1 / self.rate_per_s, float(rate_sigma) / self.rate_per_s**2, "s")
        law = DECAY_LAWS[self.name]
        if not law.has_states:
            # A shape without σ is held at the exponential: it is not determined.
            return {"decay_time_s": time} | ({law.shape_name: shape} if shape_sigma else {})
        if self.shape == 0:
            # An exponential: p has no upper limit, b = 1/(1 − 1/p) has one.
            return {"decay_time_s": time, "kinetic_order": _held_at_first_order(shape)}
        if self.shape <= shape_sigma:
            # Nothing tells it from an exponential: the exponent has no upper limit.
            return {}
        exponent = Measured(1 / self.shape, float(shape_sigma) / self.shape**2)
        tau_s = 1 / (self.shape * self.rate_per_s)
        by_parameters = -tau_s * np.array([1 / self.rate_per_s, 1 / self.shape])
        variance = float(by_parameters @ self.covariance[1:3, 1:3] @ by_parameters)
        own = {"decay_time_s": Measured(tau_s, math.sqrt(variance), "s"), "exponent": exponent}
        if self.shape < 1:
            slope = 1 / (1 - self.shape) ** 2
            own["kinetic_order"] = Measured(1 / (1 - self.shape), slope * float(shape_sigma))
        return own

    @property
    def formula(self) -> str:
        """Formula of the signal, 1 at lamp off, with its numbers."""
        return DECAY_LAWS[self.name].formula(self.rate_per_s, self.shape)

    def signal(
        self, t_s: FloatArray, exposure_s: FloatArray, *, with_offset: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Return the signal in the brightest channel and its variance, (n,) each.

        Parameters
        ----------
        t_s, exposure_s
            Begin after the law's and length of the exposures in seconds, shape (n,); before it, the
            signal is taken to be that at its start.
        with_offset
            Whether the offset of the channel is a part of it.
        """
        t_s = np.maximum(t_s, 0.0)
        means, slopes = DECAY_LAWS[self.name].means(self.rate_per_s, self.shape, t_s, exposure_s)
        by_rate = self.amplitude * slopes[:, 0] / self.rate_per_s
        jacobian = np.stack([means, by_rate, self.amplitude * slopes[:, 1]], axis=1)
        return _signal(self, self.amplitude * means, jacobian, with_offset=with_offset)

    def to_dict(self) -> dict[str, Any]:
        """Return the content for `fit.json`."""
        return {
            "name": self.name,
            "amplitude": self.amplitude,
            "rate_per_s": self.rate_per_s,
            "shape": self.shape,
            "covariance": self.covariance.tolist(),
            "parameters": {
                name: measured_number(measured) for name, measured in self.parameters.items()
            },
            "channel_weights": list(self.channel_weights),
            "offsets": list(self.offsets),
            "reduced_chi2": self.reduced_chi2,
            "bic": self.bic,
        }


@dataclass(frozen=True, eq=False)
class FittedRateSpectrum:
    """A smooth non-negative spectrum of rates, Σ_i a_i e^(−k_i t) on a grid of k.

    Attributes
    ----------
    rates_per_s, amplitudes
        Rates of the grid in 1/s, rising, and amplitude ≥ 0 of each at lamp off in the brightest
        channel, shape (m,).
    covariance
        Covariance of the amplitudes, those that vanish being held, and of the offset of the
        brightest channel, shape (m + 1, m + 1).
    n_parameters
        Effective number of parameters, by the trace of the smoothed fit's hat matrix.
    channel_weights, offsets, reduced_chi2, bic
        As of `FittedLaw`.
    """

    rates_per_s: FloatArray
    amplitudes: FloatArray
    covariance: FloatArray
    n_parameters: float
    channel_weights: tuple[float, ...]
    offsets: tuple[float, ...]
    reduced_chi2: float
    bic: float
    name: str = RATE_SPECTRUM

    @property
    def formula(self) -> str:
        """Range of the lifetimes that make up nine tenths of the signal at lamp off."""
        total = np.cumsum(self.amplitudes) / self.amplitudes.sum()
        fast, slow = (float(np.interp(part, total, self.rates_per_s)) for part in (0.95, 0.05))
        return f"lifetimes from {1 / fast:.2g} s to {1 / slow:.2g} s"

    def signal(
        self, t_s: FloatArray, exposure_s: FloatArray, *, with_offset: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Return the signal and its variance; see `FittedLaw.signal`."""
        means = exponential_means(self.rates_per_s, t_s, exposure_s)
        return _signal(self, means @ self.amplitudes, means, with_offset=with_offset)

    def to_dict(self) -> dict[str, Any]:
        """Return the content for `fit.json`."""
        return {
            "rates_per_s": self.rates_per_s.tolist(),
            "amplitudes": self.amplitudes.tolist(),
            "covariance": self.covariance.tolist(),
            "n_parameters": self.n_parameters,
            "channel_weights": list(self.channel_weights),
            "offsets": list(self.offsets),
            "reduced_chi2": self.reduced_chi2,
            "bic": self.bic,
        }


def _signal(
    law: FittedLaw | FittedRateSpectrum,
    decay: FloatArray,
    jacobian: FloatArray,
    *,
    with_offset: bool,
) -> tuple[FloatArray, FloatArray]:
    """Return a decay (n,) with derivatives (n, p), maybe with the offset, and its variance."""
    offset = law.offsets[int(np.argmax(law.channel_weights))] if with_offset else 0.0
    by_offset = np.full(len(decay), float(with_offset))
    variance = curve_variance(np.column_stack([jacobian, by_offset]), law.covariance)
    return decay + offset, variance


def _held_at_first_order(shape: Measured) -> Measured:
    """Return the kinetic order b = 1/(1 − g) of the shape g = 0; it is held where g is."""
    if not isinstance(shape, OneSided):
        return Measured(1.0, 0.0)
    order = 1 / (1 - shape.limit) if shape.limit < 1 else math.inf
    return OneSided(1.0, (order - 1) / ONE_SIDED_SIGMAS, limit=order)


def fitted_law(content: Mapping[str, Any]) -> FittedLaw:
    """Return a law from the content of `fit.json`."""
    own = {key: value for key, value in content.items() if key != "parameters"}
    return FittedLaw(**_arrays(own, "covariance"))


def fitted_rate_spectrum(content: Mapping[str, Any]) -> FittedRateSpectrum:
    """Return a spectrum of rates from the content of `fit.json`."""
    return FittedRateSpectrum(**_arrays(content, "rates_per_s", "amplitudes", "covariance"))


def _arrays(content: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """Return fields with arrays under some names; null is infinite, and no reduced χ² is NaN."""
    infinite = {name: np.array(content[name], dtype=object) for name in names}
    arrays = {
        name: np.where(values == None, np.inf, values).astype(np.float64)  # noqa: E711
        for name, values in infinite.items()
    }
    chi2 = content["reduced_chi2"]
    return {
        **content,
        **arrays,
        "channel_weights": tuple(content["channel_weights"]),
        "offsets": tuple(content["offsets"]),
        "reduced_chi2": math.nan if chi2 is None else float(chi2),
    }


def curve_variance(jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the variance of values (n,) with derivatives (n, p); inf if one is undetermined."""
    if not np.isfinite(covariance).all():
        return np.full(len(jacobian), np.inf)
    variance: FloatArray = np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian)
    return np.maximum(variance, 0.0)


@dataclass(frozen=True, eq=False)
class DecayForecast:
    """Signal of a decay at times that need not have been measured, averaged over its laws.

    Attributes
    ----------
    t_s
        Start of the exposures in seconds after lamp off, shape (n,).
    value, sigma
        Signal in the brightest channel without offset, and its σ with the differences of the laws
        in it, shape (n,). Beyond three times the last measured time both are NaN.
    low, high
        Least and largest signal of the laws that describe the data, shape (n,).
    """

    t_s: FloatArray
    value: FloatArray
    sigma: FloatArray
    low: FloatArray
    high: FloatArray

    def __str__(self) -> str:
        """Return a table for people, with brackets alone where there is no σ."""
        rows = [
            [
                duration_text(float(t_s)),
                "–" if np.isnan(value) else with_uncertainty(float(value), float(sigma)),
                f"{rounded(float(low), 3)} to {rounded(float(high), 3)}",
            ]
            for t_s, value, sigma, low, high in zip(
                self.t_s, self.value, self.sigma, self.low, self.high, strict=True
            )
        ]
        return "\n".join(aligned([["time", "signal", "by the laws that fit"], *rows]))
