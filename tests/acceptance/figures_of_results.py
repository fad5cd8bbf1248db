"""All numbers with a σ in a result folder, whatever protocol it is of; two of them compared."""

import csv
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from labrig.foundation.yaml_file import read_yaml

Figures = dict[str, tuple[float, float]]

#: Tables of single frames, values at their times, and what a run is called by: no figures. Two runs
#: have others.
NO_FIGURES = ("series.csv", "provenance.yaml")
SINGLE_FRAMES, TIMES = "frames", "t_s"
#: Whose σ a key is that does not say so itself.
OF_SIGMA = {"sigma_dn_per_s": ("rate_dn_per_s",), "sigma": ("value", "bands", "fraction", "factor")}


def figures(result: Path) -> Figures:
    """Name → value and σ."""
    found: Figures = {}
    for path in sorted(result.rglob("*")):
        if path.name not in NO_FIGURES:
            place = str(path.relative_to(result))
            found |= {f"{place} {name}": pair for name, pair in _pairs(_read(path))}
    return found


def furthest_in_sigma(some: Figures, others: Figures) -> tuple[int, float, str]:
    """Return the number of figures in both, the largest difference in σ, and its name."""
    off = {
        name: abs(others[name][0] - value) / math.hypot(sigma, others[name][1])
        for name, (value, sigma) in some.items()
        if name in others and sigma > 0 and others[name][1] > 0
    }
    which = max(off, key=lambda name: off[name], default="")
    return len(off), off.get(which, 0.0), which


def _read(path: Path) -> Any:
    if path.suffix == ".json":
        return json.loads(path.read_text(encoding="utf-8"))
    if path.suffix == ".yaml":
        return read_yaml(path)
    if path.suffix == ".csv":
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        return {key: [_number(row[key]) for row in rows] for key in rows[0]}
    return {}


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _pairs(content: Any, place: str = "") -> Iterator[tuple[str, tuple[float, float]]]:
    """Every value with its σ, which is beside it under a key that says so."""
    if isinstance(content, list):
        for number, inner in enumerate(content):
            yield from _pairs(inner, f"{place}{number} ")
    elif isinstance(content, Mapping) and TIMES not in content:
        for key, inner in content.items():
            if (of := _whose(key, content)) is not None:
                yield from _side_by_side(content[of], inner, f"{place}{of} ")
            elif key != SINGLE_FRAMES:
                yield from _pairs(inner, f"{place}{key} ")


def _whose(key: str, content: Mapping[str, Any]) -> str | None:
    wanted = (key.replace("_sigma", ""), *OF_SIGMA.get(key, ()))
    return next((one for one in wanted if one in content and one != key), None)


def _side_by_side(value: Any, sigma: Any, place: str) -> Iterator[tuple[str, tuple[float, float]]]:
    if isinstance(value, list) and isinstance(sigma, list):
        for number, pair in enumerate(zip(value, sigma, strict=True)):
            yield from _side_by_side(*pair, f"{place}{number} ")
    elif isinstance(value, Mapping) and isinstance(sigma, Mapping):
        for key in value.keys() & sigma.keys():
            yield from _side_by_side(value[key], sigma[key], f"{place}{key} ")
    elif isinstance(value, float) and isinstance(sigma, float):
        yield place.strip(), (value, sigma)
