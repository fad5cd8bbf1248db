"""`labrig run`, `labrig plan`, `labrig resume`: protocols on a rig."""

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labrig.cli.completion import complete_protocol, complete_run
from labrig.cli.default_rig import RigOption, rig_path
from labrig.cli.detachable_stream import DetachableStream
from labrig.cli.predict import LikeOption, MeteredOption, PredictOption, predict_and_print
from labrig.cli.protocol import protocol_path
from labrig.cli.screen import echo, note
from labrig.cli.wording import EDITED
from labrig.foundation.activity import activity
from labrig.foundation.clock import Interrupted
from labrig.foundation.errors import UsageError

if TYPE_CHECKING:
    from labrig.bench import Recording

Protocol = Annotated[
    str,
    typer.Argument(
        help="A shipped protocol, such as 'decay', or a path to a YAML file.",
        autocompletion=complete_protocol,
    ),
]
Runs = Annotated[Path, typer.Option("--runs", help="Folder in which run folders are created.")]
NoProcess = Annotated[
    bool, typer.Option("--no-process", help="Stop after recording; reduce and fit later.")
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Yes = Annotated[
    bool,
    typer.Option("--yes", help="Non-interactive: the rig's 'changer' does the manual steps."),
]
OnFinish = Annotated[
    bool,
    typer.Option(
        "--on-finish",
        help="Start the command in 'on_finish' of the rig file, to which 'labrig rig use' gave no "
        "consent.",
    ),
]
Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose",
        help="Print every command to a device, its answer and every decision with the time, as in "
        "the run's log.txt.",
    ),
]


def run(
    protocol: Protocol,
    rig: RigOption = None,
    runs: Runs = Path("runs"),
    yes: Yes = False,
    no_process: NoProcess = False,
    on_finish: OnFinish = False,
    verbose: Verbose = False,
    json: Json = False,
) -> None:
    """Run a protocol: record, reduce, fit, report. The last line is the run folder."""
    with activity("preparing the run"):
        from labrig.cli.on_finish import notify_at_end, permitted
        from labrig.cli.progress import progress
        from labrig.process import reduced_ahead

        path = rig_path(rig)
        recording = _prepared(protocol, path, runs)
    at_end = permitted(recording.rig.on_finish, path, is_asked_for=on_finish)
    with notify_at_end(at_end) as ending:
        has_changer = "changer" in recording.rig.devices
        watch = partial(progress, yes=yes, has_changer=has_changer, verbose=verbose)
        with reduced_ahead(wanted=not no_process) as begun:
            folder = recording.record(watch, begun)
        _finish(folder, no_process, json)
        ending.message = str(folder)


def plan(
    protocol: Protocol,
    rig: RigOption = None,
    runs: Runs = Path("runs"),
    predict: PredictOption = None,
    like: LikeOption = None,
    metered: MeteredOption = None,
    every_step: Annotated[
        bool, typer.Option("--all", help="Print every step, instead of units with repeats folded.")
    ] = False,
    json: Json = False,
) -> None:
    """Print the steps of a protocol, their times and the devices it needs; touch nothing.

    With --predict: the expected σ of the rates of a material, and changes that would halve it.
    """
    from labrig.bench import free_disk_bytes
    from labrig.cli.plan_text import folded_units, summary

    recording = _prepared(protocol, rig_path(rig), runs)
    if not json:
        echo("\n".join([*summary(recording, free_disk_bytes(runs)), ""]))
    if predict:
        predict_and_print(recording, predict, like, metered, json=json)
    elif like or metered:
        raise UsageError("--like and --metered go with --predict MATERIAL; name the material, too")
    elif json:
        typer.echo(recording.plan.to_json())
    else:
        lines = recording.plan.lines() if every_step else folded_units(recording.plan)
        echo("\n".join(lines))


def resume(
    run: Annotated[
        Path,
        typer.Argument(
            help="A run folder, the beginning of its name, or 'last'.", autocompletion=complete_run
        ),
    ],
    runs: Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")] = Path("runs"),
    yes: Yes = False,
    no_process: NoProcess = False,
    on_finish: OnFinish = False,
    verbose: Verbose = False,
    edited: Annotated[
        bool,
        typer.Option(
            EDITED,
            help="Go on by protocol.yaml and rig.yaml of the run folder as they were edited since, "
            "instead of what the journal has of them; they are written into it.",
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Go on with a run that was interrupted: completed units are kept, the rest is done.

    If only the result is missing, the run is processed.
    """
    with activity("preparing the run"):
        from labrig.acquire import read_run_rig
        from labrig.bench import resume_run
        from labrig.catalogue import find_run, summarise
        from labrig.cli.on_finish import notify_at_end, permitted
        from labrig.cli.process import print_edits
        from labrig.cli.progress import progress
        from labrig.process import reduced_ahead

        folder = find_run(run, runs)
        is_processed = summarise(folder).status == "processed"
        print_edits(folder, is_taken=edited)
    path = folder / "rig.yaml"
    rig = read_run_rig(folder, edited=edited) if path.is_file() else None
    has_changer = rig is not None and "changer" in rig.devices
    watch = partial(progress, yes=yes, has_changer=has_changer, verbose=verbose)
    at_end = permitted(None if rig is None else rig.on_finish, path, is_asked_for=on_finish)
    with notify_at_end(at_end) as ending:
        with reduced_ahead(wanted=not no_process) as begun:
            resume_run(folder, watch, partial(_confirmed, yes=yes), edited=edited, begun=begun)
        if is_processed:
            _print_processed(folder, json)
        else:
            _finish(folder, no_process, json)
        ending.message = str(folder)


def _confirmed(question: str, *, yes: bool) -> bool:
    """Ask the person at the terminal; nobody confirms anything where there is none."""
    if yes:
        print(f"warning: {question} yes", file=DetachableStream(sys.stderr))
        return True
    return sys.stdin.isatty() and typer.confirm(question, err=True)


def _prepared(protocol: str, rig: Path, runs: Path) -> "Recording":
    from labrig.bench import Recording

    recording = Recording.prepare(protocol_path(protocol), rig, runs)
    for line in recording.notes():
        note(f"note: {line}")
    return recording


def _print_processed(folder: Path, json: bool) -> None:
    from labrig.results import read_result

    echo(f"nothing to resume: all units are complete; labrig process {folder} fits again", err=True)
    if json:
        typer.echo(read_result(folder).to_json())
    typer.echo(folder)


def _finish(folder: Path, no_process: bool, json: bool) -> None:
    if not no_process:
        from labrig.cli.process import process_and_print

        try:
            process_and_print(folder, json=json)
        except Interrupted as stop:
            raise Interrupted(
                stop.signum, f"stopped; the run is recorded, go on with: labrig process {folder}"
            ) from None
    if not json:
        from labrig.record import RunSize

        echo(f"this run takes {RunSize.measured(folder)}")
    typer.echo(folder)
