"""Forecast of the time until 0.3 mcd/m² after the last reading, of decays with a true time."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from labrig.fit import fit_luminance
from labrig.foundation.arrays import FloatArray
from labrig.material import DECAY_LAWS
from labrig.results import ForecastTime, LuminanceDecay
from tests.warned import codes

END_S = 20_000.0
Curve = Callable[[FloatArray], FloatArray]


def becquerel(t_s: FloatArray) -> FloatArray:
    return np.asarray((1 + t_s / 60) ** -1.2)


def retrapping(t_s: FloatArray) -> FloatArray:
    return np.asarray(DECAY_LAWS["otor"].value(t_s / 400, np.asarray(0.5)))


def many_rates(t_s: FloatArray) -> FloatArray:
    """Log-normal rates, which no law contains."""
    z = np.linspace(-4, 4, 81)
    rates = 4e-4 * np.exp(1.3 * z)
    return np.asarray(np.exp(-np.multiply.outer(t_s, rates)) @ (rates * np.exp(-(z**2) / 2)))


def power_that_ends(t_s: FloatArray) -> FloatArray:
    """A power law that ends in an exponential, which no law contains."""
    return np.asarray((1 + t_s / 30) ** -1.0 * np.exp(-t_s / END_S))


CURVES = (becquerel, retrapping, many_rates, power_that_ends)


def cut(curve: Curve, part: float, seed: int, n: int = 60, noise: float = 0.01) -> LuminanceDecay:
    """Return what is made of readings until a part of the true time, END_S."""
    t_s = np.geomspace(60, part * END_S, n)
    light = 0.3 * curve(t_s) / curve(np.array([END_S]))
    sigma = noise * light
    read = light + sigma * np.random.default_rng(seed).standard_normal(n)
    return fit_luminance(t_s, read, sigma if seed % 2 else None)


def forecast(decay: LuminanceDecay) -> ForecastTime:
    assert decay.visible_forecast is not None
    return decay.visible_forecast


def test_the_range_holds_the_true_time_and_is_not_wide() -> None:
    widths = []
    for seed, curve in enumerate(CURVES * 2):
        found = forecast(cut(curve, 0.5, seed))
        assert found.between_s is not None
        early, late = found.between_s
        assert early < END_S < late
        assert found.least_s < END_S
        widths.append(late / early)
    assert 1.05 < np.median(widths) < 1.8


def test_the_range_grows_with_the_distance() -> None:
    ends = [forecast(cut(becquerel, part, 1)).between_s for part in (0.9, 0.5, 0.25)]
    widths = [late / early for early, late in filter(None, ends)]
    assert len(widths) == 3
    assert widths[0] < widths[1] < widths[2]


def test_the_earliest_time_of_an_exponential_is_its_time() -> None:
    """The bound is sharp: its σ is that of a line, not more."""

    def curve(t_s: FloatArray) -> FloatArray:
        return np.asarray(np.exp(-3 * t_s / END_S))

    pulls = []
    for seed in range(4):
        earliest = forecast(cut(curve, 0.6, 2 * seed + 1)).at_least
        assert earliest is not None
        assert earliest.sigma < 0.05 * END_S
        pulls.append((earliest.value - END_S) / earliest.sigma)
    assert np.abs(pulls).max() < 3


def test_the_scale_is_in_range_and_earliest_time() -> None:
    t_s = np.geomspace(60, END_S / 2, 60)
    light = 0.3 * becquerel(t_s) / becquerel(np.array([END_S]))
    exact, scaled = (
        forecast(fit_luminance(t_s, light, 0.01 * light, scale_sigma=sigma)) for sigma in (0.0, 0.2)
    )
    assert exact.between_s is not None
    assert scaled.between_s is not None
    assert scaled.between_s[1] / scaled.between_s[0] > 1.3 * exact.between_s[1] / exact.between_s[0]
    assert exact.at_least is not None
    assert scaled.at_least is not None
    assert scaled.at_least.sigma > 3 * exact.at_least.sigma


def test_a_scale_of_time_changes_nothing() -> None:
    t_s = np.geomspace(60, END_S / 2, 40)
    light = 0.3 * many_rates(t_s) / many_rates(np.array([END_S]))
    slow, fast = (forecast(fit_luminance(c * t_s, light, 0.01 * light)) for c in (1.0, 1e-3))
    assert slow.between_s is not None
    assert fast.between_s == pytest.approx(tuple(1e-3 * end for end in slow.between_s), rel=0.02)


def test_a_light_that_is_cut_off_has_no_forecast() -> None:
    """No sum of exponentials falls ever faster; the reason in the warning has the rates."""
    decay = cut(lambda t_s: np.asarray(np.exp(-4 * (t_s / END_S) ** 2)), 0.7, 1)
    assert decay.visible_forecast is None
    (warning,) = decay.warnings
    assert warning.code == "no-forecast"
    assert "grows with time, from" in warning.values["reason"]


def test_a_record_that_begins_below_has_no_forecast() -> None:
    t_s = np.geomspace(60, 3600, 30)
    decay = fit_luminance(t_s, 0.1 * (t_s / 60) ** -1.0, 0.001)
    assert decay.visible_s is None
    assert decay.visible_forecast is None
    assert codes(decay.warnings) == ["limit-before-record"]


def test_what_is_not_determined_has_an_earliest_time() -> None:
    """A hundredth of the time says little."""
    found = forecast(cut(becquerel, 0.01, 3, n=15, noise=0.05))
    assert found.between_s is None
    assert 0 < found.least_s < END_S
    assert "not determined" in str(found)


@pytest.mark.parametrize("part", [0.3, 0.9])
def test_a_real_phosphor(shared_data: Path, part: float) -> None:
    """Strontium aluminate until a part of the time in which it falls to a hundredth."""
    table = shared_data / "decay/perslqy_sao/sample_400_524_300s.txt"
    t_s, light = np.loadtxt(table, skiprows=1, usecols=(0, 1), unpack=True)
    light = light - light[t_s < 29].mean()
    t_s, light = t_s[t_s > 331] - 330, light[t_s > 331]
    unit = 0.3 / (light[:5].mean() / 100)
    end = fit_luminance(t_s[::3], unit * light[::3]).visible_s
    assert end is not None
    taken = np.unique(np.searchsorted(t_s, np.geomspace(t_s[0], part * end.value, 80)))
    found = forecast(fit_luminance(t_s[taken], unit * light[taken]))
    assert found.between_s is not None
    assert found.between_s[0] < end.value < found.between_s[1]
