"""What an excitation looks like: rates by wavelength, how sites charge, what the fit leaves."""

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.excitation.first_photographs import first_photographs
from labrig.fit.excitation import ChargingSeries, ExcitationFit
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    RULE,
    error_bars,
    new_figure,
    place,
    points,
)
from labrig.report.legend import legend_above, lined, marked
from labrig.report.sections import Picture

FloatArray = NDArray[np.float64]

HEIGHT_PT = 270.0
#: Places along the strip whose charging is shown.
SHOWN = 5


def rates_picture(fit: ExcitationFit, bands_nm: tuple[float, ...]) -> Picture:
    """k_e of every band and state, limits as arrows."""
    edges = np.array(bands_nm)
    middles, widths = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=34)
    axes.set_xlim(edges[0], edges[-1])
    entries = []
    for number, state in enumerate(fit.states):
        colour = INK if number == 0 else OTHER_CHANNELS[number - 1]
        shift = (number - (len(fit.states) - 1) / 2) * 0.16 * widths
        marker, seen = MARKERS[number], state.seen
        x, y = middles + shift, 1e3 * state.k_e_per_s
        error_bars(axes, x[seen], y[seen], 1e3 * state.k_e_sigma_per_s[seen], colour)
        points(axes, x[seen], y[seen], marker, colour, colour, 5.0)
        limits = 1e3 * state.k_e_upper_per_s[~seen]
        axes.plot(x[~seen], limits, linestyle="none", marker=7, markersize=6, color=colour)
        for at_nm, limit in zip(x[~seen], limits, strict=True):
            axes.plot([at_nm, at_nm], [0, limit], color=colour, linewidth=0.9, alpha=0.5)
        entries.append(marked(f"state {number + 1}, k_r {state.k_r_per_s:.3g} s⁻¹", marker, colour))
    axes.set_ylim(0, None)
    axes.set_xlabel("Wavelength of the exciting light / nm")
    axes.set_ylabel("k_e / 10⁻³ s⁻¹")
    legend_above(figure, entries, columns=3)
    return Picture(
        "excitation-rates",
        figure,
        "Excitation rate of each band, per unit of the stated irradiance; bars are ± 1 σ. A caret "
        "is a limit: the rate lies below it with 95 % probability.",
    )


def charging_picture(
    series: ChargingSeries, fitted: FloatArray, position_nm: FloatArray
) -> Picture:
    """Glow in the first usable photograph after every charge, over the charge, at some places.

    Parameters
    ----------
    fitted
        (n, P, C) what the fit says.
    position_nm
        (P,) wavelength that charges each place.
    """
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=48)
    axes.set_xscale("log")
    axes.set_yscale("log", nonpositive="clip")
    charge_s = np.array([charge.off_s - charge.on_s for charge in series.charges])
    channel = int(np.argmax(np.nanmean(series.values, axis=(0, 1))))
    total = np.nansum(fitted[..., channel], axis=0)
    reach = np.flatnonzero(total > 0.01 * total.max())
    shown = reach[np.linspace(0, len(reach) - 1, min(SHOWN, len(reach))).round().astype(int)]
    entries = []
    for number, site in enumerate(dict.fromkeys(shown.tolist())):
        colour = OTHER_CHANNELS[number % len(OTHER_CHANNELS)]
        first = first_photographs(series, np.isfinite(series.values[:, site, channel]))
        order = sorted(first, key=lambda number: charge_s[number])
        picked = [first[number] for number in order]
        x, y = charge_s[order], series.values[picked, site, channel]
        error_bars(axes, x, y, series.sigma[picked, site, channel], colour)
        points(axes, x, y, MARKERS[number], colour, colour, 4.2)
        axes.plot(x, fitted[picked, site, channel], color=colour, linewidth=1.0)
        entries.append(marked(f"{position_nm[site]:.0f} nm", MARKERS[number], colour))
    axes.set_xlabel("Charged for / s")
    axes.set_ylabel("First photograph / (DN/s)")
    legend_above(figure, [*entries, lined("fit", MUTED)], columns=6)
    return Picture(
        "charging",
        figure,
        "Glow in the first photograph after each charge through the filter, brightest channel, at "
        "some places along it; lines join what the fit says for these very photographs, whose "
        "times and exposures differ.",
    )


def residual_picture(residuals: FloatArray, position_nm: FloatArray) -> Picture:
    """(n, P, C) in σ, rms over channels and photographs, along the filter and over time."""
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=14)
    of_site = np.sqrt(np.nanmean(residuals**2, axis=(0, 2)))
    axes.axhline(1.0, color=RULE, linewidth=1.2)
    points(axes, position_nm, of_site, "o", INK, INK, 4.2)
    axes.set_ylim(0, max(1.5, 1.15 * float(np.nanmax(of_site))))
    axes.set_xlabel("Wavelength that charges the place / nm")
    axes.set_ylabel("Residuals, rms / σ")
    return Picture(
        "residuals",
        figure,
        "What the fit leaves at every place along the filter, in standard uncertainties of single "
        "values, flicker not taken out.",
    )


def fitted_values(series: ChargingSeries, residuals: FloatArray) -> FloatArray:
    """(n, P, C) of the model."""
    model: FloatArray = series.values - residuals * series.sigma
    return model
