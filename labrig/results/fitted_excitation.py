"""Excitation rates of all states and bands, and how well they are known."""

from dataclasses import dataclass

import numpy as np

from labrig.results.measured import BoolArray, FloatArray

#: One-sided 95 %.
UPPER_SIGMAS = 1.645
#: An excitation rate of fewer σ than this is an upper limit.
SEEN_SIGMAS = 2.0


@dataclass(frozen=True, eq=False)
class ExcitedState:
    """One state; σ are standard uncertainties.

    Attributes
    ----------
    k_r_per_s, k_r_sigma_per_s
        Re-radiation rate.
    amplitude, amplitude_sigma
        Λ* k_r: the glow of a fully charged sample, in the brightest channel and the values' unit.
    k_e_per_s, k_e_sigma_per_s
        (B,) per unit of the irradiance that the first series states.
    """

    k_r_per_s: float
    k_r_sigma_per_s: float
    amplitude: float
    amplitude_sigma: float
    k_e_per_s: FloatArray
    k_e_sigma_per_s: FloatArray

    @property
    def seen(self) -> BoolArray:
        """(B,) bool: the band excites; where not, only `k_e_upper_per_s` is known."""
        return self.k_e_per_s > SEEN_SIGMAS * self.k_e_sigma_per_s

    @property
    def k_e_upper_per_s(self) -> FloatArray:
        """(B,) what k_e stays below with 95 % probability."""
        return self.k_e_per_s + UPPER_SIGMAS * self.k_e_sigma_per_s


@dataclass(frozen=True, eq=False)
class LevelAtOff:
    """How charged the states were at a lamp-off, traced back in the dark.

    Attributes
    ----------
    series, charge, site
        Where: name and numbers from 0.
    r0, r0_sigma
        (N,) concentrations.
    amplitude, amplitude_sigma
        (N,) a = Λ* k_r r(0), what the decay from there shows, known better than its factors.
    """

    series: str
    charge: int
    site: int
    r0: FloatArray
    r0_sigma: FloatArray
    amplitude: FloatArray
    amplitude_sigma: FloatArray


@dataclass(frozen=True, eq=False)
class FittedExcitation:
    """Rates of all states and bands, from all series together.

    Attributes
    ----------
    states
        By falling rate.
    channel_weights, channel_weights_sigma
        (C,) the brightest is 1.
    at_off
        Of every series the charge and site that glow most.
    chi2, dof
        Sum of squared whitened residuals, degrees of freedom.
    covariance
        Of the `covariance_parameters`.
    warnings
        What to distrust, and what to do about it.
    residuals
        Of every series (n, P, C) in σ, flicker not taken out.
    """

    states: tuple[ExcitedState, ...]
    channel_weights: FloatArray
    channel_weights_sigma: FloatArray
    at_off: tuple[LevelAtOff, ...]
    chi2: float
    dof: int
    covariance: FloatArray
    warnings: tuple[str, ...]
    residuals: tuple[FloatArray, ...]

    @property
    def reduced_chi2(self) -> float:
        """χ² per degree of freedom."""
        return self.chi2 / self.dof if self.dof > 0 else float("nan")

    @property
    def covariance_parameters(self) -> tuple[str, ...]:
        """Names of the rows of `covariance`: k_r of all states, amplitudes, k_e of all bands."""
        states = range(1, len(self.states) + 1)
        bands = range(1, self.k_e().shape[1] + 1)
        return (
            *(f"k_r_per_s {state}" for state in states),
            *(f"amplitude_at_full_charge {state}" for state in states),
            *(f"k_e_per_s {state} {band}" for state in states for band in bands),
        )

    def k_e(self) -> FloatArray:
        """(N, B) of all states."""
        return np.array([state.k_e_per_s for state in self.states])
