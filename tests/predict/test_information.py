"""The predicted uncertainties are the fit's own, and what its results scatter by."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.fit import DecayFit, fit_decay
from labrig.foundation.arrays import FloatArray
from labrig.predict.expectation import information
from labrig.predict.patch import chance_of_all_states
from labrig.predict.series import DARK, FLICKER, PHOTONS, READING, ExpectedSeries
from tests.fit import truths

MANY = range(30)
#: From this signal-to-noise ratio on, and below this rate of the fastest state, the data exclude a
#: faster one that is not there.
TELLING_SNR, TELLING_RATE_PER_S = 200.0, 0.2


def series(
    states: tuple[tuple[float, float], ...] = ((0.03, 1.0),),
    *,
    times_s: FloatArray = truths.TIMES_S,
    exposure_s: float = 1.5,
    snr: float = 300.0,
    flicker: float = 0.007,
    offset_sigma: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> ExpectedSeries:
    """The decays of `tests.fit.truths`, as the prediction has them."""
    exposures_s = np.full(len(times_s), exposure_s)
    signal = np.multiply.outer(
        truths.exposed(truths.exponentials(*states), times_s, exposures_s), truths.RGB_WEIGHTS
    )
    return ExpectedSeries(
        t_s=times_s,
        exposure_s=exposures_s,
        rate_per_s=np.array([k for k, _ in states]),
        shape=np.zeros(len(states)),
        amplitude=np.array([a for _, a in states]),
        weights=truths.RGB_WEIGHTS,
        variances={
            PHOTONS: signal / snr**2,
            READING: np.full_like(signal, 1e-4 / snr**2),
            DARK: np.zeros_like(signal),
        },
        flicker=flicker,
        offset_sigma=np.array(offset_sigma),
    )


def fitted(expected: ExpectedSeries, values: FloatArray, flicker: float | None) -> DecayFit:
    return fit_decay(
        expected.t_s,
        values,
        np.sqrt(expected.variance),
        exposure_s=expected.exposure_s,
        channels="RGB",
        n_states=len(expected.rate_per_s),
        offset_sigma=expected.offset_sigma,
        flicker=flicker,
    )


def without_noise(expected: ExpectedSeries) -> FloatArray:
    return np.multiply.outer(expected.curve, expected.weights)


@settings(max_examples=12)
@given(
    slow=st.floats(0.008, 0.05),
    ratio=st.floats(2.5, 10.0),
    strength=st.floats(0.3, 3.0),
    flicker=st.sampled_from([0.0, 0.002, 0.01]),
    exposure_s=st.floats(0.05, 4.0),
    snr=st.floats(30.0, 1000.0),
    dark=st.sampled_from([0.0, 1e-4, 1e-2]),
    states=st.integers(1, 2),
)
def test_they_are_what_the_fit_gives_for_data_without_noise(
    slow: float,
    ratio: float,
    strength: float,
    flicker: float,
    exposure_s: float,
    snr: float,
    dark: float,
    states: int,
) -> None:
    truth = ((slow * ratio, strength), (slow, 1.0))[-states:]
    expected = series(
        truth,
        exposure_s=exposure_s,
        snr=snr,
        flicker=flicker,
        offset_sigma=(dark, 2 * dark, 0.5 * dark),
    )
    fit = fitted(expected, without_noise(expected), flicker)
    found = information(expected)
    sigma = np.sqrt(np.diag(fit.covariance))[: 2 * states]
    if flicker or snr < TELLING_SNR or truth[0][0] > TELLING_RATE_PER_S:
        # The fit's σ allows for what the data do not exclude: flicker that drifts, as values
        # without noise look, or a fast state.
        assert (found.sigma < 1.001 * sigma).all()
    else:
        np.testing.assert_allclose(found.sigma, sigma, rtol=1e-3)
    parts = np.sum(list(found.budget.values()), axis=0)
    np.testing.assert_allclose(parts, 1.0, rtol=1e-9)


@pytest.mark.parametrize("shape", [0.2, 0.5])
def test_of_a_kinetic_order_they_are_what_becquerels_law_gives(shape: float) -> None:
    expected = replace(
        series(((0.06, 1.0),), flicker=0.0, offset_sigma=(1e-3, 1e-3, 1e-3)),
        shape=np.array([shape]),
    )
    (law,) = [
        law
        for law in fitted(expected, without_noise(expected), 0.0).laws
        if law.name == "becquerel"
    ]
    assert (law.rate_per_s, law.shape) == pytest.approx((0.06, shape), rel=1e-4)
    found = information(expected)
    amplitude, rate, exponent, _ = np.sqrt(np.diag(law.covariance))
    np.testing.assert_allclose(found.sigma, [rate, amplitude, exponent], rtol=2e-3)


@pytest.mark.campaign
def test_fits_of_noisy_data_scatter_by_them() -> None:
    truth = ((0.08, 1.0), (0.015, 0.4))
    expected = series(truth)
    rates = []
    for seed in MANY:
        seen = truths.observe(truths.exponentials(*truth), seed)
        np.testing.assert_allclose(seen.sigma**2, expected.variance)
        fit = fitted(expected, seen.values, expected.flicker)
        rates.append([state.k_r_per_s for state in fit.states])
    np.testing.assert_allclose(np.std(rates, axis=0), information(expected).sigma[0::2], rtol=0.25)


@pytest.mark.campaign
@pytest.mark.parametrize("k_r_per_s", [0.02, 0.12])
def test_fits_that_have_to_measure_their_flicker_report_them(k_r_per_s: float) -> None:
    truth = ((k_r_per_s, 1.0),)
    expected = series(truth)
    own = [
        fitted(expected, truths.observe(truths.exponentials(*truth), seed).values, None)
        .states[0].k_r_per_s_sigma
        for seed in MANY
    ]  # fmt: skip
    assert np.median(own) == pytest.approx(information(expected).sigma[0], rel=0.12)


def test_what_the_frames_do_not_show_is_not_known() -> None:
    late_s = 200.0 + truths.TIMES_S
    found = information(series(((5.0, 1.0), (0.01, 1.0)), times_s=late_s))
    assert np.isinf(found.sigma[:2]).all()
    assert np.isfinite(found.sigma[2:]).all()


@pytest.mark.parametrize(
    ("changed", "source"),
    [
        ({"snr": 20.0, "flicker": 1e-4}, PHOTONS),
        ({"snr": 3000.0, "flicker": 0.02}, FLICKER),
        ({"snr": 3000.0, "flicker": 1e-4, "offset_sigma": (3e-4,) * 3}, DARK),
    ],
)
def test_the_budget_names_the_noise_that_rules(changed: dict[str, object], source: str) -> None:
    expected = series(((0.003, 1.0),), **changed)  # type: ignore[arg-type]
    budget = information(expected).budget
    assert max(budget, key=lambda name: budget[name][0]) == source


def test_reading_rules_where_it_is_raised() -> None:
    expected = series(flicker=1e-4)
    louder = replace(
        expected, variances={**expected.variances, READING: 1e4 * expected.variances[READING]}
    )
    budget = information(louder).budget
    assert max(budget, key=lambda name: budget[name][0]) == READING


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("fast_per_s", "slow_per_s", "snr"),
    [(0.06, 0.02, 7), pytest.param(0.05, 0.03, 40, marks=pytest.mark.campaign)],
)
def test_the_chance_of_telling_two_states_is_how_often_the_fit_does(
    fast_per_s: float, slow_per_s: float, snr: float
) -> None:
    truth = ((fast_per_s, 1.0), (slow_per_s, 1.0))
    expected = series(truth, snr=snr)
    told = 0
    for seed in MANY:
        seen = truths.observe(truths.exponentials(*truth), seed, snr=snr)
        fit = fit_decay(
            seen.t_s, seen.values, seen.sigma, exposure_s=seen.exposure_s, channels="RGB",
            flicker=expected.flicker,
        )  # fmt: skip
        told += fit.n_states == 2
    assert told / len(MANY) == pytest.approx(chance_of_all_states(expected), abs=0.2)
