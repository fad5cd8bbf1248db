"""Coverage of intervals by profile likelihood and of ±σ, at 68 and 95 %, side by side.

    python -m tests.acceptance.interval_coverage [--seeds 400] [--only decay charge excitation]

Each measurement has a seed of its own. Truths are integrated numerically, without the fits'
formulas. Some are not what a fit assumes: noise of Student's t with 4 degrees of freedom, flicker
of 0.2 % that the fit is not told. Near a bound (an order of 1, no retrapping, light that does not
excite) the intervals are one-sided. Printed are the percentages of measurements whose interval
holds the truth, with the standard deviation of chance in brackets, of intervals that are one-sided
at 95 %, and of those that differ from ±σ by more than 20 %.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from labrig.fit import fit_charge_and_decay, fit_decay
from labrig.fit.excitation import RelativeSigmas, fit_excitation
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.material import read_material
from labrig.results import NORMAL_95, Measured, ProfileInterval
from labrig.sim.kinetics import KineticsSettings
from labrig.sim.lamp import WAVELENGTH_NM
from tests.fit import truths
from tests.fit.charged_samples import Bench, lvf_windows

#: Parameter → its value with σ, and its interval.
Estimates = Mapping[str, tuple[Measured, ProfileInterval | None]]


@dataclass(frozen=True)
class Case:
    """A truth, the parameters by name, and the function that measures and fits it by a seed."""

    name: str
    truth: Mapping[str, float]
    fitted: Callable[[int], Estimates]


def noise(rng: np.random.Generator, size: int, *, is_heavy: bool) -> FloatArray:
    """Return noise of σ 1, of a normal distribution or Student's t with 4 degrees of freedom."""
    return rng.standard_t(4, size) / np.sqrt(2) if is_heavy else rng.standard_normal(size)


def decay(
    name: str,
    truth: Mapping[str, float],
    light: truths.Decay,
    sigma: float,
    *,
    n_times: int = 40,
    span_s: float = 180.0,
    is_heavy: bool = False,
    flicker: float = 0.0,
    sigma_given: bool = True,
    **options: object,
) -> Case:
    """Return readings of one channel with equal σ, relative to the light at lamp off."""
    t_s = 0.5 + span_s * np.arange(n_times) / n_times
    exposed = truths.exposed(light, t_s, np.full(n_times, 0.5))

    def fitted(seed: int) -> Estimates:
        rng = np.random.default_rng([seed, 9])
        values = exposed * (1 + flicker * rng.standard_normal(n_times))
        values = values + sigma * noise(rng, n_times, is_heavy=is_heavy)
        fit = fit_decay(
            t_s,
            values,
            sigma if sigma_given else "equal",
            exposure_s=0.5,
            intervals=True,
            **options,  # type: ignore[arg-type]
        )
        law = fit.chosen_law
        own = {} if law is None else dict(law.parameters)
        own |= {f"k_r_per_s {n}": rate for n, rate in enumerate(fit.rates, start=1)}
        if law is not None:
            # Without a σ that says anything the parameter is not stated: no value ± σ.
            unknown = Measured(np.nan, np.inf)
            own |= {key: unknown for key in truth if key not in own}
        return {key: (own[key], fit.intervals.get(key)) for key in truth if key in own}

    return Case(name, truth, fitted)


CHARGE_T_S = np.concatenate(
    [np.arange(0.0, 20, 2), np.arange(22.0, 218, 5), np.geomspace(223.0, 3000, 40)]
)


def charge_light(kappa: float, k: float, order: float) -> FloatArray:
    """Return the light of one state, charged from 20 to 220 s, integrated numerically."""
    light, r = np.zeros(len(CHARGE_T_S)), 0.0
    for begin, end, lamp in ((20.0, 220.0, kappa), (220.0, 3001.0, 0.0)):
        own = (begin <= CHARGE_T_S) & (end > CHARGE_T_S)

        def growth(_: float, r: FloatArray, lamp: float = lamp) -> FloatArray:
            return np.asarray((1 - r) * lamp - k * np.maximum(r, 0) ** order)

        solved = solve_ivp(
            growth, (begin, end), [r], t_eval=[*CHARGE_T_S[own], end], rtol=1e-9, atol=1e-12,
            method="LSODA",
        )  # fmt: skip
        level = np.maximum(solved.y[0, :-1], 0.0)
        light[own] = 4e4 * (k * level**order + lamp * level)
        r = float(solved.y[0, -1])
    return light


def charge(name: str, order: float, sigma: float, *, is_heavy: bool = False) -> Case:
    """Return charge and decay of one state, fitted with its order free."""
    kappa, k = 0.012, 0.03
    light = charge_light(kappa, k, order)

    def fitted(seed: int) -> Estimates:
        rng = np.random.default_rng([seed, 10])
        values = light + sigma * noise(rng, len(light), is_heavy=is_heavy)
        fit = fit_charge_and_decay(
            CHARGE_T_S, values, sigma, light_on_s=20.0, light_off_s=220.0, states=1,
            order="general", intervals=True,
        )  # fmt: skip
        (state,) = fit.states
        found = {"order 1": state.order, "k_r_per_s 1": state.k_r_per_s}
        return {
            key: (value, fit.intervals.get(key))
            for key, value in found.items()
            if value is not None
        }

    return Case(name, {"order 1": order, "k_r_per_s 1": k}, fitted)


LVF = lvf_windows(np.array([420.0, 450.0, 490.0, 540.0]))
BARE = np.ones((1, len(WAVELENGTH_NM)))


def excitation(name: str, order: float, irradiance: float) -> Case:
    """Return an excitation of one state with its order free, under a lamp that warms up."""
    material = read_material("blue-paint")
    (state,) = material.states
    k_e = state.k_e_per_s
    assert k_e is not None
    truth = {"k_r_per_s 1": state.k_r_per_s, "kinetic_order 1": order}
    truth |= {f"k_e_per_s 1 {band}": float(k_e[band - 1]) for band in (1, 2, 3, 5)}

    def fitted(seed: int) -> Estimates:
        kinetics = None if order == 1 else KineticsSettings(model="general_order", order=order)
        bench = Bench(material, irradiance=irradiance, kinetics=kinetics, seed=seed)
        bare = bench.series("bare lamp", BARE, (900.0,), shots=10, every_s=15.0)
        series = [bare, bench.series("through LVF", LVF, (8.0, 64.0, 256.0), shots=4)]
        uncertain = RelativeSigmas(bench.flicker, 0.01)
        start = [state.k_r_per_s], [1.0], uncertain
        near = fit_excitation(series, *start)
        fit = fit_excitation(series, *start, near, None, "all")
        (found,) = fit.states
        own = {
            "k_r_per_s 1": Measured(found.k_r_per_s, found.k_r_per_s_sigma),
            "kinetic_order 1": Measured(found.kinetic_order, found.kinetic_order_sigma),
        }
        for band in (1, 2, 3, 5):
            own[f"k_e_per_s 1 {band}"] = Measured(
                float(found.k_e_per_s[band - 1]), float(found.k_e_per_s_sigma[band - 1])
            )
        return {key: (value, fit.intervals.get(key)) for key, value in own.items()}

    return Case(name, truth, fitted)


def becquerel(tau_s: float, exponent: float) -> Mapping[str, float]:
    """Return the parameters of (1 + t/τ)^(−p)."""
    truth = {"decay_time_s": tau_s, "exponent": exponent}
    return truth | {"kinetic_order": exponent / (exponent - 1)}


def one_trap(rate_per_s: float, shape: float) -> truths.Decay:
    """Return the light of one trap, its rate equation integrated numerically."""

    def light(t: FloatArray) -> FloatArray:
        def fall(_: float, level: FloatArray) -> FloatArray:
            return np.asarray(-rate_per_s * level**2 / (shape + (1 - shape) * level))

        solved = solve_ivp(
            fall, (0, float(t.max()) + 1), [1.0], rtol=1e-10, atol=1e-14, dense_output=True
        )
        assert solved.sol is not None
        level = solved.sol(t.ravel())[0].reshape(t.shape)
        return np.asarray(level**2 / (shape + (1 - shape) * level))

    return light


ONE = truths.exponentials((0.02, 1.0))
TWO = truths.exponentials((0.08, 1.0), (0.015, 0.4))
RATES = {"k_r_per_s 1": 0.08, "k_r_per_s 2": 0.015}
CASES = {
    "decay": (
        decay("one state, σ 20 %", {"k_r_per_s 1": 0.02}, ONE, 0.2, n_states=1),
        decay(
            "one state, 12 values, σ of the residuals (F-test)",
            {"k_r_per_s 1": 0.02}, ONE, 0.1, n_times=12, n_states=1, sigma_given=False,
        ),
        decay("two states, σ 3 %", RATES, TWO, 0.03, n_states=2),
        decay(
            "two states, σ 3 %, 16 values, of the residuals",
            RATES, TWO, 0.02, n_times=16, n_states=2, sigma_given=False,
        ),
        decay("two states, σ 3 %, Student's t", RATES, TWO, 0.03, n_states=2, is_heavy=True),
        decay(
            "two states, σ 3 %, a flicker of 0.2 % besides",
            RATES, TWO, 0.03, n_states=2, flicker=0.002,
        ),
        decay(
            "Becquerel, p 1.5, σ 3 %", becquerel(20.0, 1.5), truths.power_law(20.0, 1.5), 0.03,
            law="becquerel",
        ),
        decay(
            "Becquerel, p 3, σ 3 %, Student's t", becquerel(60.0, 3.0),
            truths.power_law(60.0, 3.0), 0.03, law="becquerel", is_heavy=True,
        ),
        decay(
            "Becquerel where the truth is an exponential", {"kinetic_order": 1.0}, ONE, 0.03,
            law="becquerel",
        ),
        decay(
            "stretched, β 0.6, σ 3 %", {"decay_time_s": 30.0, "exponent": 0.6},
            truths.stretched(30.0, 0.6), 0.03, law="stretched",
        ),
        decay(
            "one trap, retrapping 0.3, σ 3 %", {"decay_time_s": 25.0, "retrapping": 0.3},
            one_trap(0.04, 0.3), 0.03, law="otor",
        ),
        decay(
            "one trap, retrapping 0.02, σ 3 %", {"decay_time_s": 25.0, "retrapping": 0.02},
            one_trap(0.04, 0.02), 0.03, law="otor",
        ),
    ),
    "charge": (
        charge("order 1.6, σ 3 % of the light at lamp off", 1.6, 8.0),
        charge("order 1.6, σ 10 %", 1.6, 25.0),
        charge("order 1.6, σ 3 %, Student's t", 1.6, 8.0, is_heavy=True),
        charge("order 1.02, σ 1 %", 1.02, 3.0),
        charge("order 1, σ 1 %", 1.0, 3.0),
    ),
    "excitation": (
        excitation("order 1.5", 1.5, 4.0),
        excitation("a tenth of the light, order 1.5", 1.5, 0.4),
        excitation("order 1", 1.0, 4.0),
    ),
}  # fmt: skip


def holds(truth: float, estimate: tuple[Measured, ProfileInterval | None]) -> list[bool]:
    """Return whether ±σ, ±1.96 σ and the intervals of 68 and 95 % hold the truth.

    What is not stated with σ, or has no interval, does not hold it.
    """
    measured, interval = estimate
    # A limit at a bound is met to the precision of the search.
    slack = 1e-6 * max(abs(truth), 1e-6)
    off = abs(measured.value - truth)
    by_sigma = [off <= n * measured.sigma + slack for n in (1.0, NORMAL_95)]
    if interval is None:
        return [*by_sigma, False, False]
    return [
        *by_sigma,
        interval.low_68 - slack <= truth <= interval.high_68 + slack,
        interval.low_95 - slack <= truth <= interval.high_95 + slack,
    ]


def lines(case: Case, seeds: int) -> Iterator[str]:
    """Yield a line for each parameter."""
    estimates, failed = [], 0
    for seed in range(seeds):
        try:
            estimates.append(case.fitted(seed))
        except FitError:
            failed += 1
    yield case.name + (f" ({failed} without a fit)" if failed else "")
    for key, truth in case.truth.items():
        own = [each[key] for each in estimates if key in each]
        if not own:
            continue
        held = 100 * np.mean([holds(truth, each) for each in own], axis=0)
        chance = 100 * np.sqrt(np.array([0.683 * 0.317, 0.95 * 0.05]) / len(own))
        one_sided, differs = 100 * np.mean(
            [
                (interval is not None and interval.is_one_sided,
                 interval is not None and interval.differs_from(measured.sigma))
                for measured, interval in own
            ],
            axis=0,
        )  # fmt: skip
        yield (
            f"  {key:18s} n {len(own):4d}  68 %: interval {held[2]:5.1f}({chance[0]:.1f}) ±σ "
            f"{held[0]:5.1f}  95 %: interval {held[3]:5.1f}({chance[1]:.1f}) ±1.96 σ "
            f"{held[1]:5.1f}  one-sided {one_sided:5.1f} %  by > 20 % another {differs:5.1f} %"
        )


def main() -> None:
    """Run the cases and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=400)
    parser.add_argument("--only", nargs="*", choices=[*CASES], default=[*CASES])
    parser.add_argument("--case", default="", help="the beginning of a case's name")
    asked = parser.parse_args()
    for kind in asked.only:
        print(f"{kind}, {asked.seeds} seeds each")
        for case in CASES[kind]:
            if case.name.startswith(asked.case):
                print("\n".join(lines(case, asked.seeds)), flush=True)


if __name__ == "__main__":
    main()
