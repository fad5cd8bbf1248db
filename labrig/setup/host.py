"""Devices and programs that the operating system lists; tests replace them."""

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol

from labrig.acquire import Program, running_programs


class Port(Protocol):
    """The part of pyserial's `ListPortInfo` that is used; unknown values are None."""

    device: str
    description: str
    vid: int | None
    pid: int | None
    serial_number: str | None


@dataclass(frozen=True)
class Host:
    """A PC.

    Attributes
    ----------
    platform
        Name of the platform as in `sys.platform`.
    ports
        Function that lists serial ports.
    usb_devices
        Function that lists `usb.core.Device`; raises `usb.core.NoBackendError` without libusb.
    processes
        Function that lists running programs.
    """

    platform: str
    ports: Callable[[], Iterable[Port]]
    usb_devices: Callable[[], Iterable[Any]]
    processes: Callable[[], Iterable[Program]]

    @classmethod
    def of_this_pc(cls) -> "Host":
        """Return the PC on which this runs."""
        return cls(sys.platform, _serial_ports, _usb_devices, running_programs)


def _serial_ports() -> Iterable[Port]:
    from serial.tools import list_ports

    return list_ports.comports()


def _usb_devices() -> Iterable[Any]:
    import usb.core

    devices: Iterable[Any] = usb.core.find(find_all=True)
    return devices
