"""What a spectrum and its comparisons say: lines, warnings, sections of the report."""

from collections.abc import Mapping, Sequence

import numpy as np

from labrig.analyse.emission_file import EmissionSpectrum
from labrig.analyse.emission_spectrum.bench import SpectralBench
from labrig.analyse.emission_spectrum.constancy import Comparison, differ
from labrig.analyse.emission_spectrum.figures import (
    normalised_figure,
    shift_figure,
    spectrum_figure,
)
from labrig.analyse.emission_spectrum.picture import Pictures
from labrig.report.sections import Picture as Plate, Section, Table
from labrig.written_numbers import plus_minus, rounded


def peak_line(spectrum: EmissionSpectrum) -> str:
    """Where it is, and how well it is known."""
    top = int(np.argmax(spectrum.value))
    nm = np.array(spectrum.wavelength_nm)
    value, covariance = np.array(spectrum.value), np.array(spectrum.covariance)
    centroid = float(nm @ value / value.sum())
    lever = (nm - centroid) / value.sum()
    sigma = float(np.sqrt(lever @ covariance @ lever))
    return (
        f"emission: highest at {nm[top]:.0f} nm, centroid {plus_minus(centroid, sigma)} nm; "
        f"σ of Λ* {100 * float(np.median(spectrum.sigma)):.1f} % of its peak (median)"
    )


def comparison_lines(times: Sequence[Comparison], lamps: Sequence[Comparison]) -> list[str]:
    """One for the times, one for each further lamp."""
    lines = []
    if times:
        worst = min(times, key=lambda one: one.p_value)
        said = "changes" if differ(list(times)) else "the same"
        lines.append(
            f"over time: {said} (least p = {worst.p_value:.2g} of {len(times)}, at {worst.what}; "
            f"centroid {plus_minus(worst.shift_nm, worst.shift_sigma_nm)} nm off the others)"
        )
    for one in lamps:
        said = "differs" if differ(list(lamps)) else "the same"
        lines.append(
            f"{one.what}: {said} (p = {one.p_value:.2g}; centroid "
            f"{plus_minus(one.shift_nm, one.shift_sigma_nm)} nm off, "
            f"{one.brightness:.3g} times as bright)"
        )
    return lines


def verdicts(times: Sequence[Comparison], lamps: Sequence[Comparison]) -> list[str]:
    """Warnings where spectra differ."""
    told = []
    if differ(list(times)):
        worst = max(times, key=lambda one: one.beyond_noise)
        told.append(
            f"the spectrum changes with time: at {worst.what} it differs by "
            f"{worst.beyond_noise:.1%} (rms, beyond noise) from the other times; states emit in "
            "different colours, or another light comes in, so that one Λ* does not describe them"
        )
    if differ(list(lamps)):
        worst = max(lamps, key=lambda one: one.beyond_noise)
        told.append(
            f"the spectrum depends on the lamp: {worst.what} it differs by "
            f"{worst.beyond_noise:.1%} (rms, beyond noise); is it the same sample, in its place?"
        )
    return told


def sections(
    spectrum: EmissionSpectrum,
    bench: SpectralBench,
    frames: Pictures,
    times: Sequence[Comparison],
    parts: Mapping[str, EmissionSpectrum],
    lamps: Sequence[Comparison],
    by_lamp: Mapping[str, EmissionSpectrum],
) -> list[Section]:
    """Of the report.

    Parameters
    ----------
    times, parts
        Every time against the others, and the spectrum at each.
    lamps, by_lamp
        Every further lamp against the first, and the spectrum after each.
    """
    white = (
        "A grey card under the known lamp, through the same filter, has told what the camera's "
        "curves are off by in every place."
        if bench.white
        else "Without a picture of a grey card under the known lamp the camera's curves are taken "
        "as they are, with the 6 % by which laboratories disagree in every σ."
    )
    told = [
        Section(
            "Emission spectrum",
            (
                f"Λ* from {len(bench.slices)} places of the filter in {len(frames)} frames, "
                f"largest value 1. {white}",
                "Lines much narrower than the filter's band may come out broader than they are, by "
                "more than the credible band says.",
            ),
            (
                Plate(
                    "spectrum",
                    spectrum_figure(spectrum),
                    "Emission spectrum Λ*, means over 10 nm; band: 68 % credible.",
                ),
            ),
        )
    ]
    if times:
        told.append(
            Section(
                "Constancy in time",
                (_constancy_text(times),),
                (
                    Plate(
                        "over-time",
                        normalised_figure(parts),
                        "Spectra at several times after lamp off, all of one integral; bars: 1 σ, "
                        "most of it common to all times (camera curves).",
                    ),
                    Plate(
                        "shift",
                        shift_figure(times, frames.t_s),
                        "Centroid of the light along the filter at each time, less that of all "
                        "other times; bars: 1 σ of noise.",
                    ),
                ),
                (_table("after lamp off", times),),
            )
        )
    if lamps:
        told.append(
            Section(
                "Independence of the exciting lamp",
                (_lamp_text(lamps),),
                (
                    Plate(
                        "lamps",
                        normalised_figure(by_lamp),
                        "Spectra after charging with either lamp, all of one integral; bars: 1 σ, "
                        "most of it common to both (camera curves).",
                    ),
                ),
                (_table("lamp", lamps),),
            )
        )
    return told


def _constancy_text(times: Sequence[Comparison]) -> str:
    least = min(times, key=lambda one: one.p_value)
    if differ(list(times)):
        worst = max(times, key=lambda one: one.beyond_noise)
        return (
            "The relative spectrum changes with time: the picture at "
            f"{worst.what} differs from those at the other times by {worst.beyond_noise:.2%} "
            f"beyond noise (p = {least.p_value:.2g})."
        )
    return (
        "The relative spectrum is the same at all times within noise (paper, fig. 6): the least "
        f"p-value of {len(times)} is {least.p_value:.2g}. Pictures are compared place by place, "
        "so that camera curves and filter drop out."
    )


def _lamp_text(lamps: Sequence[Comparison]) -> str:
    said = "differs" if differ(list(lamps)) else "is the same within noise"
    worst = max(lamps, key=lambda one: one.beyond_noise)
    return (
        f"The relative spectrum {said} whichever lamp charged the sample: "
        f"p = {worst.p_value:.2g}, {worst.beyond_noise:.2%} rms beyond noise."
    )


def _table(what: str, comparisons: Sequence[Comparison]) -> Table:
    return Table(
        (what, "χ²", "degrees of freedom", "p", "rms beyond noise / %", "centroid shift / nm"),
        tuple(
            (
                one.what,
                rounded(one.chi2),
                str(one.dof),
                f"{one.p_value:.2g}",
                rounded(100 * one.beyond_noise, 2),
                plus_minus(one.shift_nm, one.shift_sigma_nm),
            )
            for one in comparisons
        ),
    )
