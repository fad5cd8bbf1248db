"""The protocols that calibrate the bench: their timelines, and what they refuse."""

from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import read_protocol
from labrig.foundation.errors import DeviceError, ProtocolError
from tests.analyse.recorded import record
from tests.protocols.protocol_files import (
    assert_one_clear_line,
    assert_timeline_as_agreed,
    planned,
    written,
)


@pytest.mark.parametrize("name", ["blank", "camera_calibration", "fade"])
def test_the_timeline_of_the_shipped_protocol_is_as_agreed(name: str) -> None:
    assert_timeline_as_agreed(name, "sim-phosphor")


@pytest.mark.parametrize(
    ("name", "keys", "said"),
    [
        ("camera_calibration", {"camera": {"iso": 125}}, "camera.iso 125 among 'isos'"),
        ("camera_calibration", {"camera": {"iso": 100, "f_number": 16}}, "among 'f_numbers'"),
        ("camera_calibration", {"camera": {"iso": 100, "f_number": None}}, "'f_numbers: []'"),
        ("camera_calibration", {"isos": []}, "isos"),
        ("camera_calibration", {"f_numbers": [4, 1e300]}, "at most 1000"),
        ("camera_calibration", {"lens": "50 mm"}, "unknown key 'lens'"),
        ("blank", {"for": "10 s"}, "leaves fewer than four frames"),
        ("blank", {"first": "soon"}, "expected auto, or a duration"),
        ("blank", {"later_by": []}, "later_by"),
        ("fade", {"until": "50 ms"}, "leaves fewer than four delays"),
        ("fade", {"bands": [500, 400]}, "rising edges"),
        ("fade", {"passes": 1}, "passes"),
    ],
)
def test_an_impossible_key_is_one_clear_line(
    tmp_path: Path, name: str, keys: dict[str, object], said: str
) -> None:
    assert_one_clear_line(written(tmp_path, protocol=name, **keys), said)


def test_a_blank_before_the_door_is_open_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, protocol="blank", first="400 ms")
    with pytest.raises(ProtocolError, match="the door still moves; write first: auto"):
        planned(path, "sim-phosphor")


def test_a_lens_that_does_not_tell_its_aperture_has_one_flat_field(tmp_path: Path) -> None:
    keys = {"camera": {"iso": 100, "f_number": None}, "f_numbers": []}
    path = written(tmp_path, protocol="camera_calibration", **keys)
    units = [unit.name for unit in read_protocol(path).units()]
    assert [unit for unit in units if unit.startswith("flat")] == ["flat"]


@pytest.mark.parametrize(
    ("name", "keys"), [("camera_calibration", {"isos": [100]}), ("fade", {"longest": "0.5 s"})]
)
def test_an_unlit_card_is_refused_before_anything_is_measured(
    name: str, keys: dict[str, object], tmp_path: Path
) -> None:
    def dead(rig: dict[str, Any]) -> None:
        rig["simulation"]["faults"] = ["lamp_dead"]

    with pytest.raises(DeviceError, match="the card is not lit"):
        record(tmp_path, {"protocol": name} | keys, dead)


@pytest.mark.parametrize("name", ["blank", "camera_calibration", "fade"])
def test_a_lamp_that_burns_while_its_relay_reads_off_is_refused(name: str, tmp_path: Path) -> None:
    def welded(rig: dict[str, Any]) -> None:
        rig["simulation"] |= {"faults": ["relay_welded"], "initial": {"lamp": "on"}}
        del rig["devices"]["shield"], rig["devices"]["door"]
        rig["simulation"] |= {"shield": None, "door": None}

    with pytest.raises(DeviceError, match="the dark frames are not dark"):
        record(tmp_path, {"protocol": name}, welded)
