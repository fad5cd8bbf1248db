"""The emission spectrum, whether it stays the same over time, and whatever lamp charged it."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from labrig.analyse.emission_file import EmissionSpectrum
from labrig.analyse.emission_spectrum.constancy import Comparison
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    error_bars,
    new_figure,
    place,
    points,
)
from labrig.report.legend import BAND_OPACITY, legend_above, lined, marked, shaded

FloatArray = NDArray[np.float64]

HEIGHT_PT = 256.0
WAVELENGTH_LABEL = "Wavelength / nm"
COLUMNS = 4


def spectrum_figure(spectrum: EmissionSpectrum) -> Figure:
    """Λ* with its credible band."""
    figure, axes = _axes("Λ* (largest value 1)")
    nm = np.array(spectrum.wavelength_nm)
    axes.fill_between(nm, spectrum.low, spectrum.high, color=INK, alpha=BAND_OPACITY, linewidth=0)
    axes.plot(nm, spectrum.value, color=INK, linewidth=1.4)
    axes.set_ylim(0, 1.05 * max(spectrum.high))
    legend_above(figure, [lined("Λ*", INK), shaded("68 % credible", INK)], COLUMNS)
    return figure


def normalised_figure(spectra: Mapping[str, EmissionSpectrum]) -> Figure:
    """Several spectra, each of its own integral, so that only their shapes differ."""
    figure, axes = _axes("Share of the emission per 10 nm / %")
    entries = []
    for number, (name, spectrum) in enumerate(spectra.items()):
        colour, marker = _look(number)
        nm = np.array(spectrum.wavelength_nm)
        value, sigma = (
            100 * np.array(column) / sum(spectrum.value)
            for column in (spectrum.value, spectrum.sigma)
        )
        # Side by side, so that error bars do not cover each other.
        beside = nm + 1.2 * (number - (len(spectra) - 1) / 2)
        axes.plot(nm, value, color=colour, linewidth=0.9)
        error_bars(axes, beside, value, sigma, colour)
        points(axes, beside, value, marker, colour, colour, size=3.0)
        entries.append(marked(name, marker, colour))
    axes.set_ylim(0, None)
    legend_above(figure, entries, COLUMNS)
    return figure


def shift_figure(comparisons: Sequence[Comparison], t_s: FloatArray) -> Figure:
    """How far the centroid of every frame's light lies off that of the others."""
    figure = new_figure(180.0)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=14)
    axes.axhline(0.0, color=MUTED, linewidth=0.9)
    shift = np.array([one.shift_nm for one in comparisons])
    sigma = np.array([one.shift_sigma_nm for one in comparisons])
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


def _axes(label: str) -> tuple[Figure, Axes]:
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    axes.set_xlabel(WAVELENGTH_LABEL)
    axes.set_ylabel(label)
    axes.set_xlim(395, 705)
    return figure, axes


def _look(number: int) -> tuple[str, str]:
    colours = (INK, *OTHER_CHANNELS)
    return colours[number % len(colours)], MARKERS[number % len(MARKERS)]
