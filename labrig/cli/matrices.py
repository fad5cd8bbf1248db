"""Options of commands that read re-radiation matrices, and the reading itself."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from labrig.material import Material, ReradiationMatrix

#: Lights under which colours are described unless others are asked for.
LIGHTS = ("D65", "A", "450nm")
YAML = (".yaml", ".yml")

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
    from labrig import resources
    from labrig.errors import UsageError
    from labrig.material import read_fluorescent, read_material, read_reradiation
    from labrig.yaml_file import read_yaml

    path = Path(file)
    if path.suffix and path.suffix.lower() not in YAML:
        return read_reradiation(path, entry, pixel=_pixel(pixel))
    for option, value in (("--entry", entry), ("--pixel", pixel)):
        if value is not None:
            raise UsageError(f"{option}: expected a file of matrices, got a material file")
    found = resources.find("config/materials", "material", file)
    is_fluorescent = read_yaml(found).get("kind") == "fluorescent"
    return read_fluorescent(found) if is_fluorescent else read_material(found)


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


def _pixel(text: str | None) -> tuple[int, int] | None:
    from labrig.errors import UsageError

    if text is None:
        return None
    parts = text.split(",")
    if len(parts) != 2 or not all(part.strip().isdecimal() for part in parts):
        raise UsageError(f"--pixel: expected column and row such as 10,20, got '{text}'")
    return int(parts[0]), int(parts[1])


def with_sigma(matrix: "ReradiationMatrix", corrected: bool) -> "ReradiationMatrix":
    """Return the matrix with σ as far as it tells it, and corrected if that is asked for."""
    from labrig import material
    from labrig.errors import DataError

    if corrected:
        return material.corrected(matrix)
    if matrix.reradiation_sigma is not None or matrix.unit == "relative":
        return matrix
    try:
        return material.with_sigma(matrix)
    except DataError:
        return matrix  # without its anti-Stokes side, or made by a computer
