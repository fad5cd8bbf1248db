"""An excitation fit's exact steps against the same model with solve_ivp in the loop."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from labrig.fit.excitation import ChargingSeries, Uncertain, fit_excitation
from labrig.fit.excitation.levels import levels
from labrig.fit.excitation.problem import ExcitationProblem, Rates
from tests.fit.charged_samples import Bench, lvf_windows, two_states

Floats = npt.NDArray[np.float64]
Against = Callable[..., None]

CHARGES_S = (8.0, 64.0, 256.0)
#: Of the peer, of concentrations; as loose as a fit's finite differences allow.
RTOL = 1e-8


def integrated(series: ChargingSeries, k_r: Floats, k_e: Floats) -> Floats:
    """(n, P, N) mean levels of each exposure, by LSODA from switch to switch."""
    found = []
    size = (len(series.irradiance), len(k_r))
    level, since_s = np.zeros(size), series.charges[0].on_s

    def passed(level: Floats, light: Floats, seconds: float) -> tuple[Floats, Floats]:
        kappa = (light * series.irradiance) @ k_e.T

        def slope(_: float, y: Floats) -> Floats:
            r = y[: level.size].reshape(size)
            return np.concatenate([((1 - r) * kappa - k_r * r).ravel(), r.ravel()])

        begin = np.concatenate([level.ravel(), np.zeros(level.size)])
        end = solve_ivp(slope, (0.0, seconds), begin, method="LSODA", rtol=RTOL, atol=1e-12).y
        return end[: level.size, -1].reshape(size), end[level.size :, -1].reshape(size)

    dark = np.zeros(series.irradiance.shape[1])
    for charge in series.charges:
        if charge.on_s > since_s:
            level, _ = passed(level, dark, charge.on_s - since_s)
        for seconds, share in zip(series.rise.duration_s, series.rise.share, strict=True):
            level, _ = passed(level, charge.brightness * share, seconds)
        steady_s = charge.off_s - charge.on_s - series.rise.total_s
        level, _ = passed(level, np.full(len(dark), charge.brightness), steady_s)
        for seconds, share in zip(series.fade.duration_s, series.fade.share, strict=True):
            level, _ = passed(level, charge.brightness * share, seconds)
        since_s = charge.off_s + series.fade.total_s
        for start_s, exposure_s in zip(charge.start_s, charge.exposure_s, strict=True):
            level, _ = passed(level, dark, start_s - since_s)
            level, collected = passed(level, dark, exposure_s)
            found.append(collected / exposure_s)
            since_s = start_s + exposure_s
    return np.array(found)


def test_excitation(against: Against) -> None:
    """One step of a fit: residuals and Jacobian; the peer's by finite differences."""
    bench = Bench(two_states())
    windows = lvf_windows(np.linspace(405, 695, 31))
    series = bench.series("through LVF", windows, CHARGES_S)
    k_r = np.array([state.k_r_per_s for state in bench.material.states])
    k_e = np.array([state.k_e_per_s for state in bench.material.states])
    exact = levels(series, k_r, k_e).value
    assert np.abs(integrated(series, k_r, k_e) / exact - 1).max() < 1e-5
    problem = ExcitationProblem([series], 2, 1, Uncertain())
    charges = len(series.charges)
    theta = problem.pack(
        Rates(
            k_r,
            bench.amplitudes(),
            k_e,
            np.ones(3),
            np.zeros(1),
            np.zeros(charges),
            np.zeros(1),
            np.zeros(0),
            np.zeros(0),
        )
    )

    def peer() -> None:
        for _ in range(1 + k_r.size + k_e.size):
            integrated(series, k_r, k_e)

    against(
        lambda: problem.residuals(theta),
        {"solve_ivp in the loop, finite differences": peer},
        rounds=3,
        what="excitation, 31 sites, 3 charges: residuals and Jacobian",
    )
    fitted = fit_excitation([series], k_r, bench.amplitudes(), Uncertain(bench.flicker, 0.01))
    assert fitted.reduced_chi2 < 1.2
