"""Coverage of σ in fits of tables without σ: of values and of rates, over many seeds.

    python -m tests.acceptance.coverage_table_sigma [--seeds 75] [--jobs 1] [--broken [--only TEXT]]

With `--broken`, tables that break what a fit assumes: noise that correlates from value to value, σ
that is √N of the value or wrong by a factor, a detector that is at its ceiling at first. Printed
are mean and root mean square of the pulls, the largest one, and how many fits say so.

For each decay, kind of noise and number of values it prints the root mean square of σ over its true
value, the root mean square of (rate − truth)/σ, which is 1 if σ is right, and the fraction within
1 σ. For decays that are no sum of exponentials the truth of the rates is the fit to noise-free
values, with the same number of states. Takes about five minutes of one processor: with 75 seeds a
root mean square is known to 8 %.
"""

import argparse
import tempfile
import zlib
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from labrig.analyse import TableFitOptions, fit_table
from labrig.fit import fit_decay
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from tests.fit import truths
from tests.warned import codes

SPAN_S = 200.0
#: Values below this fraction of the first do not count for σ: there a count or none is all noise.
FAINT = 0.02


@dataclass(frozen=True)
class Decay:
    """A truth of signal 1 at first, and the number of states with which it is fitted."""

    name: str
    signal: truths.Decay
    states: int


DECAYS = {
    decay.name: decay
    for decay in (
        Decay("1 state", truths.exponentials((0.03, 1.0)), 1),
        Decay("2 states", truths.exponentials((0.1, 1.0), (0.015, 0.4)), 2),
        Decay("3 states", truths.exponentials((0.3, 1.0), (0.05, 0.5), (0.01, 0.2)), 3),
        Decay("power law", truths.power_law(8.0, 1.2), 3),
        Decay("stretched exponential", truths.stretched(20.0, 0.5), 3),
    )
}
Noise = Callable[[np.random.Generator, FloatArray], tuple[FloatArray, FloatArray]]


def _normal(constant: float, counting: float, proportional: float) -> Noise:
    def noise(rng: np.random.Generator, signal: FloatArray) -> tuple[FloatArray, FloatArray]:
        sigma = np.sqrt(constant**2 + counting * signal + (proportional * signal) ** 2)
        return signal + sigma * rng.normal(size=len(signal)), sigma

    return noise


def _counts(brightest: float) -> Noise:
    def noise(rng: np.random.Generator, signal: FloatArray) -> tuple[FloatArray, FloatArray]:
        return rng.poisson(brightest * signal) / brightest, np.sqrt(signal / brightest)

    return noise


NOISES = {
    "constant": _normal(0.01, 0.0, 0.0),
    "2000 counts": _counts(2000.0),
    "200 counts": _counts(200.0),
    "reading and counting": _normal(0.003, 1e-4, 0.0),
    "proportional": _normal(5e-4, 0.0, 0.02),
}


@dataclass(frozen=True)
class Coverage:
    """σ of the values over its truth, and (log rate − truth)/σ of each fit, shape (m, states)."""

    sigma_ratio: float
    pulls: FloatArray
    refused: int

    @property
    def rms_pulls(self) -> FloatArray:
        """Root mean square of the pulls of each rate."""
        return np.asarray(np.sqrt((self.pulls**2).mean(axis=0)))

    @property
    def within_sigma(self) -> FloatArray:
        """Fraction of the fits within 1 σ of each rate."""
        return np.asarray((np.abs(self.pulls) < 1).mean(axis=0))


def coverage(decay: Decay, noise: Noise, n_values: int, seeds: range) -> Coverage:
    """Fit the decay with each seed's noise and no σ."""
    t_s = np.linspace(0.5, SPAN_S, n_values)
    signal = decay.signal(t_s)
    _, true_sigma = noise(np.random.default_rng(0), signal)
    clean = fit_decay(t_s, signal, true_sigma, n_states=decay.states)
    truth = np.log([state.k_r_per_s for state in clean.states])
    ratios, pulls = [], []
    for seed in seeds:
        values, _ = noise(np.random.default_rng(seed), signal)
        try:
            fit = fit_decay(t_s, values, None, n_states=decay.states)
        except FitError:
            continue
        ratios.append((fit.sigma[:, 0] / true_sigma)[signal > FAINT])
        if fit.n_states == decay.states:
            relative = [state.k_r_per_s_sigma / state.k_r_per_s for state in fit.states]
            pulls.append((np.log([state.k_r_per_s for state in fit.states]) - truth) / relative)
    mean_square = float(np.mean(np.square(ratios)))
    return Coverage(float(np.sqrt(mean_square)), np.array(pulls), len(seeds) - len(pulls))


def line(case: tuple[str, str, int], seeds: range) -> str:
    """Return the printed line of a case."""
    decay, noise, n_values = case
    found = coverage(DECAYS[decay], NOISES[noise], n_values, seeds)
    rms = ", ".join(f"{value:.2f}" for value in found.rms_pulls)
    within = ", ".join(f"{100 * value:.0f} %" for value in found.within_sigma)
    return (
        f"{decay:22} {noise:21} {n_values:4} values: σ {found.sigma_ratio:.2f} of the truth; rates "
        f"rms {rms} σ, within 1 σ {within}; {found.refused} with fewer states"
    )


Table = tuple[FloatArray, FloatArray, FloatArray | None]


@dataclass(frozen=True)
class Broken:
    """A kind of table that breaks an assumption, and what its fit then has to say.

    Attributes
    ----------
    name
        Name of the case, from which its seeds follow.
    rates
        True rates in 1/s, falling.
    table
        Function of a seed's generator that returns times, values and σ.
    said
        Codes of warnings, or a text in the line on σ, any of which is expected; empty if none is.
    """

    name: str
    rates: tuple[float, ...]
    table: Callable[[np.random.Generator], Table]
    said: tuple[str, ...] = ()


def drifting(rng: np.random.Generator, n: int, correlation: float) -> FloatArray:
    """Return n numbers of unit variance, each correlated with the one before."""
    numbers = rng.normal(size=n)
    for row in range(1, n):
        fresh = np.sqrt(1 - correlation**2) * numbers[row]
        numbers[row] = correlation * numbers[row - 1] + fresh
    return numbers


SINGLE, PAIR = ((0.03, 1.0),), ((0.1, 1.0), (0.015, 0.6))


def drift(
    states: tuple[tuple[float, float], ...], n: int, correlation: float, given: bool
) -> Broken:
    """Return flicker of 1 % that correlates, with σ of the rest given or no σ at all."""

    def table(rng: np.random.Generator) -> Table:
        t_s = np.linspace(0.5, 60 * (len(states) + 1), n)
        signal = truths.exponentials(*states)(t_s)
        sigma = 0.002 * np.sqrt(signal)
        values = signal * (1 + 0.01 * drifting(rng, n, correlation)) + sigma * rng.normal(size=n)
        return t_s, values, sigma if given else None

    number = f"{len(states)} state{'s' if len(states) > 1 else ''}"
    name = (
        f"flicker, ρ = {correlation}, {number}, {n} values, {'σ of the rest' if given else 'no σ'}"
    )
    return Broken(name, tuple(rate for rate, _ in states), table, ("noise-correlated",))


def root_of_counts(brightest: float, decimals: int) -> Broken:
    """Return counts with σ = √N of the measured number."""

    def table(rng: np.random.Generator) -> Table:
        t_s = np.linspace(0.5, 150, 60)
        counts = rng.poisson(brightest * np.exp(-0.03 * t_s)).astype(np.float64)
        return t_s, counts, np.sqrt(np.maximum(counts, 1.0)).round(decimals)

    name = f"σ = √N, {brightest:g} counts, {decimals} decimals"
    return Broken(name, (0.03,), table, ("of the fitted curve",))


def scaled(factor: float, kind: str) -> Broken:
    """Return a table whose σ is wrong by a factor."""

    def table(rng: np.random.Generator) -> Table:
        t_s = np.linspace(0.5, 200, 60)
        signal = truths.exponentials(*PAIR)(t_s)
        sigma = 0.01 * (np.ones_like(t_s) if kind == "constant" else np.sqrt(signal + 0.01))
        return t_s, signal + sigma * rng.normal(size=len(t_s)), factor * sigma

    too_small = ("sigma-rescaled", "scatter-exceeds-sigma")
    said = () if factor == 1 else too_small if factor < 1 else ("sigma-too-large",)
    return Broken(f"σ times {factor:g}, {kind}", (0.1, 0.015), table, said)


def ceiling(level: float, states: tuple[tuple[float, float], ...]) -> Broken:
    """Return counts that a detector cuts off at a fraction of the brightest."""

    def table(rng: np.random.Generator) -> Table:
        t_s = np.linspace(0.5, 150, 60)
        signal = 1e4 * truths.exponentials(*states)(t_s) / sum(a for _, a in states)
        return t_s, np.minimum(rng.poisson(signal), np.round(1e4 * level)).astype(np.float64), None

    name = f"ceiling at {100 * level:g} %, {len(states)} state(s)"
    said = ("detector-clipped", "first-values-low") if level < 1 else ()
    return Broken(name, tuple(rate for rate, _ in states), table, said)


BROKEN = [
    *(
        drift(states, n, correlation, given)
        for given in (True, False)
        for states in (SINGLE, PAIR)
        for correlation in (0.0, 0.8)
        for n in (20, 40, 60, 120)
    ),
    *(root_of_counts(brightest, decimals) for brightest in (50, 100, 1000) for decimals in (1, 6)),
    *(
        scaled(factor, kind)
        for kind in ("constant", "root")
        for factor in (0.1, 0.3, 0.5, 1, 2, 5, 10)
    ),
    *(ceiling(level, states) for states in (SINGLE, PAIR) for level in (0.7, 0.8, 0.9, 1.0)),
]


def broken_line(case: Broken, seeds: range) -> str:
    """Return the printed line of a table that breaks an assumption."""
    pulls, said = broken_pulls(case, seeds)
    mean, rms = (
        ", ".join(f"{value:.2f}" for value in values)
        for values in (pulls.mean(axis=0), np.sqrt((pulls**2).mean(axis=0)))
    )
    return (
        f"{case.name:48} pulls: mean {mean}; rms {rms}; largest {np.abs(pulls).max():.1f}; "
        f"{100 * said:.0f} % say so; {len(seeds) - len(pulls)} with fewer states"
    )


def broken_pulls(case: Broken, seeds: range) -> tuple[FloatArray, float]:
    """Return (rate − truth)/σ of all fits (m, states), and the fraction of them that say so."""
    pulls, said = [], 0
    own = zlib.crc32(case.name.encode())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.csv"
        for seed in seeds:
            columns = [
                each for each in case.table(np.random.default_rng([seed, own])) if each is not None
            ]
            names = ["t_s", "value", "value_sigma"][: len(columns)]
            np.savetxt(
                path, np.transpose(columns), "%.9g", ",", header=",".join(names), comments=""
            )
            (fitted,) = fit_table(path, TableFitOptions(states=len(case.rates)))
            fit = fitted.fit
            given = (*codes(fit.warnings), fit.sigma_origin)
            said += any(each in text for each in case.said for text in given)
            if fit.n_states == len(case.rates):
                rates = zip(fit.states, case.rates, strict=True)
                pulls.append([(state.k_r_per_s - k) / state.k_r_per_s_sigma for state, k in rates])
    return np.array(pulls), said / len(seeds)


def main() -> None:
    """Print all cases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=75)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--broken", action="store_true")
    parser.add_argument("--only", default="", help="part of the names of broken tables")
    options = parser.parse_args()
    cases = [
        (decay, noise, n_values)
        for n_values in (30, 100, 500)
        for decay in DECAYS
        for noise in NOISES
    ]
    seeds = range(1, options.seeds + 1)
    if options.broken:
        for case in (case for case in BROKEN if options.only in case.name):
            print(broken_line(case, seeds), flush=True)
        return
    with ProcessPoolExecutor(options.jobs) as pool:
        for text in pool.map(partial(line, seeds=seeds), cases):
            print(text, flush=True)


if __name__ == "__main__":
    main()
