"""Layout of a comparison as sections of a page: text, figures, tables."""

from collections.abc import Iterator
from functools import partial

from labrig.compare.glow import glow_table
from labrig.compare.glow_figure import glow_figure
from labrig.compare.residuals import residuals_table
from labrig.compare.run import RunComparison
from labrig.compare.spectra_figure import spectra_figure
from labrig.compare.three_channels import three_channels_table
from labrig.report import Picture, Section, comparison_table


def sections(comparison: RunComparison) -> tuple[Section, ...]:
    """Lay out a comparison as sections of a page, in the order of the paper's figures.

    Parameters
    ----------
    comparison
        Comparison of a run.

    Returns
    -------
    tuple of Section
        Sections with text, figures and tables.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.compare import compare_run, sections
    >>> def refit(series, states, flicker):
    ...     return labrig.fit_series(series, states, flicker=flicker)
    >>> for section in sections(compare_run(Path("runs/decay"), refit)):
    ...     print(section.title)
    Glow, photographed and predicted
    Improvement by further states
    Spectra in three channels
    """
    return tuple(_sections(comparison))


def _sections(comparison: RunComparison) -> Iterator[Section]:
    if comparison.glows:
        table = glow_table(comparison.glows)
        picture = Picture(
            "glow",
            partial(glow_figure, comparison.glows),
            "Photographed and predicted glow; the brightest photograph just fills the screen. "
            "Numbers are CIEDE2000 to the photograph above; a dash: too dim to have a colour.",
        )
        yield Section(
            "Glow, photographed and predicted", (comparison.description,), (picture,), (table,)
        )
    if comparison.residuals:
        table = residuals_table(comparison.residuals)
        yield Section("Improvement by further states", tables=(table,))
    for materials in comparison.material_comparisons:
        yield Section(
            f"Measured: {materials.names[0]}; reference: {materials.names[1]}",
            tables=(comparison_table(materials),),
        )
    if comparison.spectra and comparison.camera is not None:
        table = three_channels_table(comparison.spectra, comparison.camera, comparison.white)
        picture = Picture(
            "spectra",
            partial(spectra_figure, [spectrum for spectrum, _ in comparison.spectra]),
            "Spectra relative to their maximum, and the best weighted sum of the three CIE 2015 "
            "colour-matching functions. In the corner the colour of the spectrum and, right of "
            "it, that from the camera's R, G, B, as far as a screen shows them; ΔE is CIEDE2000.",
        )
        yield Section("Spectra in three channels", figures=(picture,), tables=(table,))
