"""Page of a mixture that stands for a re-radiation matrix."""

from dataclasses import dataclass

import numpy as np

from labrig.fit import MixtureFit
from labrig.foundation.number_format import rounded
from labrig.material import ColourDifference, colour_pair, physical_warnings
from labrig.optics import Spectrum
from labrig.record import RunDescription
from labrig.report.colours import css_colour
from labrig.report.mixture import (
    FittedMatrix,
    component_head,
    component_rows,
    components_text,
    held_out_errors,
    light_kept_text,
    mixture_warnings,
    selection_text,
    threshold_text,
    white_text,
)
from labrig.report.mixture_figures import (
    error_pictures,
    matrix_pictures,
    noise_floor,
    spectra_pictures,
)
from labrig.report.page import Report
from labrig.report.reradiation import screen_linear
from labrig.report.sections import Section, Table

#: Sentences on the scale, by `MixtureFit.scaling`.
SCALINGS = {
    "integral": "The scale keeps the light of all numbers, where σ is known as far as their sum "
    "determines it better than the fit does; else of the numbers above the threshold.",
    "least-squares": "The scale makes the mean squared error least.",
    "colour": "The scale makes the mean ΔE2000 under {lights} least.",
}


@dataclass(frozen=True)
class Swatches:
    """Colours of a matrix and of its mixture on a screen.

    Attributes
    ----------
    light
        Name of the light.
    measured, mixture
        Both as `#rrggbb`; empty if the light leaves the measured surface black.
    delta_e
        CIEDE2000, as text.
    """

    light: str
    measured: str
    mixture: str
    delta_e: str


def mixture_report(fitted: FittedMatrix, about: RunDescription) -> Report:
    """Return the report of a mixture that stands for a re-radiation matrix.

    Parameters
    ----------
    fitted
        The matrix and its mixture.
    about
        Description of the file and of the processing.

    Returns
    -------
    Report
        Matrix, mixture and difference; colours; spectra both ways; errors; how it was found.

    Examples
    --------
    >>> from labrig.fit import fit_mixture
    >>> from labrig.material import read_reradiation
    >>> from labrig.record import RunDescription
    >>> from labrig.report import FittedMatrix, mixture_report
    >>> paper = read_reradiation("paper.csv")
    >>> about = RunDescription(
    ...     title=paper.name, protocol="mixture", run="paper.csv", started="", ended="", rig="",
    ...     simulated=False, labrig_version="0.1.0"
    ... )
    >>> report = mixture_report(FittedMatrix(paper, fit_mixture(paper, 2, threshold=1e-3)), about)
    >>> [section.title for section in report.sections]
    ['Mixture', 'Spectra', 'Number of components']
    """
    sections = [_mixture(fitted), _spectra(fitted), _numbers(fitted)]
    if fitted.differences:
        sections.insert(1, _colours(fitted))
    warnings = (*mixture_warnings(fitted.fit), *physical_warnings(fitted.matrix))
    return Report(about, warnings, tuple(sections), (_methods(fitted),))


def _mixture(fitted: FittedMatrix) -> Section:
    fit = fitted.fit
    stored = (6 if fit.mixture.skew is None else 8) * fit.components
    text = (
        f"{components_text(fit).capitalize()} ({stored} numbers) {_verb(fit.components)} for the "
        f"{fit.entries} measured numbers with the longer returning wavelength. {_error(fit)} Light "
        f"kept: {light_kept_text(fit.light_kept)}."
    )
    table = Table(
        ("component", *component_head(fit)),
        tuple((str(number), *row) for number, row in enumerate(component_rows(fit), 1)),
        "σ: standard deviations of incident and returning wavelength. Re-radiation per "
        f"{fit.band_nm:g} nm is {rounded(fit.mixture.scale * fit.band_nm, 4)} times the density in "
        "nm⁻².",
    )
    return Section("Mixture", (text,), matrix_pictures(fitted), (table,))


def _error(fit: MixtureFit) -> str:
    if fit.reduced_chi2 is None:
        return f"The mean squared error is {rounded(fit.masked_mse, 3)} per band²."
    return f"Reduced χ² is {rounded(fit.reduced_chi2, 3)}: the part above 1 is misfit, not noise."


def _verb(components: int) -> str:
    return "stands" if components == 1 else "stand"


def _colours(fitted: FittedMatrix) -> Section:
    swatches = tuple(
        _swatches(fitted, light, difference)
        for light, difference in zip(fitted.lights, fitted.differences, strict=True)
    )
    rows = tuple(
        (
            difference.light,
            _two_places(difference.delta_e),
            _two_places(100 * difference.xyz_error),
            white_text(difference),
        )
        for difference in fitted.differences
    )
    table = Table(
        ("light", "ΔE2000", "X, Y, Z error / %", "white"),
        rows,
        "Of the mixture with the measured reflectance, against the matrix. The white is a perfect "
        "white under the light; under a narrow light, where a fluorescent surface is far brighter "
        "than any white, that of a screen, with the matrix at half its luminance. X, Y, Z error: "
        "length of the difference over that of the matrix's X, Y, Z.",
    )
    return Section("Colours", tables=(table,), template="mixture_colours.html.j2", content=swatches)


def _swatches(fitted: FittedMatrix, light: Spectrum, difference: ColourDifference) -> Swatches:
    """Return both colours on a screen, dimmed together if it cannot show the brighter one."""
    pair = colour_pair(fitted.model, fitted.matrix, light)
    xyz = np.stack([pair.reference_xyz, pair.surface_xyz])
    delta_e = _two_places(difference.delta_e)
    if np.isnan(xyz).any():
        return Swatches(light.name, "", "", delta_e)
    both = np.stack([screen_linear(colour, pair.white_xyz) for colour in xyz])
    measured, mixture = both / max(1.0, float(both.max()))
    return Swatches(light.name, css_colour(measured), css_colour(mixture), delta_e)


def _two_places(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:.2f}"


def _spectra(fitted: FittedMatrix) -> Section:
    text = (
        "Columns and rows of the matrix, and the densities from which wavelengths are drawn, one "
        "given the other."
    )
    return Section("Spectra", (text,), spectra_pictures(fitted))


def _numbers(fitted: FittedMatrix) -> Section:
    fit = fitted.fit
    text = f"{components_text(fit).capitalize()}, {selection_text(fit)}."
    noise = noise_floor(fitted.matrix)
    caption = (
        "MSE: mean squared error per band², with the scale that makes it least; numbers below the "
        "threshold count as 0."
    )
    if noise is not None:
        caption += f" The measured numbers have a mean σ² of {rounded(noise, 3)}."
    head: tuple[str, ...] = ("components", "MSE", "BIC")
    rows: list[tuple[str, ...]] = [
        (str(tried.components), rounded(tried.masked_mse, 3), rounded(tried.bic, 5))
        for tried in fitted.candidates
    ]
    chi2 = [tried.reduced_chi2 for tried in fitted.candidates]
    if None not in chi2:
        head = (*head, "reduced χ²")
        rows = [(*row, rounded(one, 3)) for row, one in zip(rows, chi2, strict=True) if one]
    held_out = held_out_errors(fitted.candidates)
    if len(held_out) == len(rows):
        head = (*head, "MSE of numbers left out")
        rows = [(*row, rounded(mse, 3)) for row, (_, mse) in zip(rows, held_out, strict=True)]
    table = Table(head, tuple(rows), caption)
    return Section("Number of components", (text,), error_pictures(fitted), (table,))


def _methods(fitted: FittedMatrix) -> Section:
    fit = fitted.fit
    points = (
        f"Threshold: {threshold_text(fit)}. Numbers below it are taken as 0"
        + (
            "."
            if fit.false_discovery_rate is None
            else " for the start, by σ of each (Benjamini and Hochberg, J. R. Statist. Soc. B 57, "
            "1995)."
        ),
        f"Weighted expectation maximisation from several starts; the taken one needed "
        f"{fit.iterations} iterations and leaves a mean squared error of "
        f"{rounded(fit.likelihood_mse, 3)} per band².",
        f"Then least squares, {fit.refinement_iterations} iterations"
        + (
            ": the stated error is not the likelihood."
            if fit.reduced_chi2 is None
            else ", of all numbers as they were measured, weighted by σ: numbers below a "
            "threshold are partly light."
        ),
        *(
            ()
            if fit.mixture.skew is None
            else (
                "Each component is skewed in both wavelengths by a sinh-arcsinh transformation "
                "(Jones and Pewsey, Biometrika 96, 2009); 'incident' and 'returning' are medians.",
            )
        ),
        SCALINGS[fit.scaling].format(lights=", ".join(fit.lights)),
        "Densities of one wavelength, given the other, are cut off at the diagonal and have an "
        "integral of 1.",
    )
    source = "After Hua et al., A compact representation for fluorescent spectral data, EGSR 2021."
    return Section("How it was found", (source,), points=points)
