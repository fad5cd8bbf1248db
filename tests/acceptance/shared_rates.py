"""Errors of shared rates and of amplitudes in their σ, over many simulated sets of tables.

    python -m tests.acceptance.shared_rates [--seeds 400]

Means of the squared error over σ² have to lie within 20 % of 1, with their own scatter allowed for;
at 400 seeds that scatter is 7 %. Ends with 1 if one does not.
"""

import argparse
import sys

import numpy as np

from labrig.fit import DecayTable, fit_shared_rates

T_S = np.linspace(0, 60, 60)
RATES = (0.3, 0.04)
#: Amplitudes, offset, noise and stretch of the times of each table.
TABLES = (
    ((100.0, 20.0), 0.0, 1.0, 1.0),
    ((30.0, 80.0), 5.0, 0.5, 1.3),
    ((10.0, 50.0), -3.0, 2.0, 0.7),
)
ALLOWED = 0.2


def squares(seed: int, equal_weights: bool) -> list[float]:
    """Return the squared errors over σ² of both rates and of all amplitudes of one set."""
    rng, tables = np.random.default_rng([41, seed]), []
    for number, ((fast, slow), offset, noise, stretch) in enumerate(TABLES):
        t_s = stretch * T_S
        light = fast * np.exp(-RATES[0] * t_s) + slow * np.exp(-RATES[1] * t_s) + offset
        values = light + noise * rng.standard_normal(len(t_s))
        sigma = np.full_like(t_s, 1.0 if equal_weights else noise)
        tables.append(
            DecayTable(str(number), t_s, np.zeros_like(t_s), values, sigma, offset_sigma=np.inf)
        )
    fit = fit_shared_rates(tables, 2, equal_weights=equal_weights)
    errors = [(rate.value - true) / rate.sigma for rate, true in zip(fit.rates, RATES, strict=True)]
    errors += [
        (state.amplitude - true) / state.amplitude_sigma
        for table, (amplitudes, *_) in zip(fit.tables, TABLES, strict=True)
        for state, true in zip(table.states, amplitudes, strict=True)
    ]
    return [error**2 for error in errors]


def main() -> int:
    """Run the command; its exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.acceptance.shared_rates")
    parser.add_argument("--seeds", type=int, default=400)
    seeds = range(parser.parse_args().seeds)
    fails = False
    for equal_weights in (False, True):
        means = np.mean([squares(seed, equal_weights) for seed in seeds], axis=0)
        scatter = 2 * np.sqrt(2 / len(seeds))
        fails |= bool((np.abs(means - 1) > ALLOWED + scatter).any())
        fails |= bool(abs(means[:2].mean() - 1) > ALLOWED)
        print("equal" if equal_weights else "given", "mean error²/σ²:", means.round(3).tolist())
    return int(fails)


if __name__ == "__main__":
    sys.exit(main())
