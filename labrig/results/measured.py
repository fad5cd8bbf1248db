"""A measured quantity: a value, its standard uncertainty and its unit."""

import math
from dataclasses import dataclass

#: A σ of more digits than this before its point is written with a power of ten.
MOST_ROUNDED = -2


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
        Such as `1/s` or `DN/s`; empty for a pure number.

    Examples
    --------
    >>> print(Measured(0.0802, 0.0013, "1/s"))
    0.0802(13) 1/s
    """

    value: float
    sigma: float
    unit: str = ""

    def times(self, other: "Measured") -> "Measured":
        """The product with a quantity that was measured independently."""
        sigma = math.hypot(self.sigma * other.value, self.value * other.sigma)
        unit = " ".join(filter(None, (self.unit, other.unit)))
        return Measured(self.value * other.value, sigma, unit)

    def over(self, other: "Measured") -> "Measured":
        """The ratio to a quantity of the same unit that was measured independently.

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
        """The difference `self` − `other` in its own σ, both measured independently.

        NaN where nothing is known of that σ.
        """
        sigma = math.hypot(self.sigma, other.sigma)
        return (self.value - other.value) / sigma if 0 < sigma < math.inf else math.nan

    def __str__(self) -> str:
        """The value to two digits of its σ, and the unit."""
        return " ".join(filter(None, (with_uncertainty(self.value, self.sigma), self.unit)))


def with_uncertainty(value: float, sigma: float) -> str:
    """`0.0802(13)`: the value to two digits of its σ; `0.08` if σ is 0, `0.08(?)` if unknown."""
    if sigma == 0:
        return f"{value:.6g}"
    if not math.isfinite(sigma):
        return f"{value:.3g}(?)"
    decimals = 1 - math.floor(math.log10(sigma))
    digits = round(sigma * 10.0**decimals)
    if digits == 100:
        decimals, digits = decimals - 1, 10
    if decimals > 8:
        exponent = math.floor(math.log10(abs(value))) if value else 0
        if exponent < -3:
            return f"{with_uncertainty(value / 10.0**exponent, sigma / 10.0**exponent)}e{exponent}"
    if decimals < MOST_ROUNDED:
        exponent = math.floor(math.log10(max(abs(value), sigma)))
        return f"{with_uncertainty(value / 10.0**exponent, sigma / 10.0**exponent)}e{exponent}"
    if decimals < 0:
        return f"{round(value, decimals):.0f}({digits * 10**-decimals})"
    # σ of 1 and more is written with its decimal point, as in 12.5(1.3).
    bracket = f"{sigma:.{decimals}f}" if decimals > 0 and sigma >= 1 else str(digits)
    return f"{value:.{decimals}f}({bracket})"
