"""Unit of a column of uncertainties, and its conversion to the unit of the values."""

from labrig.foundation.errors import UsageError

#: Fractions of the value by the names of units that are relative.
_RELATIVE = {"%": 1e-2, "percent": 1e-2, "pct": 1e-2, "prozent": 1e-2, "‰": 1e-3}
_PREFIXES = {
    "": 1.0, "f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3,
    "k": 1e3, "M": 1e6, "G": 1e9,
}  # fmt: skip
_TYPOGRAPHY = str.maketrans({"²": "2", "³": "3", "^": "", " ": "", "·": "*", "−": "-", "⁻": "-"})


def sigma_scale(sigma_unit: str, value_unit: str, name: str) -> tuple[float, bool]:
    """Return the factor from a column of uncertainties to σ, and whether it multiplies the value.

    Parameters
    ----------
    sigma_unit, value_unit
        Units of both columns; an empty one is the same as the other's.
    name
        Name of the column of uncertainties, for the message.

    Raises
    ------
    UsageError
        The units differ by more than a prefix such as m or k.
    """
    of, value = (unit.strip(" ()[]").translate(_TYPOGRAPHY) for unit in (sigma_unit, value_unit))
    if of == value:
        return 1.0, False
    fraction = _RELATIVE.get(of.lower())
    if fraction is not None:
        return fraction, True
    # The first letter may be a prefix, in which case matters: mV, MV.
    if not of or not value or (of[0] == value[0] and of.lower() == value.lower()):
        return 1.0, False
    for prefix, factor in _PREFIXES.items():
        for value_prefix, value_factor in _PREFIXES.items():
            base = of[len(prefix) :]
            if base and of == prefix + base and value == value_prefix + base:
                return factor / value_factor, False
    raise UsageError(
        f"expected uncertainties in the unit of the values, '{value_unit}', or in %, got "
        f"'{sigma_unit}' in '{name}'; convert them and write their unit into the header, or delete "
        "the column: σ is then taken from the scatter"
    )
