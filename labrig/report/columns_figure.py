"""Numbers of any result: single values side by side, columns over wavelength, time or angle."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from labrig.report.figure_style import OTHER_CHANNELS, new_figure, place
from labrig.report.sections import Picture
from labrig.results import (
    SIGMA,
    Quantity,
    Units,
    coordinates_by_length,
    iter_quantities,
    iter_values,
    number_array,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEIGHT_PT = 256.0
#: Height of a row of single values, and the most of them; the fewest that have no σ.
ROW_PT, MAX_ROWS, MIN_ROWS = 18.0, 60, 6
#: Longest columns whose values are drawn as points with their σ.
MAX_POINTS = 200
COLOUR = OTHER_CHANNELS[0]
Place = tuple[str, ...]


def columns_pictures(result: Any) -> Iterator[Picture]:
    """Yield figures of a result's numbers: equal quantities side by side, then each column.

    Parameters
    ----------
    result
        A result of any type.

    Yields
    ------
    Picture
        Values with ± 1 σ, by a function that draws them.

    Examples
    --------
    >>> from labrig.fit import fit_trap_depth
    >>> from labrig.report import columns_pictures
    >>> depth = fit_trap_depth([15, 21, 27], [0.030, 0.048, 0.074], [0.001, 0.001, 0.002])
    >>> [picture.name for picture in columns_pictures(depth)]
    ['rate_per_s']
    """
    items = list(iter_values(result))
    units = Units(items)
    nodes: dict[Place, dict[str, NDArray[Any]]] = {}
    for path, value in items:
        if path and (array := number_array(value)) is not None and array.ndim == 1:
            nodes.setdefault(path[:-1], {})[path[-1]] = array
    own = nodes.pop((), {})
    # Curves of the result itself come first.
    is_curve = any(own[name].dtype.kind != "U" for name in coordinates_by_length(own).values())
    if is_curve:
        yield from _columns((), own, units)
    groups: dict[str, list[Quantity]] = {}
    for quantity in iter_quantities(result):
        if quantity.path and quantity.path[-1] != "sigma":
            groups.setdefault(quantity.path[-1], []).append(quantity)
    for name, group in sorted(groups.items(), key=lambda item: item[1][0].sigma is None):
        fewest = MIN_ROWS if group[0].sigma is None else 2
        if fewest <= len(group) <= MAX_ROWS:
            yield Picture(name, partial(_rows_figure, group))
    for inner, arrays in (*nodes.items(), *(() if is_curve else [((), own)])):
        yield from _columns(inner, arrays, units)


def _columns(inner: Place, arrays: Mapping[str, NDArray[Any]], units: Units) -> Iterator[Picture]:
    """Yield a figure of each column over its coordinate, or of one with σ over its number."""
    coordinates = coordinates_by_length(arrays)
    for name, y in arrays.items():
        x_name = coordinates.get(len(y), "")
        if x_name == name or name == "sigma" or name.endswith(SIGMA) or y.dtype.kind not in "iuf":
            continue
        sigma = arrays.get("sigma" if name == "value" else name + SIGMA)
        if sigma is None and not x_name:
            continue
        x = arrays[x_name] if x_name else np.arange(1, len(y) + 1)
        x_label = _label(x_name, units.of((*inner, x_name))) if x_name else "Number"
        y_label = _label(name, units.of((*inner, name)))
        yield Picture(
            ".".join((*inner, name)), partial(_column_figure, x, y, sigma, x_label, y_label)
        )


def _label(name: str, unit: str) -> str:
    """Return the name of a field as label of an axis, with its unit."""
    ends = (f"_{unit.replace('1/', 'per_').replace('/', '_per_').lower()}", f"_{unit.lower()}")
    for end in ends if unit else ():
        name = name.removesuffix(end)
    words = name.replace("_", " ")
    text = words[:1].upper() + words[1:]
    return f"{text} / {f'({unit})' if '/' in unit else unit}" if unit else text


def _column_figure(
    x: NDArray[Any], y: NDArray[Any], sigma: NDArray[Any] | None, x_label: str, y_label: str
) -> "Figure":
    figure = new_figure(HEIGHT_PT)
    axes = place(figure, left=72, bottom=42, right=14, top=14)
    if x.dtype.kind == "U" or (sigma is not None and len(x) <= MAX_POINTS):
        axes.errorbar(x, y, sigma, fmt="o", color=COLOUR, markersize=4)
    else:
        axes.plot(x, y, color=COLOUR)
        if sigma is not None:
            low, high = np.subtract(y, sigma), np.add(y, sigma)
            axes.fill_between(x, low, high, color=COLOUR, alpha=0.2, linewidth=0)
    axes.set(xlabel=x_label, ylabel=y_label)
    return figure


def _rows_figure(quantities: Sequence[Quantity]) -> "Figure":
    """Draw equal quantities below one another, with that by which their places differ."""
    paths = [each.path[:-1] for each in quantities]
    shared = [len(set(column)) == 1 for column in zip(*paths, strict=False)]
    names = [
        " ".join(part for n, part in enumerate(path) if n >= len(shared) or not shared[n])
        for path in paths
    ]
    values = np.array([each.value for each in quantities])
    sigma = np.array([each.sigma or 0.0 for each in quantities])
    rows = np.arange(len(names))
    figure = new_figure(56 + ROW_PT * len(names))
    longest = max(map(len, names))
    axes = place(figure, left=24 + min(6.0 * longest, 230), bottom=42, right=14, top=14)
    axes.errorbar(values, rows, xerr=np.where(np.isfinite(sigma), sigma, 0), fmt="o", color=COLOUR)
    axes.set_yticks(rows, [name.replace("_", " ") for name in names])
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel(_label(quantities[0].path[-1], quantities[0].unit))
    return figure
