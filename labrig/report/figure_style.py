"""Style of all figures of a report: sizes, colours, axes, ticks, legends."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import power_of_ten, rounded

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import XAxis, YAxis
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

#: Ticks as pairs of value and label, by rising value.
Ticks = tuple[tuple[float, str], ...]

#: Steps between ticks within a decade that are easy to read.
STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
#: Number of decades of an axis below which ticks between decades are labelled, too.
FEW_DECADES = 2.0
#: Number of labels below which evenly spaced ticks are labelled instead.
MIN_LABELS = 2


def linear_ticks(
    low: float, high: float, most: int, label: Callable[[float], str] = rounded
) -> Ticks:
    """Return at most `most + 1` evenly spaced ticks from `low` to `high`."""
    raw_step = (high - low) / most
    if not (math.isfinite(raw_step) and raw_step > 0):
        return ()
    decade = 10.0 ** math.floor(math.log10(raw_step))
    step = next(
        (factor * decade for factor in STEPS if factor * decade >= raw_step * (1 - 1e-9)),
        10 * decade,
    )
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return tuple((number * step, label(number * step)) for number in range(first, last + 1))


def decade_ticks(low: float, high: float, most: int = 8) -> tuple[Ticks, tuple[float, ...]]:
    """Return the labelled ticks of a logarithmic axis, and its short ticks without labels.

    Labelled ticks stand at `most` decades or between them; if every decade is labelled, short ticks
    stand at its multiples from 2 to 9.
    """
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    inside = [decade for decade in decades if low <= 10.0**decade <= high]
    step = max(1, math.ceil(len(inside) / most))
    labelled_decades = decades[::step]
    labelled = [10.0**decade for decade in labelled_decades]
    if high < low * 10**FEW_DECADES:
        labelled = [digit * 10.0**decade for decade in labelled_decades for digit in (1, 2, 5)]
    labelled = [tick for tick in labelled if low <= tick <= high]
    if len(labelled) < MIN_LABELS:
        labelled = [tick for tick, _ in linear_ticks(low, high, 5)]
    multiples = [digit * 10.0**decade for decade in decades for digit in range(2, 10)]
    short = tuple(tick for tick in multiples if low <= tick <= high) if step == 1 else ()
    return tuple((tick, decade_text(tick)) for tick in labelled), short


def decade_text(value: float) -> str:
    """Return the label of a tick: `0.001` to `10000`, beyond that with a power of ten."""
    exponent = math.floor(math.log10(value) + 1e-9)
    if -3 <= exponent <= 4:
        return f"{value:g}"
    digits = rounded(value / 10.0**exponent, 3)
    return power_of_ten(exponent) if digits == "1" else f"{digits} × {power_of_ten(exponent)}"


#: Width of figures in points, so that 10 pt is legible at half a desktop's or a phone's width.
WIDTH_PT = 420.0
FONT_PT = 10.5
SMALL_PT = 9.5
#: Left margin of axes in points, the same in all figures so that their axes are in line.
LEFT_PT = 62.0

#: Distance between a label and the edge of the figure in points.
EDGE_PT = 3.0

Marker: TypeAlias = str | Literal[7]
LineStyle: TypeAlias = str | tuple[float, tuple[float, ...]]
SOLID: LineStyle = "-"
DASHED: LineStyle = (0, (4, 2.5))
LONG_DASHED: LineStyle = (0, (8, 3))
DOTTED: LineStyle = (0, (1, 2))
DASH_DOTTED: LineStyle = (0, (5, 2, 1, 2))

INK, MUTED, RULE, PAPER, SHADE = "#1d2329", "#5f6b76", "#dde2e6", "#fefefe", "#e9eff4"
#: Colours of the channels R, G, B of a camera, and of other channels in turn.
CHANNEL = {"R": "#c4372c", "G": "#1b8450", "B": "#2b62c9"}
OTHER_CHANNELS = ("#7a4fb5", "#b06a00", "#0f7f8a", "#a8326e", "#4f5b66")
#: Lightness, chroma and hues in Oklab of the colours of a spectrum.
SPECTRUM_LIGHTNESS, SPECTRUM_CHROMA, SPECTRUM_HUE_DEG = 0.62, 0.13, (310.0, 20.0)
#: Marker of a value below an axis, its tip on the axis.
CARET_DOWN: Literal[7] = 7
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")

#: Name of the page's variable for each colour, which has another value in the dark scheme.
VARIABLES = {
    INK: "ink",
    MUTED: "muted",
    RULE: "rule",
    PAPER: "card",
    SHADE: "shade",
    **{colour: f"channel-{name.lower()}" for name, colour in CHANNEL.items()},
    **{colour: f"channel-{number}" for number, colour in enumerate(OTHER_CHANNELS)},
}

_SETTINGS = {
    "svg.fonttype": "none",
    "svg.hashsalt": "labrig",
    "pdf.fonttype": 42,  # TrueType: some publishers refuse the default, Type 3
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same widths everywhere
    "font.size": FONT_PT,
    "axes.unicode_minus": True,
}


@contextmanager
def figure_style() -> Iterator[None]:
    """Set the style of all figures, whatever the user's own matplotlib settings are.

    Returns
    -------
    contextlib.AbstractContextManager
        Context within which figures are made and saved.

    Examples
    --------
    >>> import matplotlib
    >>> from labrig.report import figure_style
    >>> with figure_style():
    ...     matplotlib.rcParams["font.size"]
    10.5
    """
    import matplotlib.style

    with matplotlib.style.context(["default", _SETTINGS]):
        yield


def channel_colour(name: str, number: int) -> str:
    """Return the colour of the channel `name`, whose index in its series is `number`."""
    return CHANNEL.get(name, OTHER_CHANNELS[number % len(OTHER_CHANNELS)])


def spectral_colours(wavelength_nm: Sequence[float]) -> list[str]:
    """Return a colour for each wavelength, by its place in the spectrum and all equally light.

    Of one lightness they are readable on a light page as on a dark one; the hue goes from violet
    at 360 nm to red at 700 nm.

    Parameters
    ----------
    wavelength_nm
        Wavelengths in nm; those beyond have the colour of the end.

    Returns
    -------
    list of str
        Colours as `#rrggbb`.
    """
    from labrig.optics import from_oklab, srgb_bytes

    hue = np.radians(np.interp(wavelength_nm, (360.0, 700.0), SPECTRUM_HUE_DEG))
    a, b = SPECTRUM_CHROMA * np.cos(hue), SPECTRUM_CHROMA * np.sin(hue)
    lab = np.stack([np.full_like(hue, SPECTRUM_LIGHTNESS), a, b], axis=-1)
    return ["#" + bytes(rgb).hex() for rgb in srgb_bytes(from_oklab(lab))]


def new_figure(height_pt: float, width_pt: float = WIDTH_PT) -> "Figure":
    """Return an empty, transparent figure.

    Parameters
    ----------
    height_pt
        Height in points.
    width_pt
        Width in points.

    Returns
    -------
    matplotlib.figure.Figure
        Figure without axes, of 72 dots per inch: a pixel is a point.

    Examples
    --------
    >>> from labrig.report import figure_style, new_figure, place
    >>> with figure_style():
    ...     figure = new_figure(200)
    ...     axes = place(figure, left=62, bottom=38, right=12, top=30)
    >>> [round(72 * inches) for inches in figure.get_size_inches()]
    [420, 200]
    """
    from labrig.report.notebook_figure import NotebookFigure  # matplotlib is slow to load

    figure = NotebookFigure(figsize=(width_pt / 72, height_pt / 72), dpi=72)
    figure.patch.set_visible(False)
    return figure


def place(
    figure: "Figure",
    left: float,
    bottom: float,
    right: float,
    top: float,
    share_x: "Axes | None" = None,
) -> "Axes":
    """Add axes whose margins to the edges of the figure are given in points.

    Labels stand at the figure's edge, so that those of several axes are in line.

    Parameters
    ----------
    figure
        Figure that gets the axes.
    left, bottom, right, top
        Distances of the axes from the edges of the figure in points.
    share_x
        Axes with the same horizontal axis; None for a horizontal axis of its own.

    Returns
    -------
    matplotlib.axes.Axes
        Axes with grid and the colours of the report.

    Examples
    --------
    >>> from labrig.report import figure_style, new_figure, place
    >>> with figure_style():
    ...     figure = new_figure(268)
    ...     signal = place(figure, left=62, bottom=136, right=12, top=30)
    ...     residuals = place(figure, left=62, bottom=38, right=12, top=150, share_x=signal)
    >>> round(residuals.get_window_extent().height)
    80
    """
    width, height = figure.get_size_inches() * 72
    axes = figure.add_axes(
        (left / width, bottom / height, 1 - (left + right) / width, 1 - (bottom + top) / height),
        sharex=share_x,
    )
    axes.set_facecolor("none")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(MUTED)
    axes.tick_params(colors=MUTED, labelsize=SMALL_PT, length=3.5, which="both")
    axes.tick_params(length=2, which="minor")
    axes.xaxis.label.set(color=INK, verticalalignment="bottom")
    axes.yaxis.label.set(color=INK, verticalalignment="top")
    # Placing them by hand saves matplotlib the measuring of all ticks.
    axes.xaxis.set_label_coords(0.5, (EDGE_PT - bottom) / (height - bottom - top))
    axes.yaxis.set_label_coords((EDGE_PT - left) / (width - left - right), 0.5)
    axes.grid(True, color=RULE, linewidth=0.7)
    axes.set_axisbelow(True)
    return axes


def points(
    axes: "Axes",
    x: FloatArray,
    y: FloatArray,
    marker: Marker,
    colour: str,
    face: str,
    size: float = 3.8,
) -> None:
    """Draw measured values as points, which are hollow if `face` is the colour of the paper."""
    axes.plot(
        x,
        y,
        linestyle="none",
        marker=marker,
        markersize=size,
        markerfacecolor=face,
        markeredgecolor=colour,
        markeredgewidth=0.9,
        zorder=3,
    )


def error_bars(axes: "Axes", x: FloatArray, y: FloatArray, sigma: FloatArray, colour: str) -> None:
    """Draw bars of ± 1 σ, all in one path; as single paths they would be half of the file."""
    gap = np.full_like(y, np.nan)
    axes.plot(
        np.repeat(x, 3),
        np.stack([y - sigma, y + sigma, gap], axis=1).ravel(),
        color=colour,
        linewidth=0.9,
        solid_capstyle="butt",
    )


#: Opacity of bands of uncertainty.
BAND_OPACITY = 0.3


def legend_above(figure: "Figure", entries: Sequence["Artist"], columns: int) -> None:
    """Add a legend at the top of a figure.

    Parameters
    ----------
    figure
        Figure that gets the legend, with a free margin above its axes.
    entries
        Entries of the legend, each with its label.
    columns
        Largest number of columns.

    Examples
    --------
    >>> from labrig.report import DASHED, figure_style, legend_above, line_entry, new_figure
    >>> with figure_style():
    ...     figure = new_figure(200)
    ...     entries = [line_entry("fit", "black"), line_entry("state", "black", DASHED)]
    ...     legend_above(figure, entries, 2)
    >>> [text.get_text() for text in figure.legends[0].get_texts()]
    ['fit', 'state']
    """
    figure.legend(
        handles=list(entries),
        loc="upper left",
        bbox_to_anchor=((LEFT_PT - 8) / (72 * figure.get_figwidth()), 1.0),
        ncols=min(len(entries), columns),
        frameon=False,
        fontsize=SMALL_PT,
        labelcolor=INK,
        handlelength=1.6,
        handletextpad=0.4,
        columnspacing=1.0,
        labelspacing=0.2,
        borderaxespad=0.4,
    )


def marker_entry(label: str, marker: Marker, colour: str, face: str | None = None) -> "Line2D":
    """Return the legend entry of points."""
    from matplotlib.lines import Line2D

    return Line2D(
        [],
        [],
        linestyle="none",
        marker=marker,
        markersize=5,
        markeredgecolor=colour,
        markerfacecolor=colour if face is None else face,
        label=label,
    )


def line_entry(
    label: str, colour: str, style: LineStyle = SOLID, width: float = 1.2, opacity: float = 1.0
) -> "Line2D":
    """Return the legend entry of a curve.

    Parameters
    ----------
    label
        Text of the entry.
    colour
        Colour of the curve, as matplotlib takes it.
    style
        Line style of the curve, as matplotlib takes it.
    width
        Line width in points.
    opacity
        Opacity of the curve, from 0 to 1.

    Returns
    -------
    matplotlib.lines.Line2D
        Line without points, for the handles of a legend.

    Examples
    --------
    >>> from labrig.report import INK, line_entry, legend_above, new_figure
    >>> entry = line_entry("predicted", INK)
    >>> legend_above(new_figure(200), [entry], columns=1)
    >>> entry.get_label()
    'predicted'
    """
    from matplotlib.lines import Line2D

    return Line2D([], [], color=colour, ls=style, linewidth=width, alpha=opacity, label=label)


def band_entry(label: str, colour: str) -> "Patch":
    """Return the legend entry of a band."""
    from matplotlib.patches import Patch

    return Patch(color=colour, alpha=BAND_OPACITY, linewidth=0, label=label)


def mark_decades(axes: "Axes", most: int = 8) -> None:
    """Set the ticks of a logarithmic vertical axis whose limits are set.

    Labelled ticks stand at `most` decades or between them; if every decade is labelled, short ticks
    stand at its multiples from 2 to 9.
    """
    set_ticks(axes.yaxis, *decade_ticks(*axes.get_ylim(), most))


def set_ticks(axis: "XAxis | YAxis", ticks: Ticks, short_ticks: Sequence[float] = ()) -> None:
    """Set the labelled ticks of an axis, and those of a vertical axis that have no label."""
    from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

    axis.set_major_locator(FixedLocator([value for value, _ in ticks]))
    axis.set_major_formatter(FixedFormatter([text for _, text in ticks]))
    # Matplotlib's own minor ticks would be half of the work of drawing the figure.
    axis.set_minor_locator(NullLocator())
    if short_ticks:
        axis.axes.plot(
            np.zeros(len(short_ticks)),
            short_ticks,
            transform=axis.axes.get_yaxis_transform(),
            linestyle="none",
            marker=0,  # a tick that points to the left
            markersize=2,
            markeredgewidth=0.6,
            color=MUTED,
            clip_on=False,
        )
