"""Options of the commands that serve a page to a browser on this PC."""

from collections.abc import Callable
from typing import Annotated

import typer

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
