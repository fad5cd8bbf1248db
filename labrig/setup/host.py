"""Devices and programs that the operating system lists; tests replace them."""

import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

PROCESSES = Path("/proc")
_LISTING_S = 10.0


class Port(Protocol):
    """The part of pyserial's `ListPortInfo` that is used; unknown values are None."""

    device: str
    description: str
    vid: int | None
    pid: int | None
    serial_number: str | None


@dataclass(frozen=True)
class Process:
    """A running program.

    Attributes
    ----------
    pid
        Number of the process.
    name
        Name of the program's file without its folder.
    open_files
        Device files that it has open, as far as this user may list them.
    """

    pid: int
    name: str
    open_files: frozenset[str] = frozenset()


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
    processes: Callable[[], Iterable[Process]]

    @classmethod
    def of_this_pc(cls) -> "Host":
        """Return the PC on which this runs."""
        listings: dict[str, Callable[[], Iterable[Process]]] = {
            "linux": _linux_processes,
            "darwin": _mac_processes,
        }
        processes = listings.get(sys.platform, tuple)
        return cls(sys.platform, _serial_ports, _usb_devices, processes)


def _serial_ports() -> Iterable[Port]:
    from serial.tools import list_ports

    return list_ports.comports()


def _usb_devices() -> Iterable[Any]:
    import usb.core

    devices: Iterable[Any] = usb.core.find(find_all=True)
    return devices


def _linux_processes() -> Iterable[Process]:
    for place in PROCESSES.glob("[0-9]*"):
        try:
            command = (place / "cmdline").read_bytes().split(b"\0")[0].decode(errors="replace")
            yield Process(int(place.name), Path(command).name, _usb_files(place / "fd"))
        except OSError:
            continue  # it has ended meanwhile


def _usb_files(descriptors: Path) -> frozenset[str]:
    try:
        targets = [str(entry.readlink()) for entry in descriptors.iterdir()]
    except OSError:  # another user's, or ended
        return frozenset()
    return frozenset(target for target in targets if target.startswith("/dev/bus/usb/"))


def _mac_processes() -> Iterable[Process]:
    try:
        listing = subprocess.run(
            ["/bin/ps", "-axo", "pid=,comm="],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=_LISTING_S,
            check=True,
        ).stdout
    except (OSError, subprocess.SubprocessError):
        return
    for line in listing.splitlines():
        pid, _, command = line.strip().partition(" ")
        yield Process(int(pid), Path(command.strip()).name)
