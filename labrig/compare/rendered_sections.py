"""Layout of a rendered dark room as sections of a page: pictures, tables over time."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from labrig.compare.glow_figure import glow_figure, shown_rows
from labrig.compare.glow_ratio import RenderedPatch
from labrig.compare.rendered import RenderedComparison
from labrig.compare.rendered_states import MEASURED
from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import plus_minus, rounded
from labrig.report import Picture, Section, Table

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
    patches, notes = comparison.patches, comparison.notes
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
        "the errors of the measured spectrum and of the camera's curves; noise alone: what the "
        "photographs' noise would make. Rendered over photographed ratio of glow to reflected "
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
        "L* = 50, what noise alone would make of it, and ΔE with one exposure.",
    )


def _furthest(values: FloatArray) -> float:
    return float(values[np.argmax(np.abs(values))])


def _delta_e(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:.2f}"
