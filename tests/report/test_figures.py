"""Figures: labelled, legends clear of the data, nothing lost from the logarithmic one."""

from collections.abc import Callable
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest

from labrig.fit import DecayFit
from labrig.protocols.decay.report.figures import (
    law_figure,
    periodogram_figure,
    residual_figure,
    residual_periodogram,
    residuals,
)
from labrig.report.chart import Chart, Line, Points
from labrig.report.chart_figure import chart_figure
from labrig.report.decay_figures import (
    fitted_curve,
    linear_decay,
    logarithmic_decay,
    overview_figures,
    overview_tiles,
    timing_figure,
    values_below_axis,
)
from labrig.report.figure_files import FigureFiles
from labrig.report.figure_style import CARET_DOWN, figure_style
from labrig.report.sections import Picture
from labrig.report.timing import FrameTiming
from labrig.results import Series

from .made import decay_series, fitted, patch

pytestmark = pytest.mark.drawn

SERIES = decay_series()
FLAGGED = replace(SERIES, flag=("clipped", "excluded", *SERIES.flag[2:]))


def fit_of(series: Series) -> DecayFit:
    fit = fitted(series)
    assert isinstance(fit, DecayFit)
    return fit


FIT = fit_of(SERIES)
LINES = residual_periodogram(SERIES, FIT)
assert LINES is not None
TIMINGS = [FrameTiming(f"{n}", f"decay-{n % 2}", 5.0 * n, 0.001 * n) for n in range(10)]


@pytest.mark.parametrize(
    "make",
    [
        lambda: linear_decay(SERIES, FIT),
        lambda: logarithmic_decay(SERIES, FIT),
        lambda: residual_figure(SERIES, FIT),
        lambda: law_figure(SERIES, FIT),
        lambda: periodogram_figure(LINES),
        lambda: overview_figures([patch(SERIES)])[0],
        lambda: timing_figure(TIMINGS),
    ],
    ids=["linear", "log", "residuals", "laws", "periodogram", "overview", "timing"],
)
def test_axes_are_labelled_and_inside_the_figure(make: Callable[[], Chart]) -> None:
    with figure_style():
        figure = chart_figure(make())
        figure.canvas.draw()
        width, height = figure.get_size_inches() * figure.dpi
        assert figure.axes[-1].get_xlabel().endswith("/ s")
        for axes in figure.axes:
            assert axes.get_ylabel()
            box = axes.get_tightbbox()
            assert box is not None
            assert box.x0 >= 0
            assert box.y0 >= 0
            assert box.x1 <= width
            assert box.y1 <= height


@pytest.mark.parametrize("series", [SERIES, FLAGGED], ids=["plain", "flagged"])
@pytest.mark.parametrize("make", [linear_decay, logarithmic_decay])
def test_the_legend_covers_no_data(
    make: Callable[[Series, DecayFit | None], Chart], series: Series
) -> None:
    with figure_style():
        figure = chart_figure(make(series, FIT))
        figure.canvas.draw()
        (legend,) = figure.legends
        box, axes = legend.get_window_extent(), figure.axes[0].get_window_extent()
        assert box.y0 >= axes.y1
        assert box.x1 <= figure.get_size_inches()[0] * figure.dpi
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts[:3] == ["R", "G", "B"]
    assert ("left out" in texts) == (series is FLAGGED)


def test_laws_and_values_are_shown_over_the_chosen_law() -> None:
    _, lower = law_figure(SERIES, FIT).panels
    (points,) = (mark for mark in lower.marks if isinstance(mark, Points))
    middles_s = (SERIES.t_s + SERIES.exposure_s / 2).tolist()
    rows = [middles_s.index(t_s) for t_s in points.x]
    assert len(rows) > len(middles_s) / 2
    signal = FIT.predict(SERIES.t_s, SERIES.exposure_s)[:, FIT.brightest] - FIT.offset
    values = SERIES.values[:, FIT.brightest] - FIT.offset
    np.testing.assert_allclose(points.y, (values / signal)[rows])
    curves = [mark for mark in lower.marks if isinstance(mark, Line) and len(mark.x) > 2]
    chosen = [curve for curve in curves if (curve.y == 1).all()]
    assert len(chosen) == 1
    assert chosen[0].width_pt > max(curve.width_pt for curve in curves if curve is not chosen[0])
    assert len(curves) == len(FIT.compared_laws) > 1
    # All of every law within the measurement is inside the axis.
    for curve in curves:
        measured = curve.y[curve.x <= FIT.measured_until_s]
        assert lower.y.low < measured.min() <= measured.max() < lower.y.high


def test_timing_of_several_units_has_a_legend_in_the_figure() -> None:
    with figure_style():
        figure = chart_figure(timing_figure(TIMINGS))
        figure.canvas.draw()
        (legend,) = figure.legends
        assert legend.get_window_extent().y0 >= figure.axes[0].get_window_extent().y1


def test_values_that_a_logarithm_cannot_show_are_marked() -> None:
    series = replace(SERIES, values=SERIES.values - 100.0)
    assert values_below_axis(series) >= np.count_nonzero(series.values <= 0) > 0
    (panel,) = logarithmic_decay(series, FIT).panels
    points = [mark for mark in panel.marks if isinstance(mark, Points)]
    carets = [mark for mark in points if mark.marker == CARET_DOWN]
    assert panel.y.low > 0
    assert all((mark.y == panel.y.low).all() for mark in carets)
    assert sum(len(mark.x) for mark in carets) == values_below_axis(series)


def test_the_curve_goes_through_what_the_fit_predicts() -> None:
    curve = fitted_curve(SERIES, FIT)
    first = FIT.predict(SERIES.t_s[:1], SERIES.exposure_s[:1])
    np.testing.assert_allclose(curve.total[:1], first)
    signal = curve.states.sum(axis=1) + FIT.offset
    np.testing.assert_allclose(signal, curve.total[:, curve.brightest], rtol=1e-3)


def test_what_channels_have_in_common_is_found() -> None:
    model = FIT.predict(SERIES.t_s, SERIES.exposure_s)
    moved = model.copy()
    moved[3] *= 1.05
    left = residuals(replace(SERIES, values=moved), FIT)
    assert left.common[3] == pytest.approx(0.05, abs=1e-6)
    assert left.common[4] == pytest.approx(0.0, abs=1e-9)


def test_each_channel_s_own_offset_is_no_signal() -> None:
    fit = replace(FIT, offsets=(40.0, -20.0, 10.0))
    model = fit.predict(SERIES.t_s, SERIES.exposure_s)
    signal = model - np.array([40.0, -20.0, 10.0])
    left = residuals(replace(SERIES, values=model + 0.05 * signal), fit)
    np.testing.assert_allclose(left.common, 0.05, rtol=1e-9)


def test_overviews_share_their_axes() -> None:
    dim = replace(SERIES, values=SERIES.values / 50, sigma=SERIES.sigma / 50)
    patches = [patch(SERIES), replace(patch(dim), fit="too dim")]
    for charts in (overview_figures(patches), overview_tiles(patches)[0]):
        first, second = (chart.panels[0] for chart in charts)
        assert (first.x, first.y) == (second.x, second.y)


def test_svg_follows_the_page_and_not_the_users_settings() -> None:
    def drawn() -> str:
        picture = Picture("linear", lambda: chart_figure(linear_decay(SERIES, FIT)))
        return FigureFiles().add(picture, "a", 'Decay of "x" <b>').element

    plain = drawn()
    with mpl.rc_context({"font.size": 30, "svg.fonttype": "path", "axes.grid": False}):
        assert drawn() == plain
    assert "var(--ink, " in plain
    assert "Time after lamp off / s" in plain
    assert 'aria-label="Decay of &quot;x&quot; &lt;b&gt;"' in plain
    for forbidden in ("font-family", "<style", "<metadata", "xlink", "http"):
        assert forbidden not in plain
