"""`labrig material`: material files and measured re-radiation matrices."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labrig.cli.screen import echo
from labrig.foundation.result_warning import warning_lines

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from labrig.material import Material, MatrixLayout, ReradiationMatrix

#: Most wavelengths that an option states, and how far the last may be from a step, in nm.
_MAX_STEPS, _ROUNDING_NM = 10_000, 1e-6
#: Lights under which colours are described unless others are asked for.
LIGHTS = ("D65", "A", "450nm")

File = Annotated[
    str,
    typer.Argument(
        help="A material file (.yaml), a shipped material, or a re-radiation matrix: Labsphere "
        ".BFC, .csv, ART .ark, spectral .exr, or an excitation-emission matrix (.txt, .csv, .dat)."
    ),
]
Entry = Annotated[str | None, typer.Option("--entry", help="Matrix of an archive with several.")]
Pixel = Annotated[
    str | None, typer.Option("--pixel", help="Column and row of an image's pixel, such as 10,20.")
]
Rows = Annotated[
    str | None,
    typer.Option(
        "--rows",
        help="What the rows of an excitation-emission matrix are: emission or excitation; without "
        "it, by names or by the side that has the light.",
    ),
]
Excitation = Annotated[
    str | None,
    typer.Option(
        "--excitation",
        help="Excitation wavelengths in nm of emission spectra one below the other, which the file "
        "does not have: first, last and step, such as 230:450:5.",
    ),
]
Corrected = Annotated[
    bool,
    typer.Option(
        "--corrected",
        help="Without the offset of each column and without bandpass spill, as an instrument's "
        "anti-Stokes side shows them.",
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


def read_any(
    file: str,
    entry: str | None,
    pixel: str | None,
    rows: str | None = None,
    excitation: str | None = None,
) -> "Material | ReradiationMatrix":
    """Read a phosphor or a fluorescent material from any of its files."""
    from labrig.material import read_any_material

    layout = _layout(rows, excitation)
    return read_any_material(file, entry, pixel=_pixel(pixel), layout=layout)


def read_matrix(
    file: str,
    entry: str | None = None,
    pixel: str | None = None,
    rows: str | None = None,
    excitation: str | None = None,
) -> "ReradiationMatrix":
    """Read a fluorescent material from any of its files."""
    from labrig.foundation.errors import UsageError
    from labrig.material import ReradiationMatrix

    material = read_any(file, entry, pixel, rows, excitation)
    if not isinstance(material, ReradiationMatrix):
        raise UsageError(f"{file}: expected a fluorescent material, got a phosphor")
    return material


def read_fractions(file: str) -> "ReradiationMatrix":
    """Read a fluorescent material in absolute units: a relative one has no colours."""
    from labrig.foundation.errors import UsageError

    matrix = read_matrix(file)
    if matrix.unit == "relative":
        raise UsageError(
            f"{file}: expected fractions of the incident light, got relative re-radiation; give a "
            "matrix in absolute units"
        )
    return matrix


def _pixel(text: str | None) -> tuple[int, int] | None:
    from labrig.foundation.errors import UsageError

    if text is None:
        return None
    parts = text.split(",")
    if len(parts) != 2 or not all(part.strip().isdecimal() for part in parts):
        raise UsageError(f"--pixel: expected column and row such as 10,20, got '{text}'")
    return int(parts[0]), int(parts[1])


def _layout(rows: str | None, excitation: str | None) -> "MatrixLayout | None":
    from labrig.foundation.errors import UsageError
    from labrig.material import MatrixLayout

    if rows is None and excitation is None:
        return None
    if rows not in (None, "emission", "excitation"):
        raise UsageError(f"--rows: expected emission or excitation, got '{rows}'")
    excitation_nm = None if excitation is None else _steps_nm(excitation)
    return MatrixLayout(rows, excitation_nm)  # type: ignore[arg-type]


def _steps_nm(text: str) -> "npt.NDArray[np.float64]":
    import numpy as np

    from labrig.foundation.errors import UsageError

    expected = f"--excitation: expected first, last and step such as 230:450:5, got '{text}'"
    try:
        first, last, step = map(float, text.split(":"))
    except ValueError:
        raise UsageError(expected) from None
    count = round((last - first) / step) if step else -1
    if not 1 <= count < _MAX_STEPS or abs(first + count * step - last) > _ROUNDING_NM:
        raise UsageError(expected)
    return first + step * np.arange(count + 1.0)


def checked(file: str, matrix: "ReradiationMatrix", is_corrected: bool) -> "ReradiationMatrix":
    """Return a matrix with σ as far as it tells it, and corrected if that is asked for.

    What no surface can do, beyond that σ, is refused, and what few can is told on standard error.
    """
    from labrig.foundation.errors import DataError
    from labrig.material import physical_warnings

    try:
        matrix = _corrected(matrix) if is_corrected else _with_sigma(matrix)
        warnings = physical_warnings(matrix)
    except DataError as error:
        raise DataError(f"{file}: {error}") from None
    for line in warning_lines(warnings, "warning: "):
        echo(line, err=True)
    return matrix


def _corrected(matrix: "ReradiationMatrix") -> "ReradiationMatrix":
    from labrig.material import corrected

    return corrected(matrix)


def _with_sigma(matrix: "ReradiationMatrix") -> "ReradiationMatrix":
    from labrig.foundation.errors import DataError
    from labrig.material import with_sigma

    if matrix.reradiation_sigma is not None or matrix.unit == "relative":
        return matrix
    try:
        return with_sigma(matrix)
    except DataError:
        return matrix  # without its anti-Stokes side, or made by a computer


app = typer.Typer(help="Materials: show, convert, light and compare them.", no_args_is_help=True)


@app.command("show")
def show(
    file: File,
    entry: Entry = None,
    pixel: Pixel = None,
    rows: Rows = None,
    excitation: Excitation = None,
    corrected: Corrected = False,
    light: Lights = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="File for a figure (.png, .svg, .pdf).")
    ] = None,
) -> None:
    """Show a material: its numbers, its colours, and a picture."""
    from labrig.material import Material
    from labrig.optics import read_light
    from labrig.report import (
        describe_phosphor,
        describe_reradiation,
        draw_phosphor,
        draw_reradiation,
    )

    material = read_any(file, entry, pixel, rows, excitation)
    if isinstance(material, Material):
        echo(describe_phosphor(material))
        if picture is not None:
            draw_phosphor(material, picture)
            echo(f"drawn into {picture}")
        return
    material = checked(file, material, corrected)
    lights = [read_light(name) for name in light or LIGHTS]
    echo(describe_reradiation(material, lights))
    if picture is not None:
        draw_reradiation(material, lights, picture)
        echo(f"drawn into {picture}")


@app.command("convert")
def convert(
    file: File,
    out: Annotated[
        Path,
        typer.Argument(
            help="File to write: .csv, .ark or .exr; .yaml writes a material file and the matrix "
            "beside it."
        ),
    ],
    entry: Entry = None,
    pixel: Pixel = None,
    rows: Rows = None,
    excitation: Excitation = None,
    corrected: Corrected = False,
) -> None:
    """Write a re-radiation matrix in another format."""
    from labrig.material import YAML, write_fluorescent, write_reradiation

    matrix = read_matrix(file, entry, pixel, rows, excitation)
    with_sigma = checked(file, matrix, corrected)
    if corrected:
        matrix = with_sigma
    if out.suffix.lower() in YAML:
        write_fluorescent(out, matrix)
    else:
        write_reradiation(out, matrix)
    echo(f"written: {out}")


@app.command("from-cubes")
def from_cubes(
    cubes: Annotated[
        Path,
        typer.Argument(
            help="A .yaml that names the hyperspectral images, one for each light, and the regions "
            "of sample and white."
        ),
    ],
    out: Annotated[
        Path,
        typer.Argument(
            help="File to write: .csv, .ark or .exr; .yaml writes a material file and the matrix "
            "beside it."
        ),
    ],
    lights_only: Annotated[
        bool,
        typer.Option(
            "--lights-only",
            help="One input band for each light; without it bands of 10 nm, between the lights "
            "interpolated.",
        ),
    ] = False,
) -> None:
    """Make a re-radiation matrix from hyperspectral images, one for each light.

    Images are ENVI files (.hdr), .npz or .npy.
    """
    from labrig.analyse import CubeList, matrix_from_cubes
    from labrig.foundation.yaml_file import read_model
    from labrig.material import YAML, write_fluorescent, write_reradiation

    columns, name = matrix_from_cubes(read_model(cubes, CubeList), cubes)
    matrix = columns.matrix(name) if lights_only else columns.interpolated(name)[0]
    checked(str(cubes), matrix, is_corrected=False)
    if out.suffix.lower() in YAML:
        write_fluorescent(out, matrix)
    else:
        write_reradiation(out, matrix)
    lights = ", ".join(f"{nm:.0f}" for nm in columns.input_nm)
    echo(f"{name}: {len(columns.lights)} lights at {lights} nm")
    echo(f"written: {out}")


@app.command("apply")
def apply(
    file: File,
    light: Annotated[
        str,
        typer.Option(
            "--light",
            help="A CIE illuminant such as D65, a narrow light such as 450nm, or a file with a "
            "spectrum.",
        ),
    ],
    entry: Entry = None,
    pixel: Pixel = None,
    rows: Rows = None,
    excitation: Excitation = None,
    corrected: Corrected = False,
    out: Annotated[Path | None, typer.Option("--out", help="CSV file to write.")] = None,
) -> None:
    """The light that comes back from a material under a light, as CSV.

    In the unit of the irradiance; of a perfect white all of it would be reflected.
    """
    from labrig.optics import read_light
    from labrig.text_table import table_text

    matrix = checked(file, read_matrix(file, entry, pixel, rows, excitation), corrected)
    returned = matrix.under(read_light(light))
    columns = {
        "wavelength_nm": returned.total.wavelength_nm,
        "reflected": returned.reflected.value,
        "reradiated": returned.reradiated.value,
        "total": returned.total.value,
    }
    if returned.total.sigma is not None:
        columns["total_sigma"] = returned.total.sigma
    numbers = zip(*(column.tolist() for column in columns.values()), strict=True)
    _write_lines(table_text(list(columns), numbers).splitlines(), out)


@app.command("compare")
def compare(
    file: File,
    reference: File,
    corrected: Corrected = False,
    light: Lights = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """Compare the colours of a fluorescent material with those of a reference.

    The white of ΔE2000 is a perfect white under the light; under a narrow light, where a
    fluorescent material is far brighter than any white, that of a screen (D65), with the reference
    at half its luminance.
    """
    from labrig.material import compare_colours
    from labrig.optics import read_light
    from labrig.report import difference_lines

    lights = [read_light(name) for name in light or LIGHTS]
    ours, theirs = (checked(path, read_fractions(path), corrected) for path in (file, reference))
    differences = compare_colours(ours, theirs, lights)
    if as_json:
        rows = [difference.to_dict() for difference in differences]
        typer.echo(json.dumps(rows, indent=1))
        return
    for line in difference_lines(differences):
        echo(line)


@app.command("list")
def list_materials(
    folder: Annotated[Path, typer.Argument(help="Folder of re-radiation matrices.")],
    picture: Annotated[
        Path | None, typer.Option("--picture", help="File for a sheet of all (.png, .svg, .pdf).")
    ] = None,
) -> None:
    """The fluorescent materials in a folder, a line each, and on one sheet.

    Files that cannot be used are named with the reason, and left out.
    """
    from labrig.foundation.errors import DataError, UsageError
    from labrig.material import matrix_files
    from labrig.optics import read_light
    from labrig.report import draw_contact_sheet, reradiation_text

    matrices = []
    for path in matrix_files(folder):
        try:
            matrix = checked(path.name, read_matrix(str(path)), is_corrected=False)
        except (UsageError, DataError) as error:
            echo(f"left out: {error}", err=True)
            continue
        matrices.append(matrix)
        echo(f"{path.name:20} {matrix.name:32} {reradiation_text(matrix)}")
    if not matrices:
        raise UsageError(f"{folder}: expected files of re-radiation matrices, got none of use")
    if picture is not None:
        draw_contact_sheet(matrices, read_light("D65"), picture)
        echo(f"drawn into {picture}")


def _write_lines(lines: list[str], out: Path | None) -> None:
    from labrig.foundation.output_file import write_text

    if out is None:
        for line in lines:
            echo(line)
        return
    write_text(out, "\n".join(lines) + "\n")
    echo(f"written: {out}")
