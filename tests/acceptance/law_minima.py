"""Fits of the laws of decay against their lowest χ², and against the laws nested in them.

    python -m tests.acceptance.law_minima [--seeds 300]

First decays by Becquerel's law (1 + t/τ)^(−p), p 1.08 to 1.6, τ 30 s to 100 s, σ 1 %, whose first
reading is 20 s to 300 s after lamp off, in 96 tables, with the background held at zero and free.
Then, a seed each, decays of all laws and of two exponentials with p 0.4 to 6, τ 0.1 s to 1000 s, 25
to 250 readings from 0.1 s to 500 s on, noise of 0.03 % to 10 % and of reading, in one channel or
three, half of them with a background of their own in each channel. The lowest χ² is that of SciPy's
trust-region search from the ten best places of a grid, with the same bounds on rate and shape; for
given ones, the levels of the channels and their backgrounds follow exactly.

Printed are: fits further above that minimum than 9 and than 10⁻³, and the furthest; laws and
numbers of states that fit worse by more than 10⁻³ than what they contain; fits that were not
compared; and how often correlated noise is claimed, which no decay has.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from labrig.fit import DecayFit, fit_decay
from labrig.fit.decay.law_fit import FASTEST_STEPS, SLOWEST_SPANS
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.material import DECAY_LAWS
from tests.fit import truths
from tests.warned import codes

#: Differences of χ² that are counted.
FAR, NEAR = 9.0, 1e-3
GRID, STARTS, MAX_SHAPE = (40, 9), 10, 3.0


@dataclass(frozen=True)
class Table:
    """A decay as it is fitted: times (n,), values and σ (n, C), and if backgrounds are free."""

    t_s: FloatArray
    values: FloatArray
    sigma: FloatArray
    has_offset: bool

    def fit(self) -> DecayFit:
        """Return labrig's fit, flicker known to be none."""
        return fit_decay(
            self.t_s,
            self.values,
            self.sigma,
            channels=[str(channel) for channel in range(self.values.shape[1])],
            offset_sigma=np.inf if self.has_offset else 0.0,
            flicker=0.0,
        )

    def dof(self, n_shape: int) -> int:
        """Return the degrees of freedom of a shape with so many parameters."""
        channels = self.values.shape[1]
        return int(self.values.size - n_shape - (channels - 1) - channels * self.has_offset)

    def residuals(self, signal: FloatArray) -> FloatArray:
        """Return the residuals of the best levels ≥ 0 and backgrounds of a signal (n,)."""
        peak = np.abs(signal).max()
        columns = [signal / peak if 0 < peak < np.inf else 0 * signal]
        columns += [np.ones_like(signal)] * self.has_offset
        left = []
        for values, sigma in zip(self.values.T, self.sigma.T, strict=True):
            design = np.nan_to_num(np.column_stack(columns)) / sigma[:, None]
            levels = np.linalg.lstsq(design, values / sigma)[0]
            if levels[0] < 0:
                rest = design[:, 1:]
                levels = np.append(0.0, np.linalg.lstsq(rest, values / sigma)[0])
            left.append(design @ levels - values / sigma)
        return np.concatenate(left)


def lowest_chi2(table: Table, law: str, reference_s: float) -> float:
    """Return the lowest χ² of a law that begins at a time, by another search."""
    t_s, kind = table.t_s - reference_s, DECAY_LAWS[law]
    rates = (
        -float(np.log(SLOWEST_SPANS * np.ptp(t_s))),
        float(np.log(FASTEST_STEPS / np.diff(t_s).min())),
    )
    least, largest = kind.shapes

    def residuals(theta: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            signal = kind.value(np.exp(theta[0]) * t_s, np.full_like(t_s, theta[1]))
        return table.residuals(signal)

    places = [
        (log_rate, shape)
        for log_rate in np.linspace(*rates, GRID[0])
        for shape in np.linspace(least, min(largest, MAX_SHAPE), GRID[1])
    ]
    chi2 = [float(np.sum(residuals(np.array(place)) ** 2)) for place in places]
    ends = []
    for place in np.argsort(chi2)[:STARTS]:
        log_rate, shape = places[place]
        inside = np.clip(shape, least + 1e-6, largest - 1e-6)
        end = least_squares(
            residuals, [log_rate, inside], bounds=([rates[0], least], [rates[1], largest]),
            x_scale=[1.0, 0.3], xtol=1e-12, ftol=1e-12, gtol=1e-12, max_nfev=200,
        )  # fmt: skip
        ends.append(2 * float(end.cost))
    return min(ends)


def becquerel_decays() -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Yield times, values and σ (n,) of 96 decays, each with its own noise."""
    cases = [
        (p, tau_s, first_s)
        for p in (1.08, 1.2, 1.4, 1.6)
        for tau_s in (30, 50, 70, 100)
        for first_s in (20, 60, 300)
    ]
    for number, (p, tau_s, first_s) in enumerate(2 * cases):
        even = np.linspace(first_s, first_s + 1800, 181)
        t_s = even if number < len(cases) else np.geomspace(first_s, 40 * first_s, 120)
        signal = 1000 * truths.power_law(tau_s, p)(t_s)
        noise = np.random.default_rng(number).standard_normal(len(t_s))
        yield t_s, signal * (1 + 0.01 * noise), 0.01 * signal


def any_decay(seed: int) -> Table | None:
    """Return a decay of a law that the seed draws; None if it is dark at the first reading."""
    rng = np.random.default_rng([77, seed])
    name = rng.choice(["becquerel", "becquerel", "exponential", "otor", "stretched", "two"])
    p, tau_s = float(np.exp(rng.uniform(np.log(0.4), np.log(6)))), 10 ** rng.uniform(-1, 3)
    first_s, n = 10 ** rng.uniform(-1, 2.7), int(rng.integers(25, 250))
    t_s = (
        np.linspace(first_s, first_s + 10 ** rng.uniform(1, 4), n)
        if rng.random() < 0.5
        else np.geomspace(first_s, first_s * 10 ** rng.uniform(0.5, 3), n)
    )
    share = rng.uniform(0.3, 1)
    decays = {
        "becquerel": truths.power_law(tau_s, p),
        "exponential": truths.exponentials((1 / tau_s, 1.0)),
        "otor": lambda t: DECAY_LAWS["otor"].value(t / tau_s, np.full_like(t, share)),
        "stretched": truths.stretched(tau_s, share),
        "two": truths.exponentials((1 / tau_s, 0.5), (share / (4 * tau_s), 0.5)),
    }
    signal = decays[str(name)](t_s)
    if not signal.max() > 1e-200:
        return None
    weights = np.ones(1) if rng.random() < 0.7 else np.array([0.5, 1.0, 0.3])
    signal = np.multiply.outer(1000 * signal / signal.max(), weights)
    relative, read = 10 ** rng.uniform(-3.5, -1), 1000 * 10 ** rng.uniform(-6, -2)
    sigma = np.hypot(relative * signal, read)
    has_offset = bool(rng.random() < 0.5)
    background = 20 * rng.standard_normal(len(weights)) * has_offset
    values = signal + sigma * rng.standard_normal(signal.shape) + background
    return Table(t_s, values, sigma, has_offset)


@dataclass
class Count:
    """Counts over many tables."""

    fits: int = 0
    laws: int = 0
    far: int = 0
    near: int = 0
    furthest: float = 0.0
    nested: int = 0
    pairs: int = 0
    unfinished: int = 0
    correlated: int = 0

    def add(self, table: Table, laws: tuple[str, ...]) -> None:
        """Count a table; one that labrig refuses does not."""
        try:
            fit = table.fit()
        except FitError:
            return
        self.fits += 1
        self.correlated += "noise-correlated" in codes(fit.warnings)
        self.unfinished += codes(fit.warnings).count("law-unconverged")
        chi2 = {law.name: law.reduced_chi2 * table.dof(3) for law in fit.laws}
        for law in laws:
            if law not in chi2:
                continue
            above = chi2[law] - lowest_chi2(table, law, fit.reference.t_s)
            self.laws += 1
            self.far += above > FAR
            self.near += above > NEAR
            self.furthest = max(self.furthest, above)
        states = [each.reduced_chi2 * table.dof(2 * each.n_states) for each in fit.candidates]
        within = [(states[0], other) for other in chi2.values()]
        within += pairwise(states)
        self.pairs += len(within)
        self.nested += sum(more > fewer + NEAR for fewer, more in within)

    def line(self, name: str) -> str:
        """Return the counts as a line."""
        return (
            f"{name:28s} {self.fits:3d} decays: of {self.laws} laws {self.far} end more than "
            f"{FAR:g} above the lowest χ², {self.near} more than {NEAR:g} (furthest "
            f"{self.furthest:.2g}); of {self.pairs} pairs {self.nested} fit worse than what they "
            f"contain; {self.unfinished} laws not compared; correlated noise claimed "
            f"{self.correlated} times"
        )


def main() -> None:
    """Print a line for each kind of decay."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=300)
    seeds = range(parser.parse_args().seeds)
    for has_offset in (False, True):
        count = Count()
        for t_s, values, sigma in becquerel_decays():
            count.add(Table(t_s, values[:, None], sigma[:, None], has_offset), ("becquerel",))
        print(count.line(f"Becquerel, background {'free' if has_offset else 'held'}"), flush=True)
    count = Count()
    for table in map(any_decay, seeds):
        if table is not None:
            count.add(table, tuple(DECAY_LAWS))
    print(count.line("any decay"))


if __name__ == "__main__":
    main()
