"""A simulated board at the other end of a real terminal device, and a guard that does nothing."""

import os
import select
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.drivers.serial_wire import Board

pty = pytest.importorskip("pty", reason="Windows has no pseudo terminals")


def idle_guard(order: object) -> "subprocess.Popen[bytes]":
    """What stands in for a guard's process: it listens until nobody speaks any more."""
    return subprocess.Popen(["cat"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, bufsize=0)


@contextmanager
def on_a_terminal(board: Board) -> Iterator[str]:
    """The terminal device at whose other end `board` is."""
    ours, theirs = pty.openpty()
    ends, end = os.pipe()

    def serve() -> None:
        while ends not in select.select([ours, ends], [], [])[0]:
            try:
                os.write(ours, board.receive(os.read(ours, 100)))
            except OSError:
                return

    server = threading.Thread(target=serve, daemon=True)
    server.start()
    try:
        yield os.ttyname(theirs)
    finally:
        # Before anything is closed: the number of a file that is closed may soon be another one's,
        # and this board would answer for the next.
        os.close(end)
        server.join()
        for descriptor in (ends, theirs, ours):
            os.close(descriptor)
