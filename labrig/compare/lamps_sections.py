"""Layout of fluorescent samples under lamps as sections of a page: colours, tables of each lamp."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from labrig.compare.lamps_figure import NOTHING, lamps_figure, percent
from labrig.compare.rendered_lamps import LampsComparison, RenderedLamp, RenderedSample
from labrig.foundation.number_format import plus_minus
from labrig.report import Picture, Section, Table

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
        "would make; reflected: CIEDE2000 to what is reflected only. Off: rendered over "
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
