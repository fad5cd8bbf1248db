"""Why a serial port fails, as far as the PC shows it, and what to do.

Two services of Linux take serial ports unasked. brltty (Ubuntu's for Braille displays) claims the
CH340 adapters of many relay boards: their port vanishes a second after it was plugged in.
ModemManager sends modem commands to a new port and keeps others out of it meanwhile.
"""

import errno
import os
from collections.abc import Callable, Iterable

from labrig.acquire.running_programs import Program, running_programs

try:
    import termios
except ImportError:  # Windows
    PORT_FAILURES: tuple[type[Exception], ...] = (OSError,)
else:
    #: What a port raises when it fails; pyserial's own errors are `OSError`, termios' are not.
    PORT_FAILURES = (OSError, termios.error)

#: What services take ports, and how to make each leave them alone.
SERVICES = {
    "brltty": (
        "brltty, the service for Braille displays, is running and takes adapters such as the CH340 "
        "for itself: remove it (sudo apt remove brltty) and plug the board in again"
    ),
    "ModemManager": (
        "ModemManager is running and asks each new port for half a minute whether it is a modem: "
        "wait and try again; for good, sudo systemctl disable --now ModemManager, or the udev rule "
        'ENV{ID_MM_DEVICE_IGNORE}="1" for this board'
    ),
}
_IN_USE = {errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK}
_FORBIDDEN = {errno.EACCES, errno.EPERM}
_GONE = {errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.EIO}
#: Windows says so of a port that another program has open; pyserial puts it into words.
_IN_USE_ON_WINDOWS = "PermissionError(13"
#: Names of the ports of USB adapters on Linux, which brltty may take.
_ADAPTER = "ttyUSB"


def not_opened(
    error: Exception,
    address: str,
    programs: Callable[[], Iterable[Program]] = running_programs,
) -> str:
    """Return why a port cannot be opened, and what to do, for the end of a message.

    Parameters
    ----------
    error
        One of `PORT_FAILURES`.
    address
        The port, such as `/dev/ttyUSB0`.
    programs
        Function that lists the programs on this PC.

    Returns
    -------
    str
        The cause as far as it can be seen, and what to do.

    Examples
    --------
    >>> from labrig.acquire import Program, not_opened
    >>> modems = [Program(612, "ModemManager")]
    >>> not_opened(OSError(16, "Device or resource busy"), "/dev/ttyACM0", lambda: modems)[:40]
    'ModemManager is running and asks each ne'
    """
    number = _number(error)
    if number in _IN_USE or _IN_USE_ON_WINDOWS in str(error):
        return _user(address, list(programs()))
    if number in _FORBIDDEN:
        return (
            "you may not use it: become a member of the group that owns it (Debian, Ubuntu: sudo "
            "usermod -aG dialout $USER) and log in again"
        )
    if number in _GONE and (taken := _taken(address, programs)):
        return taken
    return (
        "check that it is plugged in ('labrig rig devices' shows the ports) and that no other "
        "program uses it"
    )


def gone(
    error: Exception,
    name: str,
    programs: Callable[[], Iterable[Program]] = running_programs,
) -> str:
    """Return why an open port is gone and what to do, for the end of a message.

    Parameters
    ----------
    error
        One of `PORT_FAILURES`.
    name
        Name of the device in messages, with its address.
    programs
        Function that lists the programs on this PC.

    Returns
    -------
    str
        The system's words, and the cause or what to do.

    Examples
    --------
    >>> from labrig.acquire import Program, gone
    >>> displays = [Program(407, "brltty")]
    >>> gone(OSError(5, "Input/output error"), "the relay at /dev/ttyUSB0", lambda: displays)[:44]
    '([Errno 5] Input/output error); brltty, the '
    """
    reason = " ".join(str(error).split())
    return f"({reason}); {_taken(name, programs) or 'plug it in again'}"


def _number(error: Exception) -> int | None:
    """Return the system's number of an error; termios has it as its first argument."""
    number = getattr(error, "errno", None)
    first = error.args[0] if number is None and error.args else number
    return first if isinstance(first, int) else None


def _user(address: str, programs: Iterable[Program]) -> str:
    """Return who has a port open: seen to, else one of the services that do so."""
    device = os.path.realpath(address)
    for program in programs:
        if device in program.open_files and program.pid != os.getpid():
            return SERVICES.get(
                program.name, f"{program.name} (process {program.pid}) has it open: close it"
            )
    running = {program.name for program in programs}
    suspects = [remedy for service, remedy in SERVICES.items() if service in running]
    return "; ".join(suspects) or "another program has it open: close it"


def _taken(name: str, programs: Callable[[], Iterable[Program]]) -> str | None:
    """Return that brltty may have taken an adapter away; None if it has not."""
    if _ADAPTER in name and any(program.name == "brltty" for program in programs()):
        return SERVICES["brltty"]
    return None
