"""Glow of a material over time, from its file."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import (
    DECAY_LAWS,
    Material,
    State,
    becquerel_of,
    exponential_means_and_slopes,
    lit_concentration,
    steady_concentration,
)
from labrig.optics import CHANNELS, CameraResponse

#: Largest number of states that a fit resolves; a file with more approximates a power law.
MAX_STATES = 3


@dataclass(frozen=True, eq=False)
class Glow:
    """Glow of m states with one weight per channel, for given camera settings.

    A state is a_i exp(−k_i t), or of a kinetic order b Becquerel's law of that rate at lamp off.

    Attributes
    ----------
    rate_per_s
        Relative fall of each state at lamp off in 1/s, by descending k_r: k_r, or b k_r r(0)^(b −
        1), shape (m,).
    shape
        (b − 1)/b of each state, 0 of an exponential, shape (m,).
    amplitude
        Amplitudes at lamp off in the brightest channel in DN/s, shape (m,).
    weights
        Weights of the channels by name, maximum 1.
    iso
        Sensitivity of the camera.
    f_number
        Aperture of the camera; None if it is not known.
    """

    rate_per_s: FloatArray
    shape: FloatArray
    amplitude: FloatArray
    weights: Mapping[str, float]
    iso: float
    f_number: float | None

    def at_settings(self, iso: float, f_number: float | None) -> "Glow":
        """Return the glow at other camera settings; an unknown aperture is taken as unchanged."""
        light = 1.0
        if self.f_number is not None and f_number is not None:
            light = (self.f_number / f_number) ** 2
        return replace(
            self,
            amplitude=self.amplitude * light * iso / self.iso,
            iso=iso,
            f_number=f_number,
        )

    def brighter(self, factor: float) -> "Glow":
        """Return the glow with its amplitudes multiplied by `factor`."""
        return replace(self, amplitude=self.amplitude * factor)


def check_states(material: Material) -> None:
    """Refuse a material whose states a decay cannot resolve.

    Raises
    ------
    UsageError
        If it has more states than a fit can resolve, or two with the same rate.
    """
    rates = sorted((state.k_r_per_s for state in material.states), reverse=True)
    if len(rates) > MAX_STATES:
        raise UsageError(
            f"{material.name}: expected at most {MAX_STATES} states, got {len(rates)}; no decay "
            "resolves so many (such a list stands for a power law, which has no rates to "
            "predict)"
        )
    if len(set(rates)) < len(rates):
        raise UsageError(
            f"{material.name}: two states have the same rate, {max(rates):g} /s; join them"
        )


def measured_amplitudes(material: Material) -> FloatArray | None:
    """Return the amplitudes by descending rate in counts, (m,); None if one is missing."""
    amplitudes = [state.amplitude for state in by_falling_rate(material)]
    if any(amplitude is None for amplitude in amplitudes):
        return None
    return np.array(amplitudes, dtype=np.float64) / material.scale_per_count


def by_falling_rate(material: Material) -> Sequence[State]:
    """Return the states in order of descending rate, as in fits."""
    return sorted(material.states, key=lambda state: -state.k_r_per_s)


def laws(material: Material, charge_s: float) -> tuple[FloatArray, FloatArray]:
    """Return rates at lamp off in 1/s and shapes of the states by descending k_r, (m,) each.

    The decay of a kinetic order depends on the charge; `charge_s` is that of `radiated`.
    """
    states = by_falling_rate(material)
    levels = _concentrations(material, charge_s)
    becquerel = [
        becquerel_of(float(level), state.k_r_per_s, state.kinetic_order)
        for state, level in zip(states, levels, strict=True)
    ]
    rate_per_s, shape = np.array(becquerel).T
    return rate_per_s, shape


def radiated(
    material: Material, response: CameraResponse | None, charge_s: float
) -> tuple[FloatArray, dict[str, float]] | None:
    """Return relative amplitudes Λ_i k_r,i r_i(0)ᵇ and channel weights.

    Parameters
    ----------
    material
        Material with its states.
    response
        Spectral responses of the camera; without them there are no weights.
    charge_s
        Duration of the charge in seconds; infinite for a charge to the plateau.

    Returns
    -------
    tuple or None
        Amplitudes by descending rate, shape (m,), and weights by channel; None if Λ of a state is
        not known.
    """
    states = by_falling_rate(material)
    if material.bands_nm is None or any(state.reradiation is None for state in states):
        return None
    edges = np.array(material.bands_nm)
    bands = np.array([state.reradiation for state in states])
    k_r, order = _rates_and_orders(material)
    emitted = bands * (k_r * _concentrations(material, charge_s) ** order)[:, np.newaxis]
    if response is None:
        return emitted @ np.diff(edges), {}
    wavelength = response.wavelength_nm
    band = np.searchsorted(edges, wavelength, side="right") - 1
    inside = (band >= 0) & (band < len(edges) - 1)
    spectra = np.where(inside, emitted[:, np.clip(band, 0, len(edges) - 2)], 0.0)
    values = np.array([response.response(spectrum) for spectrum in spectra])
    total = values.sum(axis=0)
    if not total.max() > 0:
        return None
    weights = dict(zip(CHANNELS, (total / total.max()).tolist(), strict=True))
    return values[:, int(np.argmax(total))], weights


def _concentrations(material: Material, charge_s: float) -> FloatArray:
    """Return the concentrations r(0) of the states, shape (m,).

    They are those of the file, else those that its k_e reach within the charge under spectrally
    even light, else 1 as in Nalbach et al. The irradiance is taken to be equal in all bands, with
    the norm to which the file's k_e belong.
    """
    states = by_falling_rate(material)
    if all(state.r0 is not None for state in states):
        return np.array([state.r0 for state in states], dtype=np.float64)
    norm = material.irradiance_norm
    if norm is None or any(state.k_e_per_s is None for state in states):
        return np.ones(len(states))
    k_e = np.array([state.k_e_per_s for state in states])
    kappa = k_e.sum(axis=1) * norm.value / math.sqrt(k_e.shape[1])
    k_r, order = _rates_and_orders(material)
    if math.isinf(charge_s):
        return steady_concentration(kappa, k_r, order)
    return lit_concentration(0.0, kappa, k_r, order, charge_s)


def _rates_and_orders(material: Material) -> tuple[FloatArray, FloatArray]:
    """Return k_r in 1/s and kinetic orders of the states by descending k_r, (m,) each."""
    states = by_falling_rate(material)
    k_r, order = np.array([(state.k_r_per_s, state.kinetic_order) for state in states]).T
    return k_r, order


BECQUEREL = DECAY_LAWS["becquerel"]


class StateMeans(NamedTuple):
    """Means of m states over n exposures, 1 at lamp off.

    Attributes
    ----------
    value
        Means, shape (n, m).
    slopes
        Derivatives by the logarithm of the rate at lamp off and by the shape, shape (n, m, 2).
    """

    value: FloatArray
    slopes: FloatArray


def state_means(
    rate_per_s: FloatArray, shape: FloatArray, t_s: FloatArray, exposure_s: FloatArray
) -> StateMeans:
    """Return the means of states with these rates at lamp off and shapes (b − 1)/b, (m,) each."""
    value, by_log_rate = exponential_means_and_slopes(rate_per_s, t_s, exposure_s)
    slopes = np.stack([by_log_rate, np.zeros_like(by_log_rate)], axis=2)
    for state in np.flatnonzero(shape):
        rate, exponent = float(rate_per_s[state]), float(shape[state])
        value[:, state], slopes[:, state] = BECQUEREL.means(rate, exponent, t_s, exposure_s)
    return StateMeans(value, slopes)
