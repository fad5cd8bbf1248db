"""A measured quantity: a value, its standard uncertainty and its unit."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any

from pydantic import BaseModel

from labrig.foundation.number_format import (
    VANISHES_SIGMAS,
    as_written,
    plus_minus,
    power_of_ten,
    rounded,
)
from labrig.foundation.result_warning import ResultWarning
from labrig.results.run_result import RunResult

#: Fewest decimals of a rounded value; a larger σ is written with a power of ten.
MAX_ROUNDED = -2


@dataclass(frozen=True)
class Measured:
    """A value with its standard uncertainty σ, both in `unit`.

    Attributes
    ----------
    value
        The value.
    sigma
        Its standard uncertainty ≥ 0; infinite where nothing is known of the value.
    unit
        Unit such as `1/s` or `DN/s`; empty for a pure number.

    Examples
    --------
    >>> print(Measured(0.0802, 0.0013, "1/s"))
    0.0802(13) 1/s
    """

    value: float
    sigma: float
    unit: str = ""

    def times(self, other: "Measured") -> "Measured":
        """Return the product with an independently measured quantity."""
        sigma = math.hypot(self.sigma * other.value, self.value * other.sigma)
        unit = " ".join(filter(None, (self.unit, other.unit)))
        return Measured(self.value * other.value, sigma, unit)

    def over(self, other: "Measured") -> "Measured":
        """Return the ratio to an independently measured quantity of the same unit.

        Raises
        ------
        ValueError
            The units differ.
        """
        if self.unit != other.unit:
            raise ValueError(f"expected two values in {self.unit}, got one in {other.unit}")
        inverse = Measured(1 / other.value, other.sigma / other.value**2)
        ratio = Measured(self.value, self.sigma).times(inverse)
        return ratio

    def sigmas_from(self, other: "Measured") -> float:
        """Return the difference `self` − `other` in its own σ, both measured independently.

        It is NaN where that σ is 0 or infinite.
        """
        sigma = math.hypot(self.sigma, other.sigma)
        return (self.value - other.value) / sigma if 0 < sigma < math.inf else math.nan

    @property
    def plus_minus(self) -> str:
        """The value ± σ as text, without its unit."""
        return plus_minus(self.value, self.sigma)

    def __str__(self) -> str:
        """Return the value to two digits of its σ, and the unit."""
        return " ".join(filter(None, (with_uncertainty(self.value, self.sigma), self.unit)))


#: Distance of a one-sided limit of 95 % probability from a bound, in σ.
ONE_SIDED_SIGMAS = 1.645


@dataclass(frozen=True)
class OneSided(Measured):
    """A value that a bound of its range holds: it is between that bound and `limit`.

    Attributes
    ----------
    value
        The bound, at which the value is fitted.
    sigma
        Distance of the limit over 1.645.
    limit
        Limit of 95 % probability, on the open side.

    Examples
    --------
    >>> print(OneSided.held(1.0, 0.02, pull=0.0))
    < 1.033
    >>> print(OneSided.held(10.0, 1.0, pull=0.5, is_upper=True))
    > 8.8
    """

    limit: float = field(kw_only=True)

    @classmethod
    def held(
        cls, value: float, sigma: float, pull: float, unit: str = "", *, is_upper: bool = False
    ) -> "OneSided":
        """Return a value at its bound, by the curvature of χ² there.

        Parameters
        ----------
        value
            The bound.
        sigma
            Standard uncertainty without the bound, > 0.
        pull
            Distance in σ by which the value would be beyond the bound without it, ≥ 0.
        unit
            Unit of the value.
        is_upper
            Whether the bound is the largest possible value.
        """
        # Where χ² is larger than at the bound by 1.645²: with a pull a shorter way off.
        distance = ONE_SIDED_SIGMAS * sigma
        if math.isfinite(sigma):
            distance = sigma * (math.hypot(pull, ONE_SIDED_SIGMAS) - pull)
        limit = value - distance if is_upper else value + distance
        return cls(value, distance / ONE_SIDED_SIGMAS, unit, limit=limit)

    @property
    def plus_minus(self) -> str:
        """The limit as text, without its unit."""
        return str(replace(self, unit=""))

    def __str__(self) -> str:
        """Return the limit to two digits of its distance from the bound, and the unit."""
        if not math.isfinite(self.limit):
            return "?"
        sign = "<" if self.limit >= self.value else ">"
        distance = abs(self.limit - self.value)
        places = 1 - math.floor(math.log10(distance)) if distance > 0 else 6
        text = f"{sign} {self.limit:.{min(max(places, 0), 9)}f}"
        return " ".join(filter(None, (text, self.unit)))


def measured_number(measured: Measured) -> dict[str, float | None]:
    """Return a quantity as in JSON files: what is infinite is null.

    Parameters
    ----------
    measured
        The quantity; its unit is that of the key.

    Returns
    -------
    dict
        `value` and `sigma`, and `limit_95` of a value that a bound holds.

    Examples
    --------
    >>> from labrig.results import Measured, measured_number
    >>> measured_number(Measured(2.0, 0.1))
    {'value': 2.0, 'sigma': 0.1}
    """
    numbers = {"value": measured.value, "sigma": measured.sigma}
    if isinstance(measured, OneSided):
        numbers["limit_95"] = measured.limit
    return {name: number if math.isfinite(number) else None for name, number in numbers.items()}


def with_uncertainty(value: float, sigma: float) -> str:
    """Write a value to two digits of its standard uncertainty, as in `0.0802(13)`.

    Parameters
    ----------
    value
        The value.
    sigma
        Its standard uncertainty in the same unit; 0 of an exact value, infinite if unknown.

    Returns
    -------
    str
        The value and, in brackets, σ in units of its last digits: `0.08` if σ is 0, `0.08(?)` if it
        is unknown. A σ of 1 or more has its decimal point, as in `12.5(1.3)`.

    Examples
    --------
    >>> from labrig.results import with_uncertainty
    >>> with_uncertainty(0.0802, 0.0013), with_uncertainty(12.47, 1.3), with_uncertainty(0.08, 0.0)
    ('0.0802(13)', '12.5(1.3)', '0.08')
    """
    if sigma == 0:
        return as_written(f"{value:.6g}")
    if not math.isfinite(sigma):
        return f"{rounded(value, 3)}(?)"
    if 0 < abs(value) < VANISHES_SIGMAS * sigma:
        return plus_minus(value, sigma)
    decimals = 1 - math.floor(math.log10(sigma))
    digits = round(sigma * 10.0**decimals)
    if digits == 100:
        decimals, digits = decimals - 1, 10
    if decimals > 8:
        exponent = math.floor(math.log10(abs(value))) if value else 0
        if exponent < -3:
            return _with_power(value, sigma, exponent)
    if decimals < MAX_ROUNDED:
        return _with_power(value, sigma, math.floor(math.log10(max(abs(value), sigma))))
    if decimals < 0:
        return as_written(f"{round(value, decimals):.0f}({digits * 10**-decimals})")
    # σ of 1 and more is written with its decimal point, as in 12.5(1.3).
    bracket = f"{sigma:.{decimals}f}" if decimals > 0 and sigma >= 1 else str(digits)
    return as_written(f"{value:.{decimals}f}({bracket})")


def _with_power(value: float, sigma: float, exponent: int) -> str:
    scale = 10.0**exponent
    return f"{with_uncertainty(value / scale, sigma / scale)} × {power_of_ten(exponent)}"


#: Ends of the names of fields, longest first, and the unit that they stand for.
_UNITS = {
    "_dn_per_s": "DN/s",
    "_per_s": "1/s",
    "_nm": "nm",
    "_deg": "deg",
    "_dn": "DN",
    "_px": "pixel",
    "_ms": "ms",
    "_k": "K",
    "_c": "degC",
    "_s": "s",
}
#: Name of the only entry of a mapping, whose key is empty.
ONLY = "only"

Path = tuple[str, ...]


def iter_values(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Iterate over every plain value in a result and its path.

    A plain value is a number, a text, an array, a `Measured` or a sequence of these. Results within
    a result, such as the parts of a chain, are left out.

    Parameters
    ----------
    value
        A result, or a dataclass, mapping or sequence in one.
    path
        Path of `value` itself, before those of the plain values in it.

    Yields
    ------
    path : tuple of str
        Names of fields, keys of mappings, or positions in a sequence from 1.
    value : object
        The plain value.

    Examples
    --------
    >>> import labrig
    >>> from labrig.results import iter_values
    >>> fit = labrig.read_result("runs/decay").patches["sample"].fit
    >>> for path, value in iter_values(fit):
    ...     if path[-1] == "k_r_per_s":
    ...         print("/".join(path), f"{value:.2g}")
    states/1/k_r_per_s 0.2
    states/2/k_r_per_s 0.01
    """
    inner = _members(value)
    if inner is None:
        yield path, value
        return
    for name, item in inner:
        if not isinstance(item, RunResult):
            yield from iter_values(item, (*path, name))


def field_unit(name: str) -> str:
    """Return the unit that the name of a field ends with.

    Parameters
    ----------
    name
        Name of a field of a result; that of a standard uncertainty has the unit of its value.

    Returns
    -------
    str
        The unit; empty if the name has none.

    Examples
    --------
    >>> from labrig.results import field_unit
    >>> field_unit("k_r_per_s_sigma"), field_unit("centre_nm"), field_unit("chi2")
    ('1/s', 'nm', '')
    """
    base = name.removesuffix("_sigma").replace("_sigma_", "_")
    return next((unit for end, unit in _UNITS.items() if base.endswith(end)), "")


def _members(value: Any) -> list[tuple[str, Any]] | None:
    """Return the named values in a value; None for a plain one."""
    if isinstance(value, Measured | ResultWarning):
        return None
    if isinstance(value, BaseModel):
        return [(name, getattr(value, name)) for name in type(value).model_fields]
    if is_dataclass(value) and not isinstance(value, type):
        return [(member.name, getattr(value, member.name)) for member in fields(value)]
    if isinstance(value, Mapping):
        return [(str(key) or ONLY, item) for key, item in value.items()]
    if isinstance(value, tuple | list) and any(_members(item) is not None for item in value):
        return [(str(number), item) for number, item in enumerate(value, start=1)]
    return None
