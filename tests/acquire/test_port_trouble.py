"""What a serial port's failure says: the programs that take ports, rights, a port that is gone."""

import errno
import os
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

import pytest

from labrig.acquire import PORT_FAILURES, Program, gone, linux_programs, not_opened
from labrig.drivers.serial_line import SerialLine
from labrig.foundation.clock import SystemClock
from labrig.foundation.errors import DeviceLostError

Programs = Callable[[], Iterable[Program]]


@pytest.fixture
def proc(tmp_path: Path) -> Callable[..., Programs]:
    """A /proc with programs by name, each with the device file that this user sees it use."""

    def write(**open_files: str | None) -> Programs:
        for pid, (name, file) in enumerate(open_files.items(), start=100):
            place = tmp_path / str(pid)
            (place / "fd").mkdir(parents=True)
            (place / "cmdline").write_bytes(f"/usr/sbin/{name}\0--system\0".encode())
            if file is not None:
                (place / "fd" / "3").symlink_to(file)
        return partial(linux_programs, tmp_path)

    return write


def failure(number: int) -> OSError:
    return OSError(number, os.strerror(number))


@pytest.mark.parametrize("number", [errno.EBUSY, errno.EWOULDBLOCK])
def test_who_holds_a_port(proc: Callable[..., Programs], number: int) -> None:
    programs = proc(bash="/dev/ttyUSB1", picocom="/dev/ttyUSB0", ModemManager=None)
    assert "picocom (process 101)" in not_opened(failure(number), "/dev/ttyUSB0", programs)


@pytest.mark.parametrize(
    ("service", "remedy"), [("ModemManager", "ID_MM_DEVICE_IGNORE"), ("brltty", "apt remove")]
)
def test_a_service_of_another_user_is_named(
    proc: Callable[..., Programs], service: str, remedy: str
) -> None:
    told = not_opened(failure(errno.EBUSY), "/dev/ttyUSB0", proc(systemd=None, **{service: None}))
    assert service in told
    assert remedy in told


def test_a_port_that_brltty_took_away(proc: Callable[..., Programs]) -> None:
    programs = proc(brltty=None)
    for number in (errno.ENOENT, errno.ENXIO, errno.EIO):
        assert "brltty" in not_opened(failure(number), "/dev/ttyUSB0", programs)
        assert "brltty" in gone(failure(number), "LCUS board at /dev/ttyUSB0", programs)
        # It takes no board that is a port by itself.
        assert "brltty" not in not_opened(failure(number), "/dev/ttyACM0", programs)


def test_without_such_services_none_is_blamed(proc: Callable[..., Programs]) -> None:
    for number in (errno.ENOENT, errno.EBUSY, errno.EIO, errno.EACCES):
        told = not_opened(failure(number), "/dev/ttyUSB0", proc())
        assert "brltty" not in told
        assert "ModemManager" not in told
    assert "dialout" in not_opened(failure(errno.EACCES), "/dev/ttyUSB0", proc())


def test_what_termios_raises_is_a_failure_of_the_port() -> None:
    termios = pytest.importorskip("termios", reason="Windows has none")
    error = termios.error(errno.EIO, "Input/output error")
    assert isinstance(error, PORT_FAILURES)
    assert "Input/output" in gone(error, "board at /dev/ttyACM0", tuple)


@pytest.mark.parametrize(
    "use",
    [
        lambda line: line.write(b"relay on 0\r"),
        lambda line: line.read_until(b">", 1.0),
        lambda line: line.discard(),
        lambda line: line.drain(),
    ],
    ids=["write", "read", "discard", "drain"],
)
def test_a_port_that_goes_while_it_is_open(use: Callable[[SerialLine], object]) -> None:
    """A pseudo terminal whose other end is closed answers as a board that was pulled out."""
    pty = pytest.importorskip("pty", reason="Windows has no pseudo terminals")
    serial = pytest.importorskip("serial")
    ours, theirs = pty.openpty()
    with serial.Serial(os.ttyname(theirs), timeout=0, write_timeout=1.0) as port:
        os.close(theirs)
        os.close(ours)
        line = SerialLine(port, SystemClock(), "board at /dev/ttyACM0")
        with pytest.raises(DeviceLostError, match="is gone"):
            use(line)
