"""Photographed and rendered values as a table for other programs."""

from collections.abc import Iterator
from pathlib import Path

from labrig.compare.rendered import RenderedComparison
from labrig.compare.rendered_lamps import LampsComparison
from labrig.foundation.output_file import make_folder
from labrig.results import write_csv

Row = tuple[str | float, ...]

#: Columns of both tables: light over reflected light, or over that of the card.
LIGHT = ("photographed", "photographed_sigma", "rendered", "rendered_sigma")
OF_GLOW = (
    "patch",
    "t_s",
    "rendering",
    "channel",
    *LIGHT,
    "delta_e",
    "delta_e_noise",
    "delta_e_matched",
    "delta_e_one_exposure",
)
OF_LAMPS = (
    "lamp",
    "sample",
    "channel",
    "reference",
    *LIGHT,
    "reradiated",
    "reradiated_luminance",
    "delta_e",
    "delta_e_by_errors",
    "delta_e_reflected",
)


def write_rendered(path: Path, comparison: RenderedComparison | LampsComparison) -> None:
    """Write a comparison of photographs and renderings as CSV.

    Parameters
    ----------
    path
        Path of the table: of glow a row for each patch, time and rendering, of samples under lamps
        for each lamp, sample and channel; as of `rendered_numbers` and `lamps_numbers`.
    comparison
        The comparison.

    Raises
    ------
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.compare import RenderedComparison, write_rendered
    >>> write_rendered(Path("rendered.csv"), RenderedComparison((), (), (), ()))
    >>> Path("rendered.csv").read_text().split(",")[:3]
    ['patch', 't_s', 'rendering']
    """
    head: tuple[str, ...] = OF_LAMPS
    if isinstance(comparison, RenderedComparison):
        head, rows = OF_GLOW, _of_glow(comparison)
    else:
        rows = _of_lamps(comparison)
    make_folder(path.parent)
    write_csv(
        path,
        head,
        ([cell if isinstance(cell, str) else f"{cell:.6g}" for cell in row] for row in rows),
    )


def _of_glow(comparison: RenderedComparison) -> Iterator[Row]:
    for patch in comparison.patches:
        ratio = patch.ratio
        for name in patch.each.delta_e:
            columns = zip(
                patch.each.t_s,
                ratio.photographed,
                ratio.photographed_sigma,
                ratio.rendered[name],
                ratio.rendered_sigma[name],
                patch.each.delta_e[name],
                patch.each.noise,
                patch.matched.delta_e[name],
                patch.common.delta_e[name],
                strict=True,
            )
            for t_s, *numbers in columns:
                yield (patch.each.patch, t_s, name, ratio.channel, *numbers)


def _of_lamps(comparison: LampsComparison) -> Iterator[Row]:
    for lamp in comparison.lamps:
        for name, sample in lamp.samples.items():
            for number, channel in enumerate(comparison.channels):
                yield (
                    lamp.name,
                    name,
                    channel,
                    lamp.reference,
                    sample.photographed[number],
                    sample.photographed_sigma[number],
                    sample.rendered[number],
                    sample.rendered_sigma[number],
                    sample.reradiated[number],
                    sample.reradiated_luminance,
                    sample.delta_e,
                    sample.delta_e_by_errors,
                    sample.delta_e_reflected,
                )
