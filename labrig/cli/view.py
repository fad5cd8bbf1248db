"""`labrig rig view`: live view in the browser, to aim, focus and draw regions."""

from pathlib import Path
from typing import Annotated

import typer

from labrig.cli.default_rig import RigArgument, rig_path


def view(
    rig: RigArgument = None,
    protocol: Annotated[
        Path | None,
        typer.Option("--protocol", help="Your protocol file; regions are written into it."),
    ] = None,
    port: Annotated[
        int, typer.Option("--port", help="On 127.0.0.1; 0 for any free one.", min=0, max=65535)
    ] = 0,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Only print the page's address.")
    ] = False,
) -> None:
    """Live view for aiming and focus, regions drawn into a protocol. Ctrl-C ends it."""
    from labrig.setup import view_rig

    def tell(url: str) -> None:
        typer.echo(url)
        if not no_browser:
            import webbrowser

            webbrowser.open(url)

    view_rig(rig_path(rig), protocol, port, tell)
