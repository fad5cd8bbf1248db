"""Mistakes of a first day at a bench: each is answered in one line with its cause and a remedy."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import Ended

LAMP = "  lamp: {driver: numato, address: COM3, relay: 0}\n"
CAMERA = "  camera: {driver: ptp_camera, address: 'usb://04a9:3199'}\n"
RIG = f"name: x\ndevices:\n{LAMP}{CAMERA}"
PLAN = ("plan", "decay", "--rig", "rig.yaml")
OWN = ("plan", "./own.yaml", "--rig", "sim")

#: Files, the command, and what its answer names.
MISTAKES: dict[str, tuple[dict[str, str], tuple[str, ...], tuple[str, ...]]] = {
    "a misspelt key that is required": (
        {"rig.yaml": RIG.replace("address: COM3", "adress: COM3")}, PLAN,
        ("rig.yaml: the key 'devices.lamp.address' is missing", "'adress'"),
    ),
    "a role in capitals": ({"rig.yaml": RIG.replace("lamp", "Lamp")}, PLAN, ("mean 'lamp'",)),
    "a camera that is not shipped": (
        {"rig.yaml": f"{RIG}optics: {{camera: canon_5d}}\n"}, PLAN,
        ("rig.yaml, optics: ", "'canon_5d'", "did you mean 'canon_eos_5d'"),
    ),
    "a curve that is missing": (
        {"rig.yaml": f"{RIG}optics: {{lamp: ./lamp.csv}}\n", "lamps.csv": ""}, PLAN,
        ("rig.yaml, optics: ", "lamp.csv: no such file", "did you mean", "lamps.csv"),
    ),
    "a reading without its unit": (
        {"rig.yaml": f"{RIG}optics: {{luminance: {{value: 312, sigma: 3 %, at: card}}}}\n"}, PLAN,
        ("optics.luminance: ", "such as '312 lx'", "got '312'"),
    ),
    "a relay twice": (
        {"rig.yaml": f"{RIG}  leds: {{driver: numato, address: COM3, channels: {{450 nm: 0}}}}\n"},
        PLAN,
        ("'devices.lamp' and 'devices.leds'", "give each its own"),
    ),
    "two boards at a port": (
        {"rig.yaml": RIG + "  changer: {driver: text_changer, address: COM3}\n"}, PLAN,
        ("are both at COM3", "labrig rig devices"),
    ),
    "a misspelt key in a part": (
        {"own.yaml": "protocol: phosphor\nparts:\n - protocol: decay\n   chrge: 5 min\n"}, OWN,
        ("own.yaml: part decay: unknown key 'chrge'", "mean 'charge'"),
    ),
    "a duration in the wrong unit": (
        {"own.yaml": "protocol: decay\ncharge: 90 m\n"}, OWN, ("charge: ", "such as '90 min'"),
    ),
    "a region in pixels of another camera": (
        {"own.yaml": "protocol: decay\npatches: {sample: [4000, 300, 400, 400]}\n"}, OWN,
        ("own.yaml: patches.sample", "1404 × 936"),
    ),
    "a shutter time that no camera has": (
        {"own.yaml": "protocol: decay\nexposure: 5 min\nevery: 10 min\nfor: 1 h\n"}, OWN,
        ("own.yaml: ", "does not offer an exposure of 5 min", "nearest is 32 s"),
    ),
    "an aperture that the lens has not": (
        {"own.yaml": "protocol: decay\ncamera: {f_number: 95}\n"}, OWN,
        ("own.yaml: camera.f_number: ", "f/95", "f/16"),
    ),
    "the rig without its option": ({}, ("plan", "decay", "sim"), ("a rig is given by --rig",)),
    "rig and protocol swapped": (
        {"rig.yaml": RIG, "own.yaml": "protocol: decay\n"},
        ("plan", "rig.yaml", "--rig", "own.yaml"),
        ("own.yaml: this is a protocol", "a rig file is expected"),
    ),
    "a file whose name is nearly right": (
        {"decay.csv": "t,v\n"}, ("fit", "decay", "decya.csv"), ("did you mean decay.csv?",),
    ),
    "a folder that is missing": ({}, ("fit", "decay", "data/decay.csv"), ("no folder data",)),
    "a report for a table": (
        {"report.html": "<!DOCTYPE html>\n"}, ("fit", "decay", "report.html"),
        ("this is a report (HTML)", "a table is expected"),
    ),
    "one run to be compared": ({}, ("runs", "compare", "last"), ("'other'", "--help")),
    "a new rig into no folder": (
        {}, ("rig", "new", "lab/rig.yaml", "--simulated", "sim", "--yes", "--no-check"),
        ("there is no folder lab", "make it"),
    ),
    "a misspelt device of a new rig": (
        {}, ("rig", "new", "--simulated", "sim", "--yes", "--without", "lapm"), ("mean 'lamp'",),
    ),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_the_answer_names_cause_and_remedy(
    mistake: str, labrig: Callable[..., Ended], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    files, command, named = MISTAKES[mistake]
    for name, text in files.items():
        Path(name).write_text(text, "utf-8")
    ended = labrig(*command)
    assert ended.code in (2, 5)
    answer = ended.err.splitlines()[-1]
    assert "fault in labrig" not in answer
    for part in named:
        assert part in answer
