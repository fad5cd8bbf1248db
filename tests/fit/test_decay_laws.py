"""Laws that are no sum of a few exponentials: chosen where they hold, with parameters and σ."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import least_squares

from labrig.fit import DecayFit, fit_decay
from labrig.fit.decay import law_fit
from labrig.fit.decay.noise_correlation import NoiseLikelihood
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.material import DECAY_LAWS, DecayLaw, exponential_means
from labrig.results import FORECAST_SPANS, FittedDecay, OneSided
from tests.fit import truths
from tests.pulls import assert_sigma_is_right
from tests.warned import codes, of_code

T_S = np.concatenate([np.arange(0.0, 60.0, 1.5), np.arange(60.0, 400.0, 12.0)])
EXPOSURE_S = np.full(len(T_S), 0.5)
#: Signal-to-noise ratio of the first frame, and noise without light.
SNR, READ = 300.0, 1e-3


def measured(signal: FloatArray, seed: int) -> tuple[FloatArray, FloatArray]:
    """Values with photon and read noise, and their σ."""
    sigma = np.sqrt(signal / SNR**2 + READ**2)
    return signal + sigma * np.random.default_rng(seed).standard_normal(len(signal)), sigma


def fitted(name: str, shape: float, seed: int, law: str = "auto") -> DecayFit:
    signal, _ = DECAY_LAWS[name].means(0.05, shape, T_S, EXPOSURE_S)
    values, sigma = measured(signal, seed)
    return fit_decay(T_S, values, sigma, exposure_s=EXPOSURE_S, law=law)


@pytest.mark.parametrize(
    ("name", "shape", "right"),
    [
        ("becquerel", 1 / 3, {"becquerel"}),
        # The second order is both.
        ("becquerel", 0.5, {"becquerel", "otor"}),
        ("otor", 0.3, {"otor"}),
        ("stretched", 0.6, {"stretched"}),
    ],
)
def test_the_law_is_chosen_by_which_the_signal_decays(
    name: str, shape: float, right: set[str]
) -> None:
    fits = [fitted(name, shape, seed) for seed in range(100, 103)]
    assert sum(fit.law in right for fit in fits) >= 2
    assert all(fit.compared_laws[0].bic_above_best == 0 for fit in fits)


def test_a_trap_that_hardly_retraps_is_taken_from_odds_of_two_on() -> None:
    """Its BIC is lower by 1.8 than that of two exponentials, which have one parameter more."""
    fit = fitted("otor", 0.15, 419)
    two = next(each.bic for each in fit.candidates if each.n_states == 2)
    of_law = next(each.bic for each in fit.laws if each.name == "otor")
    assert 1 < two - of_law < 2
    assert fit.law == "otor"


def test_exponentials_stay_exponentials() -> None:
    signal = exponential_means(np.array([0.2, 0.02]), T_S, EXPOSURE_S) @ [0.7, 0.3]
    for seed in range(200, 205):
        values, sigma = measured(signal, seed)
        fit = fit_decay(T_S, values, sigma, exposure_s=EXPOSURE_S)
        assert (fit.law, fit.n_states) == ("exponentials", 2)
        assert fit.compared_laws[0].probability > 0.95


def lowest_chi2(t_s: FloatArray, values: FloatArray, sigma: FloatArray, offset: bool) -> float:
    """χ² of (1 + t/τ)^(−p) by a search in τ and p, for which level and background follow."""

    def residuals(theta: FloatArray) -> FloatArray:
        shape = np.exp(-theta[1] * np.log1p((t_s - t_s[0]) / (np.exp(theta[0]) + t_s[0])))
        columns = [shape, np.ones_like(t_s)][: 1 + offset]
        design = np.column_stack(columns) / sigma[:, None]
        return np.asarray(design @ np.linalg.lstsq(design, values / sigma)[0] - values / sigma)

    starts = [(log_tau, p) for log_tau in (1.0, 3.5, 6.0) for p in (0.5, 1.2, 2.5)]
    return min(2 * least_squares(residuals, start, xtol=1e-12).cost for start in starts)


@pytest.mark.parametrize(
    ("p", "tau_s", "first_s", "offset"),
    [(1.08, 70.0, 300.0, False), (1.2, 30.0, 60.0, True), (1.4, 100.0, 60.0, False),
     (0.6, 20.0, 100.0, False), (2.5, 40.0, 20.0, True)],
)  # fmt: skip
def test_becquerels_law_ends_at_its_lowest_chi2(
    p: float, tau_s: float, first_s: float, offset: bool
) -> None:
    t_s = np.geomspace(first_s, 40 * first_s, 120)
    signal = 1000 * (1 + t_s / tau_s) ** -p
    sigma = 0.01 * signal
    seed = round(100 * p + tau_s + first_s)
    values = signal + sigma * np.random.default_rng(seed).standard_normal(120)
    fit = fit_decay(t_s, values, sigma, offset_sigma=np.inf if offset else 0.0, flicker=0.0)
    (law,) = (law for law in fit.laws if law.name == "becquerel")
    chi2 = law.reduced_chi2 * (120 - 3 - offset)
    assert chi2 == pytest.approx(lowest_chi2(t_s, values, sigma, offset), abs=1e-3)
    assert "noise-correlated" not in codes(fit.warnings)


def test_a_long_table_ends_at_its_lowest_chi2_though_its_rows_are_merged() -> None:
    t_s = np.asarray(5.0 + 0.3 * np.arange(1500), dtype=np.float64)
    signal = 1000 * (1 + t_s / 25.0) ** -1.6
    sigma: FloatArray = np.hypot(0.01 * signal, 0.05)
    values = signal + sigma * np.random.default_rng(1516).standard_normal(len(t_s))
    fit = fit_decay(t_s, values, sigma, flicker=0.0)
    (law,) = (law for law in fit.laws if law.name == "becquerel")
    chi2 = law.reduced_chi2 * (len(t_s) - 3)
    assert chi2 == pytest.approx(lowest_chi2(t_s, values, sigma, False), abs=1e-3)


@given(
    shape=st.floats(0.02, 1.2),
    log_rate=st.floats(-5.0, 0.0),
    relative=st.sampled_from([1e-3, 1e-2, 5e-2]),
    offset=st.booleans(),
    seed=st.integers(0, 10_000),
)
@settings(max_examples=8)
def test_a_law_never_fits_worse_than_one_that_it_contains(
    shape: float, log_rate: float, relative: float, offset: bool, seed: int
) -> None:
    t_s = np.geomspace(2.0, 400.0, 50)
    signal = DECAY_LAWS["becquerel"].value(np.exp(log_rate) * t_s, np.full_like(t_s, shape))
    signal = signal / signal[0]
    sigma = np.hypot(relative * signal, 1e-4)
    values = signal + sigma * np.random.default_rng(seed).standard_normal(50) + 0.02 * offset
    fit = fit_decay(t_s, values, sigma, offset_sigma=np.inf if offset else 0.0, flicker=0.0)
    states = [each.reduced_chi2 * (50 - 2 * each.n_states - offset) for each in fit.candidates]
    chi2 = {law.name: law.reduced_chi2 * (50 - 3 - offset) for law in fit.laws}
    assert set(chi2) == set(DECAY_LAWS)
    assert max(chi2.values()) <= states[0] + 1e-3
    assert all(more <= fewer + 1e-3 for fewer, more in pairwise(states))


def test_a_fit_that_does_not_end_at_a_minimum_is_named_and_not_compared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    own = law_fit.fit_law

    def fit_law(likelihood: NoiseLikelihood, law: DecayLaw, *others: Any) -> law_fit.LawFit | None:
        if law.name == "becquerel":
            raise law_fit.UnfinishedFitError("unfinished")
        return own(likelihood, law, *others)

    monkeypatch.setattr(law_fit, "fit_law", fit_law)
    fit = fitted("becquerel", 0.4, 3)
    assert "Becquerel" in of_code(fit.warnings, "law-unconverged").values["law"]
    assert {law.name for law in fit.compared_laws}.isdisjoint({"becquerel"})
    with pytest.raises(FitError, match="minimum"):
        fitted("becquerel", 0.4, 3, law="becquerel")


def test_what_a_bound_holds_has_a_one_sided_limit() -> None:
    signal = exponential_means(np.array([0.05]), T_S, EXPOSURE_S)[:, 0]
    limits = []
    for seed in range(310, 314):
        values, sigma = measured(signal, seed)
        fit = fit_decay(T_S, values, sigma, exposure_s=EXPOSURE_S)
        own = {law.name: law for law in fit.laws}
        if own["becquerel"].shape == 0:
            limits.append(own["becquerel"].parameters["kinetic_order"])
        if own["stretched"].shape == 1:
            limits.append(own["stretched"].parameters["exponent"])
    assert limits
    for each in limits:
        assert isinstance(each, OneSided)
        assert 1e-3 < abs(each.limit - 1) < 0.1
        assert str(each)[0] == ("<" if each.limit > 1 else ">")


@pytest.mark.campaign
def test_the_errors_of_rate_and_shape_are_as_large_as_their_sigma() -> None:
    pulls = []
    for number, (name, shape) in enumerate(
        [("becquerel", 0.4), ("otor", 0.3), ("stretched", 0.6)] * 17
    ):
        fit = fitted(name, shape, 300 + number)
        law = next(law for law in fit.laws if law.name == name)
        sigma = np.sqrt(np.diag(law.covariance))
        pulls += [(law.rate_per_s - 0.05) / sigma[1], (law.shape - shape) / sigma[2]]
    assert_sigma_is_right(pulls)


def test_parameters_are_those_of_the_papers() -> None:
    fit = fitted("becquerel", 0.4, 1)
    own = next(law for law in fit.laws if law.name == "becquerel").parameters
    for name, expected in (
        ("decay_time_s", 1 / (0.4 * 0.05)),
        ("exponent", 2.5),
        ("kinetic_order", 1 / 0.6),
    ):
        assert abs(own[name].value - expected) < 4 * own[name].sigma, name


def test_beyond_three_times_the_measured_time_there_is_a_bracket_without_sigma() -> None:
    fit = fitted("becquerel", 0.5, 2)
    near_s, far_s = 0.9 * FORECAST_SPANS * T_S[-1], 1.2 * FORECAST_SPANS * T_S[-1]
    forecast = fit.forecast([near_s, far_s])
    assert np.isfinite([forecast.value[0], forecast.sigma[0]]).all()
    assert np.isnan([forecast.value[1], forecast.sigma[1]]).all()
    true = DECAY_LAWS["becquerel"].value(0.05 * np.array([near_s, far_s]), np.full(2, 0.5))
    assert abs(forecast.value[0] - true[0]) < 4 * forecast.sigma[0]
    assert (forecast.low < true).all()
    assert (true < 1.2 * forecast.high).all()


@pytest.mark.campaign
def test_the_errors_of_the_averaged_signal_are_as_large_as_their_sigma() -> None:
    pulls = []
    at_s = np.array([5.0, 150.0, 600.0])
    for number, (name, shape) in enumerate([("becquerel", 0.35), ("stretched", 0.7)] * 17):
        forecast = fitted(name, shape, 500 + number).forecast(at_s)
        true = DECAY_LAWS[name].value(0.05 * at_s, np.full(3, shape))
        pulls += list((forecast.value - true) / forecast.sigma)
    assert_sigma_is_right(pulls)


def test_a_law_that_was_asked_for_is_taken_and_what_is_better_is_said() -> None:
    fit = fitted("becquerel", 0.4, 3, law="exponentials")
    assert fit.law == "exponentials"
    assert "rates-descriptive" in codes(fit.warnings)
    fit = fitted("stretched", 0.6, 4, law="becquerel")
    assert fit.law == "becquerel"
    assert "residuals-correlated" in codes(fit.warnings)


def test_an_unknown_law_is_refused() -> None:
    with pytest.raises(FitError, match="becquerel, otor"):
        fit_decay(T_S, np.exp(-T_S), 0.01, law="power")


def test_what_is_written_is_read_again() -> None:
    from labrig.results.fitted_decay_file import _from_dict

    fit = fitted("otor", 0.3, 5)
    again = _from_dict(fit.to_dict())
    assert isinstance(again, FittedDecay)
    at_s = np.array([1.0, 100.0])
    for law in ("exponentials", *(law.name for law in fit.other_laws)):
        for old, new in zip(
            fit.signal(at_s, 0 * at_s, law), again.signal(at_s, 0 * at_s, law), strict=True
        ):
            np.testing.assert_allclose(new, old)
    assert again.law == fit.law
    assert math.isclose(again.measured_until_s, fit.measured_until_s)


@pytest.mark.parametrize("seed", range(300, 306))
def test_a_signal_without_retrapping_is_predicted_with_a_small_sigma(seed: int) -> None:
    """One trap's law is an exponential there, and its shape changes it as its rate does."""
    truth = 0.05
    values, sigma = measured(exponential_means(np.array([truth]), T_S, EXPOSURE_S)[:, 0], seed)
    fit = fit_decay(T_S, values, sigma, exposure_s=EXPOSURE_S)
    forecast = fit.forecast([1.0, 40.0, 100.0], 0.0)
    true = np.exp(-truth * forecast.t_s)
    assert np.all(abs(forecast.value - true) < 4.5 * forecast.sigma)
    assert np.all(forecast.sigma < 0.01 * forecast.value + READ / 4)


def test_a_spectrum_that_contains_all_laws_has_to_be_clearly_better() -> None:
    seen = truths.observe(truths.exponentials((0.08, 1.0), (0.015, 0.4)), 5, snr=100)
    fit = fit_decay(
        seen.t_s, seen.values, seen.sigma, exposure_s=seen.exposure_s, channels="RGB", flicker=None
    )
    best, second, *_ = fit.compared_laws
    assert best.name == "rate-spectrum"
    assert 0 < second.bic_above_best < 3
    assert fit.law == second.name == "exponentials"
