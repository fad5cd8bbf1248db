"""Report of the luminance of an afterglow: figure, table, excitation and chain of factors."""

import math
from collections.abc import Iterator, Mapping
from functools import partial

from matplotlib.artist import Artist
from matplotlib.figure import Figure

from labrig.foundation.number_format import plus_minus, rounded
from labrig.foundation.quantity import duration_text
from labrig.protocols.luminance.result import LuminanceResult, PatchLuminance
from labrig.report.figure_style import (
    DASHED,
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    error_bars,
    legend_above,
    line_entry,
    mark_decades,
    marker_entry,
    new_figure,
    place,
    points,
    set_ticks,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table
from labrig.results import MCD_PER_M2, VISIBLE_MCD_PER_M2, Measured

#: Times in seconds that are marked on the axis.
MARKED_S = (10.0, 30.0, 120.0, 600.0, 1800.0, 3600.0, 7200.0, 36_000.0)
#: Part of the lowest drawn luminance's limit below 0.3 mcd/m².
LOWEST = 0.1


def render(result: LuminanceResult, source: Source) -> Rendered:
    """Render luminances at the times of standards, and the chain that leads to them."""
    sections = [_section(result), _scale(result)]
    return Rendered(tuple(sections), tuple(_lines(result)))


def _lines(result: LuminanceResult) -> Iterator[str]:
    """Yield the lines for the terminal."""
    for name, patch in result.patches.items():
        if len(result.patches) > 1:
            yield f"{name}:"
        yield from patch.decay.table().splitlines()
    if len(result.patches) > 1:
        yield f"by luminance at 10 min: {', '.join(result.ranked())}"


def _section(result: LuminanceResult) -> Section:
    """Return the section with figure, table, excitation and marking."""
    excitation = result.excitation
    several = len(result.patches) > 1
    lux = plus_minus(excitation.illuminance.value, excitation.illuminance.sigma)
    rested = excitation.rested_s
    after = "a time that is not stated" if rested is None else duration_text(rested)
    temperature = excitation.temperature_c
    warmth = "temperature not measured" if temperature is None else f"{temperature:.1f} °C"
    thickness = _stated(result.thickness_mm, "mm")
    mass = _stated(result.mass_per_area_g_per_m2, "g/m²")
    stated = (
        f"Excited by: {f'{excitation.lamp} lamp' if excitation.lamp else 'a lamp not stated'}, "
        f"{lux} lx, for {duration_text(excitation.charged_s)}, after {after} in the dark.",
        f"{excitation.accordance[0].upper()}{excitation.accordance[1:]}.",
        f"Sample: thickness {thickness}, mass per area {mass}; {warmth}.",
        *(
            f"{f'{name}: marking' if several else 'Marking'} {patch.decay.marking or 'none'}."
            for name, patch in result.patches.items()
        ),
    )
    caption = (
        f"Luminance after lamp off, with 1 σ of every reading; dashed: {VISIBLE_MCD_PER_M2:g} "
        f"{MCD_PER_M2}, a hundred times the limit of visibility; thick on it: the time when it is "
        "reached, forecast with 95 %, where it was not measured."
    )
    tables = [_table(result.patches), *_requirements(result.patches)]
    if several:
        tables.append(_ranking(result))
    return Section(
        "Luminance of the afterglow",
        stated,
        (Picture("luminance", partial(_figure, result.patches), caption),),
        tuple(tables),
    )


def _stated(value: float | None, unit: str) -> str:
    """Return what the user stated of the sample."""
    return "not stated" if value is None else f"{rounded(value)} {unit}"


def _table(patches: Mapping[str, PatchLuminance]) -> Table:
    """Return the table of luminances."""
    rows = []
    for name, patch in patches.items():
        for entry in patch.decay.at:
            light = entry.luminance
            mesopic = patch.mesopic_ratio
            cells = [_cell(light), _cell(light and light.times(patch.scotopic_ratio))]
            cells += [_cell(light and light.times(mesopic))] if mesopic is not None else []
            rows.append((_row(name, duration_text(entry.t_s), patches), *cells))
    head = ["After lamp off", f"L / {MCD_PER_M2}", f"Scotopic / {MCD_PER_M2}"]
    if any(patch.mesopic_ratio is not None for patch in patches.values()):
        head.append(f"Mesopic / {MCD_PER_M2}")
    for name, patch in patches.items():
        row = (_row(name, f"until {VISIBLE_MCD_PER_M2:g} {MCD_PER_M2}", patches), _end(patch))
        rows.append((*row, *[""] * (len(head) - len(row))))
    caption = "All σ are 1 σ, with those of the scale. Standards ask for the photopic luminance L."
    return Table(tuple(head), tuple(rows), caption)


def _row(name: str, text: str, patches: Mapping[str, PatchLuminance]) -> str:
    return f"{name}, {text}" if len(patches) > 1 else text


def _cell(measured: Measured | None) -> str:
    return "not measured" if measured is None else plus_minus(measured.value, measured.sigma)


def _end(patch: PatchLuminance) -> str:
    """Return the time until 0.3 mcd/m², or its forecast."""
    decay = patch.decay
    if decay.visible_s is not None:
        return f"{plus_minus(decay.visible_s.value / 60, decay.visible_s.sigma / 60)} min"
    if decay.visible_forecast is None:
        return "not measured"
    return f"not reached; forecast: {decay.visible_forecast}"


def _requirements(patches: Mapping[str, PatchLuminance]) -> Iterator[Table]:
    """Yield the table of requirements, if there are any."""
    rows = [
        (
            _row(name, duration_text(at.t_s), patches),
            f"{required.least_mcd_per_m2:g}",
            _cell(at.luminance),
            at.verdict(required.least_mcd_per_m2).value,
        )
        for name, patch in patches.items()
        for required, at in patch.decay.required
    ]
    if rows:
        head = ("Requirement at", f"At least / {MCD_PER_M2}", "Measured", "Verdict")
        caption = "Met, or missed, with a probability of 95 % or more."
        yield Table(head, tuple(rows), caption)


def _ranking(result: LuminanceResult) -> Table:
    """Return the patches by falling luminance, relative to the first of the protocol."""
    first = next(iter(result.patches))
    times_s = [entry.t_s for entry in result.patches[first].decay.at]
    rows = []
    for name in result.ranked():
        ratios = result.patches[name].relative_to_first
        cells = ["1" if ratios is None else _cell(ratios.get(t_s)) for t_s in times_s]
        rows.append((name, *cells))
    head = ("Patch", *(duration_text(t_s) for t_s in times_s))
    return Table(head, tuple(rows), f"Luminances over those of {first}, by falling luminance.")


def _scale(result: LuminanceResult) -> Section:
    """Return the section with the chain of factors."""
    tables = []
    for name, patch in result.patches.items():
        rows = tuple(
            (factor.name, f"{100 * factor.relative_sigma:.2g} %", factor.source)
            for factor in patch.factors
        )
        head = ("Factor", "σ", "From")
        title = name if len(result.patches) > 1 else ""
        ratio = patch.scotopic_ratio
        caption = (
            f"Emission: {patch.emission}; scotopic over photopic luminance "
            f"{plus_minus(ratio.value, ratio.sigma)}."
        )
        tables.append(Table(head, rows, caption, title))
    adapted = result.adaptation_mcd_per_m2
    text = (
        "Signals of the glow are relative to those of the grey card in the sample's place under "
        "the bare lamp, whose luminance is known by the meter's reading.",
        *(
            (f"Mesopic luminances are those of CIE 191 for eyes adapted to {adapted:g} "
             f"{MCD_PER_M2} of light of the glow's colour.",)
            if adapted is not None
            else ()
        ),
    )  # fmt: skip
    return Section("Scale of the luminances", text, (), tuple(tables))


def _figure(patches: Mapping[str, PatchLuminance]) -> Figure:
    """Draw the luminances over time, both logarithmic."""
    figure = new_figure(250.0)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    axes.set_xscale("log")
    axes.set_yscale("log", nonpositive="clip")
    axes.axhline(VISIBLE_MCD_PER_M2, color=MUTED, linewidth=0.9, linestyle=DASHED)
    entries: list[Artist] = []
    lowest, highest, first_s, last_s = VISIBLE_MCD_PER_M2, VISIBLE_MCD_PER_M2, math.inf, 0.0
    for number, (name, patch) in enumerate(patches.items()):
        colour = (INK, *OTHER_CHANNELS)[number % (1 + len(OTHER_CHANNELS))]
        marker, decay = MARKERS[number % len(MARKERS)], patch.decay
        drawn = decay.luminance_mcd_per_m2 > LOWEST * VISIBLE_MCD_PER_M2
        t_s, light = decay.t_s[drawn], decay.luminance_mcd_per_m2[drawn]
        if not len(t_s):
            continue
        error_bars(axes, t_s, light, decay.luminance_mcd_per_m2_sigma[drawn], colour)
        points(axes, t_s, light, marker, colour, colour, size=2.4)
        entries.append(marker_entry(name, marker, colour))
        lowest, highest = min(lowest, float(light.min())), max(highest, float(light.max()))
        first_s, last_s = min(first_s, float(t_s[0])), max(last_s, float(t_s[-1]))
        forecast = decay.visible_forecast
        if forecast is not None and forecast.between_s is not None:
            axes.plot(forecast.between_s, [VISIBLE_MCD_PER_M2] * 2, color=colour, linewidth=3.0)
            last_s = max(last_s, forecast.between_s[1])
    entries.append(line_entry(f"{VISIBLE_MCD_PER_M2:g} {MCD_PER_M2}", MUTED, DASHED))
    if last_s:
        axes.set_xlim(first_s / 1.2, last_s * 1.2)
    axes.set_ylim(lowest / 2, 2 * highest)
    mark_decades(axes)
    low, high = axes.get_xlim()
    marked = ((s, duration_text(s)) for s in MARKED_S if low <= s <= high)
    set_ticks(axes.xaxis, tuple(marked))
    axes.set_xlabel("After lamp off")
    axes.set_ylabel(f"Luminance / ({MCD_PER_M2})")
    legend_above(figure, entries, columns=4)
    return figure
