"""`labrig design`: the material that glows as someone wants it to."""

from pathlib import Path
from typing import Annotated

import typer


def design(
    constraints: Annotated[
        Path,
        typer.Option(
            "--constraints",
            help="A .yaml that says how it should glow when, under which light (labrig schema "
            "design).",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", help="Material file to write (.yaml).")
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option("--picture", help="File for a figure over time (.png, .svg, .pdf)."),
    ] = None,
    nearest: Annotated[
        bool, typer.Option("--nearest", help="Name the nearest measured materials, too.")
    ] = False,
) -> None:
    """Find the phosphorescent material that glows as a file wants it to."""
    from labrig.design import nearest_materials, read_wish, to_material
    from labrig.errors import DiskError
    from labrig.material import write_material
    from labrig.report import describe_design, draw_design

    wish = read_wish(constraints)
    found = wish.solve()
    measured = [each for each in nearest_materials(found) if each] if nearest else []
    typer.echo(describe_design(found, wish.places, measured))
    if out is not None:
        try:
            write_material(out, to_material(found, wish.file.name))
        except OSError as error:
            raise DiskError(f"{out}: cannot be written ({error.strerror})") from None
        typer.echo(f"written: {out}")
    if picture is not None:
        draw_design(found, wish.places, picture)
        typer.echo(f"drawn into {picture}")
