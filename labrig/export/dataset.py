"""Export of a result to xarray."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.errors import UsageError
from labrig.record import read_run
from labrig.results import (
    ChainResult,
    FittedDecay,
    Measured,
    ResultWithDecays,
    RunResult,
    Series,
    field_unit,
    iter_values,
    read_result,
)

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

#: Attributes of variables, with which xarray labels axes.
SECONDS, PER_S, DN_PER_S = {"units": "s"}, {"units": "1/s"}, {"units": "DN/s"}
AFTER_LAMP_OFF = {"long_name": "start of the exposure after lamp off"}

Column = tuple[Any, ...]


def read_dataset(run: Path | str) -> "Dataset | DataTree":
    """Read the latest result of a run as an xarray Dataset or DataTree.

    Parameters
    ----------
    run
        Run folder with a result.

    Returns
    -------
    Dataset
        Result of a decay, with dimensions `patch`, `frame` (file names), `channel` and `state`
        (from 1, by falling rate). Signals `value` and `sigma` have the shape (patch, frame,
        channel), `flag` has (patch, frame); the coordinates `t_s`, `exposure_s`, `unit`, `iso`,
        `f_number` have (frame,). Fit parameters are `k_r_per_s`, `amplitude` (patch, state) and
        `channel_weight`, `offset` (patch, channel), each with its σ, and `flicker`, `reduced_chi2`,
        `fit_warnings` (patch); NaN where there is no fit. Units are attributes of the variables;
        attributes of the Dataset name run, sample and devices.
    DataTree
        Result of any other protocol, with its fields as variables and fields within fields as
        nodes; a chain has a node for each part.

    Raises
    ------
    UsageError
        If this is not a run folder with a result, or xarray is not installed.
    DataError
        If a file of the result was changed.

    Examples
    --------
    >>> import labrig
    >>> decay = labrig.read_dataset("runs/decay")
    >>> decay["value"].dims
    ('patch', 'frame', 'channel')
    >>> [f"{rate:.4f}" for rate in decay["k_r_per_s"].sel(patch="sample").values]
    ['0.2048', '0.0101']
    >>> decay["k_r_per_s"].attrs["units"]
    '1/s'
    """
    try:
        import xarray  # noqa: F401
    except ImportError:
        raise UsageError(
            "a Dataset needs xarray, which is not installed; install it with: "
            "python -m pip install xarray"
        ) from None
    folder = Path(run)
    result = read_result(folder)
    attributes = _attributes(folder)
    if isinstance(result, ResultWithDecays):
        return _decay(result, attributes)
    return tree_of(result, attributes)


def tree_of(result: RunResult, attributes: Mapping[str, str] | None = None) -> "DataTree":
    """Convert a result of any protocol to an xarray DataTree.

    Parameters
    ----------
    result
        Result of a run.
    attributes
        Attributes of the root node.

    Returns
    -------
    DataTree
        Tree with the fields of the result, as described in `read_dataset`.

    Examples
    --------
    >>> import labrig
    >>> from labrig.export import tree_of
    >>> tree = tree_of(labrig.read_result("runs/decay"), {"run": "decay"})
    >>> tree["value"].shape
    (1, 18, 3)
    >>> tree.attrs["run"]
    'decay'
    """
    import xarray

    tree = xarray.DataTree.from_dict(_nodes(result))
    tree.attrs.update(attributes or {})
    return tree


def _nodes(result: RunResult) -> "dict[str, Dataset]":
    """Return the nodes of a result's tree by path."""
    import xarray

    if isinstance(result, ResultWithDecays):
        return {"/": _decay(result, {})}
    variables: dict[str, dict[str, Column]] = {"/": {}}
    for path, value in iter_values(result):
        *inner, name = (key.replace("/", "_") for key in path)
        if path != ("warnings",):
            place = "/" + "/".join(inner)
            variables.setdefault(place, {}).update(_columns(".".join((*inner, name)), name, value))
    nodes = {place: xarray.Dataset(columns) for place, columns in variables.items()}
    nodes["/"].attrs["warnings"] = "\n".join(map(str, result.warnings))
    if isinstance(result, ChainResult):
        for name, part in result.parts.items():
            nodes |= {f"/{name}{path}".rstrip("/"): node for path, node in _nodes(part).items()}
    return nodes


def _columns(dimension: str, name: str, value: Any) -> dict[str, Column]:
    """Return a field as variable, with its σ if it has one; empty for other values."""
    if isinstance(value, Measured):
        unit = {"units": value.unit}
        return {name: ((), value.value, unit), f"{name}_sigma": ((), value.sigma, unit)}
    try:
        array = np.asarray(value)
    except ValueError:
        return {}
    if array.dtype.kind not in "iufbU" or not array.size:
        return {}
    dimensions = tuple(f"{dimension}_{axis}" for axis in range(array.ndim))
    units = field_unit(name)
    return {name: (dimensions, array, {"units": units} if units else {})}


def _decay(result: ResultWithDecays, attributes: Mapping[str, str]) -> "Dataset":
    import xarray

    patches = [patch.series for patch in result.patches.values()]
    fits = [patch.fit for patch in result.patches.values()]
    channels = patches[0].channels
    first = patches[0]
    return xarray.Dataset(
        _measured(patches) | _fitted(fits, channels),
        {
            "patch": list(result.patches),
            "channel": list(channels),
            "state": 1 + np.arange(max((fit.n_states for fit in fits if fit), default=0)),
            "frame": np.array(first.frame),
            "unit": ("frame", np.array(first.unit)),
            "t_s": ("frame", first.t_s, SECONDS | AFTER_LAMP_OFF),
            "exposure_s": ("frame", first.exposure_s, SECONDS),
            "iso": ("frame", first.iso),
            "f_number": ("frame", first.f_number),
        },
        attributes,
    )


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
    flags = np.stack([np.array(series.flag) for series in patches])
    return {
        "value": (dimensions, values, DN_PER_S | {"long_name": "signal"}),
        "sigma": (dimensions, np.stack([series.sigma for series in patches]), DN_PER_S),
        "flag": (("patch", "frame"), flags),
    }


def _fitted(fits: Sequence[FittedDecay | None], channels: Sequence[str]) -> dict[str, Column]:
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
        "amplitude": (states, state_rows("amplitude"), DN_PER_S),
        "amplitude_sigma": (states, state_rows("amplitude_sigma"), DN_PER_S),
        "channel_weight": (weights, channel_rows("channel_weights")),
        "channel_weight_sigma": (weights, channel_rows("channel_weights_sigma")),
        "offset": (weights, channel_rows("offsets"), DN_PER_S),
        "offset_sigma": (weights, channel_rows("offsets_sigma"), DN_PER_S),
        "flicker": ("patch", patch_values("flicker")),
        "reduced_chi2": ("patch", patch_values("reduced_chi2")),
        "fit_warnings": (
            "patch",
            ["\n".join(map(str, fit.warnings)) if fit else "" for fit in fits],
        ),
    }
