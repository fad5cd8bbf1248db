"""Programs that run on this PC, with the device files that they have open."""

import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

PROCESSES = Path("/proc")
_LISTING_S = 10.0


@dataclass(frozen=True)
class Program:
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


def running_programs() -> Iterable[Program]:
    """List the programs that run on this PC.

    Returns
    -------
    iterable of Program
        The programs; none where the platform does not tell.

    Examples
    --------
    >>> from labrig.acquire import running_programs
    >>> all(program.pid > 0 for program in running_programs())
    True
    """
    listings: dict[str, Callable[[], Iterable[Program]]] = {
        "linux": partial(linux_programs, PROCESSES),
        "darwin": _mac_programs,
    }
    return listings.get(sys.platform, tuple)()


def linux_programs(processes: Path) -> Iterable[Program]:
    r"""List the programs in a folder such as `/proc`.

    Parameters
    ----------
    processes
        The folder.

    Yields
    ------
    Program
        One program after the other.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.acquire import linux_programs
    >>> process = Path("processes/612")
    >>> process.mkdir(parents=True)
    >>> _ = (process / "cmdline").write_bytes(b"/usr/sbin/ModemManager\0--debug\0")
    >>> list(linux_programs(Path("processes")))
    [Program(pid=612, name='ModemManager', open_files=frozenset())]
    """
    for place in processes.glob("[0-9]*"):
        try:
            command = (place / "cmdline").read_bytes().split(b"\0")[0].decode(errors="replace")
            yield Program(int(place.name), Path(command).name, _device_files(place / "fd"))
        except OSError:
            continue  # it has ended meanwhile


def _device_files(descriptors: Path) -> frozenset[str]:
    try:
        targets = [str(entry.readlink()) for entry in descriptors.iterdir()]
    except OSError:  # another user's, or ended
        return frozenset()
    return frozenset(target for target in targets if target.startswith("/dev/"))


def _mac_programs() -> Iterable[Program]:
    try:
        listing = subprocess.run(
            ["/bin/ps", "-axo", "pid=,comm="],
            capture_output=True,
            text=True,
            encoding="utf-8",
            errors="replace",
            timeout=_LISTING_S,
            check=True,
        ).stdout
    except (OSError, subprocess.SubprocessError):
        return
    for line in listing.splitlines():
        pid, _, command = line.strip().partition(" ")
        yield Program(int(pid), Path(command.strip()).name)
