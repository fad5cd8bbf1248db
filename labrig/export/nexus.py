"""Export of a run and its result to a NeXus file `run.nxs`, whose default plot is the decay.

Base classes are those of the NeXus manual (manual.nexusformat.org/classes/base_classes); no
application definition describes a decay.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.acquire import CAMERA, DARK, LIGHTS
from labrig.foundation.output_file import write_durably
from labrig.record import DeviceLine, RunDescription, RunRecord
from labrig.results import (
    ChainResult,
    DecayPatch,
    FittedDecay,
    Measured,
    ResultWithDecays,
    RunResult,
    Series,
    field_unit,
    iter_values,
)

TEXT = h5py.string_dtype()


def add_group(parent: h5py.Group, name: str, nx_class: str) -> h5py.Group:
    """Add a group of a NeXus class and return it."""
    group = parent.create_group(name)
    group.attrs["NX_class"] = nx_class
    return group


def add_number(
    group: h5py.Group, name: str, value: ArrayLike, units: str = "", long_name: str = ""
) -> h5py.Dataset:
    """Add a field of numbers and return it.

    Parameters
    ----------
    group
        Group to which the field is added.
    name
        Name of the field.
    value
        Numbers of any shape.
    units
        Units of the numbers; empty for dimensionless ones.
    long_name
        Label of the axis in plots.
    """
    field = group.create_dataset(name, data=np.asarray(value), track_times=False)
    field.attrs["units"] = units
    if long_name:
        field.attrs["long_name"] = long_name
    return field


def add_text(group: h5py.Group, name: str, value: str | Sequence[str]) -> h5py.Dataset:
    """Add a field of one text or several and return it."""
    data = value if isinstance(value, str) else np.array(value, dtype=object)
    return group.create_dataset(name, data=data, dtype=TEXT, track_times=False)


def add_note(parent: h5py.Group, name: str, text: str, kind: str, file_name: str = "") -> None:
    """Add an NXnote: a text with its media type and the name of its file."""
    note = add_group(parent, name, "NXnote")
    add_text(note, "type", kind)
    if file_name:
        add_text(note, "file_name", file_name)
    add_text(note, "data", text)


def add_fields(entry: h5py.Group, result: RunResult, name: str, version: str) -> None:
    """Add an NXprocess with the fields of a result; fields within fields become groups."""
    (valid,) = valid_names([name])
    process = add_group(entry, valid, "NXprocess")
    add_text(process, "program", "labrig")
    add_text(process, "version", version)
    for path, value in iter_values(result):
        group = process
        *groups, last = _valid_path("result", *path)
        for group_name in groups:
            group = (
                group[group_name]
                if group_name in group
                else add_group(group, group_name, "NXcollection")
            )
        if value is not None:
            _add(group, last, path[-1], value)
        if path[-1] == "covariance":
            owner = _owner(result, groups_of=path[:-1])
            add_covariance_units(group[last], getattr(owner, "covariance_parameters", ()))


def _owner(result: RunResult, groups_of: Sequence[str]) -> Any:
    """Return what a path within a result, as of `iter_values`, leads to."""
    owner: Any = result
    for name in groups_of:
        if isinstance(owner, Mapping):
            # The only entry of a mapping may have an empty name.
            owner = {str(key): value for key, value in owner.items()}.get(name, owner.get(""))
        elif isinstance(owner, tuple | list):
            owner = owner[int(name) - 1]
        else:
            owner = getattr(owner, name)
    return owner


def add_covariance_units(field: h5py.Dataset, parameters: Sequence[str], own: str = "") -> None:
    """Add to a covariance the units of its rows, whose products are those of its numbers.

    Parameters
    ----------
    field
        Field of the covariance.
    parameters
        Names of the rows, each with its unit at the end of its first word; empty for numbers
        without a dimension.
    own
        Unit of the parameters whose names have none because they have that of the values.
    """
    if not parameters:
        return
    in_values = ("amplitude", "offset")
    rows = [
        own or DN_PER_S if name.startswith(in_values) else field_unit(name.split()[0]) or "1"
        for name in parameters
    ]
    field.attrs["units"] = f"products of {', '.join(rows)}"
    field.attrs["rows"] = ", ".join(parameters)


def _valid_path(*names: str) -> list[str]:
    """Return names that NeXus allows; names along one path may be equal."""
    return [valid_names([name])[0] for name in names]


def _add(group: h5py.Group, name: str, field: str, value: Any) -> None:
    """Add a field of numbers or texts of any shape; other values are added as text."""
    if isinstance(value, Measured):
        add_number(group, name, value.value, value.unit)
        add_number(group, f"{name}_errors", value.sigma, value.unit)
        return
    if isinstance(value, str):
        add_text(group, name, value)
        return
    try:
        numbers = np.asarray(value)
    except ValueError:
        numbers = np.asarray(None)
    if numbers.dtype.kind in "iuf":
        add_number(group, name, numbers, field_unit(field))
    elif numbers.dtype.kind == "b":
        add_number(group, name, numbers.astype(np.int8))
    elif isinstance(value, tuple | list):
        add_text(group, name, [str(element) for element in value])
    else:
        add_text(group, name, str(value))


DN_PER_S = "DN/s"
#: Plot style by which silx and h5web show a decay on a logarithmic scale.
LOGARITHMIC = json.dumps({"signal_scale_type": "log"})


def valid_names(names: Sequence[str]) -> list[str]:
    """Return distinct names that NeXus allows: ASCII letters, digits and underscores."""
    valid: list[str] = []
    for name in names:
        allowed = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_") or "unnamed"
        while allowed in valid:
            allowed += "_"
        valid.append(allowed)
    return valid


def add_decays(entry: h5py.Group, name: str, title: str, patch: DecayPatch) -> None:
    """Add an NXdata `decay_1_<name>` for each decay of a patch; the first is the default plot."""
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
    """Add an NXprocess `fit_<name>` with parameters, curves and residuals, or the failure."""
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
        residual_plot = _add_plot(
            process, f"{decay}_residuals", f"whitened residuals of {title}", patch, series
        )
        for number, channel in enumerate(series.channels):
            add_number(residual_plot, channel, residuals[rows, number], "", f"{channel} / σ")
        process.attrs.setdefault("default", f"{decay}_curve")


def _decays(series: Series) -> Iterator[tuple[str, NDArray[np.intp]]]:
    """Yield name and rows of each decay, since repeated decays are plotted apart."""
    units = list(dict.fromkeys(series.unit))
    for unit, name in zip(units, valid_names(units), strict=True):
        yield name, np.flatnonzero(np.array(series.unit) == unit)


def _add_plot(
    parent: h5py.Group, name: str, title: str, patch: DecayPatch, series: Series
) -> h5py.Group:
    """Add an NXdata with its time axis, whose signal is the brightest channel, and return it."""
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
    add("rate", [s.k_r_per_s for s in states], [s.k_r_per_s_sigma for s in states], "1/s")
    unit = fit.value_unit or DN_PER_S
    add("amplitude", [s.amplitude for s in states], [s.amplitude_sigma for s in states], unit)
    add_text(parameters, "channel", fit.channels)
    add("channel_weight", fit.channel_weights, fit.channel_weights_sigma)
    add("offset", fit.offsets, fit.offsets_sigma, unit)
    add("flicker", [fit.flicker], [fit.flicker_sigma])
    add_number(parameters, "reduced_chi2", fit.reduced_chi2)
    covariance = add_number(parameters, "covariance", fit.covariance)
    add_covariance_units(covariance, fit.covariance_parameters, unit)


def _brightest(patch: DecayPatch) -> int:
    """Return the index of the channel that a plot shows first."""
    if patch.fit is not None:
        return patch.fit.brightest
    return int(np.argmax(patch.series.values.mean(axis=0)))


YAML = "application/yaml"
#: NeXus classes of the devices that have one.
DEVICE_CLASSES = {CAMERA.key: "NXdetector", **dict.fromkeys(LIGHTS, "NXsource")}


def write_nexus(path: Path, run: RunRecord, about: RunDescription, result: RunResult) -> None:
    """Write a run and its result to a NeXus file.

    The bytes depend on the run and on labrig's version only, not on the time of writing.

    Parameters
    ----------
    path
        File to be written, such as `result/run.nxs`.
    run
        Run with at least one completed unit.
    about
        Description of the run, its bench and the processing.
    result
        Result of any protocol.

    Raises
    ------
    DiskError
        If the file cannot be written.

    References
    ----------
    NeXus base classes, https://manual.nexusformat.org/classes/base_classes.

    Examples
    --------
    >>> from pathlib import Path
    >>> import h5py
    >>> import labrig
    >>> from labrig.export import write_nexus
    >>> from labrig.record import RunDescription
    >>> about = RunDescription(
    ...     title="paint", protocol="decay", run="decay", started="", ended="", rig="bench",
    ...     simulated=True, labrig_version="1",
    ... )
    >>> run, result = labrig.read_run("runs/decay"), labrig.read_result("runs/decay")
    >>> write_nexus(Path("decay.nxs"), run, about, result)
    >>> with h5py.File("decay.nxs") as file:
    ...     print(file["entry"].attrs["default"], file["entry/decay_1_sample/G"].shape)
    decay_1_sample (18,)
    """
    # Made in memory: HDF5 has no plain way to say that a disk has failed it.
    content = BytesIO()
    with h5py.File(content, "w") as file:
        file.attrs["NX_class"] = "NXroot"
        file.attrs["creator"] = "labrig"
        file.attrs["creator_version"] = about.labrig_version
        file.attrs["default"] = "entry"
        _add_entry(file, run, about, result)
    write_durably(path, content.getvalue())


def _add_entry(file: h5py.File, run: RunRecord, about: RunDescription, result: RunResult) -> None:
    start_time = _start_time(run)
    entry = add_group(file, "entry", "NXentry")
    add_text(entry, "title", about.title)
    add_text(entry, "experiment_identifier", about.run)
    simulated = " in a simulated dark room" if about.simulated else ""
    add_text(entry, "experiment_description", f"{_subject(result)}{simulated}")
    add_text(entry, "start_time", _iso(start_time))
    add_text(entry, "end_time", _iso(run.last_time))
    program = add_text(entry, "program_name", "labrig")
    program.attrs["version"] = about.labrig_version
    add_note(entry, "protocol", about.protocol_text, YAML, "protocol.yaml")
    add_note(entry, "rig", about.rig_text, YAML, "rig.yaml")
    versions = [f"{name} {version}" for name, version in about.libraries]
    add_note(entry, "libraries", "\n".join(versions), "text/plain")
    if result.warnings:
        add_note(entry, "warnings", "\n".join(map(str, result.warnings)), "text/plain")

    sample = add_group(entry, "sample", "NXsample")
    add_text(sample, "name", about.title)
    if about.sample:
        lines = [f"{what}: {value}" for what, value in about.sample]
        add_text(sample, "description", "\n".join(lines))

    instrument = add_group(entry, "instrument", "NXinstrument")
    add_text(instrument, "name", about.rig)
    for device in about.devices:
        _add_device(instrument, device, run, start_time)
    _add_results(entry, result, about.labrig_version)


def _subject(result: RunResult) -> str:
    return (
        "phosphorescent decay"
        if isinstance(result, ResultWithDecays)
        else result.kind.replace("_", " ")
    )


def _add_results(entry: h5py.Group, result: RunResult, version: str, part: str = "") -> None:
    """Add decays with their fits, other results field by field, and every part of a chain."""
    if isinstance(result, ChainResult):
        for name, part_result in result.parts.items():
            _add_results(entry, part_result, version, name)
    if isinstance(result, ResultWithDecays):
        names = valid_names([" ".join(filter(None, (part, name))) for name in result.patches])
        for valid, (name, patch) in zip(names, result.patches.items(), strict=True):
            add_decays(entry, valid, name, patch)
            add_fit(entry, valid, name, patch, version)
    else:
        add_fields(entry, result, part or result.kind, version)


def _add_device(
    instrument: h5py.Group, device: DeviceLine, run: RunRecord, start_time: float
) -> None:
    group = add_group(instrument, device.role, DEVICE_CLASSES.get(device.role, "NXcollection"))
    add_text(group, "name", device.role)
    add_text(group, "description", device.identity)
    if device.role == CAMERA.key:
        _add_frames(group, run, start_time)
    if device.role in LIGHTS:
        _add_switching(group, device.role, run, start_time)


def _add_frames(camera: h5py.Group, run: RunRecord, start_time: float) -> None:
    """Add time, settings and checksum of every frame of completed units."""
    frames = [frame for attempt in run.completed().values() for frame in attempt.frames]
    times = np.array([(frame.start_time, frame.end_time) for frame in frames]).reshape(-1, 2)
    seconds = times - start_time
    add_number(camera, "count_time", [frame.exposure_s for frame in frames], "s")
    for name, column in zip(("start_time", "stop_time"), seconds.T, strict=True):
        add_number(camera, name, column, "s").attrs["start"] = _iso(start_time)
    files = add_group(camera, "frames", "NXcollection")
    add_text(files, "file_name", [f"frames/{frame.path.name}" for frame in frames])
    add_text(files, "sha256", [frame.sha256 for frame in frames])
    add_number(files, "size", [frame.size_bytes for frame in frames], "byte")
    add_text(files, "role", [frame.role for frame in frames])
    add_text(files, "unit", [frame.unit for frame in frames])
    add_number(files, "iso", [frame.iso for frame in frames])
    add_number(
        files,
        "f_number",
        [np.nan if frame.f_number is None else frame.f_number for frame in frames],
    )
    add_number(files, "late", [frame.late_s for frame in frames], "s")


def _add_switching(light: h5py.Group, key: str, run: RunRecord, start_time: float) -> None:
    """Add the times at which a light was switched, the charging history of the sample."""
    actions = [
        action
        for attempt in run.completed().values()
        for action in attempt.actions
        if action.device == key
    ]
    log = add_group(light, "switched", "NXlog")
    middles = [action.middle_time - start_time for action in actions]
    add_number(log, "time", middles, "s").attrs["start"] = _iso(start_time)
    add_number(log, "value", np.array([action.action != DARK for action in actions], np.int8))
    add_text(log, "description", "1: on, 0: off")


def _start_time(run: RunRecord) -> float:
    return float(next(iter(run.completed().values())).start["time"])


def _iso(seconds: float) -> str:
    """Return a time in seconds since 1970 as ISO 8601 text."""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="microseconds")
