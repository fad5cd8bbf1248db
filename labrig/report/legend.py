"""Legends: in rows above the axes, so that they cover no data."""

from collections.abc import Sequence

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from labrig.report.figure_style import INK, LEFT_PT, SMALL_PT, LineStyle

#: How strongly bands of uncertainty are coloured.
BAND_OPACITY = 0.3


def legend_above(figure: Figure, entries: Sequence[Artist], columns: int) -> None:
    """`entries`, each with its label, at the top of `figure`."""
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


def marked(label: str, marker: str, colour: str, face: str | None = None) -> Line2D:
    """An entry for points."""
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


def lined(
    label: str, colour: str, style: LineStyle = "-", width: float = 1.2, opacity: float = 1.0
) -> Line2D:
    """An entry for a curve."""
    return Line2D([], [], color=colour, ls=style, linewidth=width, alpha=opacity, label=label)


def shaded(label: str, colour: str) -> Patch:
    """An entry for a band."""
    return Patch(color=colour, alpha=BAND_OPACITY, linewidth=0, label=label)
