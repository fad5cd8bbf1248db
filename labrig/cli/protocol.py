"""`labrig protocol` and `labrig driver`: shipped protocols, copies to be edited, new packages."""

from itertools import takewhile
from pathlib import Path
from typing import Annotated

import typer

from labrig.cli.completion import complete_protocol
from labrig.cli.screen import echo_table
from labrig.foundation.input_file import read_text

app = typer.Typer(help="The protocols that can be run.")


def protocol_path(protocol: str) -> Path:
    """Return the file of a protocol as given: a shipped name, or a path.

    Raises
    ------
    UsageError
        There is no such file, as of a protocol that a package adds without one.
    """
    from labrig.foundation import plugins, resources
    from labrig.foundation.errors import UsageError

    try:
        return resources.find("protocols", "protocol", protocol)
    except UsageError:
        if protocol in plugins.names(plugins.MEASUREMENTS):
            raise UsageError(
                f"the protocol '{protocol}' is of an installed package, which ships no file of it; "
                f"expected a file of yours with 'protocol: {protocol}' in it, such as "
                f"./{protocol}.yaml, got its name"
            ) from None
        raise


@app.command("list")
def list_protocols() -> None:
    """List the shipped protocol files and what each of them measures.

    Protocols of installed packages, which have no shipped file, come last.
    """
    from labrig.acquire import read_protocol
    from labrig.foundation import plugins, resources
    from labrig.foundation.errors import UsageError

    rows, shipped = [], set()
    for path in resources.names("protocols").values():
        model = read_protocol(path)
        shipped.add(model.protocol)
        other = "" if path.stem == model.protocol else f" (protocol {model.protocol})"
        rows.append((path.stem, _summary(read_text(path)) + other))
    for name in plugins.names(plugins.MEASUREMENTS):
        if name not in shipped:
            try:
                described = plugins.measurement(name).load("protocol").__doc__ or ""
            except UsageError as error:
                described = str(error)
            first = described.strip().partition("\n")[0]
            rows.append((name, f"{first} (of an installed package, without a file)"))
    echo_table(("protocol", "measures"), rows)


def _summary(text: str) -> str:
    """Return the first sentence of the comment that a protocol file begins with."""
    comment = takewhile(lambda line: line.startswith("#"), text.splitlines())
    whole = " ".join(line.removeprefix("#").strip() for line in comment)
    return whole.partition(". ")[0].removesuffix(".") + "."


@app.command("new")
def new_protocol(
    name: Annotated[
        str,
        typer.Argument(
            help="A shipped protocol, see 'labrig protocol list'; with --python a new name.",
            autocompletion=complete_protocol,
        ),
    ],
    file: Annotated[
        Path | None,
        typer.Argument(
            help="Path of the new file; with --python of the new folder.",
            show_default="./my-NAME.yaml, with --python ./NAME",
        ),
    ] = None,
    python: Annotated[
        bool, typer.Option("--python", help="Create a package with a protocol of your own.")
    ] = False,
) -> None:
    """Create a commented protocol file to change; nothing is overwritten.

    With --python: a package with a protocol, its analysis and its result, and their test.
    """
    if python:
        _new_package(name, file or Path(name))
    else:
        _new_file(name, file or Path(f"my-{name}.yaml"))


def _new_package(name: str, folder: Path) -> None:
    from labrig.package_template import create_package

    create_package("protocol", name, folder)
    typer.echo(f'{folder} is yours to change; then: pip install -e "{folder.resolve()}[test]"')


def _new_file(name: str, path: Path) -> None:
    from labrig.foundation.errors import UsageError
    from labrig.foundation.output_file import write_text

    text = read_text(protocol_path(name))
    if path.exists() or path.is_symlink():
        raise UsageError(f"{path} is there already; give the new file another name")
    write_text(path, text)
    place = path if path.is_absolute() else f"./{path}"
    typer.echo(f"{path} is yours to change; then: labrig plan {place} --rig sim")


@app.callback()
def protocols() -> None:
    """The protocols that can be run."""


driver_app = typer.Typer(help="Drivers of devices that labrig does not have.")


@driver_app.callback()
def drivers() -> None:
    """Drivers of devices that labrig does not have."""


@driver_app.command("new")
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
