"""Plateaus of the glow over the length of the charge, and decays of different charge compared."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from labrig.analyse.saturation.shared_rates import Curve, RatesTest
from labrig.report.figure_style import (
    DASHED,
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    PAPER,
    error_bars,
    new_figure,
    place,
    points,
)
from labrig.report.legend import legend_above, lined, marked
from labrig.report.log_axis import mark_decades

FloatArray = NDArray[np.float64]

HEIGHT_PT = 256.0


def plateau_figure(
    charges_s: Mapping[str, FloatArray],
    amplitude: Mapping[str, FloatArray],
    sigma: Mapping[str, FloatArray],
) -> Figure:
    """Amplitude of every state (d, s) after each charge (d,), by light."""
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    entries = []
    for style, light in zip(("-", DASHED), charges_s, strict=False):
        minutes = charges_s[light] / 60
        full = light == "full"
        entries.append(lined(f"{light} light", MUTED, style))
        for state in range(amplitude[light].shape[1]):
            colour, marker = _look(state)
            y, s = amplitude[light][:, state], sigma[light][:, state]
            axes.plot(minutes, y, color=colour, linestyle=style, linewidth=1.0)
            error_bars(axes, minutes, y, s, colour)
            points(axes, minutes, y, marker, colour, colour if full else PAPER)
            if full:
                entries.append(marked(f"state {state + 1}", marker, colour))
    axes.set_xlim(0, None)
    axes.set_ylim(0, None)
    axes.set_xlabel("Charge / min")
    axes.set_ylabel("Amplitude / (DN/s)")
    legend_above(figure, entries, columns=5)
    return figure


def decays_figure(curves: Mapping[str, Curve], test: RatesTest) -> Figure:
    """Decays over what shared rates make of their begin, and what is left of each."""
    figure = new_figure(320.0)
    top = place(figure, left=LEFT_PT, bottom=150, right=12, top=46)
    below = place(figure, left=LEFT_PT, bottom=38, right=12, top=190, share_x=top)
    top.set_yscale("log", nonpositive="clip")
    entries = []
    for number, (name, one) in enumerate(curves.items()):
        colour, marker = _look(number)
        start = float(test.amplitude[number].sum())
        middle = one.t_s + one.exposure_s / 2
        points(top, middle, one.value / start, marker, colour, colour, size=3.0)
        left = one.residuals(test.shared_per_s)[:-1]
        points(below, middle, -left, marker, colour, colour, size=3.0)
        entries.append(marked(name, marker, colour))
    low = min(float(np.min(one.value[one.value > 0], initial=np.inf)) / float(a.sum())
              for one, a in zip(curves.values(), test.amplitude, strict=True))  # fmt: skip
    top.set_ylim(max(low / 1.5, 1e-5), 1.5)
    mark_decades(top)
    below.axhline(0, color=MUTED, linewidth=0.9)
    top.set_ylabel("Over begin")
    below.set_ylabel("Residual / σ")
    below.set_xlabel("Time after lamp off / s")
    top.tick_params(labelbottom=False)
    legend_above(figure, entries, columns=3)
    return figure


def _look(number: int) -> tuple[str, str]:
    colours: Sequence[str] = (INK, *OTHER_CHANNELS)
    return colours[number % len(colours)], MARKERS[number % len(MARKERS)]
