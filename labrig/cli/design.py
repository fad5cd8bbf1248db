"""`labrig design`: the material that glows as someone wants it to."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from labrig.material import Material


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
    from labrig.design import nearest_materials, read_wish, solve_in_scene, to_material
    from labrig.report import (
        describe_design,
        describe_energy,
        describe_scene_design,
        draw_design,
        draw_scene_design,
    )

    wish = read_wish(constraints)
    if wish.scene is not None:
        in_scene = solve_in_scene(wish)
        typer.echo(describe_scene_design(in_scene))
        if nearest:
            typer.echo("--nearest is for a light programme, not for a scene", err=True)
        if out is not None:
            _write(in_scene.material, out)
        if picture is not None:
            draw_scene_design(in_scene, picture)
            typer.echo(f"drawn into {picture}")
        return
    wished = wish.solve()
    found = wished if wished.keeps_energy else wish.solve("kept")
    measured = [each for each in nearest_materials(found) if each] if nearest else []
    typer.echo(describe_design(found, wish.places, measured))
    if found is not wished:
        typer.echo(describe_energy(wished))
    if out is not None:
        _write(to_material(found, wish.file.name), out)
    if picture is not None:
        draw_design(found, wish.places, picture)
        typer.echo(f"drawn into {picture}")


def _write(material: "Material", path: Path) -> None:
    from labrig.errors import DiskError
    from labrig.material import write_material

    try:
        write_material(path, material)
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None
    typer.echo(f"written: {path}")
