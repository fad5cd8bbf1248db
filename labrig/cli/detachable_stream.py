"""A stream that may lose its reader."""

import os
from typing import Any, TextIO


class DetachableStream:
    """A stream that accepts text even when its reader has gone, so that a run continues."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write `text`; discard it if the reader has gone."""
        try:
            return self._stream.write(text)
        except OSError:
            self._drop_the_rest()
            return len(text)

    def flush(self) -> None:
        """Flush the stream, if the reader has not gone."""
        try:
            self._stream.flush()
        except OSError:
            self._drop_the_rest()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _drop_the_rest(self) -> None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
