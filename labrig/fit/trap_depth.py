"""Depth of a trap, from decay rates at several temperatures (Arrhenius' law)."""

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from labrig.foundation.errors import FitError
from labrig.foundation.quantity import BOLTZMANN_EV_PER_K, ZERO_C_K
from labrig.foundation.result_warning import Contradiction, Misfit, ResultWarning
from labrig.results import Measured, TrapDepth

#: Span of the temperatures that tells a depth, in K.
MIN_SPAN_K = 2.0
#: Probability of χ² below which one depth does not describe the rates.
MISSED = 0.01
#: Frequency factors that lattices have, in 1/s: those of their phonons, and some orders below.
FREQUENCIES = (1e6, 1e16)
#: Alternations of the depth and of the weights that depend on it.
ALTERNATIONS = 6


def fit_trap_depth(
    temperature_c: ArrayLike,
    rate_per_s: ArrayLike,
    rate_per_s_sigma: ArrayLike,
    *,
    temperature_sigma_k: float = 0.3,
) -> TrapDepth:
    """Fit k = s exp(−E / k_B T) to the rates of a state of first order.

    It is a line in 1/T whose weights hold the errors of rates and temperatures (effective variance;
    J. Orear, Am. J. Phys. 50, 1982).

    Parameters
    ----------
    temperature_c
        Temperatures of the sample in °C, shape (n,), n ≥ 2, in any order.
    rate_per_s, rate_per_s_sigma
        Rates and their σ in 1/s, > 0, shape (n,).
    temperature_sigma_k
        Standard uncertainty of each temperature in K, independent of the others, ≥ 0.

    Returns
    -------
    TrapDepth
        Depth in eV, logarithm of the frequency factor, and how well one depth describes the rates.

    Raises
    ------
    FitError
        There are fewer than two temperatures, they span less than 2 K, or rates are not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import fit_trap_depth
    >>> rates = np.array([0.0300, 0.0478, 0.0737])
    >>> found = fit_trap_depth([15, 21, 27], rates, 0.01 * rates, temperature_sigma_k=0.1)
    >>> print(found.depth_ev)
    0.558(11) eV
    """
    celsius, rate, sigma = (
        np.asarray(each, dtype=np.float64) for each in (temperature_c, rate_per_s, rate_per_s_sigma)
    )
    if not celsius.shape == rate.shape == sigma.shape or celsius.ndim != 1 or celsius.size < 2:
        raise FitError(
            "expected the rate and its σ at two temperatures or more, got "
            f"{len(celsius)} of a temperature, {len(rate)} of a rate and {len(sigma)} of a σ; "
            "measure the decay at another temperature, and name that run, too"
        )
    order = np.argsort(celsius, kind="stable")
    celsius, rate, sigma = celsius[order], rate[order], sigma[order]
    if not (np.isfinite(celsius).all() and celsius[0] > -ZERO_C_K and temperature_sigma_k >= 0):
        raise FitError(
            "expected temperatures above −273.15 °C and their σ ≥ 0, got "
            f"{', '.join(f'{each:g}' for each in celsius)} °C and {temperature_sigma_k:g} K"
        )
    is_usable = np.isfinite(rate) & np.isfinite(sigma) & (rate > 0) & (sigma > 0)
    if not is_usable.all():
        place = int(np.argmin(is_usable))
        raise FitError(
            f"expected rates and σ above 0, got {rate[place]:g} ± {sigma[place]:g} 1/s at "
            f"{celsius[place]:g} °C; leave that one out"
        )
    if np.ptp(celsius) < MIN_SPAN_K:
        raise FitError(
            f"expected temperatures that differ by {MIN_SPAN_K:g} K or more, got "
            f"{celsius[0]:.1f} °C to {celsius[-1]:.1f} °C; heat or cool the sample"
        )
    kelvin = celsius + ZERO_C_K
    inverse_ev = -1 / (BOLTZMANN_EV_PER_K * kelvin)
    depth = 0.0
    for _ in range(ALTERNATIONS):
        by_temperature = depth / (BOLTZMANN_EV_PER_K * kelvin**2) * temperature_sigma_k
        weight = 1 / ((sigma / rate) ** 2 + by_temperature**2)
        middle = float(np.average(inverse_ev, weights=weight))
        level = float(np.average(np.log(rate), weights=weight))
        information = float(weight @ (inverse_ev - middle) ** 2)
        depth = float(weight @ ((inverse_ev - middle) * (np.log(rate) - level))) / information
    residual = np.log(rate) - level - depth * (inverse_ev - middle)
    chi2, dof = float(weight @ residual**2), len(rate) - 2
    depth_sigma, level_sigma = information**-0.5, float(weight.sum()) ** -0.5
    log10_frequency = Measured(
        (level - depth * middle) / math.log(10),
        math.hypot(level_sigma, middle * depth_sigma) / math.log(10),
    )
    p_value = float(chdtrc(dof, chi2)) if dof > 0 else math.nan
    return TrapDepth(
        temperature_c=celsius,
        rate_per_s=rate,
        rate_per_s_sigma=sigma,
        temperature_sigma_k=temperature_sigma_k,
        depth_ev=Measured(depth, depth_sigma, "eV"),
        log10_frequency=log10_frequency,
        log_rate=Measured(level, level_sigma),
        reference_c=-1 / (BOLTZMANN_EV_PER_K * middle) - ZERO_C_K,
        chi2=chi2,
        dof=dof,
        p_value=p_value,
        warnings=tuple(_warnings(depth, depth_sigma, log10_frequency, p_value)),
    )


def _warnings(
    depth_ev: float, sigma_ev: float, log10_frequency: Measured, p_value: float
) -> list[ResultWarning]:
    """Return warnings that contradict one depth, or thermal release."""
    if depth_ev < 2 * sigma_ev:
        return [
            Misfit(
                "rates-not-thermal",
                "the rates do not rise with temperature (E = {depth}): traps are not emptied by "
                "heat, or the thermometer is not at the sample",
                depth=Measured(depth_ev, sigma_ev, "eV"),
            )
        ]
    warnings: list[ResultWarning] = []
    if p_value < MISSED:
        warnings.append(
            Misfit(
                "depth-misfit",
                "a single depth does not describe these rates (p = {p_value:.1g}): there are "
                "several traps, or the temperature is not that of the sample; measure at more "
                "temperatures",
                p_value=p_value,
            )
        )
    low, high = (math.log10(each) for each in FREQUENCIES)
    beyond = max(low - log10_frequency.value, log10_frequency.value - high)
    if beyond > 2 * log10_frequency.sigma:
        warnings.append(
            Contradiction(
                "frequency-unphysical",
                "the frequency factor 10^{log10_frequency} 1/s is none of a lattice "
                "(10^{log10_low:.0f} to 10^{log10_high:.0f} 1/s): the temperature may not be that "
                "of the sample, or several traps look like a single trap",
                log10_frequency=log10_frequency,
                log10_low=low,
                log10_high=high,
            )
        )
    return warnings
