"""One spectrum and one excitation-emission matrix in the many shapes that programs write."""

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray

SEPARATORS = ("\t", ";", ",", " ", "  ", ", ")
ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1", "cp1252")
NEWLINES = ("\n", "\r\n", "\r")
_ABOVE = (
    "Instrument: U-2900",
    "Operator: J. Doe",
    "Date: 12.03.2024",
    "Scan speed: 300 nm/min",
    "Temperature (°C): 21.5",
    "Slit width: 5.0 nm",
)
_BELOW = ("*END", ">>>>>End Spectral Data<<<<<", "Collection Time: 3/31/2019 12:23:13 PM")
#: Unit of the axis: how a column is called, nm in it, and digits that keep 1e-7 of them.
AXES: tuple[tuple[str, Callable[[FloatArray], FloatArray]], ...] = (
    ("Wavelength (nm)", lambda nm: nm),
    ("wavelength_nm", lambda nm: nm),
    ("Wavelength [nm]", lambda nm: nm),
    ("λ / nm", lambda nm: nm),
    ("Wellenlänge in nm", lambda nm: nm),
    ("nm", lambda nm: nm),
    ("Wavelength (Å)", lambda nm: nm * 10),
    ("Wavelength/µm", lambda nm: nm / 1e3),
    ("Wavenumber (cm-1)", lambda nm: 1e7 / nm),
    ("Energy (eV)", lambda nm: 1239.8419843320026 / nm),
    ("Frequency [THz]", lambda nm: 299792.458 / nm),
)
#: Names of columns that hold a transmittance: what is written of it.
FRACTIONS: tuple[tuple[str, Callable[[FloatArray], FloatArray]], ...] = (
    ("Abs", lambda t: -np.log10(t)),
    ("Absorbance (AU)", lambda t: -np.log10(t)),
    ("mAU", lambda t: -1000 * np.log10(t)),
    ("Optical density", lambda t: -np.log10(t)),
    ("%T", lambda t: 100 * t),
    ("T (%)", lambda t: 100 * t),
    ("Transmission [%]", lambda t: 100 * t),
    ("Transmittance", lambda t: t),
)
#: Names of columns that hold light: what is written of it.
LIGHTS: tuple[tuple[str, Callable[[FloatArray], FloatArray]], ...] = (
    ("Counts", lambda v: v),
    ("Intensity (a.u.)", lambda v: v),
    ("Ee [W/(sqm*nm)]", lambda v: v),
    ("Irradiance (µW/cm²/nm)", lambda v: 100 * v),
)


@dataclass(frozen=True)
class Writing:
    """How a table is written: separator, decimal mark, encoding, end of a line."""

    separator: str
    decimal: str
    encoding: str
    newline: str
    is_trailing: bool

    @classmethod
    def drawn(cls, rng: random.Random) -> "Writing":
        """Draw one; commas are decimal marks only where they do not separate."""
        separator = rng.choice(SEPARATORS)
        decimal = rng.choice(".,") if "," not in separator else "."
        return cls(
            separator,
            decimal,
            rng.choice(ENCODINGS),
            rng.choice(NEWLINES),
            separator.strip() != "" and rng.random() < 0.3,
        )

    def number(self, value: float) -> str:
        """Write a number with ten digits; nothing where it is NaN."""
        return "" if np.isnan(value) else f"{value:.10g}".replace(".", self.decimal)

    def line(self, cells: Sequence[str]) -> str:
        """Write the cells of a row."""
        return self.separator.join(cells) + (self.separator if self.is_trailing else "")

    def encoded(self, lines: Sequence[str]) -> bytes:
        """Return the bytes of a text, with ? for what the encoding does not have."""
        return (self.newline.join(lines) + self.newline).encode(self.encoding, "replace")


def about(rng: random.Random) -> list[str]:
    """Draw lines about a measurement."""
    return rng.sample(_ABOVE, rng.randint(0, 4))


def below(rng: random.Random) -> list[str]:
    """Draw lines that stand below a table."""
    return ["", rng.choice(_BELOW)] if rng.random() < 0.4 else []


def spectrum_text(
    rng: random.Random, wavelength_nm: FloatArray, columns: Sequence[tuple[str, FloatArray]]
) -> bytes:
    """Write spectra of the same axis: each column has its name and what stands in it."""
    writing = Writing.drawn(rng)
    # In a text separated by blanks, names are glued to their units.
    glue = (lambda name: name.replace(" ", "")) if not writing.separator.strip() else str
    axis_name, of_nm = rng.choice(
        [axis for axis in AXES if axis[0].encode(writing.encoding, "replace").find(b"?") < 0]
    )
    table = np.column_stack([of_nm(wavelength_nm), *(values for _, values in columns)])
    order = rng.choice(["rising", "falling", "mixed"])
    rows = np.argsort(table[:, 0])[:: -1 if order == "falling" else 1]
    if order == "mixed":
        rows = np.array(rng.sample(list(rows), len(rows)))
    names = [axis_name, *(name for name, _ in columns)]
    if not writing.separator.strip():
        names = [name.replace(" in ", "/") for name in names]
    return writing.encoded(
        [
            *about(rng),
            writing.line([glue(name) for name in names]),
            *(writing.line([writing.number(cell) for cell in row]) for row in table[rows]),
            *below(rng),
        ]
    )


def matrix_text(
    rng: random.Random, excitation_nm: FloatArray, emission_nm: FloatArray, intensity: FloatArray
) -> bytes:
    """Write a matrix, shape (emission, excitation), as a grid or as a column for each spectrum."""
    writing = Writing.drawn(rng)
    rows_nm, columns_nm, table = emission_nm, excitation_nm, intensity
    kind = ["Ex", "Em"]
    if rng.random() < 0.5:
        rows_nm, columns_nm, table, kind = excitation_nm, emission_nm, intensity.T, ["Em", "Ex"]
    rows = np.arange(len(rows_nm))[:: rng.choice([1, -1])]
    columns = np.arange(len(columns_nm))[:: rng.choice([1, -1])]
    rows_nm, columns_nm, table = rows_nm[rows], columns_nm[columns], table[np.ix_(rows, columns)]
    number = writing.number
    form = rng.choice(["grid", "named", "list", "pairs"])
    lines = about(rng)
    if form == "grid":
        corner = rng.choice(["sample", "Wavelength", f"{kind[1]}/{kind[0]}"])
        head = [corner, *map(number, columns_nm)]
        if not writing.separator.strip() and rng.random() < 0.3:
            head = head[1:]
        lines.append(writing.line(head))
        lines += [
            writing.line([number(nm), *map(number, row)])
            for nm, row in zip(rows_nm, table, strict=True)
        ]
    elif form == "list":
        name = {"Ex": "Excitation", "Em": "Emission"}
        lines.append(writing.line([name[kind[1]], name[kind[0]], "Intensity"]))
        lines += [
            writing.line([number(row_nm), number(nm), number(value)])
            for row_nm, row in zip(rows_nm, table, strict=True)
            for nm, value in zip(columns_nm, row, strict=True)
        ]
    elif form == "named" or not writing.separator.strip():
        names = [f"S1_{kind[0].upper()}_{nm:.2f}" for nm in columns_nm]
        lines.append(writing.line(["Wavelength(nm)", *names]))
        lines += [
            writing.line([number(nm), *map(number, row)])
            for nm, row in zip(rows_nm, table, strict=True)
        ]
    else:
        lines = [
            writing.line([part for nm in columns_nm for part in (f"S1_{kind[0]}_{nm:.2f}", "")]),
            writing.line(["Wavelength (nm)", "Intensity (a.u.)"] * len(columns_nm)),
        ]
        lines += [
            writing.line([part for value in row for part in (number(nm), number(value))])
            for nm, row in zip(rows_nm, table, strict=True)
        ]
    return writing.encoded([*lines, *below(rng)])
