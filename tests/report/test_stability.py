"""Repeats held against one another, and frames against their planned times."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.fit import DecayFit
from labrig.protocols.decay.report import repeats, steady
from labrig.report.decay_figures import fitted_curve
from labrig.report.timing import FrameTiming, frame_lateness
from labrig.results import Series

from .made import decay_series, fitted

SERIES = decay_series(60)


def fit_of(series: Series) -> DecayFit:
    fit = fitted(series)
    assert isinstance(fit, DecayFit)
    return fit


FIT = fit_of(SERIES)


def test_a_decay_that_was_brighter_is_found() -> None:
    unit = np.where(np.arange(60) % 2, "decay-2", "decay-1")
    model = FIT.predict(SERIES.t_s, SERIES.exposure_s)
    signal = model - np.array(FIT.offsets)
    brighter = np.where(unit == "decay-2", 1.05, 1.0)[:, np.newaxis]
    series = replace(
        SERIES,
        values=model + (brighter - 1) * signal,
        sigma=np.full_like(SERIES.sigma, 1e-6),
        unit=tuple(unit),
    )
    (repeat,) = repeats(series, FIT)
    assert repeat.unit == "decay-2"
    assert repeat.ratio == pytest.approx(1.05, rel=1e-6)
    # 30 frames of each, without noise of their own.
    assert repeat.sigma == pytest.approx(1.05 * FIT.flicker * np.sqrt(2 / 30), rel=0.03)


def test_a_single_decay_has_nothing_to_compare() -> None:
    assert repeats(SERIES, FIT) == ()


def test_a_repeat_without_usable_frames_is_left_out() -> None:
    unit = ("decay-1",) * 30 + ("decay-2",) * 30
    flag = ("",) * 30 + ("clipped",) * 30
    assert repeats(replace(SERIES, unit=unit, flag=flag), FIT) == ()


def test_lateness_in_numbers() -> None:
    timings = [FrameTiming(f"{n}", "decay-1", 5.0 * n, 0.001 * n) for n in range(101)]
    late = frame_lateness(timings)
    assert late is not None
    assert late.median_s == pytest.approx(0.050)
    assert late.p95_s == pytest.approx(0.095)
    assert (late.worst_s, late.worst_frame) == (0.1, "100")
    assert frame_lateness([]) is None


def test_the_band_is_what_the_covariance_scatters_curves_by() -> None:
    curve = fitted_curve(SERIES, FIT)
    rng = np.random.default_rng(5)
    best = [[state.k_r_per_s, state.amplitude] for state in FIT.states]
    drawn = rng.multivariate_normal([*np.ravel(best), FIT.offset], FIT.covariance, 4000)
    middle_s = curve.t_s[::20]
    # Over an exposure of 1 s a mean is its middle but for a part in 1000 at these rates.
    curves = sum(
        drawn[:, 2 * n + 1, np.newaxis] * np.exp(-np.multiply.outer(drawn[:, 2 * n], middle_s))
        for n in range(FIT.n_states)
    )
    np.testing.assert_allclose(curve.sigma[::20], np.std(curves + drawn[:, -1:], axis=0), rtol=0.06)


def test_an_unknown_parameter_leaves_the_band_unknown() -> None:
    covariance = FIT.covariance.copy()
    covariance[0, 0] = np.inf
    assert np.isinf(fitted_curve(SERIES, replace(FIT, covariance=covariance)).sigma).all()


@pytest.mark.parametrize("drift", [0.0, 0.02, -0.05])
def test_a_steady_source_tells_its_level_and_its_drift_within_their_sigma(drift: float) -> None:
    rng = np.random.default_rng(3)
    seen = []
    for _ in range(200):
        frames = 1 + drift * (np.arange(60) / 59 - 0.5) + 0.007 * rng.standard_normal(60)
        found = steady(replace(SERIES, values=np.outer(frames, [10.0, 400.0, 90.0])))
        assert found is not None
        assert found.channel == "G"
        seen.append(
            ((found.level - 400) / found.level_sigma, (found.drift - drift) / found.drift_sigma)
        )
    # 200 draws: a mean is known to 0.07, a scatter to 5 %
    assert np.abs(np.mean(seen, axis=0)).max() < 0.25
    assert np.std(seen, axis=0) == pytest.approx([1.0, 1.0], abs=0.2)


def test_what_was_dark_is_not_called_steady() -> None:
    noise = np.random.default_rng(4).standard_normal(SERIES.values.shape)
    assert steady(replace(SERIES, values=noise)) is None
    assert steady(replace(SERIES, flag=("clipped",) * 60)) is None
