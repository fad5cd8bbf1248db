"""Network addresses of a rig file: by consent of this user for this address alone."""

import socket
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from labrig.acquire import LAMP, read_rig_file
from labrig.bench import open_bench
from labrig.consent import calls, give_consent, has_consent, starting
from labrig.foundation.errors import UsageError
from tests.terminal import idle_guard


class Board:
    """A relay behind a network: it answers every line, as `ser2net` passes it on."""

    def __init__(self) -> None:
        self.calls = 0
        self.lines: list[bytes] = []
        self._server = socket.create_server(("127.0.0.1", 0))
        self.address = f"socket://127.0.0.1:{self._server.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self._server.accept()
            except OSError:
                return
            self.calls += 1
            with connection, connection.makefile("rb") as lines:
                for line in lines:
                    self.lines.append(line.strip())
                    connection.sendall(b"ok\n")

    def close(self) -> None:
        self._server.close()


@pytest.fixture(autouse=True)
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("labrig.consent._file", lambda: tmp_path / "settings" / "consents.txt")
    monkeypatch.setattr("labrig.bench.guard._started", idle_guard)


@pytest.fixture
def board() -> Iterator[Board]:
    with closing(Board()) as board:
        yield board


def rig_with(folder: Path, address: str) -> Path:
    path = folder / "rig.yaml"
    path.write_text(
        f"name: x\ndevices:\n  lamp: {{driver: serial_relay, address: '{address}',\n"
        "    on: {send: on, answer: ok}, off: {send: off, answer: ok}}\n"
    )
    return path


def test_a_board_behind_a_network_is_used_by_consent_alone(tmp_path: Path, board: Board) -> None:
    path = rig_with(tmp_path, board.address)
    file = read_rig_file(path)
    with (
        pytest.raises(UsageError, match=r"rig\.yaml connects to 'socket://.*rig use FILE"),
        open_bench(file, str(path)),
    ):
        pass
    assert board.calls == 0
    give_consent(calls(file.addresses()))
    with open_bench(file, str(path)) as bench, bench.devices() as devices:
        devices[LAMP].on()
    assert b"on" in board.lines
    assert board.lines[-1] == b"off"


def test_a_consent_is_for_one_sentence(tmp_path: Path) -> None:
    (sentence,) = calls(["/dev/ttyACM0", "sim://room/x", "usb://1:2", "socket://bench:4001"])
    assert not has_consent(sentence)
    give_consent([sentence])
    assert has_consent(sentence)
    others = [*calls(["socket://bench:4002", "SOCKET://bench:4001"]), starting(["bench"])]
    assert not any(map(has_consent, others))


@pytest.mark.parametrize(
    "address",
    [
        "spy://loop://?file=mine.txt", "SPY://loop://?file=mine.txt", "alt:///dev/null?class=x",
        "hwgrep://.*", "loop://", "rfc2217://127.0.0.1:2217", "cp2110://x", " spy://x",
        "socket://127.0.0.1:1?logging=debug", "socket://127.0.0.1", "Socket://127.0.0.1:1",
        "mine.txt", "./mine.txt", "/etc/hostname", "/dev/null", "SIM://room/lamp", ".",
    ],
)  # fmt: skip
def test_no_other_address_reaches_pyserial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    """Not even one to which the user consented."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.txt").write_text("mine")
    monkeypatch.setattr("serial.serial_for_url", lambda *_, **__: pytest.fail("was called"))
    path = rig_with(tmp_path, address)
    file = read_rig_file(path)
    give_consent(calls(file.addresses()))
    with (
        pytest.raises(UsageError, match="is no serial port"),
        open_bench(file, str(path)) as bench,
        bench.devices(),
    ):
        pass
    assert (tmp_path / "mine.txt").read_text() == "mine"
