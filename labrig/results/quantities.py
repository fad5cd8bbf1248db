"""Single values of a result with σ and unit, whatever its type."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from labrig.results.measured import Measured, field_unit, iter_values

#: Begins of the names of fields in the unit of the values that were fitted.
IN_VALUES = ("amplitude", "offset", "value", "sigma", "dark_sigma")
#: Field with that unit, in the object that holds them or in one around it.
VALUE_UNIT = "value_unit"
SIGMA = "_sigma"

Place = tuple[str, ...]


@dataclass(frozen=True)
class Quantity:
    """A single value of a result.

    Attributes
    ----------
    path
        Names of fields, keys of mappings, or positions in a sequence from 1.
    value
        The value.
    sigma
        Its standard uncertainty; None if the result has none.
    unit
        Its unit; empty for a pure number, or if unknown.
    """

    path: Place
    value: float
    sigma: float | None
    unit: str


class Units:
    """Units of the fields of a result, by their names and by the unit of its values.

    Parameters
    ----------
    items
        Paths and plain values, as `iter_values` yields them.
    """

    def __init__(self, items: Sequence[tuple[Place, Any]]) -> None:
        self._of_values = {path[:-1]: value for path, value in items if path[-1:] == (VALUE_UNIT,)}

    def of(self, path: Place) -> str:
        """Return the unit of the field at a path; empty if it has none."""
        if unit := field_unit(path[-1]):
            return unit
        if path[-1].startswith(IN_VALUES):
            for length in range(len(path) - 1, -1, -1):
                if path[:length] in self._of_values:
                    return str(self._of_values[path[:length]])
        return ""


def iter_quantities(result: Any) -> Iterator[Quantity]:
    """Iterate over the single values of a result; texts, truths and arrays are left out.

    Parameters
    ----------
    result
        A result, or a dataclass, mapping or sequence in one.

    Yields
    ------
    Quantity
        A value with its σ, which is not yielded by itself.

    Examples
    --------
    >>> import labrig
    >>> from labrig.results import iter_quantities
    >>> fit = labrig.read_result("runs/decay").patches["sample"].fit
    >>> for quantity in iter_quantities(fit.states):
    ...     print("/".join(quantity.path), f"{quantity.value:.2g} ± {quantity.sigma:.1g}")
    1/k_r_per_s 0.2 ± 0.003
    1/amplitude 8e+03 ± 1e+02
    2/k_r_per_s 0.01 ± 0.0001
    2/amplitude 2.8e+03 ± 2e+01
    """
    items = list(iter_values(result))
    units, values = Units(items), dict(items)
    for path, value in items:
        if isinstance(value, Measured):
            yield Quantity(path, value.value, value.sigma, value.unit)
        elif _is_number(value) and not _is_sigma(path, values):
            sigma = values.get((*path[:-1], path[-1] + SIGMA))
            yield Quantity(
                path, float(value), float(sigma) if _is_number(sigma) else None, units.of(path)
            )


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_sigma(path: Place, values: Mapping[Place, Any]) -> bool:
    return path[-1].endswith(SIGMA) and (*path[:-1], path[-1].removesuffix(SIGMA)) in values


def number_array(value: Any) -> NDArray[Any] | None:
    """Return a field of a result as array of numbers, truths or texts; None if it is no such.

    Parameters
    ----------
    value
        Value of a field.

    Returns
    -------
    numpy.ndarray or None
        The array, of any shape.

    Examples
    --------
    >>> from labrig.results import number_array
    >>> number_array((1.0, 2.0)).shape, number_array(None) is None
    ((2,), True)
    """
    try:
        array = np.asarray(value)
    except ValueError:
        return None
    return array if array.dtype.kind in "iufbU" and array.size else None


def coordinates_by_length(arrays: Mapping[str, NDArray[Any]]) -> dict[int, str]:
    """Return which of several arrays are coordinates of the others, by their length.

    A coordinate rises or falls throughout, has a unit in its name, and no σ; of several it is the
    first. Without one, names that are all different serve.

    Parameters
    ----------
    arrays
        Arrays of one object by the names of their fields.

    Returns
    -------
    dict
        Name of the coordinate for each length that has one.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.results import coordinates_by_length
    >>> arrays = {"albedo": np.ones(3), "wavelength_nm": np.array([400.0, 500.0, 600.0])}
    >>> coordinates_by_length(arrays)
    {3: 'wavelength_nm'}
    """
    vectors = {name: array for name, array in arrays.items() if array.ndim == 1 and len(array) > 1}
    numbers = {
        name: array
        for name, array in vectors.items()
        if array.dtype.kind in "iuf"
        and field_unit(name)
        and not name.endswith(SIGMA)
        and name + SIGMA not in arrays
        and (np.all(np.diff(array) > 0) or np.all(np.diff(array) < 0))
    }
    texts = {
        name: array
        for name, array in vectors.items()
        if array.dtype.kind == "U" and len(set(array.tolist())) == len(array)
    }
    found: dict[int, str] = {}
    for name, array in (*numbers.items(), *texts.items()):
        found.setdefault(len(array), name)
    return found
