"""How figures look, and how they get into the page: as SVG whose colours are the page's.

Colours are CSS variables with the light scheme's colour as fallback, so that one figure serves the
light scheme, the dark one and print. Text stays text: it takes the page's font and can be searched.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from io import BytesIO

import matplotlib.style
from matplotlib.axes import Axes
from matplotlib.figure import Figure

#: Figures are this wide in points, so that 10 pt is legible at half a desktop's or a phone's width.
WIDTH_PT = 420.0
FONT_PT = 10.5
SMALL_PT = 9.5

INK, MUTED, RULE, PAPER, SHADE = "#1d2329", "#5f6b76", "#dde2e6", "#fefefe", "#e9eff4"
#: Colours of the channels of a camera, and of other channels in turn.
CHANNEL = {"R": "#c4372c", "G": "#1b8450", "B": "#2b62c9"}
OTHER_CHANNELS = ("#7a4fb5", "#b06a00", "#0f7f8a", "#a8326e", "#4f5b66")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")

_VARIABLES = {
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
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same widths everywhere
    "font.size": FONT_PT,
    "axes.unicode_minus": True,
}


@contextmanager
def figure_style() -> Iterator[None]:
    """While open, figures come out alike whatever the user's own matplotlib settings are."""
    with matplotlib.style.context(["default", _SETTINGS]):
        yield


def channel_colour(name: str, number: int) -> str:
    """Colour of the channel called `name`, the `number`-th of its series."""
    return CHANNEL.get(name, OTHER_CHANNELS[number % len(OTHER_CHANNELS)])


def new_figure(height_pt: float, width_pt: float = WIDTH_PT) -> Figure:
    """An empty, transparent figure."""
    figure = Figure(figsize=(width_pt / 72, height_pt / 72), dpi=72)
    figure.patch.set_visible(False)
    return figure


def place(
    figure: Figure,
    left: float,
    bottom: float,
    right: float,
    top: float,
    share_x: Axes | None = None,
) -> Axes:
    """Axes with margins in points from the figure's left, bottom, right and top edge."""
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
    axes.xaxis.label.set_color(INK)
    axes.yaxis.label.set_color(INK)
    axes.grid(True, color=RULE, linewidth=0.7)
    axes.set_axisbelow(True)
    return axes


def svg(figure: Figure, name: str, described: str) -> str:
    """The figure as an `<svg>` element.

    Parameters
    ----------
    figure
        Made within `figure_style`.
    name
        Unique on the page; letters, digits and hyphens.
    described
        What it shows, for those who cannot see it.
    """
    buffer = BytesIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    figure.savefig(buffer, format="svg", metadata=nothing)
    text = buffer.getvalue().decode("utf-8")
    text = text[text.index("<svg") :].strip()
    body = text.split(">", 1)[1]
    width, height = figure.get_size_inches() * 72
    # Its style sheet would hold for the whole page, which has one of its own.
    body = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>", "", body, flags=re.DOTALL)
    body = re.sub(r" font-family: [^;\"]*;", "", body)
    # Ids are unique in a figure, not in a page of figures.
    body = re.sub(r'\bid="', f'id="{name}-', body)
    body = body.replace("url(#", f"url(#{name}-").replace('xlink:href="#', f'href="#{name}-')
    for colour, variable in _VARIABLES.items():
        body = body.replace(colour, f"var(--{variable}, {colour})")
    body = re.sub(r">\s+<", "><", body)
    label = escape(described)
    return f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{label}">{body}'
