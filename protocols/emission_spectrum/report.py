"""Report of an emission spectrum: Λ*, its constancy in time, its independence of the lamp."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import plus_minus, rounded
from labrig.protocols.emission_spectrum.result import EmissionSpectrumResult, PatchSpectrum
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    error_bars,
    legend_above,
    marker_entry,
    new_figure,
    place,
    points,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table
from labrig.report.spectrum_figure import COLUMNS, spectrum_axes, spectrum_figure
from labrig.results import EmissionSpectrum, SpectralComparison


def render(result: EmissionSpectrumResult, source: Source) -> Rendered:
    """Render the spectrum of every patch, its constancy and its independence of the lamp."""
    sections: list[Section] = []
    lines: list[str] = []
    for name, patch in result.patches.items():
        title_suffix, prefix = (f": {name}", f"{name}: ") if name else ("", "")
        sections += (
            replace(section, title=section.title + title_suffix) for section in _sections(patch)
        )
        lines += (prefix + line for line in _lines(patch))
    return Rendered(tuple(sections), tuple(lines))


def _lines(patch: PatchSpectrum) -> Iterator[str]:
    """Yield a line on the spectrum, one on its constancy, and one for each further lamp."""
    spectrum, centroid = patch.spectrum, patch.spectrum.centroid
    yield (
        f"emission: highest at {spectrum.peak_nm:.0f} nm, centroid "
        f"{plus_minus(centroid.value, centroid.sigma)} nm; "
        f"σ of Λ* {100 * float(np.median(spectrum.sigma)):.1f} % of its peak (median)"
    )
    if patch.times:
        least_p = min(patch.times, key=lambda comparison: comparison.p_value)
        outcome = "changes" if patch.changes_with_time else "the same"
        yield (
            f"over time: {outcome} (least p = {least_p.p_value:.2g} of {len(patch.times)}, "
            f"at {least_p.what}; centroid {_shift(least_p)} nm off the others)"
        )
    outcome = "differs" if patch.depends_on_lamp else "the same"
    for comparison in patch.lamps:
        yield (
            f"{comparison.what}: {outcome} (p = {comparison.p_value:.2g}; "
            f"centroid {_shift(comparison)} nm off, {comparison.brightness:.3g} times as bright)"
        )


def _seen_through(patch: PatchSpectrum) -> str:
    return "scenes with and without a filter" if patch.filters else "positions along the filter"


def _resolved(patch: PatchSpectrum) -> str:
    """Return the statement on what is narrower than the filters."""
    if patch.filters:
        return (
            f"{len(patch.filters)} filters and the camera's channels do not resolve "
            "details narrower than about 40 nm: σ is right for spectra with peaks of 25 nm and "
            "more. Only the sum of narrow lines is measured; a variable filter or a spectrometer "
            "resolves them."
        )
    return (
        "Of lines much narrower than the filter's band the sum of the light is measured, and a "
        "mean over 50 nm keeps its σ; how it is divided between neighbouring wavelengths is not, "
        "and a mean over 10 nm may be wrong by three σ. Peaks narrower than the band come out "
        "lower, since spectra are assumed to be smooth: two of 18 nm that are 30 to 45 nm apart by "
        "2 to 4 % at their tops, which is about one σ."
    )


def _shift(comparison: SpectralComparison) -> str:
    """Return the shift of the centroid with its σ in nm, as text."""
    return plus_minus(comparison.shift_nm, comparison.shift_nm_sigma)


def _sections(patch: PatchSpectrum) -> Iterator[Section]:
    """Yield the sections on the spectrum, its constancy and its independence of the lamp."""
    frames = patch.charges[0].frames
    white = (
        "A grey card under the known lamp, seen through the same filter, corrects the camera's "
        "curves at every position."
        if patch.white_reference
        else "Without a frame of a grey card under the known lamp the camera's curves are used "
        "uncorrected; the 6 % by which laboratories disagree is part of every σ."
    )
    places = len(patch.centre_nm) // len(patch.channels)
    yield Section(
        "Emission spectrum",
        (
            f"Λ* from {places} {_seen_through(patch)} in {len(frames)} frames, largest value "
            f"1. {white}",
            _resolved(patch),
        ),
        (
            Picture(
                "spectrum",
                partial(
                    spectrum_figure,
                    np.array(patch.spectrum.wavelength_nm),
                    np.array(patch.spectrum.value),
                    (np.array(patch.spectrum.low), np.array(patch.spectrum.high)),
                    ("Λ*", "68 % credible"),
                ),
                "Emission spectrum Λ*, means over 10 nm; band: 68 % credible.",
            ),
        ),
    )
    if patch.times:
        at_times = {
            f"{t_s:.3g} s": spectrum
            for t_s, spectrum in zip(frames.t_s, patch.at_times, strict=True)
        }
        yield Section(
            "Constancy in time",
            (_constancy_text(patch),),
            (
                Picture(
                    "over-time",
                    partial(_normalised_figure, at_times),
                    "Spectra at several times after lamp off, normalised to equal area; bars: 1 σ, "
                    "most of it common to all times (camera curves).",
                ),
                Picture(
                    "shift",
                    partial(_shift_figure, patch.times, frames.t_s),
                    "Centroid of the light along the filter at each time, less that of all "
                    "other times; bars: 1 σ of noise.",
                ),
            ),
            (_table("after lamp off", patch.times),),
        )
    if patch.lamps:
        by_lamp = {charge.lamp: charge.spectrum for charge in patch.charges}
        yield Section(
            "Independence of the exciting lamp",
            (_lamp_text(patch),),
            (
                Picture(
                    "lamps",
                    partial(_normalised_figure, by_lamp),
                    "Spectra after charging with either lamp, normalised to equal area; bars: 1 σ, "
                    "most of it common to both (camera curves).",
                ),
            ),
            (_table("lamp", patch.lamps),),
        )


def _constancy_text(patch: PatchSpectrum) -> str:
    """Return the statement on the constancy of the spectrum in time."""
    least_p = min(patch.times, key=lambda comparison: comparison.p_value)
    if patch.changes_with_time:
        worst = max(patch.times, key=lambda comparison: comparison.beyond_noise)
        return (
            "The relative spectrum changes with time: the frame at "
            f"{worst.what} differs from those at the other times by {worst.beyond_noise:.2%} "
            f"beyond noise (p = {least_p.p_value:.2g})."
        )
    return (
        "The relative spectrum is the same at all times within noise (paper, fig. 6): the least "
        f"p-value of {len(patch.times)} is {least_p.p_value:.2g}. Frames are compared "
        "position by position, so that camera curves and filter cancel."
    )


def _lamp_text(patch: PatchSpectrum) -> str:
    """Return the statement on the independence of the spectrum of the exciting lamp."""
    outcome = "differs" if patch.depends_on_lamp else "is the same within noise"
    worst = max(patch.lamps, key=lambda comparison: comparison.beyond_noise)
    return (
        f"The relative spectrum {outcome} whichever lamp charged the sample: "
        f"p = {worst.p_value:.2g}, {worst.beyond_noise:.2%} rms beyond noise."
    )


def _table(head: str, comparisons: Sequence[SpectralComparison]) -> Table:
    """Return the table of comparisons; `what` is the head of its first column."""
    return Table(
        (head, "χ²", "degrees of freedom", "p", "rms beyond noise / %", "centroid shift / nm"),
        tuple(
            (
                comparison.what,
                rounded(comparison.chi2),
                str(comparison.dof),
                f"{comparison.p_value:.2g}",
                rounded(100 * comparison.beyond_noise, 2),
                _shift(comparison),
            )
            for comparison in comparisons
        ),
    )


def _normalised_figure(spectra: Mapping[str, EmissionSpectrum]) -> Figure:
    """Draw several spectra, each normalised to its integral."""
    figure, axes = spectrum_axes("Fraction of the emission per 10 nm / %")
    entries = []
    for number, (name, spectrum) in enumerate(spectra.items()):
        colour, marker = _colour_and_marker(number)
        nm = np.array(spectrum.wavelength_nm)
        value, sigma = (
            100 * np.array(column) / sum(spectrum.value)
            for column in (spectrum.value, spectrum.sigma)
        )
        # Side by side, so that error bars do not cover each other.
        shifted_nm = nm + 1.2 * (number - (len(spectra) - 1) / 2)
        axes.plot(nm, value, color=colour, linewidth=0.9)
        error_bars(axes, shifted_nm, value, sigma, colour)
        points(axes, shifted_nm, value, marker, colour, colour, size=3.0)
        entries.append(marker_entry(name, marker, colour))
    axes.set_ylim(0, None)
    legend_above(figure, entries, COLUMNS)
    return figure


def _shift_figure(comparisons: Sequence[SpectralComparison], t_s: FloatArray) -> Figure:
    """Draw the shift of the centroid of every frame relative to the other frames, in nm.

    Parameters
    ----------
    comparisons
        Comparison of each of n frames with the others.
    t_s
        Times of the frames in seconds after lamp off, shape (n,).
    """
    figure = new_figure(180.0)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=14)
    axes.axhline(0.0, color=MUTED, linewidth=0.9)
    shift = np.array([comparison.shift_nm for comparison in comparisons])
    sigma = np.array([comparison.shift_nm_sigma for comparison in comparisons])
    error_bars(axes, t_s, shift, sigma, INK)
    points(axes, t_s, shift, "o", INK, INK)
    axes.set_xscale("log")
    axes.set_xticks(t_s, [f"{time_s:.3g}" for time_s in t_s])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("Time after lamp off / s")
    axes.set_ylabel("Shift of centroid / nm")
    reach = 1.2 * float(np.max(np.abs(shift) + sigma, initial=0.1))
    axes.set_ylim(-reach, reach)
    return figure


def _colour_and_marker(number: int) -> tuple[str, str]:
    """Return colour and marker of the spectrum with index `number`."""
    colours = (INK, *OTHER_CHANNELS)
    return colours[number % len(colours)], MARKERS[number % len(MARKERS)]
