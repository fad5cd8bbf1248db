"""`labrig rig`: discovery of devices and check of a rig."""

import logging
import sys
from collections import Counter
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from labrig.cli import default_rig, new_rig, page
from labrig.cli.default_rig import RigArgument, rig_path
from labrig.cli.detachable_stream import DetachableStream
from labrig.cli.screen import echo
from labrig.cli.wording import counted
from labrig.foundation.errors import DeviceError, ProtocolError

if TYPE_CHECKING:
    from labrig.setup import Discovery, RigReport

app = typer.Typer(help="The devices of a bench.")

_STYLES: dict[str, dict[str, Any]] = {
    "refuse": {"fg": "red"},
    "failed": {"fg": "red"},
    "warn": {"fg": "yellow"},
    "fine": {"fg": "green"},
}
_TROUBLES = {"failed": "failure", "refuse": "refused setting", "warn": "warning"}


@app.callback()
def rigs() -> None:
    """The devices of a bench."""


@app.command("devices")
def list_devices(
    json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """Serial ports, USB cameras and spectrometers on this PC, each with its line for a rig file.

    Names programs that may hold a camera, and how to end them. Nothing is switched or sent.
    """
    from dataclasses import asdict
    from json import dumps

    from labrig.foundation import plugins
    from labrig.foundation.activity import activity
    from labrig.setup import Host, discover

    with activity("looking for devices"):
        discovery = discover(Host.of_this_pc(), plugins.names(plugins.DRIVERS))
    if json:
        typer.echo(dumps(asdict(discovery)))
    else:
        _print_discovery(discovery)


@app.command("check")
def check(
    rig: RigArgument = None,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose", help="Print every command to a device and its answer with the time."
        ),
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """Connect, identify, look for settings that spoil photometry, exercise gently, leave safe.

    Lights are lit some times, well under a second each; door and shield go there and back once;
    the camera takes three short frames and a dark one of 2 s. Do it in the dark. Exit code 0:
    fine, 2: a setting has to be changed first, 3: a device failed.
    """
    from json import dumps

    from labrig.acquire import read_rig_file
    from labrig.bench import logging_to, open_bench
    from labrig.foundation.activity import activity
    from labrig.setup import check_rig

    path = rig_path(rig)
    with activity("checking the rig"), open_bench(read_rig_file(path), str(path)) as bench:
        handler = logging.StreamHandler(DetachableStream(sys.stderr))
        with logging_to(handler, bench.clock) if verbose else nullcontext():
            report = check_rig(bench)
    if json:
        typer.echo(dumps(report.to_json()))
    else:
        _print_report(report)
    _raise_failures(report, path)


app.command("new")(new_rig.new)
app.command("view")(page.view)
app.command("use")(default_rig.use)


def _print_discovery(discovery: "Discovery") -> None:
    groups = [("serial ports", discovery.ports), ("USB cameras", discovery.cameras)]
    if discovery.spectrometers:
        groups.append(("USB spectrometers", discovery.spectrometers))
    for title, devices in groups:
        typer.echo(f"{title}:" if devices else f"{title}: none")
        for device in devices:
            typer.echo(f"  {device.address}  {device.name}")
            for hint in device.hints:
                typer.echo(f"    ! {hint}")
    for note in discovery.notes:
        typer.echo(f"! {note}")
    snippets = [device.snippet for _, devices in groups for device in devices if device.snippet]
    if snippets:
        typer.echo("\na rig file:\n\nname: my bench\n\ndevices:")
    roles: set[str] = set()
    for snippet in snippets:
        role = snippet.partition(":")[0]
        typer.echo(f"  {'# ' if role in roles else ''}{snippet}")  # a role has one device
        roles.add(role)


def _print_report(report: "RigReport") -> None:
    """Print the verdict, then each device with its settings and measured times."""
    rows = list(report.rows())
    assessed = Counter(assessment for _, assessment, _, _ in rows)
    troubles = [counted(assessed[kind], noun) for kind, noun in _TROUBLES.items() if assessed[kind]]
    echo(f"{report.rig}: {', '.join(troubles) or 'all is fine'}", bold=True)
    for device, assessment, what, value in rows:
        text = f"{what.removesuffix(':')}: {value}" if value else what
        if device:
            echo(f"\n{device}: {text}", bold=True, **_STYLES.get(assessment, {}))
        else:
            echo(f"  {assessment:6}  {text}", **_STYLES.get(assessment, {}))


def _raise_failures(report: "RigReport", path: Path) -> None:
    if report.failures:
        raise DeviceError(f"{path}: {'; '.join(report.failures)}")
    if report.refusals:
        raise ProtocolError(f"{path}: this would spoil photometry: {'; '.join(report.refusals)}")
