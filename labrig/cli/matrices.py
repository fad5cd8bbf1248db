"""Options of commands that read re-radiation matrices, and the reading itself."""

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from labrig.material import Material, ReradiationMatrix

#: Lights under which colours are described unless others are asked for.
LIGHTS = ("D65", "A", "450nm")

File = Annotated[
    str,
    typer.Argument(
        help="A material file (.yaml), a shipped material, or a re-radiation matrix: Labsphere "
        ".BFC, .csv, ART .ark, spectral .exr, EEM .txt."
    ),
]
Entry = Annotated[str | None, typer.Option("--entry", help="Matrix of an archive with several.")]
Pixel = Annotated[
    str | None, typer.Option("--pixel", help="Column and row of an image's pixel, such as 10,20.")
]
Corrected = Annotated[
    bool,
    typer.Option(
        "--corrected",
        help="Without the offset of each column and without bandpass spill, as an instrument's "
        "anti-Stokes side tells them.",
    ),
]
Lights = Annotated[
    list[str] | None,
    typer.Option(
        "--light",
        help="A CIE illuminant such as D65, a narrow light such as 450nm, or a file with a "
        f"spectrum. Repeatable; default: {', '.join(LIGHTS)}.",
    ),
]


def read_any(file: str, entry: str | None, pixel: str | None) -> "Material | ReradiationMatrix":
    """Read a phosphor or a fluorescent material from any of its files."""
    from labrig.material import read_any_material

    return read_any_material(file, entry, pixel=_pixel(pixel))


def read_matrix(
    file: str, entry: str | None = None, pixel: str | None = None
) -> "ReradiationMatrix":
    """Read a fluorescent material from any of its files."""
    from labrig.errors import UsageError
    from labrig.material import ReradiationMatrix

    material = read_any(file, entry, pixel)
    if not isinstance(material, ReradiationMatrix):
        raise UsageError(f"{file}: expected a fluorescent material, got a phosphor")
    return material


def read_fractions(file: str) -> "ReradiationMatrix":
    """Read a fluorescent material in absolute units: a relative one has no colours."""
    from labrig.errors import UsageError

    matrix = read_matrix(file)
    if matrix.unit == "relative":
        raise UsageError(
            f"{file}: expected fractions of the incident light, got relative re-radiation; give a "
            "matrix in absolute units"
        )
    return matrix


def _pixel(text: str | None) -> tuple[int, int] | None:
    from labrig.errors import UsageError

    if text is None:
        return None
    parts = text.split(",")
    if len(parts) != 2 or not all(part.strip().isdecimal() for part in parts):
        raise UsageError(f"--pixel: expected column and row such as 10,20, got '{text}'")
    return int(parts[0]), int(parts[1])


def checked(file: str, matrix: "ReradiationMatrix", is_corrected: bool) -> "ReradiationMatrix":
    """Return a matrix with σ as far as it tells it, and corrected if that is asked for.

    What no surface can do, beyond that σ, is refused, and what few can is told on standard error.
    """
    from labrig.errors import DataError
    from labrig.material import physical_warnings

    try:
        matrix = _corrected(matrix) if is_corrected else _with_sigma(matrix)
        warnings = physical_warnings(matrix)
    except DataError as error:
        raise DataError(f"{file}: {error}") from None
    for warning in warnings:
        typer.echo(f"warning: {warning}", err=True)
    return matrix


def _corrected(matrix: "ReradiationMatrix") -> "ReradiationMatrix":
    from labrig.material import corrected

    return corrected(matrix)


def _with_sigma(matrix: "ReradiationMatrix") -> "ReradiationMatrix":
    from labrig.errors import DataError
    from labrig.material import with_sigma

    if matrix.reradiation_sigma is not None or matrix.unit == "relative":
        return matrix
    try:
        return with_sigma(matrix)
    except DataError:
        return matrix  # without its anti-Stokes side, or made by a computer
