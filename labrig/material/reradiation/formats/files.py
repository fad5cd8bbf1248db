"""Files of re-radiation matrices, in the format that their ending and their content tell."""

import dataclasses
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeVar

from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes
from labrig.foundation.output_file import write_durably
from labrig.foundation.yaml_file import did_you_mean
from labrig.material.reradiation.formats import ark, bfc
from labrig.material.reradiation.formats.ark import ark_entries, ark_text, parse_ark_matrix
from labrig.material.reradiation.formats.bfc import bfc_text, parse_bfc
from labrig.material.reradiation.formats.csv_table import csv_text, is_fraction_table, parse_csv
from labrig.material.reradiation.formats.eem import MatrixLayout, eem_text, parse_eem
from labrig.material.reradiation.formats.spectral_exr import read_spectral_image, write_exr
from labrig.material.reradiation.matrix import ReradiationMatrix
from labrig.text_table import read_table_text

ContentT = TypeVar("ContentT")
T = TypeVar("T")

#: What makes the content of a text, by its ending.
_TEXTS: dict[str, Callable[[ReradiationMatrix], bytes]] = {
    ".bfc": lambda matrix: bfc_text(matrix).encode(bfc.ENCODING),
    ".csv": lambda matrix: csv_text(matrix).encode("utf-8", "replace"),
    ".ark": lambda matrix: ark_text(matrix).encode("utf-8", "replace"),
    ".txt": lambda matrix: eem_text(matrix).encode("utf-8"),
}
#: Endings of tables: of fractions of light, or of spectrofluorometers.
_TABLES = (".csv", ".txt", ".dat", ".asc", ".tsv")
_ENDINGS = "BFC, CSV, ARK, EXR or, of an excitation-emission matrix, TXT, DAT, ASC or TSV"


def read_reradiation(
    path: str | os.PathLike[str],
    entry: str | None = None,
    *,
    pixel: tuple[int, int] | None = None,
    layout: MatrixLayout | None = None,
) -> ReradiationMatrix:
    r"""Read the re-radiation matrix of a surface from a file.

    Formats are Labsphere BFC, tables with commas (labrig's own and those of fractions per band),
    text archives of ART, excitation-emission matrices in the texts of spectrofluorometers and
    spreadsheets, and bispectral OpenEXR images (Fichet, Pacanowski and Wilkie, JCGT 2021; 32-bit
    numbers). Which axis of an excitation-emission matrix is which is told by names, else by the
    side of the diagonal that has the light; lines of scattered light count as not measured. Both
    is logged.

    Parameters
    ----------
    path
        Path of the file; its ending is `.bfc`, `.ark`, `.exr`, or `.csv`, `.txt`, `.dat`, `.asc`
        or `.tsv` of tables.
    entry
        Name of the matrix in the file; not needed where there is only one.
    pixel
        Column and row of a pixel of an image, from 0 at the upper left; not needed where all
        pixels are the same.
    layout
        Answers to what the table of an excitation-emission matrix leaves open.

    Returns
    -------
    ReradiationMatrix
        The matrix, named as in the file, otherwise as the file. An excitation-emission matrix is
        `relative`. A reflective image without bispectral layers re-radiates nothing.

    Raises
    ------
    UsageError
        The file cannot be read, has none of the formats, is broken, or holds several matrices and
        none of them is named.

    Examples
    --------
    >>> from labrig.material import read_reradiation
    >>> paper = read_reradiation("paper.csv")
    >>> paper.name, paper.reradiation.shape, paper.unit
    ('yellow paper', (41, 49), '1/nm')
    >>> float(paper.output_nm[paper.reradiation[:, 17].argmax()])
    520.0
    """
    file_path = Path(path)
    matrices = _matrices(file_path, pixel, layout)
    name = _picked(file_path, list(matrices), entry)
    return _checked(file_path, lambda read: read(), matrices[name])


def write_reradiation(path: str | os.PathLike[str], matrix: ReradiationMatrix) -> None:
    """Write a re-radiation matrix in the format that the file's ending tells.

    `.csv` holds all of a matrix and is read back exactly. The others hold no standard deviations:
    `.bfc` (even steps of whole nm) and `.ark` (even steps) hold fractions per band, read back to
    the rounding of one product; `.txt` an excitation-emission matrix, exactly; `.exr` an image of
    one pixel, in 32-bit numbers, relative error 6e-8. Wavelengths of `.ark` and `.exr` are read
    back to 1e-6 nm.

    Parameters
    ----------
    path
        Path of the file, which is overwritten; its ending is `.bfc`, `.csv`, `.ark`, `.txt` or
        `.exr`.
    matrix
        The matrix. Runs of blanks in its name become one.

    Raises
    ------
    UsageError
        The ending is none of these, or the format cannot hold the matrix.
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from labrig.material import read_reradiation, write_reradiation
    >>> write_reradiation("paper.BFC", read_reradiation("paper.csv"))
    >>> read_reradiation("paper.BFC").name
    'yellow paper'
    """
    file_path = Path(path)
    ending = file_path.suffix.lower()
    if ending == ".exr":
        _checked(file_path, lambda matrix: write_exr(file_path, matrix), matrix)
        return
    if ending not in _TEXTS:
        raise UsageError(f"{file_path}: expected the ending {_ENDINGS}")
    content = _checked(file_path, _TEXTS[ending], matrix)
    write_durably(file_path, content)


def _matrices(
    path: Path, pixel: tuple[int, int] | None, layout: MatrixLayout | None
) -> dict[str, Callable[[], ReradiationMatrix]]:
    """Return what reads each matrix of a file, by its name."""
    if path.suffix.lower() == ".exr":
        _checked(path, _refuse_layout, layout)
        matrix = read_spectral_image(path).matrix(pixel)
        return {matrix.name: lambda: matrix}
    if pixel is not None:
        raise UsageError(f"{path}: expected an image (EXR) for a pixel, got another file")
    content = read_bytes(path, MAX_TEXT_BYTES)
    if content.startswith(ark.MARK.encode()) or path.suffix.lower() == ".ark":
        _checked(path, _refuse_layout, layout)
        return _archived(path)
    found = _checked(path, lambda path: _parsed(path, content, layout), path)
    matrix = dataclasses.replace(found, name=found.name or path.stem)
    return {matrix.name: lambda: matrix}


def _archived(path: Path) -> dict[str, Callable[[], ReradiationMatrix]]:
    entries = _checked(path, ark_entries, read_table_text(path))
    matrices = {name: entry for name, entry in entries.items() if entry.is_matrix}
    if not matrices:
        raise UsageError(f"{path}: expected a matrix {{{{…}}}}, got {len(entries)} plain spectra")

    def read(name: str) -> ReradiationMatrix:
        matrix = parse_ark_matrix(matrices[name])
        return dataclasses.replace(matrix, name=matrix.name or name)

    return {name: partial(read, name) for name in matrices}


def _parsed(path: Path, content: bytes, layout: MatrixLayout | None) -> ReradiationMatrix:
    ending = path.suffix.lower()
    if ending == ".bfc" or bfc.MARK.encode() in content[:100]:
        _refuse_layout(layout)
        return parse_bfc(content.decode(bfc.ENCODING))
    if ending not in _TABLES:
        raise ValueError(f"expected the ending {_ENDINGS}")
    text = read_table_text(path)
    if ending == ".csv" and is_fraction_table(text):
        _refuse_layout(layout)
        return parse_csv(text)
    return parse_eem(text, layout or MatrixLayout(), str(path))


def _refuse_layout(layout: MatrixLayout | None) -> None:
    if layout is not None:
        raise ValueError("expected an excitation-emission matrix if axes are stated")


def _picked(path: Path, names: list[str], entry: str | None) -> str:
    if entry is None:
        if len(names) > 1:
            raise UsageError(
                f"{path}: expected one matrix, got {len(names)} ({', '.join(names)}); name one"
            )
        return names[0]
    if entry not in names:
        raise UsageError(f"{path}: no matrix is called '{entry}'; {did_you_mean(entry, names)}")
    return entry


def _checked(path: Path, make: Callable[[ContentT], T], content: ContentT) -> T:
    """Return `make(content)`; a ValueError becomes a UsageError in one line about `path`."""
    try:
        return make(content)
    except ValueError as error:
        raise UsageError(f"{path}: {error}") from None


def matrix_files(folder: str | os.PathLike[str]) -> list[Path]:
    """Return the files of a folder whose ending is that of a matrix.

    Parameters
    ----------
    folder
        Path of the folder. Folders in it are left out.

    Returns
    -------
    list of Path
        Paths, sorted by name.

    Raises
    ------
    UsageError
        There is no such folder.

    Examples
    --------
    >>> from labrig.material import matrix_files
    >>> "paper.csv" in [path.name for path in matrix_files(".")]
    True
    """
    place = Path(folder)
    if not place.is_dir():
        raise UsageError(f"{place}: expected a folder of re-radiation matrices, got none")
    endings = {*_TEXTS, *_TABLES, ".exr"}
    return sorted(path for path in place.iterdir() if path.suffix.lower() in endings)
