"""Headline values of a result, as its file has them with their budgets; read without NumPy."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from labrig.foundation.errors import LabrigError
from labrig.foundation.input_file import MAX_JSON_BYTES, read_text
from labrig.results.budget import named
from labrig.results.measured import Measured
from labrig.results.run_result import FILE


def headline_values(folder: Path) -> dict[str, Measured]:
    """Return the values of a result whose uncertainty has a budget, those of a chain by part.

    Parameters
    ----------
    folder
        Folder of the result.

    Returns
    -------
    dict of str to Measured
        Values with σ and unit by their names; none if there is no result, or it cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.results import headline_values
    >>> values = headline_values(Path("runs/decay/result"))
    >>> list(values)[:2], str(values["k_r of state 1"])
    (['k_r of state 1', 'amplitude of state 1'], '0.2048(31) 1/s')
    """
    try:
        content = json.loads(read_text(folder / FILE, MAX_JSON_BYTES))
        return dict(_values(content, ""))
    except (LabrigError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}


def _values(content: Mapping[str, Any], part: str) -> Iterator[tuple[str, Measured]]:
    """Yield the values of a result, then those of its parts."""
    for name, budget in content["budgets"].items():
        # An infinite σ is a text.
        value = Measured(float(budget["value"]), float(budget["sigma"]), str(budget["unit"]))
        yield named(part, name), value
    for name, result in content.get("parts", {}).items():
        yield from _values(result, named(part, name))
