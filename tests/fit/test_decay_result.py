"""What a decay fit hands back: JSON, table, predictions, warnings, refusals."""

import json
import re
from typing import Any

import numpy as np
import pytest
from scipy.optimize import curve_fit

from labrig.fit import DecayFit, fit_decay
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from tests.fit import truths
from tests.warned import codes, of_code

DOUBLE = truths.exponentials((0.08, 1.0), (0.015, 0.4))
T = truths.TIMES_S
#: Frames of what fades within seconds.
FAST_S: FloatArray = 0.3 + 2.0 * np.arange(31, dtype=np.float64)
SEEN = truths.observe(DOUBLE, seed=11)


def _seen_fit(**options: Any) -> DecayFit:
    return fit_decay(
        SEEN.t_s,
        SEEN.values,
        SEEN.sigma,
        exposure_s=SEEN.exposure_s,
        channels="RGB",
        flicker=None,
        **options,
    )


def test_json_has_the_contract_keys_in_its_order() -> None:
    fit = _seen_fit(offset_sigma=0.01)
    read = json.loads(fit.to_json())
    assert read["n_states"] == 2
    assert read["states"][0]["k_r_per_s"] > read["states"][1]["k_r_per_s"]
    assert set(read["states"][0]) == {
        "k_r_per_s",
        "k_r_per_s_sigma",
        "amplitude",
        "amplitude_sigma",
    }
    assert read["channel_weights"].keys() == {"R", "G", "B"}
    assert max(read["channel_weights"].values()) == 1
    covariance = np.array(read["covariance"])
    assert covariance.shape == (5, 5)
    states = read["states"]
    sigma = [states[i][key] for i in (0, 1) for key in ("k_r_per_s_sigma", "amplitude_sigma")]
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), [*sigma, read["offset_sigma"]])
    assert read["warnings"] == []
    assert read["reduced_chi2"] == pytest.approx(1, abs=0.4)
    assert [candidate["n_states"] for candidate in read["candidates"]][:2] == [1, 2]
    assert read["offsets"].keys() == read["offsets_sigma"].keys() == {"R", "G", "B"}
    # G is the brightest.
    assert read["offsets"]["G"] == read["offset"] != read["offsets"]["R"]
    assert read["offsets_sigma"]["G"] == read["offset_sigma"] != read["offsets_sigma"]["R"]
    assert {"bic", "flicker", "law", "laws", "rate_spectrum", "law_comparison"} <= read.keys()


def test_what_is_not_finite_is_null() -> None:
    fit = fit_decay([0.0, 1.0], [2.0, 1.0], [0.1, 0.1])
    assert np.isnan(fit.reduced_chi2)
    assert json.loads(fit.to_json())["reduced_chi2"] is None


def test_table_shows_rates_with_their_sigma() -> None:
    text = str(_seen_fit())
    assert "k / s⁻¹" in text
    assert "flicker" in text
    assert "0.08" in text
    assert "offsets" not in text


def test_table_shows_the_offset_of_each_channel() -> None:
    (line,) = [x for x in str(_seen_fit(offset_sigma=[0.01, 0, 0.01])).splitlines() if "offs" in x]
    assert re.fullmatch(r"offsets  R −?[\d.]+\(\d+\), G 0, B −?[\d.]+\(\d+\)", line)


def test_prediction_and_residuals_add_up_to_the_values() -> None:
    fit = _seen_fit(offset_sigma=0.01)
    predicted = fit.predict(SEEN.t_s, SEEN.exposure_s)
    np.testing.assert_allclose(predicted + fit.residuals, SEEN.values, atol=1e-12)
    assert fit.predict(0.0).shape == (1, 3)
    assert float(np.mean(fit.normalised_residuals**2)) == pytest.approx(1, abs=0.35)
    with pytest.raises(FitError, match="one exposure per time"):
        fit.predict([1.0, 2.0], [1.0, 2.0, 3.0])


def test_missing_sigma_is_estimated_and_reported() -> None:
    rng = np.random.default_rng(0)
    values = 50 * DOUBLE(T) + 0.2 * rng.normal(size=37)
    fit = fit_decay(T, values, None)
    told = fit_decay(T, values, 0.2)
    assert fit.n_states == told.n_states == 2
    assert fit.scatter is not None
    assert fit.sigma == pytest.approx(0.2, rel=0.3)
    assert fit.scatter.at_brightest == pytest.approx(fit.sigma.max())
    assert fit.warnings == ()
    apart = fit.states[0].k_r_per_s - told.states[0].k_r_per_s
    assert abs(apart) < 0.3 * told.states[0].k_r_per_s_sigma
    assert fit.states[0].k_r_per_s_sigma == pytest.approx(told.states[0].k_r_per_s_sigma, rel=0.3)


def test_one_state_too_few_is_a_misfit() -> None:
    fit = _seen_fit(n_states=1)
    values = of_code(fit.warnings, "residuals-correlated").values
    assert values["law"] == "1 exponential"
    assert values["p_value"] < 1e-3
    assert "--states 2" in values["remedy"]


def test_states_the_data_do_not_support_are_dropped_or_ill_determined() -> None:
    fit = _seen_fit(n_states=3)
    unsupported = {"states-unsupported", "rate-unresolved", "offset-unresolved"}
    assert unsupported.intersection(codes(fit.warnings))


def test_decay_longer_than_the_record() -> None:
    fit = fit_decay(T, np.exp(-0.002 * T), 0.002)
    values = of_code(fit.warnings, "lifetime-beyond-record").values
    assert values["lifetime_s"] == pytest.approx(500, rel=0.01)
    assert values["span_s"] == pytest.approx(180, rel=0.01)


def test_constant_under_the_decay_is_noticed() -> None:
    fit = fit_decay(T, np.exp(-0.05 * T) + 0.1, 0.002)
    assert fit.n_states == 2
    assert of_code(fit.warnings, "rate-too-slow").values["state"] == 2


def test_changing_colour() -> None:
    values = np.stack([np.exp(-0.05 * T), np.exp(-0.045 * T)], axis=1)
    fit = fit_decay(T, values, np.sqrt(values) / 300 + 1e-4, channels=["R", "G"])
    assert of_code(fit.warnings, "colour-changes").values["reduced_chi2"] > 1.5


def test_offset_far_from_its_prior() -> None:
    values = np.exp(-0.05 * T) + 0.1
    fit = fit_decay(T, values, 0.001, offset_sigma=0.01, n_states=1)
    assert of_code(fit.warnings, "offset-beyond-prior").values["sigmas"] > 4
    # Left to choose, a state too slow to resolve from a constant takes it over, with a warning.
    fit = fit_decay(T, values, 0.001, offset_sigma=0.01)
    assert "--offset" in of_code(fit.warnings, "rate-too-slow").values["remedy"]


def test_offset_far_from_its_prior_is_named() -> None:
    values = np.stack([np.exp(-0.05 * T), 0.5 * np.exp(-0.05 * T) + 0.1], axis=1)
    fit = fit_decay(T, values, 0.001, channels="RG", offset_sigma=0.01)
    assert of_code(fit.warnings, "offset-beyond-prior").values["channel"] == "G"


def test_flicker_from_too_few_bright_frames_is_reported() -> None:
    for seed in range(10):
        seen = truths.observe(truths.exponentials((0.5, 1.0)), seed, weights=np.ones(1))
        fit = fit_decay(seen.t_s, seen.values, seen.sigma, exposure_s=1.5, flicker=None)
        assert "flicker-from-few-frames" in codes(fit.warnings)
        (state,) = fit.states
        assert abs(state.k_r_per_s - 0.5) < 4.5 * state.k_r_per_s_sigma


def test_flicker_from_few_bright_frames_is_in_sigma() -> None:
    """Five frames tell it to a third, which its σ allows for: nothing is to be said."""
    pulls = []
    for seed in range(20):
        seen = truths.observe(
            truths.exponentials((0.35, 1.0)), seed, snr=1000, t_s=FAST_S, exposure_s=1.0
        )
        fit = fit_decay(
            seen.t_s, seen.values, seen.sigma, exposure_s=1.0, channels="RGB", flicker=None
        )
        (state,) = fit.states
        pulls.append((state.k_r_per_s - 0.35) / state.k_r_per_s_sigma)
        assert "flicker-from-few-frames" not in codes(fit.warnings)
    assert 0.5 < np.sqrt(np.mean(np.square(pulls))) < 1.3


GOOD = np.exp(-0.05 * T)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((T, np.zeros(37), 0.1), "positive signal"),
        ((T, -GOOD, 0.1), "positive signal"),
        ((T, 1 + T / 180, 0.01), "one that rises"),
        ((T, np.ones(37), 0.01), "constant within its noise"),
        ((T, np.where(T > 50, np.nan, GOOD), 0.1), "expected finite values"),
        ((np.full(37, 3.0), GOOD, 0.1), "record a decay"),
        ((T - 10, GOOD, 0.1), "when the lamp went off"),
        ((T[:1], GOOD[:1], 0.1), "two or more values"),
        ((T, GOOD[:-1], 0.1), "one row per frame"),
        ((T, GOOD, 0.0), "expected σ > 0"),
        ((T, GOOD, np.ones(5)), "one σ per value"),
        ((np.where(T > 50, np.inf, T), GOOD, 0.1), "expected finite times"),
    ],
)
def test_impossible_data_are_refused(arguments: tuple[Any, Any, Any], message: str) -> None:
    with pytest.raises(FitError, match=message):
        fit_decay(*arguments)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_states": 2, "t_s": T[:3], "values": GOOD[:3]}, "values at 4 times or more for 2"),
        ({"n_states": 0}, "expected 1 states or more"),
        ({"n_states": 9}, "at most 8 states"),
        ({"n_states": 1, "fixed_rates": [0.1, 0.2]}, "expected 2 states or more"),
        ({"fixed_rates": [-1.0]}, "fixed rates > 0"),
        ({"flicker": -0.1}, r"flicker in \[0, 1\)"),
        ({"flicker": None, "sigma": None}, "to separate flicker"),
        ({"flicker": None, "t_s": T[:5], "values": GOOD[:5]}, "to estimate flicker"),
        ({"offset_sigma": -1.0}, "σ of the offset ≥ 0"),
        ({"offset_sigma": np.nan}, "σ of the offset ≥ 0"),
        ({"offset_sigma": [0.1, 0.1]}, "expected 1 or 1 σ"),
        ({"exposure_s": np.ones(4)}, "one exposure or 37"),
        ({"exposure_s": -1.0}, "exposures ≥ 0"),
        ({"sigma": None, "channels": "RG", "values": np.ones((37, 2))}, "weighed against"),
    ],
)
def test_impossible_wishes_are_refused(options: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"t_s": T, "values": GOOD, "sigma": 0.01}
    with pytest.raises(FitError, match=message):
        fit_decay(**(arguments | options))


def test_noise_alone_is_no_decay() -> None:
    values = np.full((37, 3), -0.1)
    values[20] = 0.05
    with pytest.raises(FitError, match="was the sample charged"):
        fit_decay(T, values, 0.1, channels="RGB", flicker=None)


def test_flicker_cannot_come_from_a_curve_through_all_bright_frames() -> None:
    values = np.where(np.arange(37) == 0, 1.0, 0.0)
    with pytest.raises(FitError, match="frames to spare"):
        fit_decay(T, values, 1e-6, flicker=None)


def test_amplitude_at_lamp_off_is_as_uncertain_as_the_rate_that_leads_there() -> None:
    """The first frame is three lifetimes after lamp off."""
    t_s, k_per_s = 60.0 + 3.0 * np.arange(30), 0.05
    sigma = np.full(30, 1e-3)
    values = np.exp(-k_per_s * t_s) + sigma * np.random.default_rng(5).normal(size=30)

    def signal(t_s: FloatArray, k_per_s: float, amplitude: float) -> FloatArray:
        return amplitude * np.exp(-k_per_s * t_s)

    best, covariance = curve_fit(
        signal, t_s, values, p0=(0.05, 1.0), sigma=sigma, absolute_sigma=True
    )
    fit = fit_decay(t_s, values, sigma, n_states=1, flicker=0.0)
    (state,) = fit.states
    assert state.amplitude == pytest.approx(best[1], rel=1e-4)
    assert state.amplitude_sigma == pytest.approx(np.sqrt(covariance[1, 1]), rel=0.02)
    assert state.k_r_per_s_sigma == pytest.approx(np.sqrt(covariance[0, 0]), rel=0.02)
