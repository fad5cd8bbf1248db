"""`labrig rig new`: a rig file made in a dialogue, or by options alone."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from labrig.cli.completion import complete_rig
from labrig.cli.screen import echo
from labrig.foundation.activity import activity
from labrig.foundation.errors import DeviceError, LabrigError, UsageError

if TYPE_CHECKING:
    from labrig.setup import Candidate, Dialogue, NewRig


def new(
    file: Annotated[Path, typer.Argument(help="Path of the new file.")] = Path("my-rig.yaml"),
    name: Annotated[
        str | None, typer.Option("--name", help="Name of the bench, for reports.")
    ] = None,
    set_keys: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="A key of a device, such as lamp.relay=2 or door.open='1900 us', which is then "
            "not asked for; may be given again.",
        ),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option("--without", help="A device to leave out, such as door; may be given again."),
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="Ask nothing: take what is found, and the defaults.")
    ] = False,
    no_check: Annotated[
        bool, typer.Option("--no-check", help="Connect to nothing, move and measure nothing.")
    ] = False,
    simulated: Annotated[
        str | None,
        typer.Option(
            "--simulated",
            help="Make it for the devices of a simulated rig, such as 'sim'.",
            autocompletion=complete_rig,
        ),
    ] = None,
) -> None:
    """Make a rig file: find boards and cameras, ask, find the ends of the door, measure lags.

    The lamp is lit for a second, door and shield move, the camera takes some frames, as in 'labrig
    rig check'. Nothing is overwritten.
    """
    from labrig.foundation.output_file import write_text
    from labrig.setup import NewRig, Unattended, choose_devices, measure, set_up

    if file.exists() or file.is_symlink():
        raise UsageError(f"{file} is there already; give the new file another name")
    room = None if simulated is None else _room(simulated)
    dialogue = Unattended(typer.echo) if yes else Terminal()
    given = _given(set_keys or [])
    connected = _connected(room, dialogue)
    bench_name = name or dialogue.ask("name of the bench", "my bench")
    rig = choose_devices(
        NewRig(bench_name, simulated=room), connected, given, without or [], dialogue, str(file)
    )
    if not rig.devices:
        raise UsageError(
            "no device was found or chosen, so that there is nothing to write; plug the boards in "
            "('labrig rig devices' shows them), name one (--set lamp.driver=numato --set "
            "lamp.address=COM3), or try it with --simulated sim"
        )
    if no_check or not dialogue.confirm("Connect now? The lamp flashes, door and camera move."):
        write_text(file, rig.text())
        _tell_next(file, rig)
        return
    try:
        if not yes:
            rig = set_up(rig, dialogue, str(file))
        with activity("measuring the devices"):
            rig, report = measure(rig, str(file))
    except LabrigError as error:
        write_text(file, rig.text())  # what was answered is kept
        error.args = (f"{error}; {file} is written, without what could not be measured",)
        raise
    write_text(file, rig.text())
    _tell_next(file, rig)
    if failed := (*report.failures, *report.refusals):
        raise DeviceError(f"{file} is written, with devices to look at: {'; '.join(failed)}")


def _room(name: str) -> dict[str, Any]:
    """Return the content of the rig file of a simulated room, as it was written."""
    from labrig.acquire import read_rig_file
    from labrig.foundation import resources
    from labrig.foundation.yaml_file import read_yaml

    path = resources.find("config", "rig", name)
    if read_rig_file(path).simulation is None:
        raise UsageError(f"{path}: expected a simulated rig, this one has no 'simulation:'")
    return read_yaml(path)


def _given(set_keys: list[str]) -> dict[str, dict[str, Any]]:
    """Return the keys of `--set`, by devices."""
    from labrig.foundation.yaml_file import parse_yaml

    given: dict[str, dict[str, Any]] = {}
    for each in set_keys:
        place, equals, value = each.partition("=")
        role, dot, key = place.partition(".")
        if not (equals and dot and key):
            raise UsageError(
                f"--set: expected DEVICE.KEY=VALUE, such as lamp.relay=2, got '{each}'"
            )
        given.setdefault(role, {})[key] = parse_yaml(f"value: {value}", "--set")["value"]
    return given


def _connected(room: dict[str, Any] | None, dialogue: "Dialogue") -> "list[Candidate]":
    from labrig.foundation import plugins
    from labrig.setup import Host, candidates, discover, simulated_candidates

    if room is not None:
        return simulated_candidates(room)
    discovery = discover(Host.of_this_pc(), plugins.names(plugins.DRIVERS))
    for note in discovery.notes:
        dialogue.tell(f"! {note}")
    return candidates(discovery)


def _tell_next(file: Path, made: "NewRig") -> None:
    from labrig.acquire import plan, planned_rig, read_protocol, read_rig_file
    from labrig.foundation import resources

    place = file if file.is_absolute() else f"./{file}"
    typer.echo(f"{file} is written, and yours to change")
    for line in made.unmeasured():
        echo(line)
    rig = read_rig_file(file)
    try:
        with activity("planning a decay"):
            decay = read_protocol(resources.names(resources.PROTOCOLS)["decay"])
            adapted, _ = decay.adapted_to(planned_rig(rig, str(file)), chosen=())
            plan(adapted, rig, str(file))
    except LabrigError as error:
        echo(f"! a decay cannot run on it yet: {error}")
    else:
        typer.echo(f"a decay: labrig plan decay --rig {place}, then labrig run")
    typer.echo(f"after a change: labrig rig check {place}")
    typer.echo(f"as the default of all commands: labrig rig use {place}")


class Terminal:
    """The person at the terminal, or a pipe with answers."""

    is_person = True

    def tell(self, text: str) -> None:
        """Print a text."""
        echo(text)

    def ask(self, question: str, default: str) -> str:
        """Return a line; the default if it is empty."""
        shown = f" [{default}]" if default else ""
        while True:
            print(f"{question}{shown}: ", end="", flush=True)
            if answer := self._line().strip() or default:
                return answer

    def confirm(self, question: str) -> bool:
        """Return whether the answer is not no."""
        while True:
            print(f"{question} [Y/n] ", end="", flush=True)
            answer = self._line().strip().lower()
            if answer in ("", "y", "yes", "n", "no"):
                return answer not in ("n", "no")

    def key(self) -> str:
        """Wait for a key; a pipe gives one character after another."""
        if sys.stdin.isatty():
            return str(typer.getchar())
        return self._answered(sys.stdin.read(1))

    def _line(self) -> str:
        return self._answered(sys.stdin.readline())

    def _answered(self, text: str) -> str:
        if not text:
            raise UsageError(
                "nobody can answer here (the input has ended); run labrig in a terminal, or give "
                "--yes and --set"
            )
        return text
