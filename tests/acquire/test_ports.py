"""Devices of a rig that contradict each other: two boards at one port, one channel twice."""

from pathlib import Path

import pytest

from labrig.acquire import read_rig_file, require_own_ports
from labrig.bench import open_bench
from labrig.foundation import resources
from labrig.foundation.errors import LabrigError

LAMP = "lamp: {driver: numato, address: COM3, relay: 0}"
DOOR = (
    "door: {driver: maestro, address: %s, channel: 0, closed: 1000 us, open: 2000 us, "
    "travel: 300 ms}"
)
SHIELD = (
    "shield: {driver: maestro, address: COM4, channel: %d, covering: 1000 us, "
    "uncovering: 2000 us, travel: 300 ms}"
)
OWN_COMMANDS = "lamp: {driver: serial_relay, address: COM7, on: a, off: b}"
CHANGER = "changer: {driver: text_changer, address: COM7}"


def refusal(tmp_path: Path, *devices: str) -> str:
    path = tmp_path / "rig.yaml"
    path.write_text("name: x\ndevices:\n" + "".join(f"  {device}\n" for device in devices))
    rig = read_rig_file(path)
    try:
        require_own_ports(rig, str(path))
    except LabrigError as error:
        with pytest.raises(LabrigError, match="'devices"), open_bench(rig, str(path)) as bench:
            bench.devices().__enter__()
        return str(error)
    return ""


def test_two_kinds_of_boards_at_one_port_are_refused_with_both_drivers(tmp_path: Path) -> None:
    text = refusal(tmp_path, LAMP, DOOR % "com3")
    assert "'devices.lamp' and 'devices.door' are both at com3" in text
    assert "numato" in text
    assert "maestro" in text
    assert "a port leads to one board" in refusal(tmp_path, LAMP, CHANGER.replace("COM7", "COM3"))


def test_one_channel_of_a_board_is_of_one_device(tmp_path: Path) -> None:
    assert "'devices.door' and 'devices.shield'" in refusal(tmp_path, DOOR % "COM4", SHIELD % 0)
    leds = "leds: {driver: numato, address: COM3, channels: {450 nm: 1, 525 nm: %d}}"
    assert "'devices.lamp' and 'devices.leds'" in refusal(tmp_path, LAMP, leds % 0)
    assert not refusal(tmp_path, LAMP, leds % 2)


def test_devices_that_share_a_board_are_welcome(tmp_path: Path) -> None:
    assert not refusal(tmp_path, LAMP, DOOR % "COM4", SHIELD % 1)
    assert not refusal(tmp_path, OWN_COMMANDS, CHANGER)
    for name, path in resources.names("config").items():
        require_own_ports(read_rig_file(path), name)


def test_a_misspelt_driver_is_named_first(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    misspelt = LAMP.replace("numato", "numata")
    path.write_text(f"name: x\ndevices:\n  {misspelt}\n  {DOOR % 'COM3'}\n")
    with pytest.raises(LabrigError, match="did you mean 'numato'"):
        require_own_ports(read_rig_file(path), str(path))
