"""The protocol led_brightness: its timeline, with and without a spectrometer, and bad input."""

from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import plan, read_protocol, read_rig_file
from labrig.foundation import resources
from tests.protocols.protocol_files import (
    assert_one_clear_line,
    assert_timeline_as_agreed,
    written,
)

GOLDEN = Path(__file__).parent / "led_brightness.timeline.txt"
RIG = resources.find("config", "rig", "sim-fluorescent")


def test_the_timeline_of_the_shipped_protocol_is_as_agreed() -> None:
    assert_timeline_as_agreed("led_brightness", "sim-fluorescent")


def test_without_a_spectrometer_the_camera_works_alone() -> None:
    rig = read_rig_file(RIG)
    devices = {key: entry for key, entry in rig.devices.items() if key != "spectrometer"}
    protocol = read_protocol(resources.find("protocols", "protocol", "led_brightness"))
    lines = plan(protocol, rig.model_copy(update={"devices": devices}), str(RIG)).lines()
    golden = GOLDEN.read_text(encoding="utf-8").splitlines()
    assert not any("spectrometer" in line for line in lines)
    units = [line for line in golden if line.startswith("unit")]
    assert [line for line in lines if line.startswith("unit")] == units
    assert units[1] == units[-2].replace("again", "card")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"leds": ["455 nm", "455 nm"]}, "expected every LED once"),
        ({"leds": []}, "leds"),
        ({"repetitions": 1}, "repetitions"),
        ({"integration": "0 s"}, "integration"),
        ({"leds_": 1}, "unknown key 'leds_'"),
    ],
)
def test_bad_settings_are_one_line(keys: dict[str, Any], said: str, tmp_path: Path) -> None:
    assert_one_clear_line(written(tmp_path, protocol="led_brightness", **keys), said)
