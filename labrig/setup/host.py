"""Devices and programs that the operating system lists, and those that hold a camera.

Sources: gphoto2 issues #154, #181 and #485 (Linux), libgphoto2 issue #1064 (macOS).
"""

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol

import usb.core
import usb.util

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


#: Programs that open every camera, and how to make each release it.
_REMEDIES = {
    "linux": {
        "gvfsd-gphoto2": "gio mount -s gphoto2",
        "gvfs-gphoto2-volume-monitor": (
            "systemctl --user mask --now gvfs-gphoto2-volume-monitor (until 'unmask')"
        ),
        "shotwell": "close Shotwell",
        "digikam": "close digiKam",
        "darktable": "close darktable",
        "entangle": "close Entangle",
        "gphoto2": "end gphoto2",
    },
    "darwin": {
        "PTPCamera": "killall PTPCamera (it comes back when a camera is plugged in)",
        "ptpcamerad": "launchctl disable gui/$UID/com.apple.ptpcamerad; killall ptpcamerad",
        "icdd": "close Image Capture and Photos",
        "EOS Utility": "close EOS Utility",
    },
}
_ZADIG = "give this camera the WinUSB driver with Zadig (https://zadig.akeo.ie)"


def port_users(device: Any, host: Host) -> list[str]:
    """Return the programs that may hold a `usb.core.Device`, each with a remedy."""
    return [
        f"{process.name} (process {process.pid}): {remedy}"
        for process, remedy in _suspects(_node(device), host.processes(), host.platform)
    ]


def unreachable(device: Any, platform: str) -> str | None:
    """Return why this user cannot open a `usb.core.Device`, with a remedy; None if possible."""
    try:
        device.get_active_configuration()
    except (usb.core.USBError, NotImplementedError) as error:
        if isinstance(error, usb.core.USBError) and error.errno is None:
            return None  # pyusb's way of saying that no configuration is set: it was opened
        reason = " ".join(str(error).split())
        if platform == "win32":
            return f"it cannot be opened ({reason}): {_ZADIG}"
        if platform == "linux":
            return (
                f'it cannot be opened ({reason}): put SUBSYSTEM=="usb", '
                f'ATTR{{idVendor}}=="{device.idVendor:04x}", TAG+="uaccess" into '
                "/etc/udev/rules.d/70-labrig.rules and plug it in again"
            )
        return f"it cannot be opened ({reason}): unplug it and plug it in again"
    finally:
        usb.util.dispose_resources(device)
    return None


def _node(device: Any) -> str:
    """Return the device file on Linux."""
    return f"/dev/bus/usb/{device.bus or 0:03d}/{device.address or 0:03d}"


def _suspects(
    node: str, processes: Iterable[Program], platform: str
) -> Iterable[tuple[Program, str]]:
    remedies = _REMEDIES.get(platform, {})
    for process in processes:
        if node in process.open_files:
            yield process, remedies.get(process.name, "close it")
        elif process.name in remedies:
            yield process, remedies[process.name]
