"""Keeps C libraries from writing into the user's terminal."""

import os
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_STDERR = 2
#: How LibRaw's lines begin (it names the file, which a buffer has not), and those of its libjpeg.
_PREFIXES = (b"unknown file:", b"Corrupt JPEG data:", b"Premature end of JPEG file")
#: The process has one stderr: two redirections at once would restore each other's.
_lock = threading.Lock()


@contextmanager
def quiet_stderr() -> Iterator[None]:
    """While open, LibRaw's lines on the process's stderr are dropped.

    Lines that other threads write meanwhile are passed on at the end.
    """
    with _lock, tempfile.TemporaryFile() as caught:
        try:
            kept = os.dup(_STDERR)
        except OSError:  # a process without stderr has nothing to keep quiet
            yield
            return
        os.dup2(caught.fileno(), _STDERR)
        try:
            yield
        finally:
            os.dup2(kept, _STDERR)
            os.close(kept)
            caught.seek(0)
            for line in caught:
                if not line.startswith(_PREFIXES):
                    os.write(_STDERR, line)
