"""`labrig design`: the material that glows as someone wants it to, on a page or from a file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labrig.cli.page import NoBrowserOption, PortOption, announcing
from labrig.cli.screen import echo
from labrig.foundation.activity import activity
from labrig.foundation.clock import SystemClock

if TYPE_CHECKING:
    from labrig.design import Wish
    from labrig.material import Material

NOT_IN_SCENES = "--nearest is for a light programme, not for a scene"


def design(
    scene: Annotated[
        str | None,
        typer.Argument(
            help="A scene file, or the name of a shipped scene, to design in. Default: a patch.",
        ),
    ] = None,
    material: Annotated[
        str | None,
        typer.Option(
            "--material", help="The material of the scene to design. Default: the one that glows."
        ),
    ] = None,
    constraints: Annotated[
        Path | None,
        typer.Option(
            "--constraints",
            help="A .yaml that says how it should glow when, under which light (labrig schema "
            "design): it is solved, and no page is opened.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="With --constraints: material file to write (.yaml)."),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            "--picture", help="With --constraints: file for a figure over time (.png, .svg, .pdf)."
        ),
    ] = None,
    nearest: Annotated[
        bool,
        typer.Option(
            "--nearest", help="With --constraints: name the nearest measured materials, too."
        ),
    ] = False,
    begin_with: Annotated[
        Path | None,
        typer.Option("--open", help="A .yaml of wishes with which the page begins."),
    ] = None,
    port: PortOption = 0,
    no_browser: NoBrowserOption = False,
) -> None:
    """Find the phosphorescent material that glows as you want it to: on a page, or from a file."""
    from labrig.foundation.errors import UsageError

    if constraints is not None:
        for_page = {"SCENE": scene, "--material": material, "--open": begin_with, "--port": port}
        if given := [name for name, value in for_page.items() if value]:
            raise UsageError(
                f"expected --constraints without {', '.join(given)}: the file says in which scene; "
                "without --constraints a page is opened"
            )
        with activity("designing"):
            _solve(constraints, out, picture, nearest)
        return
    if out is not None or picture is not None or nearest:
        raise UsageError(
            "expected --constraints with --out, --picture and --nearest, got none; on the page the "
            "same is behind its buttons"
        )
    if material is not None and scene is None and begin_with is None:
        raise UsageError("expected a scene with --material, got none: labrig design SCENE")
    _serve(begin_with, scene, material, port, no_browser)


def _serve(
    begin_with: Path | None, scene: str | None, material: str | None, port: int, no_browser: bool
) -> None:
    with announcing(no_browser) as announce:
        from labrig.studio import design_on_page

        design_on_page(begin_with, scene, material, port, SystemClock(), announce)


def _solve(constraints: Path, out: Path | None, picture: Path | None, nearest: bool) -> None:
    from labrig.design import (
        nearest_materials,
        read_wish,
        solve_in_scene,
        to_material,
        written_factor,
    )
    from labrig.foundation.errors import DiskError, UsageError
    from labrig.report import (
        describe_design,
        describe_energy,
        describe_factor,
        describe_scene_design,
        draw_design,
        draw_scene_design,
        require_picture,
    )

    for path in (out, picture):
        if path is not None and not path.absolute().parent.is_dir():
            raise DiskError(f"{path}: cannot be written (there is no such folder)")
    if picture is not None:
        require_picture(picture)
    wish = read_wish(constraints)
    if wish.file.scene is not None and wish.file.scene.spread is not None:
        _spread(wish, constraints.parent, out, picture, nearest)
        return
    if wish.scene is not None:
        if nearest:
            raise UsageError("expected --nearest with a light programme, got a scene")
        in_scene = solve_in_scene(wish)
        echo(describe_scene_design(in_scene))
        if out is not None:
            if weaker := describe_factor(written_factor(in_scene.design, in_scene.spectra)):
                echo(f"! {weaker}")
            _write(in_scene.material, out)
        if picture is not None:
            draw_scene_design(in_scene, picture)
            echo(f"drawn into {picture}")
        return
    wished, found = wish.solve_kept()
    measured = [each for each in nearest_materials(found) if each] if nearest else []
    echo(describe_design(found, wish.places, measured))
    if found is not wished and (cost := describe_energy(wished, found)):
        echo(cost)
    if out is not None:
        if weaker := describe_factor(written_factor(found)):
            echo(f"! {weaker}")
        _write(to_material(found, wish.file.name), out)
    if picture is not None:
        draw_design(found, wish.places, picture)
        echo(f"drawn into {picture}")


def _spread(
    wish: "Wish", folder: Path, out: Path | None, picture: Path | None, nearest: bool
) -> None:
    from labrig.design import solve_spread
    from labrig.report import describe_spread, draw_scene_design
    from labrig.reproduce import write_parameter_texture

    found = solve_spread(wish, folder)
    echo(describe_spread(found))
    if nearest:
        echo(NOT_IN_SCENES, err=True)
    if out is not None:
        texture = out.with_name(f"{out.stem}-texture.npz")
        _write(found.material, out)
        write_parameter_texture(texture, found.texture)
        echo(f"written: {texture}")
        echo(
            f"In the scene, beside both files:\nmaterials:\n  {found.light.material}: "
            f"{{file: {out.name}, texture: {texture.name}}}"
        )
    if picture is not None:
        draw_scene_design(found, picture)
        echo(f"drawn into {picture}")


def _write(material: "Material", path: Path) -> None:
    from labrig.foundation.errors import DiskError
    from labrig.material import write_material

    try:
        write_material(path, material)
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None
    echo(f"written: {path}")
