"""A recorded run that is recorded again, line by line."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

from labrig.foundation.output_file import write_durably
from labrig.record import JOURNAL

#: Writes one frame: its new path and its content.
WriteFrame = Callable[[Path, bytes], None]


class Replay:
    """A recorded run that is recorded anew into `folder`: each frame before its journal line."""

    def __init__(self, run: Path, folder: Path, write: WriteFrame = write_durably) -> None:
        self.folder, self._run, self._write = folder, run, write
        (folder / "frames").mkdir(parents=True)
        for file in run.iterdir():
            if file.is_file() and file.name != JOURNAL:
                shutil.copy(file, folder)
        self._left = (run / JOURNAL).read_bytes().splitlines(keepends=True)

    def go_on(self, frames: int | None = None) -> None:
        """Record that many further frames, or all that are left."""
        with (self.folder / JOURNAL).open("ab", buffering=0) as journal:
            while self._left and frames != 0:
                line = self._left.pop(0)
                if (name := json.loads(line)["doc"].get("data", {}).get("frame")) is not None:
                    self._write(self.folder / name, (self._run / name).read_bytes())
                    frames = None if frames is None else frames - 1
                journal.write(line)
