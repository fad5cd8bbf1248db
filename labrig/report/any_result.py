"""Plain table of a result, for protocols that register no report of their own."""

from typing import Any

import numpy as np

from labrig.report.sections import Rendered, Section, Source, Table
from labrig.results import RunResult, iter_values

#: Largest number of values that are shown; of longer arrays only the shape is shown.
MAX_SHOWN = 12


def render(result: RunResult, source: Source) -> Rendered:
    """Return a table of all fields of the result; names of nested fields are joined by dots."""
    rows = tuple(
        (".".join(path).replace("_", " "), _value_text(value))
        for path, value in iter_values(result)
        if path != ("warnings",)
    )
    table = Table(("Quantity", "Value"), rows, "Value with its standard uncertainty (1 σ).")
    lines = tuple(f"{name}: {value}" for name, value in rows)
    return Rendered((Section("Results", tables=(table,)),), lines)


def _value_text(value: Any) -> str:
    """Return a value of a result as text."""
    if isinstance(value, np.ndarray):
        if value.size > MAX_SHOWN:
            return f"{' × '.join(map(str, value.shape))} numbers"
        return ", ".join(f"{number:.6g}" for number in value.ravel())
    if isinstance(value, tuple | list):
        if len(value) > MAX_SHOWN:
            return f"{len(value)} values"
        return ", ".join(map(_value_text, value)) or "none"
    if isinstance(value, float):
        return f"{value:.6g}"
    return "none" if value is None else str(value)
