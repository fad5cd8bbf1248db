"""Report of a lamp's fade, rise and warming."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from labrig.acquire import CAMERA
from labrig.calibration import Change, FadeFile, Warming
from labrig.foundation.detection import DECAY_DETECTION_SIGMA
from labrig.foundation.number_format import plus_minus, rounded
from labrig.protocols.fade.result import FadeResult, LampChange, WarmingLight
from labrig.report.figure_style import (
    CHANNEL,
    INK,
    LEFT_PT,
    OTHER_CHANNELS,
    legend_above,
    line_entry,
    new_figure,
    place,
    points,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table

HEIGHT_PT = 250.0
#: Colours of the bands that are drawn, from blue to red.
COLOURS = (CHANNEL["B"], OTHER_CHANNELS[2], CHANNEL["G"], OTHER_CHANNELS[1], CHANNEL["R"])


def render(result: FadeResult, source: Source) -> Rendered:
    """Render the light of the lamp during fade and rise, and while its housing warms."""
    file = result.calibration
    changes = [("fade", file.fade, result.fade)]
    if file.rise is not None and result.rise is not None:
        changes.append(("rise", file.rise, result.rise))
    sections, lines = [_changes(file, changes)], [*_lines(changes), *_lag_lines(result, source)]
    if file.warming is not None and result.warming is not None:
        sections.append(_warming(file.warming, result.warming))
        lines.append(_warming_line(file.warming))
    return Rendered(tuple(sections), tuple(lines))


def _lag_lines(result: FadeResult, source: Source) -> Iterator[str]:
    """Yield by how much the shutter lag of the run's rig file is off, if it is for certain."""
    given = source.rig.devices[CAMERA.key].settings().get("shutter_lag", "0 s")
    off = result.fade.lag
    if abs(off.value) > DECAY_DETECTION_SIGMA * off.sigma:
        milliseconds = plus_minus(1e3 * off.value, 1e3 * off.sigma)
        yield f"shutter_lag of the rig file ({given}): add {milliseconds} ms to it"


def _changes(file: FadeFile, changes: list[tuple[str, Change, LampChange]]) -> Section:
    """Return the section on fade and rise, each given by name, table and fit."""
    figures = tuple(
        Picture(
            name,
            partial(_fractions, file, table),
            f"The lamp's light over that of the steady lamp during its {name}, in some bands; "
            "pale: ± 1 σ.",
        )
        for name, table, _ in changes
    )
    rows = tuple(
        (
            name,
            plus_minus(change.exponent.value, change.exponent.sigma),
            plus_minus(1e3 * change.lag.value, 1e3 * change.lag.sigma),
            f"{1e3 * change.best.jitter_s:.1f}",
            f"{change.best.reduced_chi2:.2f}",
            f"{len(change.frames.start_s)}",
        )
        for name, _, change in changes
    )
    head = ("", "Exponent", "Lag / ms", "Jitter / ms", "χ² per dof", "Frames")
    return Section(
        "Turn-off and turn-on transients of the lamp",
        (
            "ln fraction = −u(t) (550 nm/λ)^p for all wavelengths, with u(t) smooth; p is 1 for a "
            "black-body emitter. What happens before the first shutter opens is constrained by the "
            "fraction of 1 (or 0) at the switch and by the later frames.",
        ),
        figures,
        (Table(head, rows, "Lag: by how much shutters opened later than recorded."),),
    )


def _fractions(file: FadeFile, table: Change) -> Figure:
    """Draw the light in some bands over that of the steady lamp."""
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=46)
    fraction, sigma = np.array(table.fraction), np.array(table.sigma)
    time_ms = 1e3 * np.array(table.t_s)
    bands = fraction.shape[1]
    drawn_bands = sorted(
        set(np.linspace(0, bands - 1, min(bands, len(COLOURS))).round().astype(int))
    )
    entries = []
    for band, colour in zip(drawn_bands, COLOURS, strict=False):
        low, high = file.bands_nm[band], file.bands_nm[band + 1]
        axes.fill_between(
            time_ms, fraction[:, band] - sigma[:, band], fraction[:, band] + sigma[:, band],
            color=colour, alpha=0.3, linewidth=0,
        )  # fmt: skip
        axes.plot(time_ms, fraction[:, band], color=colour, linewidth=1.2)
        entries.append(line_entry(f"{low:g}–{high:g} nm", colour))
    axes.set_xlabel("Time after the switch / ms")
    axes.set_ylabel("Light / steady light")
    legend_above(figure, entries, columns=3)
    return figure


def _warming(warming: Warming, measured: WarmingLight) -> Section:
    """Return the section on the warm-up transient."""
    deficit = plus_minus(100 * warming.deficit, 100 * warming.deficit_sigma)
    text = (
        f"After ten minutes in the dark the lamp has {deficit} % less light than when warm. The "
        f"deficit decays with a time constant of {warming.time_constant_s:.0f} s as the housing "
        "warms, and weakens short charges."
    )
    caption = "Light on the card in each photograph; line: 1 − d e^(−t/τ)."
    return Section(
        "Warm-up transient of the lamp",
        (text,),
        (Picture("warming", partial(_warming_figure, warming, measured), caption),),
    )


def _warming_figure(warming: Warming, measured: WarmingLight) -> Figure:
    """Draw the light after switching on in per cent of that of the warm lamp."""
    figure = new_figure(180)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=12)
    grid = np.linspace(0, float(measured.t_s.max()), 201)
    axes.plot(
        grid, 100 * (1 - warming.deficit * np.exp(-grid / warming.time_constant_s)), color=INK
    )
    points(axes, measured.t_s, 100 * measured.light, "o", INK, INK, size=3.0)
    axes.set_xlabel("Time after switching on / s")
    axes.set_ylabel("Light / % of warm")
    return figure


def _lines(changes: list[tuple[str, Change, LampChange]]) -> Iterator[str]:
    """Yield a line for the terminal on each transient."""
    for name, table, change in changes:
        equivalent_s = table.equivalent_s()
        if name == "rise":
            equivalent_s = table.t_s[-1] - equivalent_s
        first, last = 1e3 * equivalent_s[0], 1e3 * equivalent_s[-1]
        transient = "turn-on transient lacks" if name == "rise" else "turn-off transient is worth"
        yield (
            f"the {transient} {first:.1f} ms of the steady lamp in the first band, "
            f"{last:.1f} ms in the last; over after {rounded(table.t_s[-1], 3)} s; exponent of the "
            f"wavelength {plus_minus(change.exponent.value, change.exponent.sigma)} (1: a "
            "black-body emitter)"
        )


def _warming_line(warming: Warming) -> str:
    """Return the line for the terminal on the warm-up transient."""
    return (
        f"a cold lamp has {plus_minus(100 * warming.deficit, 100 * warming.deficit_sigma)} % "
        "less light; "
        f"the deficit decays with a time constant of {warming.time_constant_s:.0f} s"
    )
