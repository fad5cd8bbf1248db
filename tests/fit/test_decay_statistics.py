"""Uncertainties, choices and warnings over a few dozen seeds; many more in tests/acceptance."""

from collections.abc import Sequence

import numpy as np
import pytest

from labrig.fit import DecayFit, fit_decay
from labrig.foundation.arrays import FloatArray
from tests.fit import truths
from tests.warned import codes

SINGLE = ((0.02, 1.0),)
DOUBLE = ((0.08, 1.0), (0.015, 0.4))
CLOSE = ((0.05, 1.0), (0.02, 1.0))
SEEDS = range(30)
CAMPAIGN = pytest.mark.campaign


def _fits(
    decay: truths.Decay,
    seeds: Sequence[int] = SEEDS,
    flicker: float | None = None,
    n_states: int | None = None,
    *,
    true_flicker: float = 0.007,
    heavy_tails: bool = False,
) -> list[DecayFit]:
    seen = [
        truths.observe(decay, seed, flicker=true_flicker, heavy_tails=heavy_tails) for seed in seeds
    ]
    return [
        fit_decay(
            one.t_s,
            one.values,
            one.sigma,
            exposure_s=one.exposure_s,
            channels="RGB",
            flicker=flicker,
            n_states=n_states,
        )
        for one in seen
    ]


def _pulls(fits: list[DecayFit], truth: tuple[tuple[float, float], ...]) -> FloatArray:
    return np.array(
        [
            (state.k_r_per_s - k) / state.k_r_per_s_sigma
            for fit in fits
            for state, (k, _) in zip(fit.states, truth, strict=True)
        ]
    )


@pytest.mark.parametrize("flicker", [0.007, pytest.param(None, marks=CAMPAIGN)])
@pytest.mark.parametrize(
    "truth",
    [pytest.param(SINGLE, marks=CAMPAIGN), DOUBLE, pytest.param(CLOSE, marks=CAMPAIGN)],
    ids=["1", "2", "2 close"],
)
def test_number_and_rates_within_their_sigma(
    truth: tuple[tuple[float, float], ...], flicker: float | None
) -> None:
    fits = _fits(truths.exponentials(*truth), flicker=flicker)
    assert [fit.n_states for fit in fits] == [len(truth)] * len(fits)
    pulls = _pulls(fits, truth)
    assert np.abs(pulls).max() < 4.5
    # E|z| = 0.80, of 30 or 60 within 0.11.
    assert 0.55 < np.abs(pulls).mean() < 1.05
    assert 0.8 < np.median([fit.reduced_chi2 for fit in fits]) < 1.2


@pytest.mark.parametrize(
    ("dark_sigma", "seeds"),
    [
        (0.01, 10),
        pytest.param(0.004, 100, marks=CAMPAIGN),
        pytest.param(0.01, 100, marks=CAMPAIGN),
    ],
)
def test_dark_errors_of_opposite_signs_make_no_state(dark_sigma: float, seeds: int) -> None:
    fits = []
    for seed in range(seeds):
        seen = truths.observe(truths.exponentials(*SINGLE), seed, snr=100)
        dark = dark_sigma * np.abs(np.random.default_rng(seed + 1000).normal(size=3)) * [-1, 1, -1]
        fits.append(
            fit_decay(
                seen.t_s,
                seen.values + dark,
                seen.sigma,
                exposure_s=seen.exposure_s,
                channels="RGB",
                offset_sigma=dark_sigma,
                flicker=0.007,
            )
        )
    single = [fit for fit in fits if fit.n_states == 1]
    assert len(single) >= seeds - 1
    pulls = _pulls(single, SINGLE)
    assert np.abs(pulls).max() < 4.5
    # Of 100, 7 % by chance.
    assert abs(np.sqrt(np.mean(pulls**2)) - 1) < 2 / np.sqrt(seeds)
    assert 0.9 < np.median([fit.reduced_chi2 for fit in fits]) < 1.1


def test_sigma_is_the_cramer_rao_bound() -> None:
    fits = _fits(truths.exponentials(*DOUBLE), range(8), flicker=0.007, n_states=2)
    seen = truths.observe(truths.exponentials(*DOUBLE), 0)
    bound = truths.fisher_rate_sigma(DOUBLE, seen, 0.007)
    sigma = np.median([[state.k_r_per_s_sigma for state in fit.states] for fit in fits], axis=0)
    # 1.1 % and 0.5 %: docs/physics, "Decay fit".
    np.testing.assert_allclose(bound / [0.08, 0.015], [0.011, 0.005], rtol=0.1)
    np.testing.assert_allclose(sigma / bound, 1, atol=0.07)


@pytest.mark.parametrize(
    "decay",
    [
        truths.exponentials(*DOUBLE),
        pytest.param(truths.power_law(10, 1.5), marks=CAMPAIGN),
        pytest.param(truths.stretched(20, 0.5), marks=CAMPAIGN),
    ],
    ids=["2 states", "power law", "stretched"],
)
@pytest.mark.parametrize("true_flicker", [0.007, pytest.param(0.02, marks=CAMPAIGN)])
def test_flicker_from_the_data_whatever_the_law(decay: truths.Decay, true_flicker: float) -> None:
    fits = _fits(decay, range(20), true_flicker=true_flicker, n_states=1)
    found = np.array([fit.flicker for fit in fits])
    assert np.sqrt(np.mean(found**2)) == pytest.approx(true_flicker, rel=0.2)
    # n_states = 1 is wrong for all of these, and the flicker has not covered it up.
    assert all("residuals-correlated" in codes(fit.warnings) for fit in fits)
    claimed = np.mean([fit.flicker_sigma for fit in fits])
    assert 0.6 < np.std(found) / claimed < 1.5


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("decay", "name"),
    [
        (truths.power_law(3, 1.2), "becquerel"),
        (truths.power_law(10, 1.5), "becquerel"),
        (truths.stretched(20, 0.5), "stretched"),
    ],
)
@pytest.mark.parametrize("flicker", [0.007, pytest.param(None, marks=CAMPAIGN)])
def test_other_laws_are_chosen(decay: truths.Decay, name: str, flicker: float | None) -> None:
    fits = _fits(decay, range(15), flicker)
    assert np.mean([fit.law == name for fit in fits]) >= 0.8
    assert all(
        ("rates-descriptive" in codes(fit.warnings)) != (fit.law == "exponentials") for fit in fits
    )


def test_drifting_background_is_noticed() -> None:
    fits = _fits(lambda t: truths.exponentials(*DOUBLE)(t) + 0.01 * t / 180, range(10), 0.007)
    assert np.mean([bool(fit.warnings) for fit in fits]) >= 0.9


def test_heavy_tailed_flicker_leaves_the_choice_alone() -> None:
    fits = _fits(truths.exponentials(*DOUBLE), range(10), heavy_tails=True)
    assert all(fit.n_states == 2 for fit in fits)
    assert np.abs(_pulls(fits, DOUBLE)).max() < 5


def test_unsuspected_flicker_makes_no_states_but_a_warning() -> None:
    fits = _fits(truths.exponentials(*SINGLE), range(15), flicker=0.0)
    assert all(fit.n_states == 1 for fit in fits)
    warned = ["scatter-exceeds-sigma" in codes(fit.warnings) for fit in fits]
    assert np.mean(warned) > 0.7


def test_growing_exposures_improve_the_slow_rate() -> None:
    growing_s = np.minimum(0.25 * 1.085 ** np.arange(37), 4.0)
    decay = truths.exponentials(*DOUBLE)

    def sigma(exposure_s: float | FloatArray) -> float:
        seen = truths.observe(decay, 1, snr=100, flicker=0, exposure_s=exposure_s)
        # Photons collect in proportion to the exposure.
        noise = seen.sigma * np.sqrt(0.25 / seen.exposure_s)[:, None]
        fit = fit_decay(
            seen.t_s,
            np.multiply.outer(truths.exposed(decay, seen.t_s, seen.exposure_s), truths.RGB_WEIGHTS),
            noise,
            exposure_s=seen.exposure_s,
            channels="RGB",
            n_states=2,
        )
        return fit.states[1].k_r_per_s_sigma

    assert sigma(0.25) / sigma(growing_s) > 2


@pytest.mark.campaign
def test_flicker_known_from_few_bright_frames_is_known_badly_and_counted_so() -> None:
    """A state that is gone after five frames: what flicker could be is in σ, and not twice."""
    truth = ((0.2, 1.0),)
    fits = _fits(truths.exponentials(*truth), range(60))
    pulls = _pulls(fits, truth)
    error = [fit.states[0].k_r_per_s - 0.2 for fit in fits]
    sigma = [fit.states[0].k_r_per_s_sigma for fit in fits]
    # σ of the ratio: 9 %.
    assert 0.85 < np.sqrt(np.mean(np.square(sigma)) / np.mean(np.square(error))) < 1.35
    assert np.abs(pulls).max() < 4


@pytest.mark.parametrize("n_channels", [pytest.param(1, marks=CAMPAIGN), 3])
def test_repeats_reach_levels_of_their_own(n_channels: int) -> None:
    """Three charges under a lamp that ages: no flicker is made of it."""
    weights = truths.RGB_WEIGHTS[-n_channels:] / truths.RGB_WEIGHTS[-n_channels:].max()
    true_levels = np.array([1.05, 1.0, 0.95])
    fits = []
    for seed in range(15):
        seen = [
            truths.observe(truths.exponentials(*DOUBLE), 1000 + 10 * seed + i, weights=weights)
            for i in range(3)
        ]
        values = [one.values * level for one, level in zip(seen, true_levels, strict=True)]
        fits.append(
            fit_decay(
                np.concatenate([one.t_s for one in seen]),
                np.concatenate(values),
                np.concatenate([one.sigma for one in seen]),
                exposure_s=seen[0].exposure_s[0],
                channels="RGB"[:n_channels],
                flicker=None,
                repeats=np.repeat(["first", "second", "third"], 37).tolist(),
            )
        )
    levels = np.array([fit.levels for fit in fits])
    np.testing.assert_allclose(levels.mean(axis=0), true_levels, atol=0.001)
    assert np.sqrt(np.mean([fit.flicker**2 for fit in fits])) == pytest.approx(0.007, rel=0.15)
    assert all(fit.n_states == 2 for fit in fits)
    # Each kind of warning comes by chance in one fit of 2000.
    assert sum(bool(fit.warnings) for fit in fits) <= 1
    assert 0.6 < np.std(_pulls(fits, DOUBLE)) < 1.4
    assert "levels   first 1.0" in str(fits[0])


@pytest.mark.parametrize("asked", [None, 2])
def test_two_states_that_fewer_do_not_describe_are_kept_beside_a_free_offset(
    asked: int | None,
) -> None:
    """Truth 0.08 and 0.01 /s on 80 s: one state is refuted, the other's σ is wide."""
    t_s = np.linspace(0, 80, 60)
    noise = 0.01 * np.random.default_rng(1).normal(size=len(t_s))
    values = np.exp(-0.08 * t_s) + 0.5 * np.exp(-0.01 * t_s) + noise
    fit = fit_decay(t_s, values, 0.01, offset_sigma=np.inf, n_states=asked)
    fast, slow = fit.states
    assert abs(fast.k_r_per_s - 0.08) < 2 * fast.k_r_per_s_sigma
    assert abs(slow.k_r_per_s - 0.01) < 2 * slow.k_r_per_s_sigma
    assert fit.reduced_chi2 < 1.5
    assert "offset-unresolved" in codes(fit.warnings)
    assert "states-unsupported" not in codes(fit.warnings)
    assert not any("--states" in each.sentence for each in fit.warnings)
