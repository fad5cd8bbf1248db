"""`labrig process`: from a recorded run to its result."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labrig.cli.completion import complete_run
from labrig.cli.process_command import GIVEN

if TYPE_CHECKING:
    from labrig.analyse import Overrides


def process(
    context: typer.Context,
    run: Annotated[
        Path,
        typer.Argument(
            help="A run folder, the beginning of its name, or 'last'.", autocompletion=complete_run
        ),
    ],
    roi: Annotated[
        list[str] | None,
        typer.Option("--roi", help="NAME=x,y,width,height (or x,y,…): another region. Repeatable."),
    ] = None,
    exclude: Annotated[
        list[str] | None,
        typer.Option("--exclude", help="Frame to leave out, by number or name. Repeatable."),
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option("--camera", help="Camera curves to use instead, for the report's colours."),
    ] = None,
    optics: Annotated[
        list[str] | None,
        typer.Option(
            "--optics",
            help="KEY=PATH: what a key of the rig file's 'optics:' is to name instead, a file or a "
            "run, such as lvf=PATH. Repeatable.",
        ),
    ] = None,
    runs: Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")] = Path("runs"),
    verify: Annotated[
        bool,
        typer.Option(
            "--verify",
            help="Read every frame, compare its checksum and reduce it anew, even if its file "
            "looks untouched.",
        ),
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Reduce, fit and report a run again, and say what changed.

    Measurements have options of their own: 'labrig process RUN --help' shows those of a run. An
    earlier result that differs is kept as result-1, result-2, … What was reduced from the frames
    before is used again, unless a region or a calibration that it depends on is another one.
    """
    from labrig.analyse import Overrides, verify_frames
    from labrig.catalogue import find_run
    from labrig.record import discard_cache, read_run

    options = context.meta.get(GIVEN, {})
    overrides = Overrides.parse(roi or [], exclude or [], camera, optics or [], options)
    folder = find_run(run, runs)
    if verify:
        discard_cache(folder)
        typer.echo(verify_frames(read_run(folder), overrides), err=True)
    process_and_print(folder, overrides, json=json)
    typer.echo(folder)


def process_and_print(run: Path, overrides: "Overrides | None" = None, *, json: bool) -> None:
    """Process the run in the folder `run` and print its result."""
    from labrig.process import process_and_report

    processed = process_and_report(run, overrides)
    if json:
        typer.echo(processed.result.to_json())
        return
    for warning in processed.result.warnings:
        typer.echo(f"warning: {warning}", err=True)
    for text in processed.lines:
        typer.echo(text)
    for number, line in enumerate(processed.changes):
        typer.echo(f"  {line}" if number else line)
    typer.echo(f"report: {processed.report}")
