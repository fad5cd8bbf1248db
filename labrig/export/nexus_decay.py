"""The decays of a run and their fits, as a NeXus file has them."""

import json
import re
from collections.abc import Iterator, Sequence

import h5py
import numpy as np
from numpy.typing import NDArray

from labrig.export.hdf5 import add_group, add_note, add_number, add_text
from labrig.results import DecayPatch, FittedDecay, Series

DN_PER_S = "DN/s"
#: silx and h5web plot it so: a decay is looked at on a logarithmic scale.
LOGARITHMIC = json.dumps({"signal_scale_type": "log"})


def valid_names(names: Sequence[str]) -> list[str]:
    """Names that NeXus allows (letters of ASCII, digits, underscores), each of them once."""
    valid: list[str] = []
    for name in names:
        allowed = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_") or "unnamed"
        while allowed in valid:
            allowed += "_"
        valid.append(allowed)
    return valid


def add_decays(entry: h5py.Group, name: str, title: str, patch: DecayPatch) -> None:
    """An NXdata `decay_1_<name>` for each decay of a patch; the first is the entry's default."""
    for decay, rows in _decays(patch.series):
        series = patch.series.take(rows)
        data = _add_plot(entry, f"{decay}_{name}", title, patch, series)
        data.attrs["SILX_style"] = LOGARITHMIC
        _add_signals(data, series.channels, series.values)
        for number, channel in enumerate(series.channels):
            add_number(data, f"{channel}_errors", series.sigma[:, number], DN_PER_S)
        add_number(data, "exposure_start", series.t_s, "s")
        add_number(data, "exposure_time", series.exposure_s, "s")
        add_number(data, "iso", series.iso)
        add_number(data, "f_number", series.f_number)
        add_text(data, "frame", series.frame)
        add_text(data, "flag", series.flag)
        if patch.region is not None:
            meaning = "x, y, width, height: pixels, or fractions of the frame"
            add_number(data, "region", patch.region, "", meaning)
        entry.attrs.setdefault("default", f"{decay}_{name}")


def add_fit(entry: h5py.Group, name: str, title: str, patch: DecayPatch, version: str) -> None:
    """An NXprocess `fit_<name>`: parameters, curves, residuals, or why there is no fit."""
    process, fit = add_group(entry, f"fit_{name}", "NXprocess"), patch.fit
    add_text(process, "program", "labrig")
    add_text(process, "version", version)
    if fit is None or patch.normalised_residuals is None:
        add_note(process, "not_fitted", patch.failure, "text/plain")
        return
    add_note(process, "fit", fit.to_json(), "application/json", "fit.json")
    _add_parameters(process, fit)
    residuals = np.full(patch.series.values.shape, np.nan)  # NaN where a frame was left out
    residuals[patch.series.usable] = patch.normalised_residuals
    for decay, rows in _decays(patch.series):
        series = patch.series.take(rows)
        curve = _add_plot(process, f"{decay}_curve", f"fit of {title}", patch, series)
        curve.attrs["SILX_style"] = LOGARITHMIC
        predicted = fit.predict(series.t_s, series.exposure_s)
        _add_signals(curve, series.channels, predicted)
        left = _add_plot(
            process, f"{decay}_residuals", f"whitened residuals of {title}", patch, series
        )
        for number, channel in enumerate(series.channels):
            add_number(left, channel, residuals[rows, number], "", f"{channel} / σ")
        process.attrs.setdefault("default", f"{decay}_curve")


def _decays(series: Series) -> Iterator[tuple[str, NDArray[np.intp]]]:
    """Name and rows of each decay: repeats are plotted apart."""
    units = list(dict.fromkeys(series.unit))
    for unit, name in zip(units, valid_names(units), strict=True):
        yield name, np.flatnonzero(np.array(series.unit) == unit)


def _add_plot(
    parent: h5py.Group, name: str, title: str, patch: DecayPatch, series: Series
) -> h5py.Group:
    """A new NXdata with its time axis, that shows the brightest channel first."""
    data = add_group(parent, name, "NXdata")
    add_text(data, "title", f"{title}, {series.unit[0]}")
    data.attrs["axes"] = ["time"]
    data.attrs["time_indices"] = [0]
    middle_s = series.t_s + series.exposure_s / 2
    add_number(data, "time", middle_s, "s", "middle of the exposure after lamp off / s")
    brightest = series.channels[_brightest(patch)]
    data.attrs["signal"] = brightest
    others = [channel for channel in series.channels if channel != brightest]
    if others:
        data.attrs["auxiliary_signals"] = others
    return data


def _add_signals(data: h5py.Group, channels: Sequence[str], values: NDArray[np.float64]) -> None:
    for number, channel in enumerate(channels):
        add_number(data, channel, values[:, number], DN_PER_S, f"{channel} / ({DN_PER_S})")


def _add_parameters(process: h5py.Group, fit: FittedDecay) -> None:
    parameters = add_group(process, "parameters", "NXparameters")

    def add(name: str, values: Sequence[float], errors: Sequence[float], units: str = "") -> None:
        add_number(parameters, name, values, units)
        add_number(parameters, f"{name}_errors", errors, units)

    states = fit.states
    add("rate", [s.k_r_per_s for s in states], [s.k_r_sigma_per_s for s in states], "1/s")
    add("amplitude", [s.amplitude for s in states], [s.amplitude_sigma for s in states], DN_PER_S)
    add_text(parameters, "channel", fit.channels)
    add("channel_weight", fit.channel_weights, fit.channel_weights_sigma)
    add("offset", fit.offsets, fit.offsets_sigma, DN_PER_S)
    add("flicker", [fit.flicker], [fit.flicker_sigma])
    add_number(parameters, "reduced_chi2", fit.reduced_chi2)
    order = "of rate 1, amplitude 1, rate 2, …, offset of the brightest channel"
    add_number(parameters, "covariance", fit.covariance, "", order)


def _brightest(patch: DecayPatch) -> int:
    """Number of the channel that a plot shows first."""
    if patch.fit is not None:
        return patch.fit.brightest
    return int(np.argmax(patch.series.values.mean(axis=0)))
