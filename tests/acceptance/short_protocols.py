"""Every shipped protocol made short, and a small simulated rig for each, as files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

from labrig.foundation import resources
from labrig.foundation.yaml_file import read_yaml, yaml_text

FILTERS = [
    "longpass-440", "longpass-490", "longpass-540", "longpass-600",
    "shortpass-430", "shortpass-520", "shortpass-585", "shortpass-655",
]  # fmt: skip
#: What makes each protocol shorter. Later ones rest on what the earlier ones have found.
SHORTER: dict[str, dict[str, Any]] = {
    "blank": {"charge": "1 min", "for": "30 s", "later_by": ["0 s", "200 ms"]},
    "camera_calibration": {
        "isos": [100, 400], "f_numbers": [4], "levels": 4, "repeats": 8, "cycles": 2,
        "every_nth_shutter_time": 4, "longest_dark": "2 s",
    },
    "fade": {"passes": 3},
    "lvf_calibration": {
        "filters": FILTERS, "stripes": "2 min", "repeats": 1, "longest": "4 s",
    },
    "irradiance": {"longest": "4 s", "repeats": 1, "rounds": 1},
    "led_brightness": {
        "leds": ["455 nm", "530 nm"], "longest": "1 s", "exposures": 2, "repeats": 1,
    },
    "led_fluorescence": {
        "leds": ["430 nm", "455 nm", "530 nm"], "longest": "1 s", "exposures": 2, "repeats": 1,
        "patches": {"felt": [0.6, 0.58, 0.3, 0.3]},
    },
    "validate_illuminants": {
        "lamps": ["daylight", "halogen"], "longest": "1 s", "exposures": 1, "repeats": 1,
        "patches": {"felt": [0.6, 0.58, 0.3, 0.3]}, "fluorescence": {"felt": "grey-felt"},
    },
    "angular_fluorescence": {
        "angles": [30, 60, 90], "directions": ["vertical"], "repositionings": 3, "repeats": 1,
    },
    "angular_fluorescence-sphere": {"repositionings": 3, "repeats": 1},
    "direct_bispectral": {
        "leds": ["430 nm", "530 nm"], "samples": ["yellow"], "repetitions": 4,
    },
    "emission_spectrum": {"charge": "2 min", "times": ["2 s", "10 s"], "longest": "4 s"},
    "camera_curves": {"repeats": 1, "through": True},
    "colour_check": {"through": [14, 19], "repeats": 1},
    "decay": {"charge": "5 min", "first": "1 s", "for": "60 s"},
    "decay-eleven": {"charge": "5 min", "for": "60 s"},
    "excitation": {
        "at_most": 3, "refine": 1, "direct": ["10 s", "4 min"], "for": "40 s", "last_decay": "60 s",
        "rest": {"at_least": "1 min", "at_most": "4 min"},
    },
    "isotropy": {
        "charge": "2 min", "angles": [20, 60], "frames": 2,
        "patches": {"sample": [0.47, 0.35, 0.06, 0.3]},
    },
    "luminance": {"until": "3 min", "longest": "10 s"},
    "reflectance": {"charge": "2 min", "longest": "4 s", "repeats": 1},
    "saturation": {"charges": ["2 min", "10 min"], "for": "60 s"},
    "phosphor": {},
}  # fmt: skip
#: What the rig file has to name: keys of its optics, and the protocols whose runs they are.
KNOWN = {"lvf": "lvf_calibration", "irradiance": "irradiance", "fade": "fade"}
NEEDED = {
    "irradiance": ("lvf",),
    "emission_spectrum": ("lvf",),
    "camera_curves": ("lvf",),
    "colour_check": ("lvf",),
    "excitation": ("lvf", "irradiance", "fade"),
    "reflectance": ("lvf",),
}
ANOTHER_DAY = "2026-01-02T00:02:00Z"
RIGS = {
    "decay-eleven": "sim-eleven",
    "angular_fluorescence": "sim-fluorescent",
    "angular_fluorescence-sphere": "sim-sphere",
    "direct_bispectral": "sim-fluorescent",
    "led_brightness": "sim-fluorescent",
    "led_fluorescence": "sim-fluorescent",
    "luminance": "sim-luminance",
    "validate_illuminants": "sim-fluorescent",
    "camera_curves": "sim-chart",
    "colour_check": "sim-chart",
}
#: Sensors on which a ColorChecker is found; all others are smaller.
SMALL = {"width": 96, "height": 64}
CHART_SENSOR = {"width": 288, "height": 192}
SENSORS = dict.fromkeys(("camera_curves", "colour_check"), CHART_SENSOR)


@dataclass(frozen=True)
class Case:
    """A protocol and a rig, as files in a folder of their own."""

    folder: Path
    protocol: Path
    rig: Path

    @classmethod
    def write(cls, folder: Path, name: str, known: Mapping[str, Path]) -> Self:
        """The protocol called `name`; `known` has the runs of those that it rests on."""
        folder.mkdir()
        protocol = read_yaml(resources.find("protocols", "protocol", name)) | SHORTER[name]
        if name == "phosphor":
            protocol["parts"] = [part | SHORTER[part["protocol"]] for part in protocol["parts"]]
        rig = read_yaml(resources.find("config", "rig", RIGS.get(name, "sim-phosphor")))
        rig["simulation"]["sensor"] = SENSORS.get(name, SMALL)
        rig["optics"] |= {key: str(known[KNOWN[key]]) for key in NEEDED.get(name, ())}
        case = cls(folder, folder / "protocol.yaml", folder / "rig.yaml")
        case.protocol.write_text(yaml_text(protocol))
        case.rig.write_text(yaml_text(rig))
        return case

    def another_day(self) -> Self:
        """The same in other noise."""
        folder = self.folder / "another-day"
        folder.mkdir()
        rig = read_yaml(self.rig)
        rig["simulation"]["epoch"] = ANOTHER_DAY
        case = replace(self, folder=folder, rig=folder / "rig.yaml")
        case.rig.write_text(yaml_text(rig))
        return case


def with_what_they_need(names: Sequence[str]) -> list[str]:
    """Protocols and those that they rest on, those first."""
    wanted = set(names)
    for name in reversed(SHORTER):
        if name in wanted:
            wanted |= {KNOWN[key] for key in NEEDED.get(name, ())}
    return [name for name in SHORTER if name in wanted]
