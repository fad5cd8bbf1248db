"""A bench without a variable filter, whose camera sees the glow through a wheel of filters."""

from pathlib import Path
from typing import Any

from tests.analyse.recorded import record

FILTERS = (
    "shortpass-430", "bandpass-450", "bandpass-475", "bandpass-500", "bandpass-525", "bandpass-550",
    "bandpass-580", "bandpass-610", "bandpass-640", "longpass-660",
)  # fmt: skip
#: As many as the wheel has slots beside the open one.
IN_WHEEL = FILTERS[:5]
PLACE = (0.1, 0.2, 0.8, 0.6)
QUICK: dict[str, Any] = {
    "protocol": "emission_spectrum",
    "sample": {"name": "test"},
    "select": {"filters": list(FILTERS)},
    "charge": "2 min",
    "times": ["2 s", "20 s"],
    "longest": "8 s",
    "region": list(PLACE),
}


def without_lvf(rig: dict[str, Any], **simulation: Any) -> None:
    """Take the variable filter out of a rig, and put a wheel before its camera."""
    room = rig["simulation"]
    room["sensor"] = {"width": 48, "height": 32}
    del room["lvf"]
    slots = [None, *IN_WHEEL]
    room["camera_filter_wheel"] = {"filters": slots}
    rig["devices"]["camera_filter_wheel"] = {
        "driver": "thorlabs_fw102c",
        "address": "sim://room/camera-wheel",
        "filters": {name: number for number, name in enumerate(slots, 1) if name},
    }
    for device in rig["devices"].values():
        device.pop("warm_up", None)
    room |= simulation


def recorded(folder: Path, protocol: dict[str, Any] | None = None, **simulation: Any) -> Path:
    """The folder of a run of that protocol on such a bench."""
    return record(folder, protocol or QUICK, lambda rig: without_lvf(rig, **simulation))
