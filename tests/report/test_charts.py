"""Charts as SVG: every value is where its axes say, and as in matplotlib's drawing of the chart."""

import re
from dataclasses import replace
from itertools import product
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.report.chart import (
    Chart,
    ErrorBars,
    Line,
    Margins,
    Panel,
    Points,
    linear_axis,
    logarithmic_axis,
)
from labrig.report.chart_figure import chart_figure
from labrig.report.chart_svg import TOLERANCE_PT, svg_body, text_width
from labrig.report.figure_style import MARKERS, decade_ticks, figure_style, linear_ticks

NUMBERS = st.floats(-1e6, 1e6)
MARGINS = Margins(left=20.0, bottom=30.0, right=10.0, top=5.0)
WIDTH_PT, HEIGHT_PT = 330.0, 235.0


def chart(*marks: Points | Line | ErrorBars, logarithmic: bool = False) -> Chart:
    """Axes of 300 by 200 points, from 0 to 3 and from 1 to 100."""
    axis = logarithmic_axis if logarithmic else linear_axis
    panel = Panel(linear_axis("t / s", 0.0, 3.0), axis("y", 1.0, 100.0), marks, MARGINS)
    return Chart((panel,), HEIGHT_PT, WIDTH_PT)


def drawn(of: Chart) -> list[str]:
    """Paths of the marks of a chart."""
    (axes,) = ElementTree.fromstring(f"<svg>{svg_body(of)}</svg>").findall(".//g/svg")
    return [path.attrib["d"] for path in axes.iter("path")]


def starts(path: str) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.array(re.findall(r"M(\S+) ([-\d.e]+)", path), dtype=np.float64)


@given(st.lists(st.tuples(st.floats(0, 3), st.floats(1, 100)), min_size=1), st.booleans())
def test_points_are_where_the_axes_say(values: list[tuple[float, float]], log: bool) -> None:
    x, y = np.array(values).T
    (path,) = drawn(chart(Points("#000000", x, y), logarithmic=log))
    up = np.log10(y) / 2 if log else (y - 1) / 99
    expected = np.stack([100 * x, 200 * (1 - up)], axis=1)
    np.testing.assert_allclose(starts(path), expected, atol=0.006)


def test_matplotlib_draws_them_at_the_same_places() -> None:
    x, y = np.array([0.1, 1.7, 2.9]), np.array([2.0, 50.0, 99.0])
    for across, up in product((False, True), repeat=2):
        points = chart(Points("#000000", x, y), logarithmic=up)
        if across:
            (panel,) = points.panels
            panel = replace(panel, x=logarithmic_axis("t / s", 0.01, 3.0))
            points = replace(points, panels=(panel,))
        with figure_style():
            (axes,) = chart_figure(points).axes
            there = axes.transData.transform(np.stack([x, y], axis=1))
        here = starts(drawn(points)[0]) + np.array([MARGINS.left, MARGINS.top])
        np.testing.assert_allclose(here, [[a, HEIGHT_PT - b] for a, b in there], atol=0.006)


def test_values_that_an_axis_cannot_show_are_out_of_sight() -> None:
    values = np.array([-5.0, 0.0, 1e-300, 1e300])
    (path,) = drawn(chart(Points("#000000", np.ones(4), values), logarithmic=True))
    down = starts(path)[:, 1]
    assert (down[:3] > 200).all()
    assert down[3] < 0


def test_error_bars_reach_from_sigma_to_sigma() -> None:
    bars = ErrorBars("#000000", np.array([1.5]), np.array([50.5]), np.array([9.9]))
    assert drawn(chart(bars)) == ["M150.0 120.0V80.0"]


def test_points_that_a_curve_does_not_need_are_left_out() -> None:
    x = np.linspace(0, 3, 160)
    straight, bent = 1 + 33 * x, 100 * np.exp(-2 * x) + 1
    texts = drawn(chart(Line("#000000", x, straight), Line("#000000", x, bent)))
    for text, y in zip(texts, (straight, bent), strict=True):
        places = np.array(re.findall(r"[-\d.]+", text), dtype=np.float64).reshape(-1, 2)
        assert len(places) < 90
        down = np.interp(100 * x, places[:, 0], places[:, 1])
        # Three rounds of leaving out, and rounding.
        np.testing.assert_allclose(down, 200 * (1 - (y - 1) / 99), atol=3 * TOLERANCE_PT + 0.01)


@pytest.mark.parametrize("marker", MARKERS)
def test_every_marker_is_drawn(marker: str) -> None:
    (path,) = drawn(chart(Points("#000000", np.ones(2), np.ones(2), marker)))
    assert path.count("M") == 2


def test_what_people_name_stays_text() -> None:
    (panel,) = chart().panels
    named = replace(chart(), panels=(replace(panel, x=replace(panel.x, label="<b>&")),))
    legend = replace(named, legend=(("<i>", Points("#000000")),))
    root = ElementTree.fromstring(f"<svg>{svg_body(legend)}</svg>")
    assert {"<b>&", "<i>"} <= {text.text for text in root.iter("text")}


@pytest.mark.parametrize("text", ["each state, G", "photon noise", "± 1 σ", "left out", "decay-1"])
def test_texts_are_about_as_wide_as_estimated(text: str) -> None:
    with figure_style():
        figure = chart_figure(chart())
        drawn_text = figure.text(0, 0, text, fontsize=100)
        width = drawn_text.get_window_extent().width / 100
    assert text_width(text) == pytest.approx(width, rel=0.15)


@given(NUMBERS, st.floats(1e-6, 1e6), st.integers(2, 12))
def test_linear_ticks_are_even_few_and_inside(low: float, span: float, most: int) -> None:
    high = low + span
    values = np.array([value for value, _ in linear_ticks(low, high, most)])
    assert len(values) <= most + 1
    rounding = 1e-6 * span + np.spacing(abs(low) + span)
    assert ((values >= low - rounding) & (values <= high + rounding)).all()
    if span > 1e-6 * abs(low):
        assert len(values) >= most // 3
        np.testing.assert_allclose(np.diff(values, 2), 0, atol=1e-6 * span)


@given(st.floats(1e-9, 1e9), st.floats(1.5, 1e8), st.integers(2, 8))
def test_decade_ticks_are_few_and_inside(low: float, ratio: float, most: int) -> None:
    ticks, short_ticks = decade_ticks(low, low * ratio, most)
    values = [value for value, _ in ticks]
    assert 2 <= len(values) <= max(3 * most, 9)
    margin = 1e-9 * low * ratio
    for value in (*values, *short_ticks):
        assert low - margin <= value <= low * ratio + margin
