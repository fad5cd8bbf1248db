"""The file `fit.json` of a fitted decay: reading, writing, and finding it in a result."""

import json
import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from labrig.foundation.errors import DataError, LabrigError
from labrig.foundation.input_file import MAX_JSON_BYTES, read_text
from labrig.foundation.result_warning import as_warnings
from labrig.results.decay_reference import DecayReference, UnseenFlicker
from labrig.results.fitted_decay import (
    SCHEMA_VERSION,
    Candidate,
    DecayState,
    FittedDecay,
    ScatterSigma,
    UnseenState,
)
from labrig.results.fitted_law import fitted_law, fitted_rate_spectrum
from labrig.results.interval import read_intervals
from labrig.results.text_files import write_json

FILE = "fit.json"


def write_fitted_decay(path: Path, result: FittedDecay) -> None:
    """Write the fit of a decay to a JSON file.

    Parameters
    ----------
    path
        Path of the file, `fit.json` in a result folder.
    result
        The fitted decay.

    Raises
    ------
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.results import read_fitted_decay, write_fitted_decay
    >>> result = labrig.read_result("runs/decay")
    >>> write_fitted_decay(Path("fit.json"), result.patches["sample"].fit)
    >>> read_fitted_decay(Path("fit.json")).n_states
    2
    """
    write_json(path, result.to_dict())


def read_fitted_decay(path: Path) -> FittedDecay:
    """Read the fit of a decay from a JSON file.

    Parameters
    ----------
    path
        Path of a `fit.json`, as `write_fitted_decay` writes it.

    Returns
    -------
    FittedDecay
        Rates, amplitudes and offsets with their standard uncertainties and covariance.

    Raises
    ------
    DataError
        The file is missing, damaged, or of another version.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.results import read_fitted_decay
    >>> fit = read_fitted_decay(Path("runs/decay/result/fit.json"))
    >>> [f"{rate.value:.2g} {rate.unit}" for rate in fit.rates]
    ['0.2 1/s', '0.01 1/s']
    """
    try:
        return _from_dict(json.loads(read_text(path, MAX_JSON_BYTES)))
    except (
        LabrigError, ValueError, KeyError, TypeError, AttributeError, RecursionError
    ) as error:  # fmt: skip
        raise DataError(
            f"{path}: expected the fit of a decay as this labrig writes it, got something else "
            f"({error!r}); make it again: labrig process RUN"
        ) from None


def find_fitted_decays(folder: Path) -> dict[str, Path]:
    """Find the fit of every patch in a result folder.

    Parameters
    ----------
    folder
        A result folder.

    Returns
    -------
    dict of str to Path
        Path of each `fit.json` by the name of the patch's folder. A run with one patch has its fit
        in the result folder itself, under the name "". Folders of one name, as of several samples,
        have their whole path in the result folder instead, such as `blue-paint/decay`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.results import find_fitted_decays
    >>> for name, path in find_fitted_decays(Path("runs/decay/result")).items():
    ...     print(repr(name), path.as_posix())
    '' runs/decay/result/fit.json
    """
    paths = fits_by_folder(folder)
    last = {place: place.rpartition("/")[2] for place in paths}
    names = Counter(last.values())
    return {place if names[last[place]] > 1 else last[place]: path for place, path in paths.items()}


def fits_by_folder(folder: Path) -> dict[str, Path]:
    """Find the fitted decays in a result folder by the whole paths of their folders.

    Parameters
    ----------
    folder
        Folder of the results.

    Returns
    -------
    dict of str to Path
        Path of each `fit.json` by its folder in the result, such as `decay/left-paint`, which is
        "" if the fit lies in the result itself.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.results import fits_by_folder
    >>> list(fits_by_folder(Path("runs/decay/result")))
    ['']
    """
    return {
        path.parent.relative_to(folder).as_posix().removeprefix("."): path
        for path in sorted(folder.rglob(FILE))
    }


def read_fitted_decays(folder: Path) -> dict[str, FittedDecay]:
    """Read the fit of every patch in a result folder.

    Parameters
    ----------
    folder
        A result folder.

    Returns
    -------
    dict of str to FittedDecay
        The fits by name of the patch, as in `find_fitted_decays`; empty if nothing was fitted.

    Raises
    ------
    DataError
        A file is damaged.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.results import read_fitted_decays
    >>> for name, fit in read_fitted_decays(Path("runs/decay/result")).items():
    ...     print(repr(name), fit.n_states, fit.brightest_channel)
    '' 2 G
    """
    return {name: read_fitted_decay(path) for name, path in find_fitted_decays(folder).items()}


def _from_dict(content: Any) -> FittedDecay:
    if content["schema_version"] != SCHEMA_VERSION:
        raise ValueError(f"schema_version {content['schema_version']}, not {SCHEMA_VERSION}")
    weights: Mapping[str, float] = content["channel_weights"]
    scatter, spectrum = content["sigma_from_scatter"], content["rate_spectrum"]
    unseen, flicker = content["unseen_state"], content["unseen_flicker"]
    return FittedDecay(
        states=tuple(
            DecayState(
                k_r_per_s=float(state["k_r_per_s"]),
                k_r_per_s_sigma=_number_or(state["k_r_per_s_sigma"]),
                amplitude=float(state["amplitude"]),
                amplitude_sigma=_number_or(state["amplitude_sigma"]),
            )
            for state in content["states"]
        ),
        channels=tuple(weights),
        channel_weights=tuple(map(float, weights.values())),
        channel_weights_sigma=_by_channel_order(weights, content["channel_weights_sigma"]),
        offsets=tuple(float(content["offsets"][name]) for name in weights),
        offsets_sigma=_by_channel_order(weights, content["offsets_sigma"]),
        repeats=tuple(content["levels"]),
        levels=tuple(map(float, content["levels"].values())),
        flicker=float(content["flicker"]),
        flicker_sigma=_number_or(content["flicker_sigma"]),
        chi2=float(content["chi2"]),
        dof=int(content["dof"]),
        bic=float(content["bic"]),
        covariance=np.array(
            [[_number_or(value) for value in row] for row in content["covariance"]],
            dtype=np.float64,
        ),
        warnings=as_warnings(content["warnings"]),
        candidates=tuple(
            Candidate(
                **candidate | {"reduced_chi2": _number_or(candidate["reduced_chi2"], math.nan)}
            )
            for candidate in content["candidates"]
        ),
        law=content["law"],
        laws=tuple(fitted_law(law) for law in content["laws"]),
        rate_spectrum=None if spectrum is None else fitted_rate_spectrum(spectrum),
        measured_until_s=float(content["measured_until_s"]),
        reference=DecayReference(**content["reference"]),
        scatter=None if scatter is None else ScatterSigma(**scatter),
        sigma_origin=content["sigma_origin"],
        sigma_factor=float(content["sigma_factor"]),
        unseen_state=None if unseen is None else _unseen_state(unseen),
        intervals=read_intervals(content["intervals"]),
        value_unit=content["value_unit"],
        unseen_flicker=None if flicker is None else UnseenFlicker(**flicker),
    )


def _unseen_state(content: Mapping[str, Any]) -> UnseenState:
    return UnseenState(
        lifetime_s=float(content["lifetime_s"]),
        share=float(content["share"]),
        rate_changes=tuple(map(float, content["rate_changes"])),
        amplitude_changes=tuple(map(float, content["amplitude_changes"])),
    )


def _by_channel_order(
    channels: Mapping[str, Any], sigma: Mapping[str, float | None]
) -> tuple[float, ...]:
    return tuple(_number_or(sigma[name]) for name in channels)


def _number_or(value: float | None, unknown: float = math.inf) -> float:
    """Return the number of a JSON value, whose null stands for infinity or another `unknown`."""
    return unknown if value is None else float(value)
