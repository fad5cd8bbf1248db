"""One bench, one labrig: a lock on each device, by whatever name it is called.

The lock is an advisory one on a file. It ends with the process that has it, however that ends, and
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
from urllib.parse import quote, urlsplit

from filelock import FileLock, Timeout

from labrig.errors import UsageError

if sys.platform != "win32":
    import fcntl

#: In memory and never tidied up; open to everybody on Debian, Ubuntu and Arch, not on Fedora.
RUN_LOCK = Path("/run/lock")


@contextmanager
def held(device: str, address: str) -> Iterator[None]:
    """Keep every other labrig on this PC from `device`; nothing is sent to it.

    Parameters
    ----------
    device
        As `serial_devices`, `usb_device` or `network_devices` name it.
    address
        As the rig file calls it, for messages.

    Raises
    ------
    UsageError
        Another labrig has it.
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
    """The one folder of this PC that has the locks, whoever asks and whatever TMPDIR says."""
    if platform == "win32":
        return Path(os.environ["PROGRAMDATA"]) / "labrig"
    is_for_everybody = RUN_LOCK.is_dir() and RUN_LOCK.stat().st_mode & stat.S_IWOTH
    return RUN_LOCK if is_for_everybody else Path("/tmp")


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """A lock on a file that any user may have made.

    Of such a file in a folder for everybody, Linux forbids others to open it as if to make it
    (fs.protected_regular), and filelock does not trust it: hence both steps are done here.
    """
    if sys.platform == "win32":
        path.parent.mkdir(exist_ok=True)
        with FileLock(path, timeout=0):
            yield
        return
    with suppress(FileExistsError):
        made = os.open(path, os.O_CREAT | os.O_EXCL)
        os.fchmod(made, 0o444)
        os.close(made)
    lock = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(lock)


def serial_devices(port: str, platform: str = sys.platform) -> list[str]:
    """What is behind the name of a serial port: by a link, a relative path, a URL of pyserial's.

    Raises
    ------
    OSError
        There is no such port.
    """
    url = urlsplit(port)
    if url.scheme and url.hostname and url.port:
        return network_devices(url.hostname, url.port)
    if "://" in port:
        return [port]
    if platform == "win32":
        return [port.upper().removeprefix("\\\\.\\")]
    if platform == "darwin":  # the dial-in and the call-out name of one port
        port = os.path.realpath(port).replace("/dev/tty.", "/dev/cu.", 1)
    number = Path(port).stat().st_rdev
    return [f"serial-{os.major(number)}-{os.minor(number)}"]


def usb_device(device: Any) -> str:
    """The place of a `usb.core.Device` on the bus: many cameras have no serial number there."""
    place = device.port_numbers or (f"address-{device.address}",)
    return f"usb-{device.bus}-{'.'.join(map(str, place))}"


def network_devices(host: str, port: int) -> list[str]:
    """Every number that a name in the network stands for, with the port.

    Raises
    ------
    OSError
        Nobody knows the name.
    """
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return sorted({f"{_number(str(peer[0]))}:{port}" for *_, peer in found})


def _number(number: str) -> str:
    """An address as short as it can be; IPv4 written as IPv6 is IPv4."""
    plain = ipaddress.ip_address(number)
    return str(getattr(plain, "ipv4_mapped", None) or plain)
