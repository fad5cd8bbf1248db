"""Matrices in text archives of the Advanced Rendering Toolkit (ART).

An archive has entries: `Entry ID:`, a description, the sampling in nm, and the samples in braces,
`{…}` of a plain spectrum, `{{…}, …}` of a matrix with one row for each output wavelength. Entries
of a matrix are fractions per band, and reflectance where both wavelengths are the same.
"""

import re
from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material.reradiation.formats.text_rows import (
    Line,
    band_fractions,
    check_fractions,
    check_wavelengths,
    filled_lines,
    number,
    numbers,
    one_line,
    regular_grid,
    shown,
)
from labrig.material.reradiation.matrix import ReradiationMatrix

#: Beginning of every archive.
MARK = "ART measurement archive"
_ENTRY = "Entry ID"
_SAMPLES = "ASCII sample data"


@dataclass(frozen=True)
class ArkEntry:
    """One entry of an archive, its samples unread.

    Attributes
    ----------
    line
        Number of its first line.
    fields
        What stands behind `key :`, by the key; of a repeated key the last.
    samples
        Lines of its samples.
    """

    line: int
    fields: dict[str, Line]
    samples: tuple[Line, ...]

    @property
    def is_matrix(self) -> bool:
        """Whether the samples are a matrix rather than a plain spectrum."""
        return "".join(line.text for line in self.samples).replace(" ", "").startswith("{{")


def ark_entries(text: str) -> dict[str, ArkEntry]:
    """Return the entries of an archive by their IDs.

    Raises
    ------
    ValueError
        It is no archive, has no entries, or two of one ID.
    """
    lines = filled_lines(text)
    if not lines or not lines[0].text.startswith(MARK):
        raise ValueError(f"expected '{MARK}' in the first line")
    starts = [k for k, line in enumerate(lines) if line.text.startswith(_ENTRY)]
    if not starts:
        raise ValueError("expected entries that begin with 'Entry ID:', got none")
    entries: dict[str, ArkEntry] = {}
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        entry_id = lines[start].text.partition(":")[2].strip()
        if not entry_id or entry_id in entries:
            raise ValueError(
                f"line {lines[start].number}: expected an ID of its own for each entry, "
                f"got {shown(entry_id)}"
            )
        entries[entry_id] = _entry(lines[start:end])
    return entries


def _entry(lines: list[Line]) -> ArkEntry:
    at = next((k for k, line in enumerate(lines) if line.text == _SAMPLES), len(lines))
    fields = {}
    for line in lines[:at]:
        key, colon, value = line.text.partition(":")
        if colon:
            fields[" ".join(key.split())] = Line(line.number, value.strip())
    samples = [line for line in lines[at + 1 :] if set(line.text) != {"-"}]
    return ArkEntry(lines[0].number, fields, tuple(samples))


def parse_ark_matrix(entry: ArkEntry) -> ReradiationMatrix:
    """Return the matrix of an entry; its name is the description, which may be empty.

    Raises
    ------
    ValueError
        The entry is broken; the message names the line.
    """
    sampling = entry.fields.get("Type")
    if sampling is not None and sampling.text != "regular":
        raise ValueError(
            f"line {sampling.number}: expected regular sampling, got {shown(sampling.text)}"
        )
    scale = entry.fields.get("Maximum sample value")
    largest = 1.0 if scale is None else number(scale.text, scale.number)
    if scale is not None and largest <= 0:
        raise ValueError(
            f"line {scale.number}: expected a maximum sample value above 0, got {largest:g}"
        )
    with np.errstate(over="ignore"):  # what is infinite is refused below
        values = _samples(entry) / largest
    for row in values:
        check_fractions(row.tolist(), f"line {entry.samples[0].number}")
    output_nm = _grid(entry, "Reflectance", values.shape[0])
    input_nm = _grid(entry, "Illumination", values.shape[1])
    name = entry.fields.get("Description", Line(0, "")).text
    return ReradiationMatrix.from_bands(one_line(name), input_nm, output_nm, values)


def _grid(entry: ArkEntry, what: str, size: int) -> FloatArray:
    start, step = (_nanometres(entry, f"{what} {part}") for part in ("start", "increment"))
    if step <= 0:
        line = entry.fields[f"{what} increment"].number
        raise ValueError(f"line {line}: expected an increment above 0 nm, got {step:g}")
    # An absurd increment gives wavelengths that the check below refuses.
    with np.errstate(over="ignore"):
        grid: FloatArray = start + step * np.arange(size, dtype=np.float64)
    check_wavelengths(grid, f"line {entry.fields[f'{what} start'].number}: ")
    return grid


def _nanometres(entry: ArkEntry, key: str) -> float:
    if key not in entry.fields:
        raise ValueError(f"line {entry.line}: expected '{key}: … nm' in the entry, got none")
    line = entry.fields[key]
    cell, _, unit = line.text.partition(" ")
    if unit.strip() != "nm":
        raise ValueError(f"line {line.number}: expected '{key}' in nm, got {shown(line.text)}")
    return number(cell, line.number)


def _samples(entry: ArkEntry) -> FloatArray:
    first = entry.samples[0].number
    text = " ".join(line.text for line in entry.samples)
    rows = re.findall(r"\{([^{}]*)\}", text)
    # Without rows and commas, the outer braces are left.
    left = "".join(re.sub(r"\{[^{}]*\}", "", text).split())
    if left != "{" + "," * (len(rows) - 1) + "}" or not rows:
        raise ValueError(
            f"line {first}: expected rows {{…}}, {{…}} in braces, got {len(rows)} rows and "
            f"{shown(left)} beside them; the file is cut"
        )
    values = [numbers((cell.strip() for cell in row.split(",")), first) for row in rows]
    ragged = next((k for k, row in enumerate(values) if len(row) != len(values[0])), None)
    if ragged is not None:
        raise ValueError(
            f"line {first}: row {ragged + 1} has {len(values[ragged])} samples, "
            f"the first has {len(values[0])}"
        )
    return np.array(values)


def ark_text(matrix: ReradiationMatrix) -> str:
    """Return the text of an archive with one entry, which is called as the matrix.

    Raises
    ------
    ValueError
        The format cannot hold the matrix.
    """
    rows = [", ".join(repr(float(value)) for value in row) for row in band_fractions(matrix)]
    (out_start, out_step), (in_start, in_step) = (
        regular_grid(nm) for nm in (matrix.output_nm, matrix.input_nm)
    )
    name = one_line(matrix.name)
    fields = {
        "Description": name,
        "Type": "reflectance spectrum",
        "Fluorescence data": "yes",
        "Measurement device": "",
        "Measured by": "",
        "Measurement date": "",
    }
    sampling = {
        "Type": "regular",
        "Reflectance start": f"{out_start!r} nm",
        "Reflectance increment": f"{out_step!r} nm",
        "Illumination start": f"{in_start!r} nm",
        "Illumination increment": f"{in_step!r} nm",
        "Maximum sample value": "1.0",
    }
    head = f"{_ENTRY}:   {name.replace(' ', '_') or 'matrix'}"
    lines = [f"{MARK} version 1.1", "", f"Archive content: {name}", "", "", "", head]
    lines += ["-" * 75, *(f"{key:22}:  {value}".rstrip() for key, value in fields.items()), ""]
    lines += ["Sampling information", "-" * 20]
    lines += [*(f"{key:22}:  {value}" for key, value in sampling.items()), ""]
    lines += [_SAMPLES, "-" * len(_SAMPLES), "{{" + "}, {".join(rows) + "}}", ""]
    return "\n".join(lines)
