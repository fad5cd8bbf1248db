"""A board that comes back under another name is found; another board is not taken for it."""

from collections.abc import Callable

import pytest
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from labrig.bench.serial_ports import SerialPorts
from labrig.foundation.errors import DeviceError

NUMATO, MAESTRO, CH340 = (0x2A19, 0x0C01), (0x1FFB, 0x0089), (0x1A86, 0x7523)
Plug = Callable[..., None]


@pytest.fixture
def plug(monkeypatch: pytest.MonkeyPatch) -> Plug:
    """Says what is plugged in: name → (kind, serial number, location)."""

    def say(**ports: tuple[tuple[int, int], str | None, str]) -> None:
        listed = []
        for name, (kind, serial_number, location) in ports.items():
            port = ListPortInfo(f"/dev/{name}")
            (port.vid, port.pid), port.serial_number = kind, serial_number
            port.location = location
            listed.append(port)
        monkeypatch.setattr(list_ports, "comports", lambda: listed)

    return say


@pytest.mark.parametrize("location", ["1-2", "1-3"], ids=["same plug", "another plug"])
def test_by_its_serial_number(plug: Plug, location: str) -> None:
    ports = SerialPorts()
    plug(ttyACM0=(NUMATO, "7", "1-2"), ttyACM1=(NUMATO, "8", "1-4"))
    assert ports.look_up("/dev/ttyACM0") == "/dev/ttyACM0"
    plug(ttyACM2=(NUMATO, "7", location), ttyACM1=(NUMATO, "8", "1-4"))
    assert ports.look_up("/dev/ttyACM0") == "/dev/ttyACM2"
    plug(ttyACM0=(NUMATO, "8", "1-2"), ttyACM1=(NUMATO, "7", "1-4"))
    assert ports.look_up("/dev/ttyACM0") == "/dev/ttyACM1", "they have changed places"


def test_without_a_serial_number_by_its_plug_or_as_the_only_one_of_its_kind(plug: Plug) -> None:
    ports = SerialPorts()
    plug(ttyUSB0=(CH340, None, "1-1"), ttyUSB1=(CH340, None, "1-2"))
    assert ports.look_up("/dev/ttyUSB0") == "/dev/ttyUSB0"
    plug(ttyUSB1=(CH340, None, "1-2"), ttyUSB2=(CH340, None, "1-1"))
    assert ports.look_up("/dev/ttyUSB0") == "/dev/ttyUSB2"
    plug(ttyUSB3=(CH340, None, "1-5"))
    assert ports.look_up("/dev/ttyUSB0") == "/dev/ttyUSB3"
    plug(ttyUSB3=(CH340, None, "1-5"), ttyUSB4=(CH340, None, "1-6"))
    assert ports.look_up("/dev/ttyUSB0") == "/dev/ttyUSB0", "nobody can tell which it is"


def test_the_same_of_its_ports(plug: Plug) -> None:
    ports = SerialPorts()
    plug(ttyACM0=(MAESTRO, "5", "1-1:1.0"), ttyACM1=(MAESTRO, "5", "1-1:1.2"))
    assert ports.look_up("/dev/ttyACM1") == "/dev/ttyACM1"
    plug(ttyACM2=(MAESTRO, "5", "1-1:1.0"), ttyACM3=(MAESTRO, "5", "1-1:1.2"))
    assert ports.look_up("/dev/ttyACM1") == "/dev/ttyACM3"


def test_another_board_in_its_place_is_refused(plug: Plug) -> None:
    ports = SerialPorts()
    plug(ttyACM0=(NUMATO, "7", "1-2"))
    ports.look_up("/dev/ttyACM0")
    plug(ttyACM0=(MAESTRO, "5", "1-2"))
    with pytest.raises(DeviceError, match="another board is at /dev/ttyACM0 now"):
        ports.look_up("/dev/ttyACM0")


def test_what_is_not_on_the_usb_keeps_its_name(plug: Plug) -> None:
    ports = SerialPorts()
    plug()
    for address in ("/dev/ttyS0", "COM3", "sim://room/relays"):
        assert ports.look_up(address) == address
        assert ports.look_up(address) == address
