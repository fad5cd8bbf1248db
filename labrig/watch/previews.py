"""Previews of frames in a process of their own, so that the process of the rig keeps its timing."""

import json
import sys
import threading
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.errors import LabrigError
from labrig.foundation.own_process import own_process


@dataclass(frozen=True)
class RenderedPreview:
    """A preview received from the other process.

    Attributes
    ----------
    name
        File name of the frame.
    values, clipped
        Means and clipped patches, as in `Preview`.
    picture
        Picture, shape (height, width, 3).
    """

    name: str
    values: dict[str, dict[str, float]]
    clipped: tuple[str, ...]
    picture: NDArray[np.uint8]


class Previews:
    """Process that renders previews of the frames of one run, asynchronously.

    Parameters
    ----------
    run
        Run folder.
    width
        Largest width of the pictures in pixels.

    Attributes
    ----------
    latest
        Latest preview; None before the first one.
    """

    def __init__(self, run: Path, width: int) -> None:
        self.latest: RenderedPreview | None = None
        self._process: Popen[str] = own_process(
            "labrig.watch.previews",
            *(str(run), str(width)),
            stdin=PIPE,
            stdout=PIPE,
            stderr=DEVNULL,
            text=True,
            encoding="utf-8",
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._requests, self._replies = self._process.stdin, self._process.stdout
        self._thread = threading.Thread(target=self._receive, daemon=True)
        self._thread.start()

    def ask(self, name: str, unit: str) -> None:
        """Request the preview of the frame with a file name, taken by a unit."""
        try:
            self._requests.write(f"{json.dumps([name, unit])}\n")
            self._requests.flush()
        except OSError:  # it has died: a run goes on without pictures
            return

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        self._thread.join()
        self._replies.close()
        try:
            self._requests.close()
        except OSError:
            return

    def _receive(self) -> None:
        for line in self._replies:
            message = json.loads(line)
            picture = np.frombuffer(bytes.fromhex(message.pop("pixels")), np.uint8)
            self.latest = RenderedPreview(
                name=message["name"],
                values=message["values"],
                clipped=tuple(message["clipped"]),
                picture=picture.reshape(message["shape"]),
            )


def answer(run: Path, width: int, requests: Iterable[str], out: TextIO) -> None:
    """Print the previews requested, one JSON line each; unreadable frames are left out."""
    # only in the process that looks: the one that runs the rig starts without what this loads
    from labrig.acquire import read_run_protocol
    from labrig.watch.preview import glance

    protocol = read_run_protocol(run)
    for request in requests:
        name, unit = json.loads(request)
        try:
            preview = glance(run / "frames" / name, protocol.patches_of(unit), width)
        except LabrigError:
            continue
        message = {
            "name": name,
            "values": preview.values,
            "clipped": preview.clipped,
            "shape": preview.picture.shape,
            "pixels": preview.picture.tobytes().hex(),
        }
        print(json.dumps(message), file=out, flush=True)


if __name__ == "__main__":
    answer(Path(sys.argv[1]), int(sys.argv[2]), sys.stdin, sys.stdout)
