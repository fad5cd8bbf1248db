"""Periodic flicker: its line in the residuals, false alarms, and what even spacing hides."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.signal import lombscargle

from labrig.fit import DecayFit, fit_decay, periodogram
from labrig.fit.decay.diagnostics import unseen_flicker
from labrig.foundation.arrays import FloatArray
from labrig.protocols.steps.random_spacing import RandomSpacing
from tests.warned import codes

EVEN_S = np.linspace(0.5, 175.5, 36)
RATE_PER_S, EXPOSURE_S = 0.02, 0.6


def random_s(seed: int) -> FloatArray:
    """Begins as a decay draws them."""
    spacing = RandomSpacing(5.0, 1.7)
    return np.array(spacing.begins_s(EVEN_S.tolist(), [EXPOSURE_S] * len(EVEN_S), seed))


def flickering(t_s: FloatArray, seed: int, ripple: float, period_s: float = 5.1) -> DecayFit:
    """A fit to one exponential whose light flickers periodically."""
    rng = np.random.default_rng([seed, 7])
    phase = 2 * np.pi * (t_s + EXPOSURE_S / 2) / period_s + rng.uniform(0, 2 * np.pi)
    x = RATE_PER_S * EXPOSURE_S
    light = np.exp(-RATE_PER_S * t_s) * -np.expm1(-x) / x
    light *= 1 + ripple * np.sinc(EXPOSURE_S / period_s) * np.sin(phase)
    light *= 1 + 0.001 * rng.standard_normal(len(t_s))
    values = np.outer(light, [1.0, 0.6]) + 3e-4 * rng.standard_normal((len(t_s), 2))
    return fit_decay(
        t_s,
        values,
        np.full_like(values, 3e-4),
        exposure_s=EXPOSURE_S,
        channels=("G", "B"),
        n_states=1,
        flicker=None,
    )


def test_a_beat_that_evenly_spaced_frames_take_for_decay_is_noise_to_random_ones() -> None:
    even = [flickering(EVEN_S, seed, 0.007) for seed in range(12)]
    random = [flickering(random_s(seed), seed, 0.007) for seed in range(12)]
    pulls = [
        [(fit.rates[0].value - RATE_PER_S) / fit.rates[0].sigma for fit in fits]
        for fits in (even, random)
    ]
    assert np.max(np.abs(pulls[0])) > 3
    assert np.max(np.abs(pulls[1])) < 3
    assert all(fit.unseen_flicker is not None for fit in even)
    assert not any(fit.unseen_flicker for fit in random)
    periods_s = [
        each.values["period_s"]
        for fit in random
        for each in fit.warnings
        if each.code == "residuals-periodic"
    ]
    assert sum(5 <= period_s < 6 for period_s in periods_s) > 8


def test_a_clean_decay_has_no_warning_whatever_its_spacing() -> None:
    for seed in range(8):
        for t_s in (EVEN_S, random_s(seed)):
            assert "residuals-periodic" not in codes(flickering(t_s, seed, 0.0).warnings)


@pytest.mark.parametrize("is_random", [False, True])
def test_the_p_value_is_the_chance_of_a_line_in_noise(is_random: bool) -> None:
    rng = np.random.default_rng(3)
    snr = np.exp(-RATE_PER_S * EVEN_S) * 300
    p_values, found = [], None
    for seed in range(400):
        t_s = random_s(seed) if is_random else EVEN_S
        found = periodogram(t_s, rng.standard_normal(len(t_s)), snr)
        assert found is not None
        p_values.append(found.p_value)
    # 5 % within three binomial σ; a line that is not quite independent of others counts for less.
    assert 0.017 < np.mean(np.array(p_values) < 0.05) < 0.083
    assert found is not None
    assert found.power_at(found.p_value) == pytest.approx(found.power.max(), rel=1e-6)


@given(
    period_s=st.floats(3.0, 25.0),
    phase=st.floats(0, 6.28),
    seed=st.integers(0, 10_000),
)
def test_a_flicker_is_a_line_at_its_period(period_s: float, phase: float, seed: int) -> None:
    t_s = random_s(seed)
    found = periodogram(t_s, np.sin(2 * np.pi * t_s / period_s + phase), np.ones_like(t_s))
    assert found is not None
    assert abs(1 / found.period_s - 1 / period_s) < 1 / np.ptp(t_s)
    assert found.p_value < 1e-6


def test_even_spacing_hides_what_exposures_do_not_average_out() -> None:
    short = unseen_flicker(EVEN_S, np.full(36, 0.1))
    long = unseen_flicker(EVEN_S, np.full(36, 3.2))
    assert short is not None
    assert long is not None
    assert short.period_s == pytest.approx(5.0, rel=1e-6)
    assert short.share == pytest.approx(np.sinc(0.1 / 5.0), rel=1e-6)
    assert long.share == pytest.approx(np.sinc(3.2 / 5.0), rel=1e-6)
    assert unseen_flicker(EVEN_S, np.full(36, 5.0)) is None
    # A clock that is read to a millisecond is no random one; a second of 5 s is not enough.
    nearly: FloatArray = EVEN_S + np.random.default_rng(1).uniform(0, 0.3, 36)
    assert unseen_flicker(nearly, np.zeros(36)) is not None


@pytest.mark.parametrize(
    "t_s",
    [
        np.geomspace(1.0, 1000.0, 40),
        np.cumsum(4.0 * 1.25 ** np.arange(14)),
        np.sort(np.random.default_rng(5).uniform(0, 100, 30)),
        EVEN_S[:8],
    ],
    ids=["logarithmic", "growing pauses", "random", "few"],
)
def test_other_spacings_hide_nothing(t_s: FloatArray) -> None:
    assert unseen_flicker(t_s, np.zeros_like(t_s)) is None


def test_two_even_spacings_hide_their_common_period() -> None:
    t_s = np.concatenate([1.5 * np.arange(40), 66.0 + 12.0 * np.arange(20)])
    found = unseen_flicker(t_s, np.zeros_like(t_s))
    assert found is not None
    assert 1.5 / found.period_s == pytest.approx(round(1.5 / found.period_s), abs=1e-3)


@pytest.mark.parametrize("spacing", ["even", "uneven"])
def test_the_periodogram_is_that_of_scipy(spacing: str) -> None:
    draw = np.random.default_rng(4)
    uneven = np.sort(draw.uniform(0, 200, 40))
    t_s = 5.0 * np.arange(40.0) if spacing == "even" else uneven
    residuals, signal_to_noise = draw.normal(size=40), draw.uniform(1, 300, 40)
    lines = periodogram(t_s, residuals, signal_to_noise)
    assert lines is not None
    peer = lombscargle(
        t_s - t_s[0],
        residuals / signal_to_noise,
        2 * np.pi * lines.frequency_hz,
        normalize=True,
        weights=signal_to_noise**2,
    )
    np.testing.assert_allclose(lines.power, peer, atol=1e-9)


def test_a_steady_light_of_many_photons_is_no_flicker_that_drifts() -> None:
    """A least flicker of 0.1 % would be three times the noise: that there is none may be true."""
    t_s, weights, rate_per_s = np.linspace(3.0, 180.0, 100), np.array([1.0, 0.5, 0.1]), 0.02
    signal = 1000 * np.exp(-rate_per_s * t_s)[:, np.newaxis] * weights
    sigma = np.sqrt(signal / 1000 + 1e-4)
    pulls, told = [], []
    for seed in range(60):
        noise = np.random.default_rng([31, seed]).standard_normal(signal.shape)
        fit = fit_decay(
            t_s, signal + sigma * noise, sigma, channels=("R", "G", "B"), flicker=None,
            offset_sigma=np.inf, n_states=1,
        )  # fmt: skip
        (state,) = fit.states
        pulls.append((state.k_r_per_s - rate_per_s) / state.k_r_per_s_sigma)
        told += codes(fit.warnings)
    # Of such series with independent noise one in 240 is told to correlate.
    assert told.count("noise-correlated") < 2
    # σ allows for a drift along with the decay, which leaves no scatter.
    assert 0.6 < (rms := float(np.sqrt(np.mean(np.square(pulls))))) < 0.85, rms
