"""Locks that keep other labrigs from a bench's devices, by whatever name a device is called.

A lock is an advisory one on a file. It ends with the process that holds it, however that ends, and
no child of that process inherits it.
"""

import ipaddress
import os
import socket
import stat
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

from filelock import FileLock, Timeout

from labrig.foundation.errors import UsageError

if sys.platform != "win32":
    import fcntl

#: Folder in memory that is never cleaned up; writable for all on Debian, Ubuntu, Arch, not Fedora.
RUN_LOCK = Path("/run/lock")


@contextmanager
def held(device: str, address: str) -> Iterator[None]:
    """Lock `device` against every other labrig on this PC; nothing is sent to it.

    Parameters
    ----------
    device
        Identifier from `serial_devices`, `usb_device` or `network_devices`.
    address
        Address in the rig file, for messages.

    Raises
    ------
    UsageError
        Another labrig holds the device.
    """
    path = lock_folder() / f"labrig-{quote(os.fsencode(device), safe='')}.lock"
    with ExitStack() as stack:
        try:
            stack.enter_context(_locked(path))
        except (BlockingIOError, Timeout):
            raise UsageError(
                f"{address} is held by another labrig on this PC; wait until it has ended"
            ) from None
        except OSError as error:
            raise UsageError(
                f"{address} cannot be kept from other labrigs on this PC, because {path} cannot be "
                f"locked ({error.strerror}); see that every user may write there"
            ) from None
        yield


def lock_folder(platform: str = sys.platform) -> Path:
    """Return the folder of the locks, the same for all users and independent of TMPDIR."""
    if platform == "win32":
        return Path(os.environ["PROGRAMDATA"]) / "labrig"
    is_for_everybody = RUN_LOCK.is_dir() and RUN_LOCK.stat().st_mode & stat.S_IWOTH
    return RUN_LOCK if is_for_everybody else Path("/tmp")


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Lock a file that any user may have created.

    In a folder that everybody can write, Linux forbids opening another user's file with the flag
    that creates it (fs.protected_regular), and filelock does not trust such a file: hence both
    steps are separate here.
    """
    if sys.platform == "win32":
        path.parent.mkdir(exist_ok=True)
        with FileLock(path, timeout=0):
            yield
        return
    with suppress(FileExistsError):
        created = os.open(path, os.O_CREAT | os.O_EXCL)
        os.fchmod(created, 0o444)
        os.close(created)
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)


def serial_devices(port: str, platform: str = sys.platform) -> list[str]:
    """Return the devices behind a serial port given by a link, a relative path or a simulated name.

    Raises
    ------
    OSError
        There is no such port.
    """
    if "://" in port:
        return [port]
    if platform == "win32":
        return [port.upper().removeprefix("\\\\.\\")]
    if platform == "darwin":  # the dial-in and the call-out name of one port
        port = os.path.realpath(port).replace("/dev/tty.", "/dev/cu.", 1)
    number = Path(port).stat().st_rdev
    return [f"serial-{os.major(number)}-{os.minor(number)}"]


def usb_device(device: Any) -> str:
    """Return the place of a `usb.core.Device` on the bus; many have no serial number."""
    place = device.port_numbers or (f"address-{device.address}",)
    return f"usb-{device.bus}-{'.'.join(map(str, place))}"


def network_devices(host: str, port: int) -> list[str]:
    """Return every address of a host name, with the port.

    Raises
    ------
    OSError
        The name cannot be resolved.
    """
    addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return sorted(
        {f"{_shortest(str(socket_address[0]))}:{port}" for *_, socket_address in addresses}
    )


def _shortest(number: str) -> str:
    """Return the shortest form of an IP address; IPv4 written as IPv6 becomes IPv4."""
    plain = ipaddress.ip_address(number)
    return str(getattr(plain, "ipv4_mapped", None) or plain)
