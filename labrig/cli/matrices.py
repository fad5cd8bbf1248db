"""Options of commands that read re-radiation matrices, and the reading itself."""

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from labrig.material import Material, MatrixLayout, ReradiationMatrix

#: Most wavelengths that an option states, and how far the last may be from a step, in nm.
_MOST_STEPS, _ROUNDING_NM = 10_000, 1e-6
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
    if not 1 <= count < _MOST_STEPS or abs(first + count * step - last) > _ROUNDING_NM:
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
    for warning in warnings:
        typer.echo(f"warning: {warning}", err=True)
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
