"""A device is locked, not its spelling, in one place of a PC, for whoever opens it."""

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from labrig.bench.device_lock import (
    held,
    lock_folder,
    network_devices,
    serial_devices,
    usb_device,
)
from labrig.foundation.errors import UsageError

pty = pytest.importorskip("pty", reason="Windows has no pseudo terminals")


@pytest.fixture
def port() -> Iterator[str]:
    ours, theirs = pty.openpty()
    yield os.ttyname(theirs)
    os.close(theirs)
    os.close(ours)


def test_a_port_is_the_same_by_every_name(port: str, tmp_path: Path) -> None:
    link = tmp_path / "by-id"
    link.symlink_to(port)
    (tmp_path / "again").symlink_to(link)
    names = [port, f"/{port}", f"/dev/../{port}", os.path.relpath(port), str(link),
             str(tmp_path / "again")]  # fmt: skip
    assert {tuple(serial_devices(name)) for name in names} == {tuple(serial_devices(port))}
    assert serial_devices("/dev/null") != serial_devices(port)
    assert serial_devices("com3", "win32") == serial_devices(r"\\.\COM3", "win32")


def test_a_host_is_the_same_by_every_name() -> None:
    (number,) = network_devices("127.0.0.1", 15740)
    assert number in network_devices("localhost", 15740)
    assert [number] == network_devices("127.1", 15740) == network_devices("::ffff:127.0.0.1", 15740)
    assert network_devices("127.0.0.1", 15741) != [number]


def test_a_usb_device_is_known_by_its_place() -> None:
    camera = SimpleNamespace(bus=1, address=14, port_numbers=(2, 3))
    assert usb_device(camera) == "usb-1-2.3"
    camera.port_numbers = None
    assert usb_device(camera) == "usb-1-address-14"


def test_the_place_of_the_locks_is_one_for_all(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    before = lock_folder()
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    assert tempfile.gettempdir() == str(tmp_path)
    assert lock_folder() == before
    monkeypatch.setenv("PROGRAMDATA", str(tmp_path))
    assert lock_folder("win32") == tmp_path / "labrig"


def test_what_is_held_is_held_once_and_free_afterwards(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("labrig.bench.device_lock.lock_folder", lambda: tmp_path)
    for _ in range(2):
        with (
            held("serial-1-2", "COM3"),
            held("serial-1-3", "COM4"),
            pytest.raises(UsageError, match="COM3 is held by another labrig"),
            held("serial-1-2", "COM3"),
        ):
            pass


def test_a_lock_file_that_another_user_left_is_a_lock_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("labrig.bench.device_lock.lock_folder", lambda: tmp_path)
    before = os.umask(0o077)
    try:
        with held("serial-1-2", "COM3"):
            pass
    finally:
        os.umask(before)
    (left,) = tmp_path.iterdir()
    assert left.stat().st_mode & 0o777 == 0o444, "everybody can lock it, nobody has to write"
    with held("serial-1-2", "COM3"):
        pass


def test_a_lock_that_cannot_be_made_is_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr("labrig.bench.device_lock.lock_folder", lambda: tmp_path / "file")
    with pytest.raises(UsageError, match="COM3 cannot be kept") as caught, held("x", "COM3"):
        pass
    assert "\n" not in str(caught.value)
