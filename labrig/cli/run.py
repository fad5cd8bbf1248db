"""`labrig run`, `labrig plan`, `labrig resume`: protocols on a rig."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labrig.clock import Interrupted

if TYPE_CHECKING:
    from labrig.run import Recording

Protocol = Annotated[
    str, typer.Argument(help="A shipped protocol, such as 'decay', or a path to a YAML file.")
]
RigOption = Annotated[
    str, typer.Option("--rig", help="A shipped rig, such as 'sim', or a path to a YAML file.")
]
Runs = Annotated[Path, typer.Option("--runs", help="Where run folders are made.")]
NoProcess = Annotated[
    bool, typer.Option("--no-process", help="Stop after recording; reduce and fit later.")
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Yes = Annotated[bool, typer.Option("--yes", help="Answer every question with yes.")]


def run(
    protocol: Protocol,
    rig: RigOption,
    runs: Runs = Path("runs"),
    yes: Yes = False,
    no_process: NoProcess = False,
    json: Json = False,
) -> None:
    """Run a protocol: record, reduce, fit, report. The last line is the run folder."""
    from labrig.cli.progress import progress

    _finish(_prepared(protocol, rig, runs).record(progress), no_process, json)


def plan(protocol: Protocol, rig: RigOption, runs: Runs = Path("runs")) -> None:
    """Print what a protocol will do, how long it takes and what it needs; touch nothing."""
    recording = _prepared(protocol, rig, runs)
    for line in recording.plan.lines():
        typer.echo(line)
    typer.echo(recording.summary())


def resume(
    run: Annotated[Path, typer.Argument(help="The run folder.")],
    no_process: NoProcess = False,
    json: Json = False,
) -> None:
    """Go on with a run that was interrupted: completed units are kept, the rest is done."""
    from labrig.cli.progress import progress
    from labrig.run import resume_run

    _finish(resume_run(run, progress), no_process, json)


def _prepared(protocol: str, rig: str, runs: Path) -> "Recording":
    from labrig import shipped
    from labrig.run import Recording

    return Recording.prepare(
        shipped.find("protocols", "protocol", protocol), shipped.find("config", "rig", rig), runs
    )


def _finish(folder: Path, no_process: bool, json: bool) -> None:
    if not no_process:
        from labrig.cli.process import process_and_tell

        try:
            process_and_tell(folder, json=json)
        except Interrupted as stop:
            raise Interrupted(
                stop.signum, f"stopped; the run is recorded, go on with: labrig process {folder}"
            ) from None
    typer.echo(folder)
