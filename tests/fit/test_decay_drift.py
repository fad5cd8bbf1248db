"""Effect of a rate that drifts on a fit with constant rates, against decays integrated with it."""

import numpy as np
import pytest

from labrig.fit import fit_decay

T_S, EXPOSURE_S = np.arange(1.0, 180.0, 5.0), 1.0
STEPS = 200


def drifting(rates_per_s: list[float], gamma_per_s: float) -> np.ndarray:
    """Signal of equal states whose rates grow as 1 + γ t, averaged over each exposure, (n,)."""
    time = T_S[:, None] + EXPOSURE_S * (np.arange(STEPS) + 0.5) / STEPS
    growth = 1 + gamma_per_s * time
    phase = time + gamma_per_s * time**2 / 2
    glow = sum(1000.0 * growth * np.exp(-rate * phase) for rate in rates_per_s)
    return np.asarray(np.mean(glow, axis=1))


@pytest.mark.parametrize("rates_per_s", [[0.05], [0.14, 0.027]])
def test_results_move_with_a_drift_as_it_is_stated(rates_per_s: list[float]) -> None:
    gamma_per_s = 2e-5
    fits = [
        fit_decay(
            T_S,
            drifting(rates_per_s, gamma),
            np.sqrt(drifting(rates_per_s, 0.0) / 100) + 0.3,
            exposure_s=EXPOSURE_S,
            n_states=len(rates_per_s),
        )
        for gamma in (0.0, gamma_per_s)
    ]
    found, moved = (
        np.array([[state.k_r_per_s, state.amplitude] for state in fit.states]) for fit in fits
    )
    assert moved / found - 1 == pytest.approx(fits[0].drift_effect_s * gamma_per_s, rel=0.03)


def test_a_rate_that_is_held_does_not_move() -> None:
    values, sigma = drifting([0.05], 0.0), np.ones(len(T_S))
    fit = fit_decay(T_S, values, sigma, exposure_s=EXPOSURE_S, fixed_rates=[0.05])
    assert fit.drift_effect_s[0, 0] == 0.0
    assert fit.drift_effect_s[0, 1] != 0.0
