"""Report of an excitation: rates by band, charging curves, residuals, and closure."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import RATE_LIMIT_SIGMA
from labrig.foundation.number_format import plus_minus, rounded
from labrig.protocols.excitation.result import ExcitationResult, LightScatter, PatchExcitation
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    RULE,
    error_bars,
    legend_above,
    line_entry,
    marker_entry,
    new_figure,
    place,
    points,
)
from labrig.report.parameters import interval_tables
from labrig.report.sections import Picture, Rendered, Section, Source, Table
from labrig.results import (
    UPPER_SIGMAS,
    BandTests,
    ChargingSeries,
    Closure,
    FittedExcitation,
    LayerEffect,
    Measured,
    OneSided,
    ProfileInterval,
    interval_lines,
    spans_decades,
)

#: Height of a panel, distance of panels, and margin above them in points.
PANEL_PT, GAP_PT, TOP_PT = 84.0, 12.0, 30.0
#: Shift of one channel against the one before in nm, and largest σ in % that is drawn.
SHIFT_NM, DRAWN_PERCENT = 4.0, 50.0


def band_lines(tests: BandTests | None) -> Iterator[str]:
    """Yield the verdicts of the tests, a line each."""
    if tests is None:
        yield "one glow for all bands: not tested, one band excites all places"
        return
    quantities = {
        "glow at full charge": tests.amplitude,
        "decay": tests.rate,
        "hue": tests.hue,
    }
    verdicts = [
        f"{name} {'differs' if quantity.differs else 'the same'} (p = {quantity.p_value:.2g})"
        for name, quantity in quantities.items()
        if quantity is not None
    ]
    yield f"by exciting band: {', '.join(verdicts)}"


def band_picture(tests: BandTests, bands_nm: tuple[float, ...], channels: Sequence[str]) -> Picture:
    """Return the figure of the quantities over the exciting band, with its caption.

    Parameters
    ----------
    tests
        Tests of a fit.
    bands_nm
        Edges of all bands in nm.
    channels
        Channels whose hue is tested.
    """
    return Picture(
        "exciting-bands",
        partial(_figure, tests, bands_nm, channels),
        "Glow at full charge, rates of the decay, and channels over the brightest one, at the "
        "places that each band excites, relative to the values common to all; bars: 1 σ with all "
        "parameters free. All lie at 0 in a thin layer whose traps no light empties.",
    )


def _figure(tests: BandTests, bands_nm: tuple[float, ...], channels: Sequence[str]) -> Figure:
    edges = np.array(bands_nm)
    middle_nm = ((edges[1:] + edges[:-1]) / 2)[tests.bands]
    panels = {"Full charge / %": tests.amplitude, "Decay / %": tests.rate, "Hue / %": tests.hue}
    drawn = {label: quantity for label, quantity in panels.items() if quantity is not None}
    height_pt = TOP_PT + len(drawn) * (PANEL_PT + GAP_PT) + 38 - GAP_PT
    figure = new_figure(height_pt)
    for number, (label, quantity) in enumerate(drawn.items()):
        top = TOP_PT + number * (PANEL_PT + GAP_PT)
        axes = place(figure, left=LEFT_PT, bottom=height_pt - top - PANEL_PT, right=12, top=top)
        axes.axhline(0, color=MUTED, linewidth=1.2)
        axes.set_xlim(edges[0], edges[-1])
        axes.set_ylabel(label)
        is_last = number == len(drawn) - 1
        axes.tick_params(labelbottom=is_last)
        if is_last:
            axes.set_xlabel("Excitation wavelength / nm")
        for row, (value, sigma) in enumerate(
            zip(100 * quantity.deviation, 100 * quantity.sigma, strict=True)
        ):
            known, colour, x = sigma < DRAWN_PERCENT, _colour(row), middle_nm + SHIFT_NM * row
            error_bars(axes, x[known], value[known], sigma[known], colour)
            points(axes, x[known], value[known], MARKERS[row], colour, colour)
    entries = [
        marker_entry(f"{name} over the brightest", MARKERS[row], _colour(row))
        for row, name in enumerate(channels)
    ]
    if entries:
        legend_above(figure, entries, columns=3)
    return figure


def _colour(row: int) -> str:
    return (INK, *OTHER_CHANNELS)[row % (1 + len(OTHER_CHANNELS))]


HEIGHT_PT = 270.0
UNKNOWN = "–"
#: What is given of excitation rates where the charge does not tell their scale.
RELATIVE = "k_e over its largest"
#: Symbols and units of quantities with an interval.
SYMBOLS = {
    "k_r_per_s": ("k_r", " / s⁻¹"),
    "k_e_per_s": ("k_e", " / s⁻¹"),
    "kinetic_order": ("b", ""),
}
#: Number of positions along the filter whose charging is drawn.
SHOWN = 5
MEASURED = (
    "r(0) and a = Λ* k_r r(0) after the brightest charge by the lamp itself. r(0) is "
    "not assumed: it is constrained by the curvature of the charging curves."
)
ASSUMED = "r(0) = 1 is assumed after the longest charge, as Nalbach et al. do."


def render(result: ExcitationResult, source: Source) -> Rendered:
    """Render the excitation rates, charging curves, residuals and closure of every patch."""
    sections, lines = [], []
    for name, patch in result.patches.items():
        sections.append(_section(f"Excitation: {name}" if name else "Excitation", result, patch))
        lines += [f"{name}: {line}" if name else line for line in _lines(result, patch)]
    return Rendered(tuple(sections), tuple(lines))


def _lines(result: ExcitationResult, patch: PatchExcitation) -> Iterator[str]:
    """Yield the lines for the terminal: states, rates by band, χ² and closure."""
    fit = patch.fit
    if fit.layer is not None:
        yield f"thickness: {fit.layer}"
    for number in range(len(fit.states)):
        yield f"state {number + 1}: {_state_line(fit, number)}"
        quantity, unit = ("k_e", " /s") if fit.states[number].is_apart else (RELATIVE, "")
        bands = zip(pairwise(result.irradiance.bands_nm), _rates(fit, number), strict=True)
        for (low, high), text in bands:
            yield f"  {low:.0f}-{high:.0f} nm: {quantity} {text}{unit}"
    yield from interval_lines(_named_intervals(fit, result.irradiance.bands_nm))
    yield f"reduced χ² {rounded(fit.reduced_chi2, 3)} ({fit.dof} dof)"
    if len(fit.models) > 1:
        yield f"models: {_models_line(fit)}"
    yield from band_lines(fit.by_band)
    yield f"closure: {_closure_line(patch.closure)}"


def _state_line(fit: FittedExcitation, number: int) -> str:
    """Return what is known of a state: its rates, or what its decay after this charge tells."""
    state, off = fit.states[number], fit.at_off[-1]
    r0 = plus_minus(float(off.r0[number]), float(off.r0_sigma[number]))
    k_r = plus_minus(state.k_r_per_s, state.k_r_per_s_sigma)
    order = state.order.plus_minus
    if state.exponent is None:
        held = f", b {order} with 95 %" if isinstance(state.order, OneSided) else ""
        return f"k_r {k_r} /s, r(0) {r0}{held}"
    if state.is_level_known:
        return f"k_r {k_r} /s, b {order}, r(0) {r0}"
    amplitude = plus_minus(float(off.amplitude[number]), float(off.amplitude_sigma[number]))
    time = plus_minus(float(off.decay_time_s[number]), float(off.decay_time_s_sigma[number]))
    exponent = plus_minus(state.exponent.value, state.exponent.sigma)
    return (
        f"b {order}; after the brightest charge by the lamp itself a {amplitude} DN/s, τ {time} s, "
        f"p {exponent} (k_r, k_e and r(0) are not known apart)"
    )


def _models_line(fit: FittedExcitation) -> str:
    """Return all models that were tried, with their distance from the best."""
    best = min(model.bic for model in fit.models)
    return "; ".join(
        f"{model.label}, reduced χ² {rounded(model.reduced_chi2, 3)}, ΔBIC {model.bic - best:.0f}"
        for model in fit.models
    )


def _closure_line(closure: Closure | None) -> str:
    """Return the statement on closure."""
    if closure is None:
        return "not tested; give three charges or more in 'direct'"
    return (
        f"charging by the lamp itself is predicted within {rounded(closure.rms_percent, 2)} % "
        f"({rounded(closure.rms_sigma, 2)} σ) rms"
    )


def _rates(fit: FittedExcitation, number: int) -> list[str]:
    """Return k_e of a state in each band as text, or its upper limit.

    It is in 1/s, or over the largest band's where only that is known.
    """
    state = fit.states[number]
    columns = (state.k_e_per_s, state.k_e_per_s_sigma, state.seen, state.k_e_upper_per_s)
    if not state.is_apart:
        value, sigma = fit.relative_k_e(number)
        columns = value, sigma, value > RATE_LIMIT_SIGMA * sigma, value + UPPER_SIGMAS * sigma
        ends = np.stack([value, value])
    else:
        ends = fit.k_e_range(number)
        largest = ends[1] / np.where(state.k_e_per_s > 0, state.k_e_per_s, 1.0)
        columns = (*columns[:3], state.k_e_upper_per_s * np.maximum(largest, 1.0))
    return [
        _rate_text(float(value), float(sigma), *between)
        if detected
        else f"< {rounded(float(upper), 2)}"
        for value, sigma, detected, upper, between in zip(*columns, ends.T.tolist(), strict=True)
    ]


def _rate_text(value: float, sigma: float, least: float, largest: float) -> str:
    """Return a rate with its range by thickness, then its σ.

    The largest of relative rates, to which others refer, is exact.
    """
    text = plus_minus(value, sigma) if sigma > 0 else rounded(value)
    return text if least == largest else f"{rounded(least, 3)} to {rounded(largest, 3)}, {text}"


def _section(title: str, result: ExcitationResult, patch: PatchExcitation) -> Section:
    """Return the section of a patch."""
    fit, through, direct = patch.fit, patch.charging.through, patch.charging.direct
    position_nm, irradiance = result.position_nm, result.irradiance
    fitted = through.values - fit.residuals[0] * through.sigma
    residuals = fit.residuals[0]
    if through.is_by_light:
        fitted, residuals = (_row_by_row(through, values) for values in (fitted, residuals))
        through = replace(
            through,
            values=_row_by_row(through, through.values),
            sigma=_row_by_row(through, through.sigma),
        )
    where = "by some of the lights" if through.is_by_light else "through the filter, at positions"
    figures = [
        Picture(
            "excitation-rates",
            partial(_rates_figure, fit, irradiance.bands_nm),
            "Excitation rate of each band, per unit of the stated irradiance; bars are ± 1 σ. A "
            "caret is a limit: the rate lies below it with 95 % probability.",
        ),
        Picture(
            "charging",
            partial(_charging_figure, through, fitted, position_nm),
            f"Glow in the first photograph after each charge {where}, brightest channel; lines "
            "join the fitted values of the same photographs, whose times and exposures differ.",
        ),
        Picture(
            "residuals",
            partial(_residual_figure, residuals, position_nm),
            "Residuals at every position along the filter, or of every light, rms in standard "
            "uncertainties of single values; flicker is not removed.",
        ),
    ]
    if fit.by_band is not None:
        channels = [
            name
            for name, weight in zip(patch.charging.whole.channels, fit.channel_weights, strict=True)
            if weight != 1
        ]
        figures.append(band_picture(fit.by_band, irradiance.bands_nm, channels))
    if patch.closure is not None:
        figures.append(closure_picture(patch.closure))
    assumed = any(charge.saturated for charge in direct.charges)
    return Section(
        title,
        (
            f"{len(through.charges)} charges "
            f"{'by selected lights' if through.is_by_light else 'through the variable filter'} and "
            f"{len(direct.charges)} by the lamp itself, fitted together by the rate "
            "equation in exact steps. k_e belongs to an irradiance of vector length "
            f"{rounded(irradiance.vector_length)}.",
            *([] if fit.layer is None else [_layer_line(fit.layer)]),
            _light_line(patch.light),
            *([] if fit.veil is None else [_veil_line(fit.veil)]),
            *(f"{line[0].upper()}{line[1:]}." for line in band_lines(fit.by_band)),
            f"Closure: {_closure_line(patch.closure)}.",
            *([f"Models: {_models_line(fit)}."] if len(fit.models) > 1 else []),
        ),
        tuple(figures),
        (
            _levels_table(fit, ASSUMED if assumed else MEASURED),
            _rates_table(fit, irradiance.bands_nm),
            *interval_tables(_named_intervals(fit, irradiance.bands_nm)),
        ),
    )


def _named_intervals(
    fit: FittedExcitation, bands_nm: tuple[float, ...]
) -> dict[str, ProfileInterval]:
    """Return intervals by symbol, state, band and unit."""
    named = {}
    for name, interval in fit.intervals.items():
        quantity, state, *band = name.split(" ")
        symbol, unit = SYMBOLS[quantity]
        if band:
            low, high = bands_nm[int(band[0]) - 1 : int(band[0]) + 1]
            state += f", {low:.0f}–{high:.0f} nm"
        named[f"{symbol} {state}{unit}"] = interval
    return named


def _row_by_row(series: ChargingSeries, values: FloatArray) -> FloatArray:
    """Return values (n, 1, C) of a series by lights as (n, L, C), NaN at the other lights."""
    is_own = series.row_of_shots() == np.arange(len(series.irradiance))
    return np.where(is_own[..., None], values, np.nan)


def _layer_line(layer: LayerEffect) -> str:
    """Return the sentence on the thickness of the sample."""
    return (
        f"Thickness, before all σ: {layer}. Light falls with depth, and rates are fitted as those "
        "of a surface; the range contains all possible values and is no σ."
    )


def _light_line(light: LightScatter) -> str:
    """Return the sentence on the errors of the light."""
    if light.sites is None or light.wavelength_nm is None:
        return (
            "The glow shows, and all σ include, that the light scatters by "
            f"{rounded(100 * light.lamp, 2)} % from charge to charge beyond the calibrations' "
            "σ."
        )
    return (
        "The glow shows, and all σ include, that the lamp's brightness scatters by "
        f"{rounded(100 * light.lamp, 2)} % from charge to charge, the light on single places by "
        f"{rounded(100 * light.sites, 2)} %, and the filter's wavelengths are off by "
        f"{rounded(light.wavelength_nm, 2)} nm beyond the calibrations' σ."
    )


def _veil_line(veil: Measured) -> str:
    """Return the sentence on the light of the frame that lies over all places."""
    fraction = plus_minus(100 * veil.value, 100 * veil.sigma)
    if isinstance(veil, OneSided):
        fraction = replace(veil, sigma=100 * veil.sigma, limit=100 * veil.limit).plus_minus
    return f"Over every place lies {fraction} % of the frame's mean light, which is reckoned with."


def _levels_table(fit: FittedExcitation, caption: str) -> Table:
    """Return the table of k_r, orders, r(0) and amplitudes of the states."""
    head = ["State", "k_r / s⁻¹", "Amplitude at r = 1 / (DN/s)", "r(0)", "Amplitude a / (DN/s)"]
    if not fit.is_first_order:
        head += ["b", "τ / s", "p"]
        caption = caption.replace("k_r r(0) after", "k_r r(0)ᵇ after")
        caption += (
            " b is the kinetic order; the glow after that charge decays as a (1 + t/τ)^(−p). k_r "
            "and the amplitude belong to r = 1, and are left out where the charge does not "
            "separate them from r(0)."
        )
    rows = tuple(_levels_row(fit, number) for number in range(len(fit.states)))
    return Table(tuple(head), rows, caption)


def _levels_row(fit: FittedExcitation, number: int) -> tuple[str, ...]:
    state, off = fit.states[number], fit.at_off[-1]
    is_known = state.is_apart
    cells = [
        str(number + 1),
        plus_minus(state.k_r_per_s, state.k_r_per_s_sigma) if is_known else UNKNOWN,
        plus_minus(state.amplitude, state.amplitude_sigma) if is_known else UNKNOWN,
        plus_minus(float(off.r0[number]), float(off.r0_sigma[number])) if is_known else UNKNOWN,
        plus_minus(float(off.amplitude[number]), float(off.amplitude_sigma[number])),
    ]
    if not fit.is_first_order:
        time = plus_minus(float(off.decay_time_s[number]), float(off.decay_time_s_sigma[number]))
        exponent = state.exponent
        cells += [
            state.order.plus_minus,
            time,
            UNKNOWN if exponent is None else plus_minus(exponent.value, exponent.sigma),
        ]
    return tuple(cells)


def _rates_table(fit: FittedExcitation, bands_nm: tuple[float, ...]) -> Table:
    """Return the table of k_e by band and state."""
    states = range(len(fit.states))
    columns = [_rates(fit, number) for number in states]
    return Table(
        (
            "Band / nm",
            *(
                f"k_e of state {number + 1} / s⁻¹"
                if fit.states[number].is_apart
                else f"{RELATIVE} of state {number + 1}"
                for number in states
            ),
        ),
        tuple(
            (f"{low:.0f}–{high:.0f}", *(column[band] for column in columns))
            for band, (low, high) in enumerate(pairwise(bands_nm))
        ),
        "Range by the thickness of the sample, then value as of a surface ± 1 σ, or the upper "
        "limit with 95 % probability and at that thickness.",
    )


def _rates_figure(fit: FittedExcitation, bands_nm: tuple[float, ...]) -> Figure:
    """Draw k_e of every band and state, upper limits as carets."""
    edges = np.array(bands_nm)
    middles, widths = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=34)
    axes.set_xlim(edges[0], edges[-1])
    entries = []
    for number, state in enumerate(fit.states):
        colour = INK if number == 0 else OTHER_CHANNELS[number - 1]
        shift = (number - (len(fit.states) - 1) / 2) * 0.16 * widths
        marker, detected = MARKERS[number], state.seen
        x, y = middles + shift, 1e3 * state.k_e_per_s
        error_bars(axes, x[detected], y[detected], 1e3 * state.k_e_per_s_sigma[detected], colour)
        points(axes, x[detected], y[detected], marker, colour, colour, 5.0)
        limits = 1e3 * state.k_e_upper_per_s[~detected]
        axes.plot(x[~detected], limits, linestyle="none", marker=7, markersize=6, color=colour)
        for at_nm, limit in zip(x[~detected], limits, strict=True):
            axes.plot([at_nm, at_nm], [0, limit], color=colour, linewidth=0.9, alpha=0.5)
        entries.append(
            marker_entry(f"state {number + 1}, {_state_label(fit, number)}", marker, colour)
        )
    axes.set_ylim(0, None)
    axes.set_xlabel("Excitation wavelength / nm")
    axes.set_ylabel("kₑ / 10⁻³ s⁻¹")
    legend_above(figure, entries, columns=3)
    return figure


def _state_label(fit: FittedExcitation, number: int) -> str:
    """Return k_r of a state; where that is not known, order and τ after the brightest charge."""
    state = fit.states[number]
    if state.is_apart:
        return f"kᵣ {rounded(state.k_r_per_s, 3)} s⁻¹"
    time_s = float(fit.at_off[-1].decay_time_s[number])
    return f"b {rounded(state.kinetic_order, 3)}, τ {rounded(time_s, 3)} s; scale not known"


def _charging_figure(series: ChargingSeries, fitted: FloatArray, position_nm: FloatArray) -> Figure:
    """Draw the first usable signal after every charge over its length, at some positions.

    Parameters
    ----------
    series
        Signals of n frames at P positions in C channels, after charges through the filter.
    fitted
        Fitted signals in DN/s, shape (n, P, C).
    position_nm
        Wavelength that excites each position in nm, shape (P,).
    """
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=48)
    axes.set_xscale("log")
    axes.set_yscale("log", nonpositive="clip")
    charge_s = np.array([charge.off_s - charge.on_s for charge in series.charges])
    channel = int(np.argmax(np.nanmean(series.values, axis=(0, 1))))
    total = np.nansum(fitted[..., channel], axis=0)
    bright_sites = np.flatnonzero(total > 0.01 * total.max())
    drawn_sites = bright_sites[
        np.linspace(0, len(bright_sites) - 1, min(SHOWN, len(bright_sites))).round().astype(int)
    ]
    entries = []
    for number, site in enumerate(dict.fromkeys(drawn_sites.tolist())):
        colour = OTHER_CHANNELS[number % len(OTHER_CHANNELS)]
        first_frames = series.first_frames(np.isfinite(series.values[:, site, channel]))
        if not first_frames:
            continue
        order = sorted(first_frames, key=lambda number: charge_s[number])
        rows = [first_frames[number] for number in order]
        x, y = charge_s[order], series.values[rows, site, channel]
        error_bars(axes, x, y, series.sigma[rows, site, channel], colour)
        points(axes, x, y, MARKERS[number], colour, colour, 4.2)
        axes.plot(x, fitted[rows, site, channel], color=colour, linewidth=1.0)
        entries.append(marker_entry(f"{position_nm[site]:.0f} nm", MARKERS[number], colour))
    times_s = sorted({float(f"{time:.2g}") for time in charge_s})
    axes.set_xticks(times_s, [rounded(time, 2) for time in times_s])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("Charge / s")
    axes.set_ylabel("First photograph / (DN/s)")
    legend_above(figure, [*entries, line_entry("fit", MUTED)], columns=6)
    return figure


def _residual_figure(residuals: FloatArray, position_nm: FloatArray) -> Figure:
    """Draw the rms of the residuals over frames and channels at each position.

    Parameters
    ----------
    residuals
        Residuals of n frames at P positions in C channels, in σ, shape (n, P, C).
    position_nm
        Wavelength that excites each position in nm, shape (P,).
    """
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=14)
    site_rms = np.sqrt(np.nanmean(residuals**2, axis=(0, 2)))
    axes.axhline(1.0, color=RULE, linewidth=1.2)
    points(axes, position_nm, site_rms, "o", INK, INK, 4.2)
    axes.set_ylim(0, max(1.5, 1.15 * float(np.nanmax(site_rms))))
    axes.set_xlabel("Excitation wavelength / nm")
    axes.set_ylabel("Residuals, rms / σ")
    return figure


def closure_picture(closure: Closure) -> Picture:
    """Return the figure of closure with its caption."""
    caption = (
        "Charging under the whole lamp: the curve is predicted from the rates measured band by "
        "band, without any fit; points are measured, with ± 1 σ of both. RMS deviation "
        f"{closure.rms_percent:.2g} % of the RMS level, {closure.rms_sigma:.2g} σ."
    )
    return Picture("closure", partial(closure_figure, closure), caption)


def closure_figure(closure: Closure) -> Figure:
    """Draw measured and predicted levels over the length of the charge, and their deviation."""
    charge_s, measured, predicted = closure.charge_s, closure.measured, closure.predicted
    figure = new_figure(300.0)
    upper = place(figure, left=LEFT_PT, bottom=128, right=12, top=30)
    upper.plot(closure.curve_charge_s, closure.curve, color=MUTED, linewidth=1.2)
    error_bars(upper, charge_s, measured, closure.sigma, INK)
    points(upper, charge_s, measured, "o", INK, INK)
    upper.set_ylim(0, 1.1 * float(max(measured.max(), closure.curve.max())))
    upper.set_ylabel("Level / (DN/s)")
    upper.tick_params(labelbottom=False)
    lower = place(figure, left=LEFT_PT, bottom=38, right=12, top=188, share_x=upper)
    if spans_decades(charge_s):
        upper.set_xscale("log")
        upper.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        upper.xaxis.set_minor_locator(NullLocator())
    upper.xaxis.set_major_formatter(FuncFormatter(lambda value, _: rounded(value)))
    rms_level = float(np.sqrt(np.mean(predicted**2))) or 1.0
    fraction, fraction_sigma = (
        100 * (measured - predicted) / rms_level,
        100 * closure.sigma / rms_level,
    )
    lower.axhline(0, color=MUTED, linewidth=1.2)
    error_bars(lower, charge_s, fraction, fraction_sigma, INK)
    points(lower, charge_s, fraction, "o", INK, INK, size=3.0)
    reach = 1.15 * float(np.max(np.abs(fraction) + fraction_sigma))
    lower.set_ylim(-reach, reach)
    lower.yaxis.set_major_formatter(FuncFormatter(lambda value, _: rounded(value)))
    lower.set_ylabel("Deviation / %")
    lower.set_xlabel("Charge / s")
    legend_above(
        figure, [marker_entry("measured", "o", INK), line_entry("predicted", MUTED)], columns=2
    )
    return figure
