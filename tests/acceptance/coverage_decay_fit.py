"""Coverage of the decay fit's uncertainties, and its choices of a model, over many seeds.

    python -m tests.acceptance.coverage_decay_fit [--seeds 500] [--jobs 2] [--case NAME ...]

Prints one line per case; takes about a minute per 500 seeds and processor.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from labrig.fit import DecayFit, fit_decay
from labrig.foundation.arrays import FloatArray
from tests.fit import truths

DOUBLE = ((0.08, 1.0), (0.015, 0.4))
CLOSE = ((0.05, 1.0), (0.02, 1.0))


@dataclass(frozen=True)
class Case:
    """A truth, how it is seen and how it is fitted."""

    name: str
    decay: truths.Decay
    states: tuple[tuple[float, float], ...] = ()
    observation: dict[str, Any] = field(default_factory=dict)
    fit: dict[str, Any] = field(default_factory=lambda: {"flicker": 0.007})


def _states(name: str, states: tuple[tuple[float, float], ...], **fit: Any) -> Case:
    return Case(name, truths.exponentials(*states), states, fit={"flicker": 0.007, **fit})


def _with_dark_errors(
    name: str, states: tuple[tuple[float, float], ...], dark_sigma: float
) -> Case:
    """Each channel's dark level is wrong; the fit knows by about how much, the bound does not."""
    return Case(
        name,
        truths.exponentials(*states),
        states,
        {"dark_sigma": dark_sigma, "snr": 100},
        {"flicker": 0.007, "offset_sigma": dark_sigma},
    )


def _drifting(t: FloatArray) -> FloatArray:
    return truths.exponentials(*DOUBLE)(t) + 0.01 * t / 180


GROWING_S = np.minimum(1.0 * 1.1 ** np.arange(37), 4.5)

CASES = {
    case.name: case
    for case in [
        _states("1 state .02, ρ known", ((0.02, 1.0),)),
        _states("1 state .02, ρ from data", ((0.02, 1.0),), flicker=None),
        _states("1 state .08, ρ known", ((0.08, 1.0),)),
        _states("1 state .08, ρ from data", ((0.08, 1.0),), flicker=None),
        _states("1 state .005, ρ from data", ((0.005, 1.0),), flicker=None),
        _states("1 state .02, ρ = .7 % unsuspected", ((0.02, 1.0),), flicker=0.0),
        _states("2 states .08/.015, n given", DOUBLE, n_states=2),
        _states("2 states .08/.015, n and ρ from data", DOUBLE, flicker=None),
        _states("2 states .05/.02, n and ρ from data", CLOSE, flicker=None),
        _states("2 states .05/.02, ρ known", CLOSE),
        _states("2 states .2/.01, n and ρ from data", ((0.2, 1.0), (0.01, 0.25)), flicker=None),
        _states("2 states .2/.04, n and ρ from data", ((0.2, 1.0), (0.04, 1.0)), flicker=None),
        *(
            Case(
                f"1 state .02, flicker {flicker:g}, ρ from data",
                truths.exponentials((0.02, 1.0)),
                ((0.02, 1.0),),
                {"flicker": flicker},
                {"flicker": None},
            )
            for flicker in (0.0, 0.0005, 0.001, 0.002)
        ),
        Case(
            "2 states .08/.015, no flicker",
            truths.exponentials(*DOUBLE),
            DOUBLE,
            {"flicker": 0.0},
            {"n_states": 2},
        ),
        Case(
            "2 states .08/.015, exposures growing",
            truths.exponentials(*DOUBLE),
            DOUBLE,
            {"exposure_s": GROWING_S},
        ),
        Case(
            "2 states .08/.015, flicker heavy-tailed",
            truths.exponentials(*DOUBLE),
            DOUBLE,
            {"heavy_tails": True},
            {"flicker": None},
        ),
        _states("3 states .2/.05/.01", ((0.2, 1.0), (0.05, 0.5), (0.01, 0.2))),
        _with_dark_errors("1 state .02, dark ± .1 %", ((0.02, 1.0),), 0.001),
        _with_dark_errors("1 state .02, dark ± .4 %", ((0.02, 1.0),), 0.004),
        _with_dark_errors("1 state .08, dark ± .4 %", ((0.08, 1.0),), 0.004),
        _with_dark_errors("2 states .08/.015, dark ± .4 %", DOUBLE, 0.004),
        Case("power law τ 3, p 1.2", truths.power_law(3, 1.2)),
        Case("power law τ 3, p 1.2, ρ from data", truths.power_law(3, 1.2), fit={"flicker": None}),
        Case("power law τ 10, p 1.5", truths.power_law(10, 1.5)),
        Case("power law τ 1, p 1", truths.power_law(1, 1.0), fit={"flicker": None}),
        Case("stretched τ 20, β .5", truths.stretched(20, 0.5)),
        Case(
            "stretched τ 20, β .5, n = 2",
            truths.stretched(20, 0.5),
            fit={"flicker": 0.007, "n_states": 2},
        ),
        Case("background drifting by 1 %", _drifting),
    ]
}


def fit_case(name: str, seed: int) -> tuple[DecayFit, truths.Observed]:
    """One simulated measurement and its fit."""
    case = CASES[name]
    seen = truths.observe(case.decay, seed, **case.observation)
    fit = fit_decay(
        seen.t_s, seen.values, seen.sigma, exposure_s=seen.exposure_s, channels="RGB", **case.fit
    )
    return fit, seen


def report(case: Case, fits: list[tuple[DecayFit, truths.Observed]]) -> str:
    """Shares of choices and warnings; pulls, coverage and efficiency where the truth has rates."""
    found = np.array([fit.n_states for fit, _ in fits])
    power_law, stretched = (
        np.mean([fit.law == name for fit, _ in fits]) for name in ("becquerel", "stretched")
    )
    warned = np.mean([bool(fit.warnings) for fit, _ in fits])
    fractions = [100 * np.mean(found == n) for n in (1, 2, 3)]
    text = (
        f"{case.name:42s} n = 1, 2, 3: {' '.join(f'{fraction:5.1f}' for fraction in fractions)} %  "
        f"power law {100 * power_law:.1f} %  stretched {100 * stretched:.1f} %  "
        f"warned {100 * warned:5.1f} %  ρ {100 * np.mean([fit.flicker for fit, _ in fits]):.2f} %"
    )
    right = [fit for fit, _ in fits if fit.n_states == len(case.states)]
    if not right:
        return text
    truth = np.array([k for k, _ in case.states])
    rates = np.array([[state.k_r_per_s for state in fit.states] for fit in right])
    sigma = np.array([[state.k_r_per_s_sigma for state in fit.states] for fit in right])
    pulls = (rates - truth) / sigma
    flicker = case.observation.get("flicker", 0.007)
    bound = truths.fisher_rate_sigma(case.states, fits[0][1], flicker)
    with np.printoptions(precision=2, suppress=True):
        return text + (
            f"\n{'':12s}pull mean {pulls.mean(0)} sd {pulls.std(0)} max {np.abs(pulls).max():.1f}  "
            f"within σ {100 * np.mean(np.abs(pulls) < 1):.0f} %, 2σ "
            f"{100 * np.mean(np.abs(pulls) < 2):.0f} %  bound/k {100 * bound / truth} %  "
            f"scatter/bound {rates.std(0) / bound}  σ/bound {np.median(sigma, 0) / bound}"
        )


def main() -> None:
    """Run every case and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=500)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--case", nargs="*", default=[""], help="the beginning of their names; all")
    asked = parser.parse_args()
    with ProcessPoolExecutor(asked.jobs) as pool:
        for case in CASES.values():
            if case.name.startswith(tuple(asked.case)):
                seeds = range(asked.seeds)
                fits = list(pool.map(partial(fit_case, case.name), seeds, chunksize=10))
                print(report(case, fits), flush=True)


if __name__ == "__main__":
    main()
