"""Where σ comes from: nothing is lost, and what was put in is found."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.fit import DecayFit
from labrig.protocols.decay.analysis import noise_budget, noise_parts
from labrig.report.chart_figure import chart_figure
from labrig.report.decay_figures import noise_figure, visible_parts
from labrig.report.figure_style import figure_style
from labrig.results import Series
from tests.report.made import decay_series, fitted

READING_DN, PHOTON_GAIN, UNEVEN = 0.8, 0.02, 1e-3


def with_noise(series: Series) -> Series:
    """σ² = A + B·light + C·light² in DN², exposures of 2 s and 4 s."""
    exposure_s = np.where(np.arange(len(series.t_s)) % 2, 2.0, 4.0)
    light = np.maximum(series.values, 0) * exposure_s[:, np.newaxis]
    variance = READING_DN**2 + PHOTON_GAIN * light + (UNEVEN * light) ** 2
    sigma = np.sqrt(variance) / exposure_s[:, np.newaxis]
    return replace(series, exposure_s=exposure_s, sigma=sigma, dark_sigma=np.array([0.1, 0.2, 0.3]))


SERIES = with_noise(decay_series(40))
BRIGHTEST = 1


def fit_of(series: Series) -> DecayFit:
    fit = fitted(series)
    assert isinstance(fit, DecayFit)
    return fit


FIT = fit_of(SERIES)


def test_the_parts_add_up_to_the_sigma_of_the_series() -> None:
    scattered = replace(SERIES, sigma=SERIES.sigma * np.linspace(0.9, 1.1, 40)[:, np.newaxis])
    parts = noise_parts(scattered, BRIGHTEST, scattered.values[:, BRIGHTEST])
    np.testing.assert_allclose(np.sqrt(parts.sum(axis=1)), scattered.sigma[:, BRIGHTEST])


def test_reading_photons_and_unevenness_are_distinguished() -> None:
    light = SERIES.values[:, BRIGHTEST] * SERIES.exposure_s
    parts = noise_parts(SERIES, BRIGHTEST, SERIES.values[:, BRIGHTEST])
    expected = np.stack(
        [np.full_like(light, READING_DN**2), PHOTON_GAIN * light, (UNEVEN * light) ** 2], axis=1
    )
    np.testing.assert_allclose(parts * SERIES.exposure_s[:, np.newaxis] ** 2, expected, rtol=1e-6)


def test_a_budget_is_relative_to_the_signal_and_complete() -> None:
    budget = noise_budget(SERIES, FIT)
    assert budget is not None
    signal = FIT.predict(SERIES.t_s, SERIES.exposure_s)[:, BRIGHTEST] - FIT.offset
    own = np.sqrt(budget.photon**2 + budget.read**2 + budget.uneven**2)
    np.testing.assert_allclose(own * signal, SERIES.sigma[:, BRIGHTEST])
    light = SERIES.values[:, BRIGHTEST] * SERIES.exposure_s
    in_dn = signal * SERIES.exposure_s
    np.testing.assert_allclose(budget.read * in_dn, READING_DN, rtol=0.05)
    np.testing.assert_allclose(budget.photon * in_dn, np.sqrt(PHOTON_GAIN * light), rtol=0.05)
    np.testing.assert_allclose(budget.uneven * in_dn, UNEVEN * light, rtol=0.05)
    np.testing.assert_allclose(budget.dark_level * signal, SERIES.dark_sigma[BRIGHTEST])
    np.testing.assert_allclose(budget.flicker, FIT.flicker)
    np.testing.assert_allclose(budget.total**2, own**2 + budget.flicker**2 + budget.dark_level**2)


def test_only_the_first_of_some_decays_is_shown() -> None:
    unit = ("decay-1",) * 20 + ("decay-2",) * 20
    budget = noise_budget(replace(SERIES, unit=unit), FIT)
    assert budget is not None
    np.testing.assert_array_equal(budget.t_s, (SERIES.t_s + SERIES.exposure_s / 2)[:20])


@pytest.mark.parametrize(
    "series",
    [SERIES.take(np.arange(3)), replace(SERIES, sigma=np.full_like(SERIES.sigma, np.nan))],
    ids=["three frames", "no sigma"],
)
def test_without_enough_to_go_by_there_is_no_budget(series: Series) -> None:
    assert noise_budget(series, FIT) is None


def test_a_signal_that_has_died_away_does_no_harm() -> None:
    late = replace(SERIES, t_s=SERIES.t_s * 1000)
    assert noise_budget(late, FIT) is None


def test_the_figure_has_a_line_for_each_part_that_matters() -> None:
    budget = noise_budget(SERIES, FIT)
    assert budget is not None
    with figure_style():
        figure = chart_figure(noise_figure(budget))
        figure.canvas.draw()
        (legend,) = figure.legends
        assert legend.get_window_extent().y0 >= figure.axes[0].get_window_extent().y1
    names = [text.get_text() for text in legend.get_texts()]
    assert names == [
        "together",
        "photon noise",
        "read noise",
        "uneven light",
        "flicker",
        "dark level",
    ]
    quiet = noise_budget(replace(SERIES, dark_sigma=np.zeros(3)), FIT)
    assert quiet is not None
    assert "dark level" not in visible_parts(quiet)
