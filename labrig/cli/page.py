"""`labrig watch` and `labrig rig view`: pages that are served to a browser on this PC."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from labrig.cli.completion import complete_run
from labrig.cli.default_rig import RigArgument, rig_path

PortOption = Annotated[
    int, typer.Option("--port", help="On 127.0.0.1; 0 for any free one.", min=0, max=65535)
]
NoBrowserOption = Annotated[
    bool, typer.Option("--no-browser", help="Only print the page's address.")
]


def announcing(no_browser: bool) -> Callable[[str], None]:
    """Return what prints the address of a page and opens it in a browser, unless told not to."""

    def announce(url: str) -> None:
        typer.echo(url)
        if not no_browser:
            import webbrowser

            webbrowser.open(url)

    return announce


def view(
    rig: RigArgument = None,
    protocol: Annotated[
        Path | None,
        typer.Option("--protocol", help="Your protocol file; regions are written into it."),
    ] = None,
    port: PortOption = 0,
    no_browser: NoBrowserOption = False,
) -> None:
    """Live view for aiming and focus, regions drawn into a protocol. Ctrl-C ends it."""
    from labrig.setup import view_rig

    view_rig(rig_path(rig), protocol, port, announcing(no_browser))


def watch(
    run: Annotated[
        Path,
        typer.Argument(
            help="A run folder, the beginning of its name, or 'last'.", autocompletion=complete_run
        ),
    ] = Path("last"),
    runs: Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")] = Path("runs"),
    port: PortOption = 0,
    no_browser: NoBrowserOption = False,
) -> None:
    """A page for the screen outside the dark room: live decay, timeline, state. Ctrl-C ends it."""
    from labrig.catalogue import find_run
    from labrig.foundation.clock import SystemClock
    from labrig.foundation.signals import interrupting
    from labrig.watch import watch_run

    clock = SystemClock()
    with interrupting(clock):
        watch_run(find_run(run, runs), port, clock, announcing(no_browser))
