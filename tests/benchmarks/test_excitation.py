"""An excitation fit's exact steps against the same model with solve_ivp in the loop."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from labrig.fit.excitation import RelativeSigmas, fit_excitation
from labrig.fit.excitation.levels import levels
from labrig.fit.excitation.problem import ExcitationProblem
from labrig.results import ChargingSeries
from tests.fit.charged_samples import Bench, lvf_windows, two_states

Floats = npt.NDArray[np.float64]
Against = Callable[..., None]

CHARGES_S = (8.0, 64.0, 256.0)
#: Of the peer, of concentrations; as loose as a fit's finite differences allow.
RTOL = 1e-8
#: In a row, as in a fit, which takes about a hundred.
STEPS = 5


def integrated(series: ChargingSeries, k_r: Floats, k_e: Floats) -> Floats:
    """(n, P, N) mean levels of each exposure, by solve_ivp from switch to switch of the lamp.

    RK45 is the fastest of its methods here: LSODA takes a tenth longer, DOP853 a third.
    """
    size = (len(series.irradiance), len(k_r))
    decay = np.tile(k_r, size[0])

    def passed(level: Floats, light: Floats, until_s: Floats) -> tuple[Floats, Floats]:
        """(t, P, N) levels at some times from now, and their integrals until then."""
        kappa = ((light * series.irradiance) @ k_e.T).ravel()
        total = kappa + decay

        def slope(_: float, y: Floats) -> Floats:
            r = y[: len(total)]
            return np.concatenate([kappa - total * r, r])

        begin = np.concatenate([level.ravel(), np.zeros(level.size)])
        span = (0.0, float(until_s[-1]))
        y = solve_ivp(slope, span, begin, "RK45", t_eval=until_s, rtol=RTOL, atol=1e-12).y.T
        return y[:, : level.size].reshape(-1, *size), y[:, level.size :].reshape(-1, *size)

    found = []
    dark = np.zeros(series.irradiance.shape[1])
    level, since_s = np.zeros(size), series.charges[0].on_s
    for charge in series.charges:
        if charge.on_s > since_s:
            level = passed(level, dark, np.array([charge.on_s - since_s]))[0][-1]
        steady_s = charge.off_s - charge.on_s - series.rise.total_s
        steps_s = [*series.rise.duration_s, steady_s, *series.fade.duration_s]
        fractions = [*series.rise.fraction, np.ones(len(dark)), *series.fade.fraction]
        for seconds, fraction in zip(steps_s, fractions, strict=True):
            level = passed(level, charge.brightness * fraction, np.array([seconds]))[0][-1]
        dark_s = charge.off_s + series.fade.total_s
        switched_s = np.stack([charge.start_s, charge.start_s + charge.exposure_s], axis=1)
        levels_then, collected = passed(level, dark, switched_s.ravel() - dark_s)
        found.append((collected[1::2] - collected[::2]) / charge.exposure_s[:, None, None])
        level, since_s = levels_then[-1], float(switched_s[-1, 1])
    return np.concatenate(found)


def test_excitation(against: Against) -> None:
    """Steps of a fit: residuals and Jacobian; the peer's by finite differences."""
    bench = Bench(two_states())
    windows = lvf_windows(np.linspace(405, 695, 31))
    series = bench.series("through LVF", windows, CHARGES_S)
    k_r = np.array([state.k_r_per_s for state in bench.material.states])
    k_e = np.array([state.k_e_per_s for state in bench.material.states])
    exact = levels(series, k_r, k_e).value
    assert np.abs(integrated(series, k_r, k_e) / exact - 1).max() < 1e-5
    problem = ExcitationProblem([series], 2, 1, RelativeSigmas())
    theta = problem.parameters.as_stated(k_r, bench.amplitudes(), k_e, np.ones(3), np.ones(2))

    def ours() -> None:
        for _ in range(STEPS):
            problem.residuals(theta)

    def peer() -> None:
        for _ in range(STEPS * (1 + k_r.size + k_e.size)):
            integrated(series, k_r, k_e)

    against(
        ours,
        {"solve_ivp in the loop, finite differences": peer},
        rounds=3,
        each=STEPS,
        what="excitation, 31 sites, 3 charges: residuals and Jacobian",
    )
    fitted = fit_excitation([series], k_r, bench.amplitudes(), RelativeSigmas(bench.flicker, 0.01))
    assert fitted.reduced_chi2 < 1.2
