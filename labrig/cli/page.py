"""`labrig watch` and `labrig rig view`: pages that are served to a browser on this PC."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated

import typer

from labrig.cli.completion import complete_run
from labrig.cli.default_rig import RigArgument, rig_path
from labrig.cli.screen import echo
from labrig.foundation.activity import activity
from labrig.foundation.clock import SystemClock

PortOption = Annotated[
    int, typer.Option("--port", help="On 127.0.0.1; 0 for any free one.", min=0, max=65535)
]
NoBrowserOption = Annotated[
    bool, typer.Option("--no-browser", help="Only print the page's address.")
]


@contextmanager
def announcing(no_browser: bool) -> Iterator[Callable[[str], None]]:
    """Yield what prints the address of a page and opens it in a browser, unless told not to.

    Until then the page is being made ready, which is work that takes long.
    """
    with ExitStack() as making_ready:
        making_ready.enter_context(activity("making the page ready"))

        def announce(url: str) -> None:
            making_ready.close()
            echo(url)
            if not no_browser:
                import webbrowser

                webbrowser.open(url)

        yield announce


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
    with announcing(no_browser) as announce:
        from labrig.setup import view_rig

        view_rig(rig_path(rig), protocol, port, announce)


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
    with announcing(no_browser) as announce:
        from labrig.catalogue import find_run
        from labrig.watch import watch_run

        watch_run(find_run(run, runs), port, SystemClock(), announce)
