"""`labrig queue`: measurements one after another."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labrig.cli.completion import complete_protocol
from labrig.cli.default_rig import RigOption, rig_path
from labrig.cli.protocol import protocol_path
from labrig.cli.screen import echo, echo_table
from labrig.foundation.activity import activity
from labrig.foundation.named_files import beside, is_path

if TYPE_CHECKING:
    from labrig.acquire import RigFile
    from labrig.bench import Recording, Watch
    from labrig.cli.progress import Terminal
    from labrig.queue import QueuedRun, QueueEntry

app = typer.Typer(help="Measurements one after another.", no_args_is_help=True)

File = Annotated[Path, typer.Option("--queue", help="File of the queue.")]
Runs = Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")]
QUEUE, RUNS = Path("queue.yaml"), Path("runs")


@app.command("add")
def add(
    protocol: Annotated[
        str,
        typer.Argument(
            help="A shipped protocol, such as 'decay', or a path to a YAML file.",
            autocompletion=complete_protocol,
        ),
    ],
    rig: RigOption = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="KEY=VALUE: a key of the protocol; may be given again."),
    ] = None,
    sweeps: Annotated[
        list[str] | None,
        typer.Option(
            "--sweep",
            help="KEY=VALUE, VALUE, …: a run for each value; of several, for all combinations.",
        ),
    ] = None,
    queue: File = QUEUE,
) -> None:
    """Add a measurement, or a sweep of one, to the end of the queue."""
    from labrig.acquire import changes_with_absolute_paths, read_protocol
    from labrig.queue import Queue, QueuedRun, change_queue, combinations

    folder = queue.absolute().parent
    added = []
    for typed in combinations(settings or [], sweeps or []):
        model = type(read_protocol(protocol_path(protocol), typed))
        changes = changes_with_absolute_paths(typed, model, Path.cwd())
        named_rig = None if rig is None else _from(folder, rig, rig_path(rig))
        source = _from(folder, protocol, protocol_path(protocol))
        added.append(QueuedRun(protocol=source, rig=named_rig, set=changes))
    now = change_queue(queue, lambda before: Queue(runs=(*before.runs, *added)))
    echo(f"{len(added)} added, {len(now.runs)} in {queue}; labrig queue run measures them")


@app.command("list")
def list_(
    queue: File = QUEUE,
    runs: Runs = RUNS,
    json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """The runs of the queue, their progress and their results."""
    from json import dumps

    from labrig.queue import entries, queue_report, read_queue

    listed = entries(read_queue(queue), runs)
    if json:
        echo(dumps([_content(entry) for entry in listed], indent=1))
    elif not listed:
        echo(f"nothing in {queue}")
    else:
        table = queue_report(queue.stem, listed).sections[0].tables[0]
        echo_table(table.head, table.rows)


@app.command("run")
def run(
    queue: File = QUEUE,
    runs: Runs = RUNS,
    yes: Annotated[
        bool,
        typer.Option(
            "--yes",
            help="Non-interactive: the rig's 'changer' does the manual steps, and nobody is asked "
            "to change samples.",
        ),
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Print every command to a device and its answer.")
    ] = False,
) -> None:
    """Measure the runs that wait or were interrupted. The last line is the page of results."""
    with activity("reading the queue"):
        from labrig.cli.progress import Terminal
        from labrig.queue import run_queue

    typer.echo(run_queue(queue, runs, _Person(queue, runs, Terminal(), yes, verbose)))


class _Person:
    """A person at the terminal."""

    def __init__(
        self, queue: Path, runs: Path, terminal: "Terminal", yes: bool, verbose: bool
    ) -> None:
        self._folder = queue.absolute().parent
        self._runs = runs
        self._terminal = terminal
        self._yes = yes
        self._verbose = verbose

    def prepare(self, queued: "QueuedRun") -> "Recording":
        with activity("preparing the run"):
            from labrig.acquire import changes_with_absolute_paths, read_protocol
            from labrig.bench import Recording

            rig = None if queued.rig is None else beside(queued.rig, self._folder)
            protocol = protocol_path(beside(queued.protocol, self._folder))
            model = type(read_protocol(protocol))
            changes = changes_with_absolute_paths(queued.changes, model, self._folder)
            return Recording.prepare(protocol, rig_path(rig), self._runs, changes)

    def watch(self, rig: "RigFile") -> "Watch":
        from labrig.cli.progress import progress

        has_changer = "changer" in rig.devices
        return partial(progress, yes=self._yes, has_changer=has_changer, verbose=self._verbose)

    def change_sample(self, before: str, after: str) -> None:
        from labrig.acquire import ManualStep

        if self._yes:
            return
        step = ManualStep(
            f"put the sample '{after}' in place of '{before}'", "it is measured next", "sample"
        )
        self._terminal.ask(step, None, step.takes_s, lambda: None)

    def tell(self, text: str) -> None:
        echo(text, err=True)


def _content(entry: "QueueEntry") -> dict[str, object]:
    return {
        "number": entry.number,
        **entry.queued.model_dump(mode="json", by_alias=True),
        "status": entry.status,
        "states": [
            {
                "patch": state.patch,
                "state": state.number,
                "k_r_per_s": state.k_r_per_s.value,
                "k_r_per_s_sigma": state.k_r_per_s.sigma,
                "amplitude": state.amplitude.value,
                "amplitude_sigma": state.amplitude.sigma,
            }
            for state in entry.states
        ],
        "warnings": [each.to_dict() for each in entry.warnings],
    }


def _from(folder: Path, name: str, path: Path) -> str:
    """Return a shipped name, or the path of a file from the queue's folder if it is in there."""
    if not is_path(name):
        return name
    absolute = path.absolute()
    inside = absolute.is_relative_to(folder)
    return f"./{absolute.relative_to(folder).as_posix()}" if inside else str(absolute)
