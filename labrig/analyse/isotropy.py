"""Processing of `isotropy`: the glow at several angles over the glow seen straight."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from numpy.typing import NDArray

from labrig.analyse.clean import cleaned
from labrig.analyse.part import Part, StageResult
from labrig.analyse.series_fit import TYPICAL_FLICKER
from labrig.analyse.this_camera import insist_on_this_camera
from labrig.analyse.timed_frames import intact_frames, timing_warnings
from labrig.errors import DataError
from labrig.reduce import reduce_patches
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    SHADE,
    error_bars,
    new_figure,
    place,
    points,
)
from labrig.report.legend import legend_above, marked, shaded
from labrig.report.sections import Picture, Section, Table
from labrig.results import Series
from labrig.written_numbers import plus_minus

FloatArray = NDArray[np.float64]

#: What the paper found its samples to fluctuate by at most (section 4).
PAPER = 0.05
#: A deviation is believed when it is so many σ beyond that.
SIGMAS = 2.0
BEFORE, AFTER = "angle-before", "angle-after"


@dataclass(frozen=True)
class View:
    """The glow at one angle, relative to the straight view at the same time after lamp off."""

    angle: int
    ratio: float
    sigma: float


def process(part: Part) -> StageResult:
    """Radiance at each angle, 1 if the emission is isotropic.

    Raises
    ------
    DataError
        A straight view or all others are missing, or frames are damaged.
    """
    intact = intact_frames(part.run, part.choices, part.protocol.purpose)
    frames, stray = cleaned(intact, part.inputs.blank)
    insist_on_this_camera(part.inputs.camera, part.run, part.run.frames(part.protocol.purpose))
    patches = part.choices.patches(part.protocol)
    series = reduce_patches(frames.decay, patches, frames.dark, camera=part.inputs.camera)
    known = part.inputs.camera
    flicker = TYPICAL_FLICKER if known is None else known.flicker
    around = part.protocol.patch == "around"
    angles = {f"angle-{angle}": angle for angle in part.protocol.angles}
    found = {name: _views(one, angles, flicker, around) for name, one in series.items()}
    drifts = {name: _drift(one, flicker) for name, one in series.items()}
    _write(part.folder / "isotropy.csv", found)
    lines = [_line(name, views, len(found) > 1) for name, views in found.items()]
    return StageResult(
        known=part.inputs,
        sections=(_section(found, drifts, around),),
        lines=tuple(lines),
        warnings=(
            *timing_warnings(part.run, part.protocol.purpose),
            *stray,
            *(line for views in found.values() for line in _verdict(views)),
            *(line for drift in drifts.values() for line in _drift_warning(drift)),
        ),
    )


def _views(series: Series, angles: Mapping[str, int], flicker: float, around: bool) -> list[View]:
    units = {one.unit[0]: one for one in series.by_unit()}
    if BEFORE not in units or AFTER not in units or not angles.keys() & units.keys():
        raise DataError(
            "expected views at some angle between two straight ones, not all of them are "
            "complete: go on with labrig resume"
        )
    drift, drift_sigma = _drift(series, flicker)
    order = list(units)
    views = []
    for number, (unit, one) in enumerate(units.items()):
        if unit not in angles:
            continue
        log_ratio, sigma = _log_ratio(one, units[BEFORE], flicker)
        # What lamp and sample drifted by comes evenly between the two straight views.
        share = number / (len(order) - 1)
        log_ratio -= share * np.log(drift)
        sigma = np.hypot(sigma, np.hypot(share * drift_sigma, abs(drift - 1) / np.sqrt(12)))
        ratio = float(np.exp(log_ratio))
        if around:
            ratio /= float(np.cos(np.radians(angles[unit])))
        views.append(View(angles[unit], ratio, ratio * sigma))
    return sorted(views, key=lambda view: view.angle)


def _drift(series: Series, flicker: float) -> tuple[float, float]:
    """The straight view after all others over the one before, and its relative σ."""
    units = {one.unit[0]: one for one in series.by_unit()}
    log_ratio, sigma = _log_ratio(units[AFTER], units[BEFORE], flicker)
    return float(np.exp(log_ratio)), sigma


def _log_ratio(view: Series, straight: Series, flicker: float) -> tuple[float, float]:
    """Log of how bright a view is over the straight one at the same times, and its σ."""
    best = int(np.argmax(np.mean(straight.values / straight.sigma, axis=0)))
    y, s = _usable(view, best)
    reference, of_reference = _usable(straight, best)
    if (y <= 0).any() or (reference <= 0).any() or len(y) == 0 or len(reference) < 2:
        raise DataError(
            f"{view.unit[0]}: expected a glow in every frame, got none above the noise; charge for "
            "longer, raise camera.iso or photograph earlier (first:)"
        )
    # A frame's own flicker, and that of all frames that it is held against.
    logs = np.log(y) - _log_at(_middle_s(view), _middle_s(straight), np.log(reference))
    sigma = np.hypot(s / y, flicker)
    weight = 1 / sigma**2
    common = np.sqrt(np.mean((of_reference / reference) ** 2) + flicker**2) / np.sqrt(
        len(reference)
    )
    return float(weight @ logs / weight.sum()), float(np.hypot(1 / np.sqrt(weight.sum()), common))


def _usable(series: Series, channel: int) -> tuple[FloatArray, FloatArray]:
    """Values of a channel, and σ."""
    return series.values[series.usable, channel], series.sigma[series.usable, channel]


def _middle_s(series: Series) -> FloatArray:
    return np.asarray((series.t_s + series.exposure_s / 2)[series.usable])


def _log_at(wanted_s: FloatArray, t_s: FloatArray, log_value: FloatArray) -> FloatArray:
    """A decay's logarithm at some times: a straight line over log t through the points, as a
    power law is and an exponential nearly, over so short a time.
    """
    slope, start = np.polyfit(np.log(t_s), log_value, 1)
    within = np.interp(wanted_s, t_s, log_value)
    beyond = (wanted_s < t_s[0]) | (wanted_s > t_s[-1])
    return np.where(beyond, start + slope * np.log(wanted_s), within)


def _worst(views: Sequence[View]) -> View:
    return max(views, key=lambda view: abs(view.ratio - 1))


def _line(name: str, views: Sequence[View], several: bool) -> str:
    worst = _worst(views)
    patch = f"{name}: " if several else ""
    return (
        f"{patch}isotropy: within {abs(worst.ratio - 1):.1%} of the straight view up to "
        f"{max(view.angle for view in views)}° (at {worst.angle}°: "
        f"{plus_minus(worst.ratio, worst.sigma)}; the paper's samples: less than {PAPER:.0%})"
    )


def _verdict(views: Sequence[View]) -> list[str]:
    worst = _worst(views)
    if abs(worst.ratio - 1) < PAPER + SIGMAS * worst.sigma:
        return []
    return [
        f"the emission is not isotropic: at {worst.angle}° it is "
        f"{plus_minus(worst.ratio, worst.sigma)} of the straight view (the paper's samples stay "
        f"within {PAPER:.0%}); the model takes it for the same in all directions. Does the patch "
        "still lie inside of the turned sample?"
    ]


def _drift_warning(drift: tuple[float, float]) -> list[str]:
    ratio, sigma = drift
    if abs(ratio - 1) < PAPER + SIGMAS * sigma:
        return []
    return [
        f"between the straight views before and after the others the glow changed to "
        f"{plus_minus(ratio, ratio * sigma)} of what it was; the drift is taken for even in time: "
        "was lamp, sample or camera moved?"
    ]


def _section(
    found: Mapping[str, Sequence[View]], drifts: Mapping[str, tuple[float, float]], around: bool
) -> Section:
    what = (
        "The patches enclose the whole sample: what they show is its intensity, here divided by "
        "the cosine of the angle."
        if around
        else "The patches lie inside of the sample: what they show is its radiance, which is the "
        "same at all angles if the emission is isotropic."
    )
    drift = ", ".join(
        f"{name} {plus_minus(ratio, ratio * sigma)}" for name, (ratio, sigma) in drifts.items()
    )
    statement = []
    for name, views in found.items():
        worst = _worst(views)
        inside = abs(worst.ratio - 1) < PAPER + SIGMAS * worst.sigma
        statement.append(
            f"{name}: the largest deviation is {worst.ratio - 1:+.1%} ± {worst.sigma:.1%} at "
            f"{worst.angle}°, {'no more than' if inside else 'more than'} the paper's "
            f"{PAPER:.0%}."
        )
    return Section(
        "Isotropy",
        (
            f"Every view follows a charge seen straight. {what}",
            f"The straight view after all others over the one before: {drift}; that drift is "
            "divided out.",
            *statement,
        ),
        (
            Picture(
                "isotropy",
                _figure(found),
                "Glow at an angle relative to the straight view at the same time after lamp off; "
                "bars: 1 σ; shaded: the 5 % that the paper's samples stay within.",
            ),
        ),
        (
            Table(
                ("angle", *found),
                tuple(
                    (
                        f"{first.angle}°",
                        *(plus_minus(views[n].ratio, views[n].sigma) for views in found.values()),
                    )
                    for n, first in enumerate(next(iter(found.values())))
                ),
            ),
        ),
    )


def _figure(found: Mapping[str, Sequence[View]]) -> Figure:
    figure = new_figure(220.0)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    axes.axhspan(1 - PAPER, 1 + PAPER, color=SHADE, zorder=0)
    axes.axhline(1.0, color=MUTED, linewidth=0.9)
    entries: list[Artist] = [shaded("paper: ± 5 %", MUTED)]
    reach = 1.5 * PAPER
    for number, (name, views) in enumerate(found.items()):
        colour = (INK, *OTHER_CHANNELS)[number % (1 + len(OTHER_CHANNELS))]
        marker = MARKERS[number % len(MARKERS)]
        angle = np.array([float(view.angle) for view in views])
        ratio = np.array([view.ratio for view in views])
        sigma = np.array([view.sigma for view in views])
        error_bars(axes, angle, ratio, sigma, colour)
        points(axes, angle, ratio, marker, colour, colour)
        entries.append(marked(name, marker, colour))
        reach = max(reach, 1.2 * float(np.max(np.abs(ratio - 1) + sigma)))
    axes.set_ylim(1 - reach, 1 + reach)
    axes.set_xlabel("Angle / °")
    axes.set_ylabel("Relative to straight view")
    legend_above(figure, entries, columns=5)
    return figure


def _write(path: Path, found: Mapping[str, Sequence[View]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["patch", "angle_deg", "ratio", "ratio_sigma"])
        for name, views in found.items():
            for view in views:
                table.writerow([name, view.angle, f"{view.ratio:.6g}", f"{view.sigma:.6g}"])
