"""`labrig protocol`: shipped protocols, and copies of them to be edited."""

from itertools import takewhile
from pathlib import Path
from typing import Annotated

import typer

from labrig.cli.completion import complete_protocol

app = typer.Typer(help="The protocols that can be run.")


@app.command("list")
def list_protocols() -> None:
    """List the shipped protocol files and what each of them measures."""
    from rich.console import Console
    from rich.table import Table

    from labrig import resources
    from labrig.acquire import read_protocol

    table = Table(box=None, pad_edge=False)
    for title in ("file", "protocol", "measures"):
        table.add_column(title, no_wrap=title != "measures")
    for path in resources.names("protocols").values():
        model = read_protocol(path)
        table.add_row(path.stem, model.protocol, _summary(path.read_text(encoding="utf-8")))
    Console().print(table)


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
            help="A shipped protocol, see 'labrig protocol list'.",
            autocompletion=complete_protocol,
        ),
    ],
    file: Annotated[
        Path | None, typer.Argument(help="Path of the new file.", show_default="./my-NAME.yaml")
    ] = None,
) -> None:
    """Create a commented protocol file to change; nothing is overwritten."""
    from labrig import resources
    from labrig.errors import DiskError, UsageError

    text = resources.find("protocols", "protocol", name).read_text(encoding="utf-8")
    path = file or Path(f"my-{name}.yaml")
    try:
        with path.open("x", encoding="utf-8", newline="\n") as new:
            new.write(text)
    except FileExistsError:
        raise UsageError(f"{path} is there already; give the new file another name") from None
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None
    place = path if path.is_absolute() else f"./{path}"
    typer.echo(f"{path} is yours to change; then: labrig plan {place} --rig sim")


@app.callback()
def protocols() -> None:
    """The protocols that can be run."""
