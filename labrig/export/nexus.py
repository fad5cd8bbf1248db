"""run.nxs: a run and its result in one NeXus file that opens on the decay.

Base classes as in the NeXus manual (manual.nexusformat.org/classes/base_classes); no application
definition describes a decay.
"""

from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path

import h5py
import numpy as np

from labrig.acquire import CAMERA, DARK, LIGHTS
from labrig.errors import DiskError
from labrig.export.hdf5 import add_group, add_note, add_number, add_text
from labrig.export.nexus_decay import add_decays, add_fit, valid_names
from labrig.export.nexus_fields import add_fields
from labrig.record import DeviceLine, RunDescription, RunRecord
from labrig.results import DecayResult, PhosphorResult, RunResult

YAML = "application/yaml"
#: NeXus classes of the devices that have one.
DEVICE_CLASSES = {CAMERA.key: "NXdetector", **dict.fromkeys(LIGHTS, "NXsource")}


def write_nexus(path: Path, run: RunRecord, about: RunDescription, result: RunResult) -> None:
    """Write a run and its result.

    The bytes follow from the run and labrig's version; nothing in them is of the moment of writing.

    Parameters
    ----------
    path
        The file, such as `result/run.nxs`.
    run
        The run, with one completed unit at the least.
    about
        The run, its bench and what its result was made with.
    result
        Of any protocol.

    Raises
    ------
    DiskError
        The file cannot be written.
    """
    # Made in memory: HDF5 has no plain way to say that a disk has failed it.
    content = BytesIO()
    with h5py.File(content, "w") as file:
        file.attrs["NX_class"] = "NXroot"
        file.attrs["creator"] = "labrig"
        file.attrs["creator_version"] = about.labrig_version
        file.attrs["default"] = "entry"
        _add_entry(file, run, about, result)
    try:
        path.write_bytes(content.getbuffer())
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error})") from None


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
        add_note(entry, "warnings", "\n".join(result.warnings), "text/plain")

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
        "phosphorescent decay" if isinstance(result, DecayResult) else result.kind.replace("_", " ")
    )


def _add_results(entry: h5py.Group, result: RunResult, version: str, part: str = "") -> None:
    """Decays as plots with their fits, all other results field by field; of a chain every part."""
    if isinstance(result, PhosphorResult):
        for name, one in result.parts.items():
            _add_results(entry, one, version, name)
    if isinstance(result, DecayResult):
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
    """Every frame of completed units: when, how, and how to know the file again."""
    frames = [frame for attempt in run.completed().values() for frame in attempt.frames]
    seconds = np.array([(frame.start_time, frame.end_time) for frame in frames]) - start_time
    add_number(camera, "count_time", [frame.exposure_s for frame in frames], "s")
    for name, column in zip(("start_time", "stop_time"), seconds.T, strict=True):
        add_number(camera, name, column, "s").attrs["start"] = _iso(start_time)
    kept = add_group(camera, "frames", "NXcollection")
    add_text(kept, "file_name", [f"frames/{frame.path.name}" for frame in frames])
    add_text(kept, "sha256", [frame.sha256 for frame in frames])
    add_number(kept, "size", [frame.size_bytes for frame in frames], "byte")
    add_text(kept, "purpose", [frame.purpose for frame in frames])
    add_text(kept, "unit", [frame.unit for frame in frames])
    add_number(kept, "iso", [frame.iso for frame in frames])
    add_number(
        kept,
        "f_number",
        [np.nan if frame.f_number is None else frame.f_number for frame in frames],
    )
    add_number(kept, "late", [frame.late_s for frame in frames], "s")


def _add_switching(light: h5py.Group, key: str, run: RunRecord, start_time: float) -> None:
    """When the light went on and off: the history of the sample's charge."""
    switched = [
        action
        for attempt in run.completed().values()
        for action in attempt.actions
        if action.device == key
    ]
    log = add_group(light, "switched", "NXlog")
    middles = [action.middle_time - start_time for action in switched]
    add_number(log, "time", middles, "s").attrs["start"] = _iso(start_time)
    add_number(log, "value", np.array([action.action != DARK for action in switched], np.int8))
    add_text(log, "description", "1: on, 0: off")


def _start_time(run: RunRecord) -> float:
    return float(next(iter(run.completed().values())).start["time"])


def _iso(seconds: float) -> str:
    """Seconds since 1970 as ISO 8601."""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="microseconds")
