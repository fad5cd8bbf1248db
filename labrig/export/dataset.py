"""The result of a run as an xarray Dataset, for notebooks."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from labrig.errors import UsageError
from labrig.record import read_run
from labrig.results import FittedDecay, Series, read_fitted_decay, read_series

if TYPE_CHECKING:
    from xarray import Dataset

#: Attributes of variables: xarray's plots write them at the axes.
SECONDS, PER_S, DN_PER_S = {"units": "s"}, {"units": "1/s"}, {"units": "DN/s"}
AFTER_LAMP_OFF = {"long_name": "start of the exposure after lamp off"}

Column = tuple[Any, ...]


def read_dataset(run: Path | str) -> "Dataset":
    """The latest result of the run in folder `run`, as in its series.csv and fit.json.

    Returns
    -------
    Dataset
        Dimensions `patch`, `frame` (file names), `channel` and `state` (from 1, by falling rate).
        `value` and `sigma` (patch, frame, channel), `flag` (patch, frame); over the frames `t_s`,
        `exposure_s`, `unit`, `iso`, `f_number`. Of the fits `k_r_per_s`, `amplitude` (patch,
        state), `channel_weight`, `offset` (patch, channel), each with its σ, and `flicker`,
        `reduced_chi2`, `fit_warnings` (patch); NaN where there is no fit. Units are attributes
        of the variables; the Dataset's own say which run, sample and devices.

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
    places = sorted(path.parent for path in (folder / "result").rglob("series.csv"))
    if not places:
        raise UsageError(
            f"{folder}: expected a run with a result; make it with: labrig process {folder}"
        )
    patches = [read_series(place / "series.csv") for place in places]
    fits = [_read_fit(place / "fit.json") for place in places]
    channels = patches[0][0].channels
    return xarray.Dataset(
        _measured(patches) | _fitted(fits, channels),
        {
            "patch": [decays[0].region for decays in patches],
            "channel": list(channels),
            "state": 1 + np.arange(max((fit.n_states for fit in fits if fit), default=0)),
            "frame": _joined(patches[0], "frame"),
            "unit": ("frame", _joined(patches[0], "unit")),
            "t_s": ("frame", _joined(patches[0], "t_s"), SECONDS | AFTER_LAMP_OFF),
            "exposure_s": ("frame", _joined(patches[0], "exposure_s"), SECONDS),
            "iso": ("frame", _joined(patches[0], "iso")),
            "f_number": ("frame", _joined(patches[0], "f_number")),
        },
        _attributes(folder),
    )


def _attributes(folder: Path) -> dict[str, str]:
    """What the journal says of the whole run."""
    completed = read_run(folder).completed()
    start = next(iter(completed.values())).start if completed else {}
    known = {
        key: start[key] for key in ("protocol", "sample", "rig", "labrig_version") if key in start
    }
    return {"run": folder.resolve().name, **known, **start.get("devices", {})}


def _read_fit(path: Path) -> FittedDecay | None:
    """What was fitted; None where nothing was."""
    return read_fitted_decay(path) if path.is_file() else None


def _measured(patches: Sequence[Sequence[Series]]) -> dict[str, Column]:
    """Every patch was measured in the same frames."""

    def stacked(name: str) -> NDArray[Any]:
        return np.stack([_joined(decays, name) for decays in patches])

    dimensions = ("patch", "frame", "channel")
    return {
        "value": (dimensions, stacked("values"), DN_PER_S | {"long_name": "signal"}),
        "sigma": (dimensions, stacked("sigma"), DN_PER_S),
        "flag": (("patch", "frame"), stacked("flag")),
    }


def _joined(decays: Sequence[Series], name: str) -> NDArray[Any]:
    """A column of all decays, one after the other."""
    return np.concatenate([getattr(decay, name) for decay in decays])


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
