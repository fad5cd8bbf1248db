"""Numbers of a result as arrays of xarray, with their units."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.errors import UsageError
from labrig.foundation.notebook_views import NotebookViews
from labrig.record import read_run
from labrig.results import (
    ONLY,
    SIGMA,
    ChainResult,
    DecayPatch,
    FittedDecay,
    Measured,
    ResultWithDecays,
    RunResult,
    Series,
    Units,
    coordinates_by_length,
    iter_values,
    number_array,
)

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

#: Attributes of variables, with which xarray labels axes.
SECONDS, PER_S = {"units": "s"}, {"units": "1/s"}
AFTER_LAMP_OFF = {"long_name": "start of the exposure after lamp off"}

Column = tuple[Any, ...]
Place = tuple[str, ...]


def dataset_of(result: NotebookViews) -> "Dataset | DataTree":
    """Convert a result to an xarray Dataset or DataTree.

    Parameters
    ----------
    result
        A result, fit or series.

    Returns
    -------
    Dataset
        Of a decay, of one of its patches or of a series: dimensions `patch`, `frame` (file names),
        `channel` and `state` (from 1, by falling rate). Signals `value` and `value_sigma` have the
        shape (patch, frame, channel), `flag` has (patch, frame); the coordinates `t_s`,
        `exposure_s`, `unit`, `iso`, `f_number` have (frame,). Fit parameters are `k_r_per_s`,
        `amplitude` (patch, state) and `channel_weight`, `offset` (patch, channel), each with its σ,
        and `flicker`, `reduced_chi2`, `fit_warnings` (patch); NaN where there is no fit. Units are
        attributes of the variables; attributes of the Dataset name run, sample and devices.
    DataTree
        Of anything else, with its fields as variables and fields within fields as nodes; a chain
        has a node for each part. Arrays of one node that are as long as its wavelengths, angles or
        times have these as their coordinate.

    Raises
    ------
    UsageError
        If xarray is not installed.
    DataError
        If the journal of the result's run was changed.

    Examples
    --------
    >>> import labrig
    >>> from labrig.export import dataset_of
    >>> decay = dataset_of(labrig.read_result("runs/decay"))
    >>> decay["value"].dims
    ('patch', 'frame', 'channel')
    >>> [f"{rate:.4f}" for rate in decay["k_r_per_s"].sel(patch="sample").values]
    ['0.2048', '0.0101']
    >>> decay["k_r_per_s"].attrs["units"]
    '1/s'
    """
    try:
        import xarray
    except ImportError:
        raise UsageError(
            "a Dataset needs xarray, which is not installed; install it with: "
            "python -m pip install 'labrig[notebook]'"
        ) from None
    folder = result.run_folder if isinstance(result, RunResult) else None
    attributes = _attributes(folder) if folder is not None else {}
    if isinstance(result, ResultWithDecays):
        return _decay(result.patches, attributes)
    if isinstance(result, DecayPatch):
        return _decay({result.series.region or ONLY: result}, attributes)
    if isinstance(result, Series):
        return xarray.Dataset(_measured([result]), _frames([result.region or ONLY], result))
    tree = xarray.DataTree.from_dict(_nodes(result))
    tree.attrs.update(attributes)
    return tree


def _nodes(result: Any) -> "dict[str, Dataset]":
    """Return the nodes of a result's tree by path."""
    import xarray

    if isinstance(result, ResultWithDecays):
        return {"/": _decay(result.patches, {})}
    items = [(path, value) for path, value in iter_values(result) if path != ("warnings",)]
    units = Units(items)
    fields: dict[Place, dict[str, Any]] = {(): {}}
    for path, value in items:
        place = tuple(key.replace("/", "_") for key in path[:-1])
        fields.setdefault(place, {})[path[-1].replace("/", "_")] = value
    for node in fields.values():
        if "sigma" in node and "value" in node:
            node["value" + SIGMA] = node.pop("sigma")
    variables: dict[Place, _Variables] = {}
    for place in sorted(fields, key=len):
        outer = [variables[place[:n]] for n in range(len(place)) if place[:n] in variables]
        taken = {name for node in outer for name in node.dimensions}
        variables[place] = _variables(place, fields[place], units, taken)
    nodes = {
        "/" + "/".join(place): xarray.Dataset(node.columns, node.coordinates)
        for place, node in variables.items()
    }
    nodes["/"].attrs["warnings"] = "\n".join(map(str, getattr(result, "warnings", ())))
    if isinstance(result, ChainResult):
        for name, part in result.parts.items():
            nodes |= {f"/{name}{path}".rstrip("/"): node for path, node in _nodes(part).items()}
    return nodes


@dataclass(frozen=True)
class _Variables:
    """Variables and coordinates of a node, and the names of its dimensions."""

    columns: dict[str, Column]
    coordinates: dict[str, Column]
    dimensions: frozenset[str]


def _variables(
    place: Place, values: Mapping[str, Any], units: Units, taken: Collection[str]
) -> _Variables:
    """Return the fields of a node as variables, with their σ.

    A dimension is named by the coordinate of its length; one whose name a node around has, too, and
    one without a coordinate, by the whole path.
    """
    arrays: dict[str, NDArray[Any]] = {}
    columns: dict[str, Column] = {}
    for name, value in values.items():
        if isinstance(value, Measured):
            in_unit = {"units": value.unit}
            columns[name] = ((), value.value, in_unit)
            columns[name + SIGMA] = ((), value.sigma, in_unit)
        elif (array := number_array(value)) is not None:
            arrays[name] = array
    lengths = coordinates_by_length(arrays)
    coordinates: dict[str, Column] = {}
    dimensions = set()
    for name, array in arrays.items():
        unit = units.of((*place, name))
        attributes = {"units": unit} if unit else {}
        own = []
        for axis, length in enumerate(array.shape):
            coordinate = lengths.get(length, "")
            # A covariance has the second of its axes by another name.
            is_own = coordinate and coordinate not in taken and coordinate not in own
            own.append(coordinate if is_own else ".".join((*place, name)) + f"_{axis}")
        dimensions.update(own)
        if name in own:
            coordinates[name] = ((name,), array, attributes)
        else:
            columns[name] = (tuple(own), array, attributes)
    return _Variables(columns, coordinates, frozenset(dimensions))


def _decay(patches: Mapping[str, DecayPatch], attributes: Mapping[str, str]) -> "Dataset":
    import xarray

    series = [patch.series for patch in patches.values()]
    fits = [patch.fit for patch in patches.values()]
    states = 1 + np.arange(max((fit.n_states for fit in fits if fit), default=0))
    return xarray.Dataset(
        _measured(series) | _fitted(fits, series[0].channels, series[0].value_unit),
        _frames(list(patches), series[0]) | {"state": states},
        attributes,
    )


def _frames(patches: Sequence[str], first: Series) -> dict[str, Any]:
    """Return the coordinates of patches that were measured in the same frames."""
    return {
        "patch": list(patches),
        "channel": list(first.channels),
        "frame": np.array(first.frame),
        "unit": ("frame", np.array(first.unit)),
        "t_s": ("frame", first.t_s, SECONDS | AFTER_LAMP_OFF),
        "exposure_s": ("frame", first.exposure_s, SECONDS),
        "iso": ("frame", first.iso),
        "f_number": ("frame", first.f_number),
    }


def _attributes(folder: Path) -> dict[str, str]:
    """Return the attributes of the whole run from its journal."""
    run = read_run(folder)
    completed = run.completed()
    start = next(iter(completed.values())).start if completed else {}
    values = {
        key: start[key] for key in ("protocol", "sample", "rig", "labrig_version") if key in start
    }
    return {"run": run.name, **values, **start.get("devices", {})}


def _measured(patches: Sequence[Series]) -> dict[str, Column]:
    """Return the signals of all patches, which were measured in the same frames."""
    dimensions = ("patch", "frame", "channel")
    values = np.stack([series.values for series in patches])
    units = {"units": patches[0].value_unit}
    flags = np.stack([np.array(series.flag) for series in patches])
    return {
        "value": (dimensions, values, units | {"long_name": "signal"}),
        "value_sigma": (dimensions, np.stack([series.sigma for series in patches]), units),
        "flag": (("patch", "frame"), flags),
    }


def _fitted(
    fits: Sequence[FittedDecay | None], channels: Sequence[str], value_unit: str
) -> dict[str, Column]:
    in_values = {"units": value_unit}
    n_states = max((fit.n_states for fit in fits if fit), default=0)

    def state_rows(key: str) -> NDArray[np.float64]:
        rows = np.full((len(fits), n_states), np.nan)
        for row, fit in zip(rows, fits, strict=True):
            if fit:
                row[: fit.n_states] = [getattr(state, key) for state in fit.states]
        return rows

    def channel_rows(key: str) -> NDArray[np.float64]:
        rows = np.full((len(fits), len(channels)), np.nan)
        for row, fit in zip(rows, fits, strict=True):
            if fit:
                by_name = dict(zip(fit.channels, getattr(fit, key), strict=True))
                row[:] = [by_name.get(name, np.nan) for name in channels]
        return rows

    def patch_values(key: str) -> NDArray[np.float64]:
        return np.array([getattr(fit, key) if fit else np.nan for fit in fits])

    states, weights = ("patch", "state"), ("patch", "channel")
    return {
        "k_r_per_s": (states, state_rows("k_r_per_s"), PER_S),
        "k_r_per_s_sigma": (states, state_rows("k_r_per_s_sigma"), PER_S),
        "amplitude": (states, state_rows("amplitude"), in_values),
        "amplitude_sigma": (states, state_rows("amplitude_sigma"), in_values),
        "channel_weight": (weights, channel_rows("channel_weights")),
        "channel_weight_sigma": (weights, channel_rows("channel_weights_sigma")),
        "offset": (weights, channel_rows("offsets"), in_values),
        "offset_sigma": (weights, channel_rows("offsets_sigma"), in_values),
        "flicker": ("patch", patch_values("flicker")),
        "reduced_chi2": ("patch", patch_values("reduced_chi2")),
        "fit_warnings": (
            "patch",
            ["\n".join(map(str, fit.warnings)) if fit else "" for fit in fits],
        ),
    }
