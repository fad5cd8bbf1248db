"""Agreement of the documents of a journal with each other, by which an edited one stands out.

A document repeats what others say: an event has the time at which it was written for each of its
values and its number in its stream, a stop counts the events. Nobody but labrig writes journals.
"""

import math
from collections.abc import Collection, Mapping
from typing import Any

#: Values of the events of each stream, with their kinds.
VALUES: Mapping[str, Mapping[str, str]] = {
    "actions": {
        "device": "string",
        "action": "string",
        "start_time": "number",
        "end_time": "number",
        "late_s": "number",
        "task": "string",
    },
    "temperatures": {"time": "number", "temperature_c": "number"},
    "frames": {
        "frame": "string",
        "sha256": "string",
        "size_bytes": "integer",
        "role": "string",
        "exposure_s": "number",
        "iso": "integer",
        "f_number": "number",
        "start_time": "number",
        "end_time": "number",
        "late_s": "number",
        "disk_s": "number",
    },
    "spectra": {
        "frame": "string",
        "sha256": "string",
        "size_bytes": "integer",
        "role": "string",
        "integration_s": "number",
        "repetitions": "integer",
        "start_time": "number",
        "end_time": "number",
        "late_s": "number",
    },
}
#: Keys of a RunStart that are texts, where they are there.
_TEXTS = ("protocol", "sample", "labrig_version", "guard", "rig")
#: Parts of a descriptor for which labrig has nothing.
_EMPTY = ("configuration", "object_keys", "object_classes", "hints")
_READS_BACK = "_reads_back"
_STATUSES = ("success", "abort", "fail")
#: Times since 1970 are rounded to less than this, in seconds.
_ROUNDING_S = 1e-5


def check_start(doc: Mapping[str, Any]) -> None:
    """Check a RunStart.

    Raises
    ------
    ValueError, KeyError, TypeError
        It is none that labrig writes.
    """
    devices = doc.get("devices", {})
    texts = [doc[key] for key in _TEXTS if key in doc]
    if not isinstance(devices, dict):
        raise TypeError("'devices' is of another kind")
    texts += [doc["uid"], doc["unit"], *devices.values()]
    if not all(isinstance(text, str) for text in texts):
        raise TypeError("'unit', 'devices' or another text is of another kind")
    if not all(isinstance(doc[key], bool) for key in doc if key.endswith(_READS_BACK)):
        raise TypeError("whether a light reads back is of another kind")


def check_descriptor(doc: Mapping[str, Any]) -> None:
    """Check the descriptor of a stream.

    Raises
    ------
    ValueError, KeyError, TypeError
        It is none that labrig writes.
    """
    if doc["name"] not in VALUES:
        raise ValueError(f"'{doc['name']}' is no stream")
    expected = described(doc["name"])
    # An earlier labrig may have written fewer values.
    if any(expected.get(name) != value for name, value in dict(doc["data_keys"]).items()):
        raise ValueError(f"the values of {doc['name']} are described otherwise")
    if any(doc[key] != {} for key in _EMPTY):
        raise ValueError(f"{', '.join(_EMPTY)} are not empty")


def described(stream: str) -> dict[str, dict[str, Any]]:
    """Return the description of a stream's values, as a descriptor has it."""
    return {
        name: {"source": "labrig", "dtype": kind, "shape": []}
        for name, kind in VALUES[stream].items()
    }


def check_event(doc: Mapping[str, Any], number: int, names: Collection[str]) -> None:
    """Check an event by its number in its stream and the names of the stream's values.

    Raises
    ------
    ValueError, KeyError, TypeError
        It is none that labrig writes.
    """
    data, time_s = dict(doc["data"]), doc["time"]
    if data.keys() != set(names):
        raise ValueError(f"expected the values {', '.join(names)}, got {', '.join(data)}")
    if doc["seq_num"] != number:
        raise ValueError(f"it is number {doc['seq_num']} of its stream, expected {number}")
    if doc["timestamps"] != dict.fromkeys(data, time_s):
        raise ValueError("its 'timestamps' are not its 'time'")
    if doc["filled"] != {}:
        raise ValueError("'filled' is not empty")
    ends_s = float(data["end_time"] if "end_time" in data else data["time"])
    if not ends_s <= time_s + _ROUNDING_S:
        raise ValueError(f"it was written {ends_s - time_s:.3g} s before its end")
    if not data.get("start_time", ends_s) <= ends_s + _ROUNDING_S:
        raise ValueError("it ends before it begins")


def check_stop(doc: Mapping[str, Any], counts: Mapping[str, int]) -> None:
    """Check a RunStop by the number of events of each stream.

    Raises
    ------
    ValueError, KeyError, TypeError
        It is none that labrig writes.
    """
    if doc["exit_status"] not in _STATUSES or not isinstance(doc.get("reason", ""), str):
        raise ValueError(f"expected a status among {', '.join(_STATUSES)} and a reason")
    if not isinstance(doc["uid"], str) or not math.isfinite(doc["time"]):
        raise ValueError("'uid' or 'time' is of another kind")
    stated = dict(doc["num_events"])
    for stream in (*counts, *stated):
        if (number := stated.get(stream, 0)) != counts.get(stream, 0):
            raise ValueError(f"it counts {number} {stream}, there are {counts.get(stream, 0)}")
