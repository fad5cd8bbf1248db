"""Report of the glow at several angles."""

from collections.abc import Mapping
from functools import partial

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from labrig.foundation.number_format import plus_minus
from labrig.protocols.isotropy.result import (
    PAPER_FLUCTUATION,
    AngularGlow,
    IsotropyResult,
    is_within_paper,
)
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    SHADE,
    band_entry,
    error_bars,
    legend_above,
    marker_entry,
    new_figure,
    place,
    points,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table

#: Least half height of the figure, as a multiple of the fluctuation of the paper's samples.
MIN_REACH = 1.5


def render(result: IsotropyResult, source: Source) -> Rendered:
    """Render the radiance over the angle, and its largest deviation."""
    several = len(result.patches) > 1
    lines = (
        f"{name}: {_line(glow)}" if several else _line(glow)
        for name, glow in result.patches.items()
    )
    return Rendered((_section(result),), tuple(lines))


def _line(glow: AngularGlow) -> str:
    """Return the line for the terminal on the largest deviation of a patch."""
    worst = glow.worst
    return (
        f"isotropy: within {abs(worst.value - 1):.1%} of the straight view up to "
        f"{glow.angle_deg.max()}° (at {glow.worst_angle_deg}°: "
        f"{plus_minus(worst.value, worst.sigma)}; the paper's samples: less than "
        f"{PAPER_FLUCTUATION:.0%})"
    )


def _section(result: IsotropyResult) -> Section:
    """Return the section with the figure and the table of all patches."""
    patches = result.patches
    geometry = (
        "The patches enclose the whole sample: they show its intensity, here divided by "
        "the cosine of the angle."
        if result.encloses_sample
        else "The patches lie inside of the sample: they show its radiance, which is the "
        "same at all angles if the emission is isotropic."
    )
    drift = ", ".join(
        f"{name} {plus_minus(glow.drift.value, glow.drift.sigma)}" for name, glow in patches.items()
    )
    caption = (
        "Glow at an angle relative to the straight view at the same time after lamp off; bars: "
        f"1 σ; shaded: the {100 * PAPER_FLUCTUATION:g} % that the paper's samples stay within."
    )
    first = next(iter(patches.values()))
    rows = (
        (
            f"{angle_deg}°",
            *(plus_minus(glow.ratio[n], glow.ratio_sigma[n]) for glow in patches.values()),
        )
        for n, angle_deg in enumerate(first.angle_deg)
    )
    return Section(
        "Isotropy",
        (
            f"Every view follows a charge seen straight. {geometry}",
            f"The straight view after all others over the one before: {drift}; that drift is "
            "divided out.",
            *(_statement(name, glow) for name, glow in patches.items()),
        ),
        (Picture("isotropy", partial(_figure, patches), caption),),
        (Table(("Angle", *patches), tuple(rows)),),
    )


def _statement(name: str, glow: AngularGlow) -> str:
    """Return the sentence on the largest deviation of a patch."""
    worst = glow.worst
    return (
        f"{name}: the largest deviation is {worst.value - 1:+.1%} ± {worst.sigma:.1%} at "
        f"{glow.worst_angle_deg}°, {'no more' if is_within_paper(worst) else 'more'} than the "
        f"paper's {PAPER_FLUCTUATION:.0%}."
    )


def _figure(patches: Mapping[str, AngularGlow]) -> Figure:
    """Draw the glow over the angle, relative to the straight view."""
    figure = new_figure(220.0)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    axes.axhspan(1 - PAPER_FLUCTUATION, 1 + PAPER_FLUCTUATION, color=SHADE, zorder=0)
    axes.axhline(1.0, color=MUTED, linewidth=0.9)
    entries: list[Artist] = [band_entry(f"paper: ± {100 * PAPER_FLUCTUATION:g} %", MUTED)]
    reach = MIN_REACH * PAPER_FLUCTUATION
    for number, (name, glow) in enumerate(patches.items()):
        colour = (INK, *OTHER_CHANNELS)[number % (1 + len(OTHER_CHANNELS))]
        marker = MARKERS[number % len(MARKERS)]
        angle_deg = glow.angle_deg.astype(float)
        error_bars(axes, angle_deg, glow.ratio, glow.ratio_sigma, colour)
        points(axes, angle_deg, glow.ratio, marker, colour, colour)
        entries.append(marker_entry(name, marker, colour))
        reach = max(reach, 1.2 * float(np.max(np.abs(glow.ratio - 1) + glow.ratio_sigma)))
    axes.set_ylim(1 - reach, 1 + reach)
    axes.set_xlabel("Angle / °")
    axes.set_ylabel("Relative to straight view")
    legend_above(figure, entries, columns=5)
    return figure
