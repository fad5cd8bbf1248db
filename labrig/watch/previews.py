"""Looks at frames in a process of its own, so that the one that runs the rig keeps its time."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from labrig.errors import LabrigError


@dataclass(frozen=True)
class RenderedPreview:
    """A frame that was looked at: its values as in `Preview`, its picture (height, width, 3)."""

    name: str
    values: dict[str, dict[str, float]]
    clipped: tuple[str, ...]
    picture: NDArray[np.uint8]


class Previews:
    """Asks for frames of one run to be looked at; the answer comes when it comes.

    Parameters
    ----------
    run
        The run folder.
    width
        Of the pictures, in pixels.
    """

    def __init__(self, run: Path, width: int) -> None:
        self.latest: RenderedPreview | None = None
        # -P: nothing that lies in the working folder is taken for a module.
        # Ctrl-C on a terminal goes to all of a group: this one ends when it is told to.
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "labrig.watch.previews", str(run), str(width)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
            start_new_session=os.name != "nt",
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._questions, self._answers = self._process.stdin, self._process.stdout
        self._listening = threading.Thread(target=self._listen, daemon=True)
        self._listening.start()

    def ask(self, name: str, unit: str) -> None:
        """Have the frame of that name, which a unit has taken, looked at."""
        try:
            self._questions.write(f"{json.dumps([name, unit])}\n")
            self._questions.flush()
        except OSError:  # it has died: a run goes on without pictures
            return

    def close(self) -> None:
        """Let it end."""
        self._process.kill()
        self._process.wait()
        self._listening.join()
        self._answers.close()
        try:
            self._questions.close()
        except OSError:
            return

    def _listen(self) -> None:
        for line in self._answers:
            said = json.loads(line)
            picture = np.frombuffer(bytes.fromhex(said.pop("pixels")), np.uint8)
            self.latest = RenderedPreview(
                name=said["name"],
                values=said["values"],
                clipped=tuple(said["clipped"]),
                picture=picture.reshape(said["shape"]),
            )


def answer(run: Path, width: int, questions: Iterable[str], out: TextIO) -> None:
    """Look at the frames asked for, one JSON line each; what cannot be read is left out."""
    # only in the process that looks: the one that runs the rig starts without what this loads
    from labrig.acquire import read_protocol
    from labrig.watch.preview import glance

    protocol = read_protocol(run / "protocol.yaml")
    for question in questions:
        name, unit = json.loads(question)
        try:
            seen = glance(run / "frames" / name, protocol.patches_of(unit), width)
        except LabrigError:
            continue
        said = {
            "name": name,
            "values": seen.values,
            "clipped": seen.clipped,
            "shape": seen.picture.shape,
            "pixels": seen.picture.tobytes().hex(),
        }
        print(json.dumps(said), file=out, flush=True)


if __name__ == "__main__":
    answer(Path(sys.argv[1]), int(sys.argv[2]), sys.stdin, sys.stdout)
