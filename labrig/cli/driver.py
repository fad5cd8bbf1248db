"""`labrig driver`: packages for drivers of a person's own."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="Drivers of devices that labrig does not have.")


@app.callback()
def drivers() -> None:
    """Drivers of devices that labrig does not have."""


@app.command("new")
def new_driver(
    name: Annotated[str, typer.Argument(help="Name of the driver, such as 'my_board'.")],
    folder: Annotated[
        Path | None, typer.Argument(help="New folder of the package.", show_default="./NAME")
    ] = None,
) -> None:
    """Create a package with a commented driver and its test; nothing is overwritten.

    A board that reads and answers lines needs none: see the driver 'serial_relay'.
    """
    from labrig.package_template import create_package

    path = folder or Path(name)
    create_package("driver", name, path)
    typer.echo(f'{path} is yours to change; then: pip install -e "{path.resolve()}[test]"')
