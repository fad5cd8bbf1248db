"""Charts as SVG, in points; text remains text."""

import html
from collections.abc import Iterable, Iterator

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.report.chart import Axis, Band, Chart, ErrorBars, Line, Mark, Panel, Points
from labrig.report.figure_style import (
    CARET_DOWN,
    EDGE_PT,
    INK,
    LEFT_PT,
    MUTED,
    RULE,
    SMALL_PT,
    LineStyle,
    Marker,
)

TICK_PT, SHORT_TICK_PT = 3.5, 2.0
#: Distance of the ticks' labels from the axes.
LABEL_PT = 7.0
EDGE_WIDTH_PT, SPINE_PT, GRID_PT, ERROR_BAR_PT = 0.9, 0.8, 0.7, 0.9
#: Heights of capitals above the base line, and of descenders below it, relative to the font size.
CAPITAL, DESCENDER = 0.73, 0.24
#: Length of a legend's lines, distances beside and below its entries, relative to the font size.
HANDLE, HANDLE_GAP, COLUMN_GAP, ROW = 1.6, 0.4, 1.0, 1.36
#: Approximate widths of narrow, wide and other characters of DejaVu Sans, relative to its size.
NARROW, WIDE, MEDIAN = 0.37, 0.84, 0.62
#: Farthest distance in points of anything from the axes' edges; no viewer draws at a million.
MAX_PT = 1000.0
#: Largest distance in points by which points are left out of a curve.
TOLERANCE_PT = 0.03

_TURN = np.deg2rad(np.arange(10) * 36.0)
_STAR = np.where(np.arange(10) % 2, 0.19, 0.5)[:, np.newaxis] * np.stack(
    [np.sin(_TURN), -np.cos(_TURN)], axis=1
)
_PLUS = [(-1, -3), (1, -3), (1, -1), (3, -1), (3, 1), (1, 1), (1, 3), (-1, 3)]
_PLUS += [(-1, 1), (-3, 1), (-3, -1), (-1, -1)]
_CROSS = np.array(_PLUS) @ [[1, 1], [-1, 1]] / 8
#: Corners of markers of diameter 1, downwards positive.
_CORNERS = {
    "s": np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]),
    "^": np.array([(0.0, -0.5), (0.5, 0.5), (-0.5, 0.5)]),
    "v": np.array([(0.0, 0.5), (0.5, -0.5), (-0.5, -0.5)]),
    "D": np.array([(0.0, -0.7), (0.7, 0.0), (0.0, 0.7), (-0.7, 0.0)]),
    "P": np.array(_PLUS) / 6,
    "X": _CROSS,
    "*": _STAR,
    CARET_DOWN: np.array(
        [(0.0, 0.0), (-0.5, -0.75), (0.5, -0.75)]
    ),  # a caret, its tip on the value
}


def svg_body(chart: Chart) -> str:
    """Return what the element `<svg>` of a chart contains; its unit is the point."""
    return "".join((*(_panel(panel, chart) for panel in chart.panels), *_legend(chart)))


def text_width(text: str) -> float:
    """Return the approximate width of a text relative to the font size."""
    return sum(
        NARROW if letter in " ijl.,:;|'()/t" else WIDE if letter in "mwMW%±" else MEDIAN
        for letter in text
    )


def _panel(panel: Panel, chart: Chart) -> str:
    """Return grid, marks, spines, ticks and labels of a panel."""
    width = chart.width_pt - panel.margins.left - panel.margins.right
    height = chart.height_pt - panel.margins.top - panel.margins.bottom
    drawn = [(mark, _mark(mark, panel, width, height)) for mark in panel.marks]
    clipped = [text for mark, text in drawn if not _is_unclipped(mark)]
    unclipped = [text for mark, text in drawn if _is_unclipped(mark)]
    tick_x, tick_y = _positions(panel.x, width), height - _positions(panel.y, height)
    grid = "".join(
        [f"M{x} 0V{height:g}" for x in _numbers(tick_x)]
        + [f"M0 {y}H{width:g}" for y in _numbers(tick_y)]
    )
    ticks = "".join(
        [f"M{x} {height:g}v{TICK_PT}" for x in _numbers(tick_x)]
        + [f"M0 {y}h-{TICK_PT}" for y in _numbers(tick_y)]
    )
    short = height - _at(panel.y, np.array(panel.y.short_ticks), height)
    short_ticks = "".join(f"M0 {y}h-{SHORT_TICK_PT:g}" for y in _numbers(short))
    return "".join(
        (
            f'<g transform="translate({panel.margins.left:g} {panel.margins.top:g})">',
            _path(grid, RULE, GRID_PT),
            f'<svg width="{width:g}" height="{height:g}">',
            *clipped,
            "</svg>",
            _path(f"M0 0V{height:g}H{width:g}", MUTED, SPINE_PT),
            _path(ticks, MUTED, SPINE_PT),
            _path(short_ticks, MUTED, 0.6) if short_ticks else "",
            *unclipped,
            *_labels(panel, chart, width, height),
            "</g>",
        )
    )


def _labels(panel: Panel, chart: Chart, width: float, height: float) -> Iterator[str]:
    """Yield the labels of the axes and of their ticks."""
    size = min(SMALL_PT, chart.label_pt)
    tick = f"fill:{MUTED};font-size:{size:g}px"
    title = f"fill:{INK};font-size:{chart.label_pt:g}px;text-anchor:middle"
    if panel.x.label and panel.has_x_labels:
        base = height + LABEL_PT + CAPITAL * size
        yield f'<g style="{tick};text-anchor:middle">'
        for x, (_, label) in zip(_numbers(_positions(panel.x, width)), panel.x.ticks, strict=True):
            yield f'<text x="{x}" y="{base:.4g}">{html.escape(label)}</text>'
        base = height + panel.margins.bottom - EDGE_PT - DESCENDER * chart.label_pt
        label = html.escape(panel.x.label)
        yield f'</g><text x="{width / 2:g}" y="{base:.4g}" style="{title}">{label}</text>'
    if panel.y.label:
        middle = height - _positions(panel.y, height) + CAPITAL / 2 * size
        yield f'<g style="{tick};text-anchor:end">'
        for y, (_, label) in zip(_numbers(middle), panel.y.ticks, strict=True):
            yield f'<text x="-{LABEL_PT:g}" y="{y}">{html.escape(label)}</text>'
        base = EDGE_PT - panel.margins.left + CAPITAL * chart.label_pt
        place = f"translate({base:.4g} {height / 2:g})"
        label = html.escape(panel.y.label)
        yield f'</g><text transform="{place} rotate(-90)" style="{title}">{label}</text>'


def _mark(mark: Mark, panel: Panel, width: float, height: float) -> str:
    """Return a mark within its panel."""
    x = _at(panel.x, mark.x, width)

    def down(values: FloatArray) -> FloatArray:
        return height - _at(panel.y, values, height)

    if isinstance(mark, Points):
        return _points(mark, x, down(mark.y))
    if isinstance(mark, ErrorBars):
        ends = zip(
            _numbers(x),
            _numbers(down(mark.y - mark.sigma)),
            _numbers(down(mark.y + mark.sigma)),
            strict=True,
        )
        bars = "".join(f"M{x} {low}V{high}" for x, low, high in ends)
        return _path(bars, mark.colour, ERROR_BAR_PT)
    if isinstance(mark, Line):
        return _line(mark, x, down(mark.y))
    there, back = _polyline(x, down(mark.low)), _polyline(x[::-1], down(mark.high)[::-1])
    return f'<path d="M{there}L{back}z" style="fill:{mark.colour};fill-opacity:{mark.opacity:g}"/>'


def _is_unclipped(mark: Mark) -> bool:
    """Return whether a mark may reach beyond the axes."""
    return isinstance(mark, Points) and not mark.is_clipped


def _points(mark: Points, x: FloatArray, y: FloatArray) -> str:
    """Return points at coordinates in the panel, all in one path."""
    shape = _shape(mark.marker, mark.size_pt)
    places = "".join(f"M{x} {y}{shape}" for x, y in zip(_numbers(x), _numbers(y), strict=True))
    face = mark.face or mark.colour
    style = f"fill:{face};stroke:{mark.colour};stroke-width:{EDGE_WIDTH_PT:g}"
    return f'<path d="{places}" style="{style}"/>' if places else ""


def _line(mark: Line, x: FloatArray, y: FloatArray) -> str:
    """Return a curve through coordinates in the panel."""
    if not len(x):
        return ""
    return _path(f"M{_polyline(x, y)}", mark.colour, mark.width_pt, mark.style, mark.opacity)


def _path(
    data: str, colour: str, width_pt: float, style: LineStyle = "-", opacity: float = 1.0
) -> str:
    """Return lines; dashes are in units of their width, as in matplotlib."""
    css = f"fill:none;stroke:{colour};stroke-width:{width_pt:g}"
    if not isinstance(style, str):
        css += ";stroke-dasharray:" + " ".join(f"{width_pt * part:g}" for part in style[1])
    if opacity < 1:
        css += f";stroke-opacity:{opacity:g}"
    return f'<path d="{data}" style="{css}"/>'


def _polyline(x: FloatArray, y: FloatArray) -> str:
    """Return the coordinates of a curve, less points that are on the line of their neighbours."""
    for _ in range(3):
        if len(x) < 3:
            break
        span = x[2:] - x[:-2]
        part = np.divide(x[1:-1] - x[:-2], span, out=np.zeros_like(span), where=span != 0)
        is_needed = np.abs(y[:-2] + part * (y[2:] - y[:-2]) - y[1:-1]) > TOLERANCE_PT
        # Every other point stays, so that none is judged by a neighbour that is left out.
        is_needed[1::2] = True
        kept = np.concatenate([[True], is_needed, [True]])
        x, y = x[kept], y[kept]
    return " ".join(f"{x} {y}" for x, y in zip(_numbers(x), _numbers(y), strict=True))


def _at(axis: Axis, values: FloatArray, length_pt: float) -> FloatArray:
    """Return the distances of values from the lower end of an axis in points."""
    low, high = axis.low, axis.high
    if axis.is_logarithmic:
        values = np.log10(np.maximum(values, 1e-300))
        low, high = np.log10([low, high]).tolist()
    distance = (values - low) / (high - low) * length_pt
    return np.asarray(np.clip(distance, -MAX_PT, length_pt + MAX_PT))


def _positions(axis: Axis, length_pt: float) -> FloatArray:
    """Return the positions of the labelled ticks in points."""
    return _at(axis, np.array([value for value, _ in axis.ticks]), length_pt)


def _numbers(values: FloatArray) -> Iterable[str]:
    """Return coordinates as text, to a hundredth of a point."""
    return map(str, np.round(values, 2).tolist())


def _shape(marker: Marker, size_pt: float) -> str:
    """Return the path of a marker relative to its middle."""
    if marker == "o":
        r = f"{size_pt / 2:g}"
        return f"m-{r} 0a{r} {r} 0 1 0 {size_pt:g} 0a{r} {r} 0 1 0-{size_pt:g} 0"
    corners = size_pt * _CORNERS[marker]
    steps = np.diff(corners, axis=0, prepend=0.0).round(2).tolist()
    return "m" + " ".join(f"{x:g} {y:g}" for x, y in steps) + "z"


def _legend(chart: Chart) -> Iterator[str]:
    """Yield the legend in rows from the top of the chart, its columns as wide as their texts."""
    columns = min(len(chart.legend), chart.columns)
    if not columns:
        return
    widths = [
        max(text_width(label) for label, _ in chart.legend[column::columns])
        for column in range(columns)
    ]
    yield f'<g class="legend" style="fill:{INK};font-size:{SMALL_PT:g}px">'
    for number, (label, mark) in enumerate(chart.legend):
        row, column = divmod(number, columns)
        before = sum(widths[:column]) + column * (HANDLE + HANDLE_GAP + COLUMN_GAP)
        x = LEFT_PT - 4 + SMALL_PT * before
        middle = SMALL_PT * (1.05 + ROW * row)
        yield f"<g>{_handle(mark, x, middle)}"
        text_x, base = x + SMALL_PT * (HANDLE + HANDLE_GAP), middle + CAPITAL / 2 * SMALL_PT
        yield f'<text x="{text_x:.5g}" y="{base:.4g}">{html.escape(label)}</text></g>'
    yield "</g>"


def _handle(mark: Mark, x: float, y: float) -> str:
    """Return the sample of a mark in the legend."""
    length = HANDLE * SMALL_PT
    if isinstance(mark, Points):
        return _points(mark, np.array([x + length / 2]), np.array([y]))
    if isinstance(mark, Band):
        area = f'x="{x:.5g}" y="{y - 0.35 * SMALL_PT:.4g}" width="{length:g}" height="6.65"'
        return f'<rect {area} style="fill:{mark.colour};fill-opacity:{mark.opacity:g}"/>'
    width_pt, style, opacity = (
        (mark.width_pt, mark.style, mark.opacity)
        if isinstance(mark, Line)
        else (ERROR_BAR_PT, "-", 1.0)
    )
    data = f"M{x:.5g} {y:.4g}h{length:g}"
    return _path(data, mark.colour, width_pt, style, opacity)
