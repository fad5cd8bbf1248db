"""`labrig optics`: measured curves of cameras, lamps and filters."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="Curves of cameras, lamps and filters.", no_args_is_help=True)


@app.command("show")
def show(
    file: Annotated[str, typer.Argument(help="A file of curves, or a shipped camera.")],
    curve: Annotated[
        list[str] | None, typer.Option("--curve", help="Name of a curve; may be given again.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="File for a figure (.png, .svg, .pdf).")
    ] = None,
) -> None:
    """What is in a file of measured curves, and how they look."""
    from labrig.optics import read_checked_curves
    from labrig.report import describe_curves, draw_curves

    curves = read_checked_curves(file, curve)
    typer.echo(describe_curves(curves))
    if picture is not None:
        draw_curves(curves, picture)
        typer.echo(f"drawn into {picture}")


@app.command("list")
def list_() -> None:
    """Cameras, colour filters and other curves that are shipped."""
    from labrig.report import describe_shipped_curves

    typer.echo(describe_shipped_curves())
