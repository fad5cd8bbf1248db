"""Noise-free decays give back their parameters, in any unit, order and exposure."""

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from labrig.fit import DecayFit, fit_decay
from labrig.fit.decay.series import decay_series, whitened
from labrig.fit.decay.states import exponentials
from labrig.fit.decay.variable_projection import JointProblem, covariance_under_flicker, fit_jointly
from labrig.foundation.arrays import FloatArray
from tests.fit import truths
from tests.pulls import assert_sigma_is_right
from tests.warned import of_code

States = tuple[tuple[float, float], ...]


@st.composite
def states(draw: st.DrawFn) -> States:
    """1–3 states, rates 2.5–5 apart up to 0.5 /s, none dimmer than a tenth."""
    rates = [draw(st.floats(0.006, 0.03))]
    for _ in range(draw(st.integers(0, 2))):
        rates.append(min(rates[-1] * draw(st.floats(2.5, 5.0)), 0.5))
    return tuple((rate, draw(st.floats(0.1, 1.0))) for rate in reversed(rates))


def _fit(seen: truths.Observed, **options: object) -> DecayFit:
    channels = "RGB"[: seen.values.shape[1]]
    return fit_decay(
        seen.t_s,
        seen.values,
        seen.sigma,
        exposure_s=seen.exposure_s,
        channels=channels,
        **options,  # type: ignore[arg-type]
    )


def _exact(truth: States, exposure_s: float | FloatArray, snr: float = 300.0) -> truths.Observed:
    """Without a trace of noise, at the σ of a measurement of `snr`."""
    exposure = np.broadcast_to(np.asarray(exposure_s), truths.TIMES_S.shape)
    signal = truths.exposed(truths.exponentials(*truth), truths.TIMES_S, exposure)
    values = np.multiply.outer(signal, truths.RGB_WEIGHTS)
    return truths.Observed(truths.TIMES_S, exposure, values, np.sqrt(values + 1e-4) / snr)


def _assert_recovered(fit: DecayFit, truth: States, rtol: float = 1e-6) -> None:
    found = [(state.k_r_per_s, state.amplitude) for state in fit.states]
    np.testing.assert_allclose(found, truth, rtol=rtol)


# So flat a valley that damped steps were short two thousandths of the rate before its lowest place.
@example(truth=((0.0425390625, 0.6796875), (0.01546875, 0.1), (0.006, 0.55859375)), exposure_s=5.0)
@settings(deadline=None)
@given(truth=states(), exposure_s=st.sampled_from([0.0, 0.02, 1.5, 5.0]))
def test_parameters_are_recovered(truth: States, exposure_s: float) -> None:
    fit = _fit(_exact(truth, exposure_s), n_states=len(truth))
    _assert_recovered(fit, truth)
    np.testing.assert_allclose(fit.channel_weights, truths.RGB_WEIGHTS, rtol=1e-9)


@settings(deadline=None, max_examples=15)
@given(truth=states())
def test_number_of_states_is_recovered_with_growing_exposures(truth: States) -> None:
    growing_s = np.minimum(0.3 * 1.09 ** np.arange(37), 4.5)
    _assert_recovered(_fit(_exact(truth, growing_s, snr=1e6)), truth)


@pytest.mark.parametrize("flicker", [0.0, 0.007, None])
@pytest.mark.parametrize("offset_sigma", [0.0, 0.01, np.inf])
def test_any_noise_model_recovers_exact_data(flicker: float | None, offset_sigma: float) -> None:
    truth = ((0.08, 1.0), (0.015, 0.4))
    fit = _fit(_exact(truth, 1.5), n_states=2, flicker=flicker, offset_sigma=offset_sigma)
    _assert_recovered(fit, truth)
    assert fit.offsets == pytest.approx([0, 0, 0], abs=1e-8)


def test_free_offset_of_each_channel_is_found() -> None:
    truth = ((0.08, 1.0), (0.015, 0.4))
    exact = _exact(truth, 1.5)
    darks = np.array([0.05, -0.02, 0.01])
    moved = truths.Observed(exact.t_s, exact.exposure_s, exact.values + darks, exact.sigma)
    fit = _fit(moved, offset_sigma=np.inf)
    _assert_recovered(fit, truth)
    assert fit.offsets == pytest.approx(darks, rel=1e-6)
    assert all(sigma > 0 for sigma in fit.offsets_sigma)
    # The brightest channel is G.
    assert (fit.offset, fit.offset_sigma) == (fit.offsets[1], fit.offsets_sigma[1])
    assert fit.dof == 37 * 3 - 4 - 2 - 3


def test_each_channel_has_its_own_prior() -> None:
    truth = ((0.08, 1.0), (0.015, 0.4))
    exact = _exact(truth, 1.5)
    values = exact.values + np.array([0.0, 0.05, 0.01])
    moved = truths.Observed(exact.t_s, exact.exposure_s, values, exact.sigma)
    fit = _fit(moved, n_states=2, offset_sigma=[0.0, np.inf, 0.5])
    _assert_recovered(fit, truth, rtol=1e-4)
    assert (fit.offsets[0], fit.offsets_sigma[0]) == (0, 0)
    assert fit.offsets[1:] == pytest.approx([0.05, 0.01], rel=1e-4)
    # One prior datum: that of B.
    assert fit.dof == 37 * 3 + 1 - 4 - 2 - 2


@pytest.mark.parametrize("offset_sigma", [0.0, 0.004, np.inf])
def test_one_prior_for_all_is_the_same_for_each(offset_sigma: float) -> None:
    seen = truths.observe(truths.exponentials((0.08, 1.0)), seed=9, dark_sigma=0.004)
    one = _fit(seen, flicker=None, offset_sigma=offset_sigma)
    each = _fit(seen, flicker=None, offset_sigma=np.full(3, offset_sigma))
    assert one.to_json() == each.to_json()


def test_channel_that_was_not_measured_has_no_offset() -> None:
    exact = _exact(((0.08, 1.0), (0.015, 0.4)), 1.5)
    sigma = exact.sigma.copy()
    sigma[:, 2] = np.inf
    fit = _fit(
        truths.Observed(exact.t_s, exact.exposure_s, exact.values, sigma),
        offset_sigma=np.inf,
        flicker=0.007,
    )
    _assert_recovered(fit, ((0.08, 1.0), (0.015, 0.4)))
    assert (fit.offsets[2], fit.offsets_sigma[2]) == (0, 0)


def test_free_offset_is_found() -> None:
    truth = ((0.08, 1.0), (0.015, 0.4))
    exact = _exact(truth, 1.5)
    raised = truths.Observed(exact.t_s, exact.exposure_s, exact.values + 0.05, exact.sigma)
    fit = _fit(raised, offset_sigma=np.inf)
    _assert_recovered(fit, truth)
    assert fit.offset == pytest.approx(0.05, rel=1e-6)
    assert fit.offset_sigma > 0


def test_fixed_rate_is_held_and_drops_out_of_the_covariance() -> None:
    truth = ((0.08, 1.0), (0.015, 0.4))
    fit = _fit(_exact(truth, 1.5), fixed_rates=[0.015])
    _assert_recovered(fit, truth)
    assert fit.states[1].k_r_per_s_sigma == 0
    assert not fit.covariance[2].any()
    assert fit.covariance[3, 3] > 0


def test_fixed_rate_without_amplitude_is_dropped_with_a_warning() -> None:
    fit = _fit(_exact(((0.02, 1.0),), 0.0), n_states=2, fixed_rates=[0.3])
    assert fit.n_states == 1
    assert of_code(fit.warnings, "states-unsupported").values["requested"] == 2


@pytest.mark.parametrize("time_unit", [1e-3, 60.0])
@pytest.mark.parametrize("value_unit", [1e-7, 3e4])
def test_units_do_not_matter(time_unit: float, value_unit: float) -> None:
    seen = truths.observe(truths.exponentials((0.08, 1.0), (0.015, 0.4)), seed=5)
    here = _fit(seen, flicker=None)
    there = _fit(
        truths.Observed(
            seen.t_s * time_unit,
            seen.exposure_s * time_unit,
            seen.values * value_unit,
            seen.sigma * value_unit,
        ),
        flicker=None,
    )
    assert there.n_states == here.n_states
    for a, b in zip(here.states, there.states, strict=True):
        assert b.k_r_per_s * time_unit == pytest.approx(a.k_r_per_s, rel=1e-8)
        assert b.k_r_per_s_sigma * time_unit == pytest.approx(a.k_r_per_s_sigma, rel=1e-6)
        assert b.amplitude / value_unit == pytest.approx(a.amplitude, rel=1e-8)
    assert there.bic == pytest.approx(here.bic, rel=1e-8)


def test_order_of_channels_and_frames_does_not_matter() -> None:
    decay = truths.exponentials((0.08, 1.0), (0.015, 0.4))
    seen = truths.observe(decay, seed=6, dark_sigma=0.004)
    dark_sigma = np.array([0.003, 0.004, 0.005])
    here = _fit(seen, flicker=0.007, offset_sigma=dark_sigma)
    frames = np.random.default_rng(1).permutation(37)
    channels = [2, 0, 1]
    there = fit_decay(
        seen.t_s[frames],
        seen.values[frames][:, channels],
        seen.sigma[frames][:, channels],
        exposure_s=seen.exposure_s[frames],
        channels="BRG",
        flicker=0.007,
        offset_sigma=dark_sigma[channels],
    )
    np.testing.assert_allclose(there.offsets, np.array(here.offsets)[channels], rtol=1e-7)
    np.testing.assert_allclose(
        there.offsets_sigma, np.array(here.offsets_sigma)[channels], rtol=1e-6
    )
    np.testing.assert_allclose(there.covariance, here.covariance, rtol=1e-6)
    for a, b in zip(here.states, there.states, strict=True):
        assert b.k_r_per_s == pytest.approx(a.k_r_per_s, rel=1e-9)
    np.testing.assert_allclose(there.residuals, here.residuals[frames][:, channels], atol=1e-11)
    np.testing.assert_allclose(
        there.normalised_residuals, here.normalised_residuals[frames][:, channels], atol=1e-7
    )


@pytest.mark.parametrize("second", [0.999, 1.0, 1.001])
def test_two_channels_about_equally_bright(second: float) -> None:
    decay = truths.exponentials((0.08, 1.0), (0.015, 0.4))
    for seed in range(5):
        fit = _fit(truths.observe(decay, seed, weights=np.array([1.0, second])), flicker=0.007)
        assert max(fit.channel_weights) == 1
        assert fit.channel_weights == pytest.approx([1, second], abs=0.01)
        assert sorted(fit.channel_weights_sigma)[0] == 0


def test_value_of_infinite_sigma_is_left_out() -> None:
    truth = ((0.08, 1.0), (0.015, 0.4))
    exact = _exact(truth, 1.5)
    values, sigma = exact.values.copy(), exact.sigma.copy()
    values[0, 1], sigma[0, 1] = np.nan, np.inf
    values[5], sigma[5] = 1e9, np.inf
    fit = _fit(truths.Observed(exact.t_s, exact.exposure_s, values, sigma), flicker=0.007)
    _assert_recovered(fit, truth)
    assert fit.dof == 37 * 3 - 4 - 6


@pytest.mark.parametrize("offset_sigma", [0.0, 0.02, (0.02, 0.0, np.inf), np.inf])
def test_jacobian_is_the_difference(offset_sigma: float | tuple[float, ...]) -> None:
    seen = truths.observe(truths.exponentials((0.08, 1.0), (0.015, 0.4)), seed=7)
    series = decay_series(seen.t_s, seen.values, seen.sigma, seen.exposure_s, "RGB", offset_sigma)
    data = whitened(series, series.values, 0.007)
    fixed = np.log([2.0])
    problem = JointProblem(data, exponentials(series, 2, fixed), 5, [0, 2])
    offsets = [0.01] * len(series.fitted_offsets)
    x = np.array([2.5, 0.9, 0.9, 0.3, 0.1, 0.6, 0.3, *offsets])
    _, jacobian = problem.residuals(x)
    for j, step in enumerate(1e-6 * np.eye(len(x))):
        difference = (problem.residuals(x + step)[0] - problem.residuals(x - step)[0]) / 2e-6
        np.testing.assert_allclose(jacobian[:, j], difference, rtol=1e-6, atol=1e-5)


def test_whitening_is_the_inverse_root_of_the_covariance() -> None:
    seen = truths.observe(truths.exponentials((0.08, 1.0)), seed=8)
    series = decay_series(seen.t_s, seen.values, seen.sigma, seen.exposure_s, "RGB", 0.0)
    matrices = whitened(series, series.values, 0.05).matrices
    covariance = (1 / series.inverse_sigma**2)[:, :, None] * np.eye(3) + 0.05**2 * (
        series.values[:, :, None] * series.values[:, None, :]
    )
    np.testing.assert_allclose(
        np.einsum("fab,fbc,fdc->fad", matrices, covariance, matrices),
        np.broadcast_to(np.eye(3), (37, 3, 3)),
        atol=1e-9,
    )


def test_covariance_is_that_of_the_weights_used_whatever_the_flicker() -> None:
    """Frames that flicker by 2 % and are weighed as if by 0.1 %."""
    assumed, true, errors = 0.001, 0.02, []
    decay, weights, free = truths.exponentials((0.05, 1.0)), truths.RGB_WEIGHTS, np.full(2, np.inf)
    for seed in range(200):
        seen = truths.observe(decay, 40_000 + seed, flicker=true)
        series = decay_series(seen.t_s, seen.values, seen.sigma, seen.exposure_s, "RGB", 0.0)
        course = truths.exposed(decay, seen.t_s, seen.exposure_s) / series.peak
        signal = np.multiply.outer(course, weights)
        start = np.array([np.log(0.05 * series.span_s), 1.0])
        data, shape = whitened(series, signal, assumed), exponentials(series, 1, np.empty(0))
        fit = fit_jointly(data, shape, start, weights, np.zeros(3), -free, free, 50, 1e-8)
        errors.append(fit.shape[0] - start[0])
    sigma2 = covariance_under_flicker(fit, data, signal, true**2 - assumed**2)[0, 0]
    assert_sigma_is_right(np.array(errors) / np.sqrt(sigma2))
    data = whitened(series, signal, true)
    best = fit_jointly(data, shape, start, weights, np.zeros(3), -free, free, 50, 1e-8)
    assert sigma2 > 2 * best.least_squares.covariance[0, 0]
