"""Sections of a comparison's page: predictions, the rendered dark room, samples under lamps."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from labrig.compare.figures import (
    NOTHING,
    glow_figure,
    lamps_figure,
    percent,
    shown_rows,
    spectra_figure,
)
from labrig.compare.glow import glow_table
from labrig.compare.rendered import RenderedComparison, RenderedPatch
from labrig.compare.rendered_lamps import LampsComparison, RenderedLamp, RenderedSample
from labrig.compare.rendered_states import MEASURED
from labrig.compare.residuals import residuals_table
from labrig.compare.run import RunComparison
from labrig.compare.three_channels import three_channels_table
from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import plus_minus, rounded
from labrig.report import Picture, Section, Table, comparison_table


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


#: Units in which glow is told over reflected light, the first of which it reaches.
UNITS = ((1e-2, "%"), (1e-3, "‰"), (1e-6, "ppm"))


def rendered_sections(comparison: RenderedComparison) -> tuple[Section, ...]:
    """Lay out a rendered dark room as sections of a page.

    Parameters
    ----------
    comparison
        The dark room of a run, rendered beside its photographs.

    Returns
    -------
    tuple of Section
        One section with pictures and tables; none if no patch could be compared.

    Examples
    --------
    >>> from labrig.compare import RenderedComparison, rendered_sections
    >>> rendered_sections(RenderedComparison((), (), (), ()))
    ()
    """
    if not comparison.patches:
        return ()
    text = (
        *comparison.description,
        *(f"Note: {note}." for note in comparison.notes),
        *(f"Warning: {warning}." for warning in comparison.warnings),
    )
    return (
        Section(
            "The dark room, photographed and rendered",
            text,
            tuple(_pictures(comparison)),
            (_colours_table(comparison), *map(_ratio_table, comparison.patches)),
        ),
    )


def _pictures(comparison: RenderedComparison) -> Iterator[Picture]:
    patches, notes = comparison.patches, [str(note) for note in comparison.notes]
    below = "Numbers are CIEDE2000 to the photograph above; a dash: too dim to have a colour."
    yield Picture(
        "rendered",
        partial(glow_figure, [patch.each for patch in patches], notes),
        f"Photographed and rendered glow, every photograph with L* = 50. {below}",
    )
    yield Picture(
        "rendered-one-exposure",
        partial(glow_figure, [patch.common for patch in patches], notes),
        f"Photographed and rendered glow with one exposure for all times. {below}",
    )


def _colours_table(comparison: RenderedComparison) -> Table:
    """Return a table with a row for each patch and rendering, and one for noise."""
    rows: list[tuple[str, ...]] = []
    for patch in comparison.patches:
        of_patch = [patch.each.patch] if len(comparison.patches) > 1 else []
        rows += [
            (
                *of_patch,
                name,
                f"{patch.each.mean(name):.2f} ({patch.each.most(name):.2f})",
                _delta_e(patch.matched.mean(name)),
                f"{patch.common.mean(name):.2f} ({patch.common.most(name):.2f})",
                f"{100 * float(np.mean(patch.ratio.excess(name))):+.2f} "
                f"({_furthest(100 * patch.ratio.excess(name)):+.2f})",
                f"{_furthest(patch.ratio.in_sigma(name)):+.1f}",
            )
            for name in patch.each.delta_e
        ]
        of_noise = [_delta_e(each.mean_noise) for each in (patch.each, patch.matched, patch.common)]
        rows.append((*of_patch, "noise alone", *of_noise, "", ""))
    return Table(
        head=(
            *(["patch"] if len(comparison.patches) > 1 else []),
            "rendered",
            "ΔE at L* 50",
            "matched",
            "one exposure",
            "ratio off / %",
            "furthest / σ",
        ),
        rows=tuple(rows),
        caption="CIEDE2000 between photographs and renderings, mean over all times and, in "
        "brackets, the largest; matched: with one factor of each channel for all times, without "
        "the errors of the measured spectrum and of the camera's curves; noise alone: from the "
        "noise of the photographs. Rendered over photographed ratio of glow to reflected "
        "light − 1, mean and, in brackets, furthest over all times.",
    )


def _ratio_table(patch: RenderedPatch) -> Table:
    """Return a table of glow over reflected light at the times that the pictures show."""
    ratio = patch.ratio
    unit, in_words = next(
        (each for each in UNITS if ratio.photographed.max() >= each[0]), UNITS[-1]
    )
    rows = [
        (
            rounded(float(patch.each.t_s[row]), 3),
            *(
                plus_minus(float(values[row]) / unit, float(sigma[row]) / unit)
                for values, sigma in (
                    (ratio.photographed, ratio.photographed_sigma),
                    (ratio.rendered[MEASURED], ratio.rendered_sigma[MEASURED]),
                )
            ),
            f"{ratio.in_sigma(MEASURED)[row]:+.1f}",
            _delta_e(patch.each.delta_e[MEASURED][row]),
            _delta_e(patch.each.noise[row]),
            _delta_e(patch.common.delta_e[MEASURED][row]),
        )
        for row in shown_rows(patch.each)
    ]
    return Table(
        head=(
            "t / s",
            f"photographed / {in_words}",
            f"rendered / {in_words}",
            "σ",
            "ΔE",
            "of noise",
            "one exposure",
        ),
        rows=tuple(rows),
        caption=f"{patch.each.patch}: glow in {in_words} of the light that {ratio.reflected_by} "
        f"reflects, in {ratio.channel}, of photographs and of the measured material; ΔE of this at "
        "L* = 50, ΔE from noise alone, and ΔE with one exposure.",
    )


def _furthest(values: FloatArray) -> float:
    return float(values[np.argmax(np.abs(values))])


def _delta_e(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:.2f}"


#: Least light, relative to the brightest of a lamp, of which differences in % say something.
DARK = 0.02


def lamps_sections(comparison: LampsComparison) -> tuple[Section, ...]:
    """Lay out fluorescent samples under lamps, photographed and rendered, as sections of a page.

    Parameters
    ----------
    comparison
        The samples of a run under its lamps.

    Returns
    -------
    tuple of Section
        A section with a picture, and one with a table of each lamp.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.compare import compare_lamps, lamps_sections
    >>> compared = compare_lamps(Path("runs/validation"))  # doctest: +SKIP
    >>> [section.title for section in lamps_sections(compared)]  # doctest: +SKIP
    ['Under lamps, photographed and rendered', 'Light of the samples, photographed and rendered']
    """
    notes = (f"Note: {note}." for note in comparison.notes)
    picture = Picture(
        "lamps",
        partial(lamps_figure, comparison.lamps),
        "Photographed and rendered samples; a white under the balanced lamp is white. Numbers are "
        "CIEDE2000 of rendered and of reflected light to the photograph, and the share of the "
        "luminance that is re-radiated.",
    )
    by_lamp = tuple(_lamp_table(lamp, comparison.channels) for lamp in comparison.lamps)
    return (
        Section(
            "Under lamps, photographed and rendered",
            (*comparison.description, *notes),
            (picture,),
            (_overview(comparison),),
        ),
        Section("Light of the samples, photographed and rendered", tables=by_lamp),
    )


def _overview(comparison: LampsComparison) -> Table:
    """Return a table with a row for each lamp."""
    return Table(
        head=(
            "lamp",
            "ΔE",
            "by errors",
            "reflected",
            "off / %",
            "σ",
            "re-radiated / %",
        ),
        rows=tuple(_lamp_row(lamp) for lamp in comparison.lamps),
        caption="CIEDE2000 between photographs and renderings, mean over the samples and, in "
        "brackets, the largest; by errors: the root mean square that the errors of both alone "
        "would make; reflected: CIEDE2000 to the reflected light only. Off: rendered over "
        "photographed light − 1, mean over all samples and channels that are not dark, and the "
        "furthest value in σ. Re-radiated: share of the luminance, mean and largest.",
    )


def _lamp_row(lamp: RenderedLamp) -> tuple[str, ...]:
    samples = list(lamp.samples.values())
    bright = max(float(sample.rendered.max()) for sample in samples)
    off = np.concatenate(
        [
            sample.excess[(sample.rendered > DARK * bright) & (sample.photographed > 0)]
            for sample in samples
        ]
    )
    pulls = np.concatenate([sample.in_sigma for sample in samples])
    shares = [sample.reradiated_luminance for sample in samples]
    return (
        lamp.name,
        _mean_and_most([sample.delta_e for sample in samples]),
        _mean_and_most([sample.delta_e_by_errors for sample in samples]),
        _mean_and_most([sample.delta_e_reflected for sample in samples]),
        percent(float(off.mean()), "+.1f") if len(off) else NOTHING,
        f"{float(pulls[np.abs(pulls).argmax()]):+.1f}",
        _mean_and_most([100 * share for share in shares if not np.isnan(share)] or [0.0], digits=0),
    )


def _mean_and_most(values: list[float], digits: int = 1) -> str:
    return f"{np.mean(values):.{digits}f} ({max(values):.{digits}f})"


def _lamp_table(lamp: RenderedLamp, channels: tuple[str, ...]) -> Table:
    """Return a table with a row for each sample and channel."""
    by = {
        "card": "Light over that of the grey card in the sample's place, in the same channel.",
        "brightest": "Light over the brightest that is rendered.",
    }
    return Table(
        head=(
            "sample",
            "channel",
            "photographed / %",
            "rendered / %",
            "off / %",
            "σ",
            "re-radiated / %",
        ),
        rows=tuple(
            row for name, each in lamp.samples.items() for row in _rows(name, each, channels)
        ),
        caption=f"{by[lamp.reference]} Re-radiated: share of the rendered light.",
        title=lamp.name,
    )


def _rows(
    name: str, sample: RenderedSample, channels: tuple[str, ...]
) -> Iterator[tuple[str, ...]]:
    for number, channel in enumerate(channels):
        both = (
            (sample.photographed[number], sample.photographed_sigma[number]),
            (sample.rendered[number], sample.rendered_sigma[number]),
        )
        yield (
            name,
            channel,
            *(plus_minus(100 * float(value), 100 * float(sigma)) for value, sigma in both),
            percent(float(sample.excess[number]), "+.1f"),
            f"{sample.in_sigma[number]:+.1f}",
            percent(float(sample.reradiated[number]), ".1f"),
        )
