"""`labrig rig view`: live view in the browser, to aim, focus and draw regions."""

from pathlib import Path
from typing import Annotated

import typer

from labrig.cli.default_rig import RigArgument, rig_path
from labrig.cli.page import NoBrowserOption, PortOption, announcing


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
