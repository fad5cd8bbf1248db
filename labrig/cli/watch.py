"""`labrig watch`: display of a run in the browser while it is recorded."""

from pathlib import Path
from typing import Annotated

import typer

from labrig.cli.completion import complete_run
from labrig.cli.page import NoBrowserOption, PortOption, announcing


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
