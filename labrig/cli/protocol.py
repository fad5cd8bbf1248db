"""`labrig protocol`: shipped protocols, and copies of them to be edited."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="The protocols that can be run.")


@app.command("list")
def list_protocols() -> None:
    """Shipped protocol files and what each of them does."""
    from labrig import resources
    from labrig.acquire import read_protocol

    for path in resources.names("protocols").values():
        model = read_protocol(path)
        summary = path.read_text(encoding="utf-8").splitlines()[0].removeprefix("#").strip()
        typer.echo(f"{path.stem:16} ({model.protocol})  {summary}")


@app.command("new")
def new_protocol(
    name: Annotated[str, typer.Argument(help="A shipped protocol, see 'labrig protocol list'.")],
    file: Annotated[
        Path | None, typer.Argument(help="Where to put it.", show_default="./my-NAME.yaml")
    ] = None,
) -> None:
    """Put a commented protocol file in place, to be changed; nothing is overwritten."""
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
