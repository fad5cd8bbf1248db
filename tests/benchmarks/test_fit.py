"""A decay of two states: labrig against lmfit and SciPy, same data, same weights, same answer."""

from collections.abc import Callable
from itertools import combinations
from typing import Any

import lmfit  # type: ignore[import-untyped]
import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import curve_fit

from labrig.analyse import fit_series
from labrig.fit.nonlinear_least_squares import least_squares
from labrig.fit.profile_likelihood import Likelihood, NoiseScale, Quantity, parameter
from labrig.results import Series

Floats = npt.NDArray[np.float64]
Against = Callable[..., None]

NAMES = ("k1", "a1", "k2", "a2")
TRUTH = np.array([0.06, 3000.0, 0.011, 800.0])
#: What a person reads off a plot.
START = np.array([0.1, 2000.0, 0.02, 500.0])
EXPOSURE_S = 1.0
T_S: Floats = 0.5 + 5.0 * np.arange(60, dtype=np.float64)
#: Most that two answers may differ by, in σ of each parameter.
AGREE_SIGMA = 1e-4


def model(t_s: Floats, k1: float, a1: float, k2: float, a2: float) -> Floats:
    """Mean over each exposure."""
    means, _ = means_and_slopes(np.array([k1, k2]), t_s)
    return np.asarray(means @ np.array([a1, a2]))


def jacobian(t_s: Floats, k1: float, a1: float, k2: float, a2: float) -> Floats:
    means, slopes = means_and_slopes(np.array([k1, k2]), t_s)
    columns = np.empty((len(t_s), 4))
    columns[:, 0::2], columns[:, 1::2] = slopes * np.array([a1, a2]), means
    return columns


def means_and_slopes(rates: Floats, t_s: Floats) -> tuple[Floats, Floats]:
    decayed = np.exp(-np.multiply.outer(t_s, rates))
    turn = rates * EXPOSURE_S
    mean = -np.expm1(-turn) / turn
    slope = (np.exp(-turn) - mean) / rates
    return decayed * mean, decayed * (slope - mean * t_s[:, np.newaxis])


@pytest.fixture(scope="module")
def data() -> tuple[Floats, Floats]:
    """Values and their σ."""
    light = model(T_S, *TRUTH)
    sigma = np.sqrt(4.0 + light / 20)
    return light + sigma * np.random.default_rng(5).normal(size=len(T_S)), sigma


def labrig_core(y: Floats, sigma: Floats, start: Floats = START) -> Floats:
    def residuals(x: Floats) -> tuple[Floats, Floats]:
        means, slopes = means_and_slopes(x[0::2], T_S)
        columns = np.empty((len(T_S), 4))
        columns[:, 0::2], columns[:, 1::2] = slopes * x[1::2], means
        return (means @ x[1::2] - y) / sigma, columns / sigma[:, np.newaxis]

    return least_squares(residuals, start, lower=1e-9).parameters


def lmfit_leastsq(
    y: Floats, sigma: Floats, start: Floats = START, analytic: bool = False
) -> tuple[Floats, float]:
    """As its manual does it: parameters with a bound, residuals over σ."""

    def residuals(parameters: lmfit.Parameters) -> Floats:
        return np.asarray((model(T_S, *parameters.valuesdict().values()) - y) / sigma)

    def slopes(parameters: lmfit.Parameters) -> Floats:
        return np.asarray(jacobian(T_S, *parameters.valuesdict().values()) / sigma[:, np.newaxis])

    parameters = lmfit.Parameters()
    for name, value in zip(NAMES, start, strict=True):
        parameters.add(name, value, min=0)
    how: dict[str, Any] = {"Dfun": slopes} if analytic else {}
    result = lmfit.Minimizer(residuals, parameters).leastsq(**how)
    return np.array(list(result.params.valuesdict().values())), float(result.chisqr)


def scipy_curve_fit(
    y: Floats, sigma: Floats, bounded: bool, analytic: bool, start: Floats = START
) -> Floats:
    how: dict[str, Any] = {"jac": jacobian} if analytic else {}
    if bounded:
        how["bounds"] = (0, np.inf)
    found, _ = curve_fit(model, T_S, y, start, sigma, absolute_sigma=True, **how)
    return np.asarray(found)


def sigmas(y: Floats, sigma: Floats) -> Floats:
    """Of the parameters, at the answer."""
    columns = jacobian(T_S, *labrig_core(y, sigma)) / sigma[:, np.newaxis]
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(columns.T @ columns))))


def test_solver_from_the_same_start(data: tuple[Floats, Floats], against: Against) -> None:
    y, sigma = data
    peers: dict[str, Callable[[], Floats]] = {
        "lmfit leastsq, bounds": lambda: lmfit_leastsq(y, sigma)[0],
        "lmfit leastsq, bounds, Jacobian": lambda: lmfit_leastsq(y, sigma, analytic=True)[0],
        "curve_fit trf, bounds": lambda: scipy_curve_fit(y, sigma, True, False),
        "curve_fit trf, bounds, Jacobian": lambda: scipy_curve_fit(y, sigma, True, True),
        "curve_fit lm": lambda: scipy_curve_fit(y, sigma, False, False),
        "curve_fit lm, Jacobian": lambda: scipy_curve_fit(y, sigma, False, True),
    }
    answer, uncertain = labrig_core(y, sigma), sigmas(y, sigma)
    for name, peer in peers.items():
        assert (np.abs(peer() - answer) < AGREE_SIGMA * uncertain).all(), name
    against(
        lambda: labrig_core(y, sigma),
        peers,
        rounds=50,
        what="2 states, 60 frames: solver, good start",
    )


def best_of_starts(fit: Callable[[Floats], tuple[Floats, float]], y: Floats) -> Floats:
    """From every pair of six rates over what the times can tell, the best."""
    rates = np.geomspace(1 / (50 * T_S[-1]), 10 / (T_S[1] - T_S[0]), 6)[::-1]
    found = [
        fit(np.array([fast, y[0] / 2, slow, y[0] / 2])) for fast, slow in combinations(rates, 2)
    ]
    return min(found, key=lambda pair: pair[1])[0]


def test_cold(data: tuple[Floats, Floats], against: Against) -> None:
    """Nothing is known but the data; labrig fits two alternative models of decay as well."""
    y, sigma = data
    n = len(T_S)
    series = Series(
        t_s=T_S,
        exposure_s=np.full(n, EXPOSURE_S),
        values=y[:, np.newaxis],
        sigma=sigma[:, np.newaxis],
        dark_sigma=np.zeros(1),
        channels=("G",),
        iso=np.full(n, np.nan),
        f_number=np.full(n, np.nan),
        frame=("",) * n,
        unit=("",) * n,
        flag=("",) * n,
    )

    def cold() -> Floats:
        fit = fit_series(series, states=2, flicker=0.0)
        return np.array([x for s in fit.states for x in (s.k_r_per_s, s.amplitude)])

    def from_grid() -> Floats:
        return best_of_starts(lambda start: lmfit_leastsq(y, sigma, start), y)

    uncertain = sigmas(y, sigma)
    assert (np.abs(cold() - labrig_core(y, sigma)) < AGREE_SIGMA * uncertain).all()
    assert (np.abs(from_grid() - cold()) < AGREE_SIGMA * uncertain).all()
    against(
        cold,
        {
            "lmfit leastsq, best of 15 starts": from_grid,
            "lmfit leastsq, one good start": lambda: lmfit_leastsq(y, sigma),
        },
        rounds=15,
        what="2 states, 60 frames: start, fit, alternative models, diagnosis",
    )


WEIGHTS, OFFSETS, OFFSET_SIGMA = np.array([0.3, 1.0, 0.6]), np.array([0.5, -0.3, 0.2]), 0.5


def lmfit_three_channels(y: Floats, sigma: Floats, start: Floats) -> tuple[Floats, float]:
    """Rates and amplitudes common to the channels, weights bounded, offsets with their prior."""

    def residuals(parameters: lmfit.Parameters) -> Floats:
        *states, red, blue, r, g, b = parameters.valuesdict().values()
        offsets = np.array([r, g, b])
        light = np.multiply.outer(model(T_S, *states), [red, 1.0, blue])
        return np.concatenate([((light + offsets - y) / sigma).ravel(), offsets / OFFSET_SIGMA])

    parameters = lmfit.Parameters()
    for name, value in zip((*NAMES, "red", "blue"), (*start, 0.5, 0.5), strict=True):
        parameters.add(name, value, min=0)
    for name in ("offset_r", "offset_g", "offset_b"):
        parameters.add(name, 0.0)
    result = lmfit.Minimizer(residuals, parameters).leastsq()
    return np.array(list(result.params.valuesdict().values()))[:4], float(result.chisqr)


def three_channels(flicker: float = 0.0) -> Series:
    """Return a decay as a camera gives it: three channels that share their rates."""
    random = np.random.default_rng(5)
    light = np.multiply.outer(model(T_S, *TRUTH), WEIGHTS)
    sigma = np.sqrt(4.0 + light / 20)
    values = light + OFFSETS + sigma * random.normal(size=light.shape)
    values += flicker * light * random.normal(size=(len(T_S), 1))
    n = len(T_S)
    return Series(
        t_s=T_S,
        exposure_s=np.full(n, EXPOSURE_S),
        values=values,
        sigma=sigma,
        dark_sigma=np.full(3, OFFSET_SIGMA),
        channels=("R", "G", "B"),
        iso=np.full(n, np.nan),
        f_number=np.full(n, np.nan),
        frame=("",) * n,
        unit=("",) * n,
        flag=("",) * n,
    )


def test_three_channels_cold(against: Against) -> None:
    """The same number of states and the same noise for both."""
    series = three_channels()
    y, sigma = series.values, series.sigma

    def cold() -> Floats:
        fit = fit_series(series, states=2, flicker=0.0)
        return np.array([x for s in fit.states for x in (s.k_r_per_s, s.amplitude)])

    def from_grid() -> Floats:
        return best_of_starts(lambda start: lmfit_three_channels(y, sigma, start), y[:, 1])

    assert from_grid() == pytest.approx(cold(), rel=1e-4)
    against(
        cold,
        {
            "lmfit leastsq, best of 15 starts": from_grid,
            "lmfit leastsq, one good start": lambda: lmfit_three_channels(y, sigma, START),
        },
        rounds=15,
        what="2 states, 60 frames x 3 channels: all of it",
    )


def test_as_a_run_does_it(against: Against) -> None:
    """Number of states and flicker are labrig's to find; the peer is told the former."""
    series = three_channels(flicker=0.007)
    y, sigma = series.values, series.sigma
    assert len(fit_series(series).states) == 2
    against(
        lambda: fit_series(series),
        {
            "lmfit leastsq, 2 states, best of 15 starts": lambda: best_of_starts(
                lambda start: lmfit_three_channels(y, sigma, start), y[:, 1]
            ),
            "lmfit leastsq, 2 states, one good start": lambda: lmfit_three_channels(
                y, sigma, START
            ),
        },
        rounds=15,
        what="decay of a run: 60 frames x 3 channels, 1 to 3 states",
    )


def test_intervals_of_two_rates(data: tuple[Floats, Floats], against: Against) -> None:
    """Limits at 68 and 95 % by the F-test, from the same minimum; they are the same."""
    y, sigma = data

    def residuals(x: Floats) -> tuple[Floats, Floats]:
        off = (model(T_S, *x) - y) / sigma
        return off, jacobian(T_S, *x) / sigma[:, np.newaxis]

    lower, upper = np.full(4, 1e-9), np.full(4, np.inf)
    likelihood = Likelihood.at_minimum(residuals, START, lower, upper)
    noise = NoiseScale(likelihood.fit.reduced_chi2, likelihood.fit.dof)

    def ours() -> Floats:
        found = [likelihood.interval(Quantity(parameter(k)), noise) for k in (0, 2)]
        return np.array([[i.low_95, i.low_68, i.value, i.high_68, i.high_95] for i in found])

    parameters = lmfit.Parameters()
    for name, value in zip(NAMES, likelihood.fit.parameters, strict=True):
        parameters.add(name, value, min=0)
    minimizer = lmfit.Minimizer(
        lambda p: np.asarray((model(T_S, *p.valuesdict().values()) - y) / sigma), parameters
    )
    minimum = minimizer.leastsq()

    def theirs() -> Floats:
        limits = lmfit.conf_interval(
            minimizer, minimum, p_names=["k1", "k2"], sigmas=[0.682689, 0.95]
        )
        return np.array([[value for _, value in limits[name]] for name in ("k1", "k2")])

    off = np.abs(ours() - theirs()) / sigmas(y, sigma)[[0, 2], np.newaxis]
    assert off.max() < 5e-3
    against(
        ours,
        {"lmfit conf_interval": theirs},
        rounds=10,
        what="2 states, 60 frames: limits of both rates",
    )
