"""Files of measured curves, whatever their format: named curves over wavelength.

Read are JSON of rawtoaces, of LSPDD and of a gel catalogue (color-filter-sds), and tables in text:
`wavelength_nm` and a column a curve, `name,wavelength_nm,value` one below the other, and without a
header wavelength and R, G, B (Jiang et al. 2013) or wavelength and value.
"""

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeVar

from labrig.errors import UsageError
from labrig.input_file import read_text
from labrig.optics.curve_json import curves_from_json
from labrig.optics.curve_text import curves_from_text
from labrig.optics.piecewise import FloatArray
from labrig.optics.spectrum import Spectrum, Transmittance
from labrig.yaml_file import did_you_mean

T = TypeVar("T")

#: Names listed in a message.
LISTED = 8


class Curve(NamedTuple):
    """What a file says of one curve, sorted by wavelength, otherwise unchecked."""

    wavelength_nm: FloatArray
    value: FloatArray
    sigma: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class CurveFile:
    """A file's curves.

    Attributes
    ----------
    path
        Where it lies.
    title
        Maker and model, or what else the file calls itself; else its name.
    curves
        Name → curve, in the file's order.
    """

    path: Path
    title: str
    curves: Mapping[str, Curve]

    def pick(self, name: str | None) -> tuple[str, Curve]:
        """The curve of a name, or the only one.

        Raises
        ------
        UsageError
            No such curve, or several and no name.
        """
        if name is None:
            if len(self.curves) == 1:
                return next(iter(self.curves.items()))
            some = ", ".join(list(self.curves)[:LISTED])
            more = ", …" if len(self.curves) > LISTED else ""
            raise UsageError(
                f"{self.path}: expected one curve, got {len(self.curves)} ({some}{more}); name one"
            )
        if name not in self.curves:
            known = list(self.curves)
            hint = (
                did_you_mean(name, known)
                if len(known) <= LISTED or _close(name, known)
                else (f"it has {len(known)}, such as {', '.join(known[:LISTED])}")
            )
            raise UsageError(f"{self.path}: no curve is called '{name}'; {hint}")
        return name, self.curves[name]


def read_curve_file(path: str | os.PathLike[str]) -> CurveFile:
    """All curves of a file.

    Raises
    ------
    UsageError
        It cannot be read, or is none of the formats.
    """
    place = Path(path)
    text = read_text(place)
    if place.suffix.lower() == ".json":
        try:
            content = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise UsageError(f"{place}: not JSON ({' '.join(str(error).split())})") from None
        title, curves = checked(place, curves_from_json, content)
    else:
        title, curves = checked(place, curves_from_text, text)
    sorted_curves = {(name or place.stem): Curve(*columns) for name, columns in curves.items()}
    return CurveFile(place, title or place.stem, sorted_curves)


def read_spectrum(path: str | os.PathLike[str], name: str | None = None) -> Spectrum:
    """A lamp, an emission … from a file.

    Parameters
    ----------
    path
        A file as `read_curve_file` takes it.
    name
        Which of its curves; not needed where there is only one.

    Raises
    ------
    UsageError
        The file, the name or the curve is no good.
    """
    file = read_curve_file(path)
    found, curve = file.pick(name)
    return checked(f"{file.path}: {found}", lambda c: Spectrum(found, *c), curve)


def read_transmittance(path: str | os.PathLike[str], name: str | None = None) -> Transmittance:
    """A filter or a grey card from a file; parameters and errors as `read_spectrum`."""
    file = read_curve_file(path)
    found, curve = file.pick(name)
    return checked(f"{file.path}: {found}", lambda c: Transmittance(found, *c), curve)


ContentT = TypeVar("ContentT")


def checked(place: object, make: Callable[[ContentT], T], content: ContentT) -> T:
    """`make(content)`, its ValueError said as one line about `place`."""
    try:
        return make(content)
    except ValueError as error:
        raise UsageError(f"{place}: {error}") from None


def _close(name: str, known: list[str]) -> bool:
    return "did you mean" in did_you_mean(name, known)
