"""Errors of decay fits in units of their σ, and laws taken for each other, over many seeds.

    python -m tests.acceptance.decay_coverage [--seeds 100] [--jobs 2] [--table NAME ...]

Prints three tables: pulls of the parameters where the truth is resolved (rms 0.95 to 1.05, none
beyond 4.5), which law is taken for which (right in 90 %, wrong without a word in 2 %), and what a
fast state that the timing hardly resolves does to the others. Every fit has a seed of its own.
"""

import argparse
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from labrig.fit import DecayFit, fit_decay
from labrig.foundation.arrays import FloatArray
from labrig.material import DECAY_LAWS
from tests.fit import truths
from tests.warned import codes

#: Frames every 1.5 s for a minute, then every 12 s: they resolve three states.
DENSE_S = np.concatenate([0.3 + 1.5 * np.arange(40), 66.0 + 12.0 * np.arange(20)])


@dataclass(frozen=True)
class Truth:
    """A decay, its rates or its law's rate and shape, and the laws and numbers that are right."""

    name: str
    decay: truths.Decay
    parameters: tuple[float, ...]
    right: tuple[str, ...]
    n_states: int = 0
    is_dense: bool = False
    flicker: float | None = None


def exponentials(
    *states: tuple[float, float], dense: bool = False, flicker: float | None = None
) -> Truth:
    """Return a sum of exponentials (k, a)."""
    rates = tuple(k for k, _ in states)
    name = f"{len(states)} state{'s' if len(states) > 1 else ''} " + "/".join(
        f"{k:.2g}" for k in rates
    )
    decay = truths.exponentials(*states)
    if dense:
        name += ", dense"
        return Truth(name, decay, rates, ("exponentials",), len(states), True, flicker)
    return Truth(name, decay, rates, ("exponentials",), len(states), flicker=flicker)


def law(name: str, rate_per_s: float, shape: float, label: str, *right: str) -> Truth:
    """Return a law of `labrig.material.DECAY_LAWS` with its rate and shape."""

    def decay(t: FloatArray) -> FloatArray:
        return DECAY_LAWS[name].value(rate_per_s * t, np.full_like(t, shape))

    return Truth(label, decay, (rate_per_s, shape), (name, *right))


def general_order(b: float) -> Truth:
    """Return (1 + t/10 s)^(−p), p = b/(b − 1)."""
    p = b / (b - 1)
    return law("becquerel", p / 10, 1 / p, f"general order b = {b:g}", "otor")


def one_trap(r: float) -> Truth:
    """Return the decay of one filled trap with the retrapping ratio R."""
    return law("otor", 0.05, r, f"one trap R = {r:g}", "becquerel")


DOUBLE = ((0.08, 1.0), (0.015, 0.4))
RESOLVED = (
    exponentials((0.02, 1.0)),
    exponentials((0.02, 1.0), flicker=0.007),
    exponentials(*DOUBLE),
    exponentials(*DOUBLE, flicker=0.007),
    exponentials((0.3, 1.0), (0.06, 0.6), (0.01, 0.3), dense=True),
    law("becquerel", 0.05, 0.5, "general order b = 2, its own law"),
    law("becquerel", 0.1, 1 / 3, "general order b = 1.5, its own law"),
)
LAWS = (
    exponentials((0.05, 1.0), (0.02, 0.4)),
    exponentials((0.08, 1.0), (0.016, 0.4)),
    exponentials((0.2, 1.0), (0.01, 0.2)),
    general_order(1.5),
    general_order(2.0),
    general_order(3.0),
    one_trap(0.1),
    one_trap(0.5),
)
#: Two states beside which a third one has a lifetime of 2 s, and the share of its amplitude.
HIDING = (((0.2, 1.0), (0.02, 0.3)), ((0.1, 1.0), (0.02, 0.5)), DOUBLE, ((0.05, 1.0), (0.01, 0.4)))
SHARES = (0.0, 0.04, 0.08, 0.15)
HIDDEN_RATE = 0.5


def fit(truth: Truth, seed: int) -> DecayFit:
    """Return the fit of one simulated measurement."""
    t_s, exposure_s = (DENSE_S, 0.5) if truth.is_dense else (truths.TIMES_S, 1.5)
    seen = truths.observe(truth.decay, seed, t_s=t_s, exposure_s=exposure_s)
    return fit_decay(
        seen.t_s,
        seen.values,
        seen.sigma,
        exposure_s=seen.exposure_s,
        channels="RGB",
        flicker=truth.flicker,
    )


def pulls(truth: Truth, fits: Iterable[DecayFit]) -> FloatArray:
    """Return (found − true)/σ of rates, or of a law's rate and shape, where the model is right."""
    if truth.n_states == 0:
        own = [next(one for one in each.laws if one.name == truth.right[0]) for each in fits]
        found = np.array([[one.rate_per_s, one.shape] for one in own])
        sigma = np.array([np.sqrt(np.diag(one.covariance))[1:3] for one in own])
    else:
        states = [each.states for each in fits if each.n_states == truth.n_states]
        found = np.array([[state.k_r_per_s for state in each] for each in states])
        sigma = np.array([[state.k_r_per_s_sigma for state in each] for each in states])
    return np.asarray((found - truth.parameters) / sigma)


def pulls_line(truth: Truth, fits: list[DecayFit]) -> str:
    """Return one line of the table of pulls."""
    z = pulls(truth, fits)
    warned = np.mean([bool(each.warnings) for each in fits])
    return (
        f"{truth.name:36s} ρ {'from data' if truth.flicker is None else 'given':9s}"
        f"{z.size:6d} pulls  rms {np.sqrt(np.mean(z**2)):.2f}  mean {z.mean():+.2f}  "
        f"furthest {np.abs(z).max():.1f}  other model {100 * (1 - len(z) / len(fits)):.1f} %  "
        f"warned {100 * warned:.1f} %"
    )


def is_right(truth: Truth, each: DecayFit) -> bool:
    """Return whether the law that was taken, and the number of exponentials, are right."""
    return each.law in truth.right and truth.n_states in (0, each.n_states)


def laws_line(truth: Truth, fits: list[DecayFit]) -> str:
    """Return one line of the table of laws."""
    right = np.array([is_right(truth, each) for each in fits])
    silent = np.array([not each.warnings for each in fits]) & ~right
    told = np.array(["laws-tied" in codes(each.warnings) for each in fits])
    taken = Counter(
        f"{each.n_states} exp" if each.law == "exponentials" else each.law for each in fits
    )
    return (
        f"{truth.name:24s} right {100 * right.mean():5.1f} %  wrong without a word "
        f"{100 * silent.mean():4.1f} %  tie said {100 * told.mean():4.1f} %  "
        + ", ".join(f"{name} {100 * n / len(fits):.0f} %" for name, n in taken.most_common())
    )


def hidden_truth(states: tuple[tuple[float, float], ...], share: float) -> Truth:
    """Return states beside which one of a lifetime of 2 s has a share of all amplitudes."""
    if share == 0:
        return exponentials(*states)
    amplitude = share / (1 - share) * sum(a for _, a in states)
    return exponentials((HIDDEN_RATE, amplitude), *states)


def hidden_line(truth: Truth, share: float, fits: list[DecayFit]) -> str:
    """Return one line of the table of hidden states: the slow rates' pulls, and what is said."""
    off = [_off_and_stated(truth, each) for each in fits]
    worst = np.array([z.max() for z, _ in off])
    beyond_stated = np.array([(z - stated).max() for z, stated in off])
    stated_limit = np.array([stated.max() for _, stated in off])
    warned = np.array([bool(each.warnings) for each in fits])
    numbers = Counter(each.n_states for each in fits)
    return (
        f"{truth.name:26s} share {100 * share:3.0f} %  > 3 σ {100 * np.mean(worst > 3):5.1f} %  "
        f"without a warning {100 * np.mean((worst > 3) & ~warned):5.1f} %  nor within what is "
        f"stated {100 * np.mean((beyond_stated > 3) & ~warned):4.1f} % (median "
        f"{np.median(stated_limit):.1f} σ)  furthest "
        f"{worst.max():4.1f}  warned {100 * warned.mean():5.1f} %  states "
        + ", ".join(f"{n}: {numbers[n]}" for n in sorted(numbers))
    )


def _off_and_stated(truth: Truth, each: DecayFit) -> tuple[FloatArray, FloatArray]:
    """Return errors of the slow rates, and what an unseen state is said to change, both in σ."""
    rates = np.array([(state.k_r_per_s, state.k_r_per_s_sigma) for state in each.states])
    unseen = each.unseen_state
    changes = np.zeros(each.n_states) if unseen is None else np.abs(unseen.rate_changes)
    off = np.abs(rates[:, 0] - truth.parameters[-each.n_states :])
    return off / rates[:, 1], changes * rates[:, 0] / rates[:, 1]


#: All truths: they hold functions, which other processes find here by their place.
HIDDEN = tuple((hidden_truth(states, share), share) for states in HIDING for share in SHARES)
TRUTHS = (*RESOLVED, *LAWS, *(truth for truth, _ in HIDDEN))


def _fit_of(place: int, seed: int) -> DecayFit:
    return fit(TRUTHS[place], seed)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--table", nargs="*", default=["pulls", "laws", "hidden"])
    asked = parser.parse_args()
    with ProcessPoolExecutor(asked.jobs) as pool:

        def fits(truth: Truth) -> list[DecayFit]:
            place = TRUTHS.index(truth)
            seeds = range(10_000 * place, 10_000 * place + asked.seeds)
            return list(pool.map(partial(_fit_of, place), seeds, chunksize=5))

        if "pulls" in asked.table:
            for truth in RESOLVED:
                print(pulls_line(truth, fits(truth)), flush=True)
        if "laws" in asked.table:
            for truth in LAWS:
                print(laws_line(truth, fits(truth)), flush=True)
        if "hidden" in asked.table:
            for truth, share in HIDDEN:
                print(hidden_line(truth, share, fits(truth)), flush=True)


if __name__ == "__main__":
    main()
