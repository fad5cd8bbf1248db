"""The protocol led_brightness: its timeline, with and without a spectrometer, and bad input."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from labrig import resources
from labrig.acquire import Plan, RigFile, plan, read_protocol, read_rig_file
from labrig.errors import UsageError

GOLDEN = Path(__file__).parent / "led_brightness.timeline.txt"
RIG = resources.find("config", "rig", "sim-fluorescent")


def planned(rig: RigFile) -> Plan:
    protocol = resources.find("protocols", "protocol", "led_brightness")
    return plan(read_protocol(protocol), rig, str(RIG))


def test_the_timeline_of_the_shipped_protocol_is_as_agreed() -> None:
    lines = planned(read_rig_file(RIG)).lines()
    assert "\n".join(lines) + "\n" == GOLDEN.read_text(encoding="utf-8")


def test_without_a_spectrometer_the_camera_works_alone() -> None:
    rig = read_rig_file(RIG)
    devices = {key: entry for key, entry in rig.devices.items() if key != "spectrometer"}
    lines = planned(rig.model_copy(update={"devices": devices})).lines()
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
    path = tmp_path / "protocol.yaml"
    path.write_text(yaml.safe_dump({"protocol": "led_brightness"} | keys))
    with pytest.raises(UsageError, match=said) as caught:
        read_protocol(path)
    assert "\n" not in str(caught.value)
