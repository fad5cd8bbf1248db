"""`labrig reproduce`: a run beside predictions, another material and the paper."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from labrig.cli.completion import complete_run
from labrig.cli.screen import echo, echo_table
from labrig.foundation.result_warning import ResultWarning, warning_lines

if TYPE_CHECKING:
    from labrig.compare import DarkRoomScene, LampsComparison, RenderedComparison
    from labrig.fit import DecayFit
    from labrig.report import Section
    from labrig.results import Series

#: Name of the table of what was photographed and rendered.
TABLE = "rendered.csv"


def reproduce(
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
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the figures; default: comparison in the run folder."),
    ] = None,
    runs: Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")] = Path("runs"),
    json: Annotated[bool, typer.Option("--json", help="Print as JSON, draw nothing.")] = False,
) -> None:
    """Predicted beside photographed glow of a run, more states beside one, another material.

    With the paper's own numbers (Nalbach et al., fig. 8 and 9, section 4.4, Table 1). With
    --rendered also fluorescent samples under lamps, photographed by validate_illuminants.
    """
    from labrig.catalogue import find_run
    from labrig.compare import compare_run, is_of_fluorescence, numbers, sections, write_rendered
    from labrig.foundation.errors import UsageError

    if not rendered and (assume_albedo is not None or assume_scale is not None):
        raise UsageError("expected --assume-albedo and --assume-scale with --rendered only")
    folder, room = find_run(run, runs), None
    pages: tuple[Section, ...] = ()
    content: dict[str, Any] = {}
    warnings: tuple[ResultWarning, ...] = ()
    if is_of_fluorescence(folder):
        _check_for_fluorescence(folder, rendered, material, assume_albedo, assume_scale)
        room = _of_lamps(folder, white, camera)
    else:
        comparison = compare_run(folder, _refit, material or [], white, normalise, camera)
        content, pages = numbers(comparison), sections(comparison)
        warnings = comparison.left_out
        if rendered:
            assumed = (assume_albedo, assume_scale)
            room = _of_glow(folder, material or [], assumed, white, camera)
    if json:
        _print_json(content if room is None else content | {"rendered": room.content})
        return
    for line in warning_lines(warnings, "warning: "):
        echo(line, err=True)
    drawn = out or folder / "comparison"
    for section in (*pages, *(() if room is None else room.sections)):
        _print_section(section)
        _save_figures(section, drawn)
    if room is None:
        return
    write_rendered(drawn / TABLE, room.comparison)
    echo(f"table: {drawn / TABLE}")
    if room.scene is not None:
        echo(f"scene: {room.scene.write(drawn)}")
    if out is None:
        options = _options(material, white, camera, assume_albedo, assume_scale)
        _show_in_report(folder, room.sections, options)


@dataclass(frozen=True)
class _RenderedRoom:
    """The dark room rendered: the comparison, for programs, for people, and as a scene."""

    comparison: "RenderedComparison | LampsComparison"
    content: dict[str, Any]
    sections: "tuple[Section, ...]"
    scene: "DarkRoomScene | None"


def _of_glow(
    folder: Path,
    material: list[str],
    assumed: tuple[float | None, float | None],
    white: str,
    camera: str | None,
) -> _RenderedRoom:
    """Render the decay of a phosphor."""
    from labrig.compare import compare_rendered, rendered_numbers, rendered_sections
    from labrig.reproduce import Assumptions

    room = compare_rendered(folder, _refit, material, Assumptions(*assumed), white, camera)
    return _RenderedRoom(room, rendered_numbers(room), rendered_sections(room), room.scene)


def _of_lamps(folder: Path, white: str, camera: str | None) -> _RenderedRoom:
    """Render fluorescent samples under lamps."""
    from labrig.compare import compare_lamps, lamps_numbers, lamps_sections

    room = compare_lamps(folder, white, camera)
    return _RenderedRoom(room, lamps_numbers(room), lamps_sections(room), room.scene)


def _check_for_fluorescence(
    folder: Path,
    rendered: bool,
    material: list[str] | None,
    assume_albedo: float | None,
    assume_scale: float | None,
) -> None:
    """Refuse what a run under lamps does not answer."""
    from labrig.foundation.errors import UsageError

    if not rendered:
        raise UsageError(
            f"{folder}: expected --rendered for a run of validate_illuminants; its report has what "
            "the matrices predict"
        )
    if material:
        raise UsageError(
            f"{folder}: expected no --material for a run of validate_illuminants; name other "
            "materials as 'fluorescence:' in its protocol.yaml, and process it again with --edited"
        )
    if assume_albedo is not None or assume_scale is not None:
        raise UsageError(
            "expected --assume-albedo and --assume-scale for a run with a decay: a fluorescent "
            "material has both"
        )


def _options(
    material: list[str] | None,
    white: str,
    camera: str | None,
    assume_albedo: float | None,
    assume_scale: float | None,
) -> list[str]:
    """Return the options that change what is rendered, as they were given."""
    options = [word for name in material or () for word in ("--material", name)]
    options += ["--white", white] if white != "D65" else []
    options += ["--camera", camera] if camera is not None else []
    for name, value in (("--assume-albedo", assume_albedo), ("--assume-scale", assume_scale)):
        options += [name, f"{value:g}"] if value is not None else []
    return options


def _show_in_report(folder: Path, pages: "tuple[Section, ...]", options: list[str]) -> None:
    """Show rendered sections in the run's report, with the command that made them."""
    import shlex
    from dataclasses import replace

    from labrig.process import show_comparison

    if not pages:
        return
    command = shlex.join(["labrig", "reproduce", folder.name, "--rendered", *options])
    made = replace(pages[0], text=(*pages[0].text, f"Made by: {command}"))
    report = folder / "result" / "report.html"
    if show_comparison(folder, (made, *pages[1:])):
        echo(f"report: {report}")
    else:
        echo(
            f"note: {report} has no place for it; make the report again: labrig process {folder}",
            err=True,
        )


def _refit(series: "Series", states: int, flicker: float) -> "DecayFit":
    from labrig.analyse import fit_series

    return fit_series(series, states, flicker=flicker)


def _print_section(section: "Section") -> None:
    echo(f"\n{section.title}", bold=True)
    for text in section.text:
        echo(text, dim=True)
    for table in section.tables:
        if table.title:
            echo(f"\n{table.title}", bold=True)
        echo_table(table.head, table.rows)
        echo(table.caption, dim=True)


def _save_figures(section: "Section", folder: Path) -> None:
    """Save the figures of a section as PNG and as PDF."""
    from labrig.foundation.output_file import make_folder
    from labrig.report import figure_style, save_picture

    if section.figures:
        make_folder(folder)
    for picture in section.figures:
        with figure_style():
            figure = picture.figure()
            figure.patch.set(visible=True, facecolor="white")
            for suffix in ("png", "pdf"):
                save_picture(figure, folder / f"{picture.name}.{suffix}", dpi=200)
        echo(f"figure: {folder / picture.name}.png")


def _print_json(content: dict[str, Any]) -> None:
    import json

    typer.echo(json.dumps(content))
