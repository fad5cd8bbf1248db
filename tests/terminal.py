"""A simulated board at the other end of a real terminal device."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.drivers.serial_wire import Board

pty = pytest.importorskip("pty", reason="Windows has no pseudo terminals")


@contextmanager
def on_a_terminal(board: Board) -> Iterator[str]:
    """The terminal device at whose other end `board` is."""
    ours, theirs = pty.openpty()

    def serve() -> None:
        while True:
            try:
                os.write(ours, board.receive(os.read(ours, 100)))
            except OSError:
                return

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield os.ttyname(theirs)
    finally:
        os.close(theirs)
        os.close(ours)
