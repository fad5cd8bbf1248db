"""The result of a run as an xarray Dataset, for notebooks."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from labrig.errors import UsageError
from labrig.record import read_run
from labrig.results import (
    FittedDecay,
    Measured,
    RunResult,
    Series,
    leaves,
    read_result,
    unit_of,
)
from labrig.results.decay import DecayResult
from labrig.results.phosphor import PhosphorResult

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

#: Attributes of variables: xarray's plots write them at the axes.
SECONDS, PER_S, DN_PER_S = {"units": "s"}, {"units": "1/s"}, {"units": "DN/s"}
AFTER_LAMP_OFF = {"long_name": "start of the exposure after lamp off"}

Column = tuple[Any, ...]


def read_dataset(run: Path | str) -> "Dataset | DataTree":
    """The latest result of the run in folder `run`.

    Returns
    -------
    Dataset
        Of a decay: dimensions `patch`, `frame` (file names), `channel` and `state` (from 1, by
        falling rate). `value` and `sigma` (patch, frame, channel), `flag` (patch, frame); over the
        frames `t_s`, `exposure_s`, `unit`, `iso`, `f_number`. Of the fits `k_r_per_s`, `amplitude`
        (patch, state), `channel_weight`, `offset` (patch, channel), each with its σ, and
        `flicker`, `reduced_chi2`, `fit_warnings` (patch); NaN where there is no fit.
        Of any other protocol: every field of its result, those of fields in fields with a dot
        between, with dimensions of their own. Units are attributes of the variables; the Dataset's
        own say which run, sample and devices.
    DataTree
        Of a chain: a node for each part, and the materials at its root.

    Raises
    ------
    UsageError
        Not a run folder with a result, or xarray is not installed.
    DataError
        A file in it was changed.
    """
    try:
        import xarray
    except ImportError:
        raise UsageError(
            "a Dataset needs xarray, which is not installed; install it with: "
            "python -m pip install xarray"
        ) from None
    folder = Path(run)
    result = read_result(folder)
    if not isinstance(result, PhosphorResult):
        return _dataset(result, _attributes(folder))
    nodes = {name: _dataset(part, {}) for name, part in result.parts.items()}
    return xarray.DataTree.from_dict({"/": _dataset(result, _attributes(folder)), **nodes})


def _dataset(result: RunResult, attributes: dict[str, str]) -> "Dataset":
    import xarray

    if not isinstance(result, DecayResult):
        columns = {".".join(path): _column(path, value) for path, value in leaves(result)}
        found = {name: column for name, column in columns.items() if column is not None}
        return xarray.Dataset(found | _sigmas(result), attrs=attributes)
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


def _column(path: tuple[str, ...], value: Any) -> Column | None:
    """A field as a variable; None for what is neither numbers nor texts."""
    if isinstance(value, Measured):
        return ((), value.value, {"units": value.unit})
    try:
        array = np.asarray(value)
    except ValueError:
        return None
    if array.dtype.kind not in "iufbU":
        return None
    dimensions = tuple(f"{'.'.join(path)}_{axis}" for axis in range(array.ndim))
    unit = unit_of(path[-1])
    return (dimensions, array, {"units": unit} if unit else {})


def _sigmas(result: RunResult) -> dict[str, Column]:
    """The σ of every measured value, beside it."""
    return {
        f"{'.'.join(path)}_sigma": ((), value.sigma, {"units": value.unit})
        for path, value in leaves(result)
        if isinstance(value, Measured)
    }


def _attributes(folder: Path) -> dict[str, str]:
    """What the journal says of the whole run."""
    completed = read_run(folder).completed()
    start = next(iter(completed.values())).start if completed else {}
    known = {
        key: start[key] for key in ("protocol", "sample", "rig", "labrig_version") if key in start
    }
    return {"run": folder.resolve().name, **known, **start.get("devices", {})}


def _measured(patches: Sequence[Series]) -> dict[str, Column]:
    """Every patch was measured in the same frames."""
    dimensions = ("patch", "frame", "channel")
    values = np.stack([series.values for series in patches])
    flags = np.stack([np.array(series.flag) for series in patches])
    return {
        "value": (dimensions, values, DN_PER_S | {"long_name": "signal"}),
        "sigma": (dimensions, np.stack([series.sigma for series in patches]), DN_PER_S),
        "flag": (("patch", "frame"), flags),
    }


def _fitted(fits: Sequence[FittedDecay | None], channels: Sequence[str]) -> dict[str, Column]:
    most = max((fit.n_states for fit in fits if fit), default=0)

    def of_state(key: str) -> NDArray[np.float64]:
        rows = np.full((len(fits), most), np.nan)
        for row, fit in zip(rows, fits, strict=True):
            if fit:
                row[: fit.n_states] = [getattr(state, key) for state in fit.states]
        return rows

    def of_channel(key: str) -> NDArray[np.float64]:
        rows = np.full((len(fits), len(channels)), np.nan)
        for row, fit in zip(rows, fits, strict=True):
            if fit:
                by_name = dict(zip(fit.channels, getattr(fit, key), strict=True))
                row[:] = [by_name.get(name, np.nan) for name in channels]
        return rows

    def of_patch(key: str) -> NDArray[np.float64]:
        return np.array([getattr(fit, key) if fit else np.nan for fit in fits])

    states, weights = ("patch", "state"), ("patch", "channel")
    return {
        "k_r_per_s": (states, of_state("k_r_per_s"), PER_S),
        "k_r_sigma_per_s": (states, of_state("k_r_sigma_per_s"), PER_S),
        "amplitude": (states, of_state("amplitude"), DN_PER_S),
        "amplitude_sigma": (states, of_state("amplitude_sigma"), DN_PER_S),
        "channel_weight": (weights, of_channel("channel_weights")),
        "channel_weight_sigma": (weights, of_channel("channel_weights_sigma")),
        "offset": (weights, of_channel("offsets"), DN_PER_S),
        "offset_sigma": (weights, of_channel("offsets_sigma"), DN_PER_S),
        "flicker": ("patch", of_patch("flicker")),
        "reduced_chi2": ("patch", of_patch("reduced_chi2")),
        "fit_warnings": ("patch", ["\n".join(fit.warnings) if fit else "" for fit in fits]),
    }
