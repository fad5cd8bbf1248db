"""`labrig compare`: comparison of a run with predictions, another material and the paper."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from labrig.cli.completion import complete_run

if TYPE_CHECKING:
    from labrig.fit import DecayFit
    from labrig.report import Section
    from labrig.results import Series


def compare(
    run: Annotated[
        Path,
        typer.Argument(
            help="A run folder, the beginning of its name, or 'last'.", autocompletion=complete_run
        ),
    ],
    material: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[PATCH=]MATERIAL",
            help="Material to compare with the measured one: a shipped one such as blue-paint, "
            "or a file; with --rendered it is rendered instead of the run's own. Repeatable.",
        ),
    ] = None,
    white: Annotated[
        str, typer.Option(help="White of CIELAB: a CIE illuminant such as D65, D50, A, E.")
    ] = "D65",
    normalise: Annotated[
        str,
        typer.Option(
            help="'all': one exposure for all photographs of a patch; 'each': each at its best."
        ),
    ] = "all",
    camera: Annotated[
        str | None, typer.Option("--camera", help="Camera curves to use instead of the rig file's.")
    ] = None,
    rendered: Annotated[
        bool,
        typer.Option(
            "--rendered",
            help="Render the dark room with the measured material, too, beside the photographs.",
        ),
    ] = False,
    assume_albedo: Annotated[
        float | None,
        typer.Option(
            "--assume-albedo",
            help="With --rendered: albedo of a material whose file has none, 0 to below 1.",
        ),
    ] = None,
    assume_scale: Annotated[
        float | None,
        typer.Option(
            "--assume-scale",
            help="With --rendered: factor from Λ to s/sr of a material whose file has no scale.",
        ),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(help="Folder for the figures; default: comparison in the run folder."),
    ] = None,
    runs: Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")] = Path("runs"),
    json: Annotated[bool, typer.Option("--json", help="Print as JSON, draw nothing.")] = False,
) -> None:
    """Predicted against photographed glow, more states against one, a material beside another.

    With the paper's own numbers (Nalbach et al., fig. 8 and 9, section 4.4, Table 1).
    """
    from labrig.catalogue import find_run
    from labrig.compare import (
        compare_rendered,
        compare_run,
        numbers,
        rendered_numbers,
        rendered_sections,
        sections,
    )
    from labrig.errors import UsageError
    from labrig.reproduce import Assumptions

    if not rendered and (assume_albedo is not None or assume_scale is not None):
        raise UsageError("expected --assume-albedo and --assume-scale with --rendered only")
    folder = find_run(run, runs)
    comparison = compare_run(folder, _refit, material or [], white, normalise, camera)
    content, pages = numbers(comparison), sections(comparison)
    room = None
    if rendered:
        room = compare_rendered(
            folder, _refit, material or [], Assumptions(assume_albedo, assume_scale), white, camera
        )
        content |= {"rendered": rendered_numbers(room)}
        pages = (*pages, *rendered_sections(room))
    if json:
        _print_json(content)
        return
    for line in comparison.left_out:
        typer.echo(f"warning: {line}", err=True)
    drawn = figures or folder / "comparison"
    for section in pages:
        _print_section(section)
        _save_figures(section, drawn)
    if room is not None and room.scene is not None:
        typer.echo(f"scene: {room.scene.write(drawn)}")


def _refit(series: "Series", states: int, flicker: float) -> "DecayFit":
    from labrig.analyse import fit_series

    return fit_series(series, states, flicker=flicker)


def _print_section(section: "Section") -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    console.print(f"\n[bold]{section.title}[/bold]")
    for text in section.text:
        console.print(text, style="dim")
    for data in section.tables:
        table = Table(box=None, pad_edge=False)
        for number, heading in enumerate(data.head):
            table.add_column(heading, justify="right" if number else "left", overflow="fold")
        for row in data.rows:
            table.add_row(*row)
        console.print(table)
        console.print(data.caption, style="dim")


def _save_figures(section: "Section", folder: Path) -> None:
    """Save the figures of a section as PNG and as PDF."""
    from labrig.report import figure_style

    if section.figures:
        folder.mkdir(parents=True, exist_ok=True)
    for picture in section.figures:
        with figure_style():
            figure = picture.figure()
            figure.patch.set(visible=True, facecolor="white")
            for suffix in ("png", "pdf"):
                figure.savefig(folder / f"{picture.name}.{suffix}", dpi=200)
        typer.echo(f"figure: {folder / picture.name}.png")


def _print_json(content: dict[str, Any]) -> None:
    import json

    typer.echo(json.dumps(content, ensure_ascii=False))
