"""`labrig` as a process of its own, to be killed; the simulated room is looked at when it is left.

    python -m tests.acceptance.labrig_process SETTINGS ARGUMENT ...

is that process: `labrig ARGUMENT ...`, settings in JSON.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

from labrig.bench import Bench, open_bench, recording
from labrig.cli.exit_codes import guarded
from tests.forked import forked

LOOK_S = 0.002
#: Begins of lines of progress, and of those that tell of no failure.
REMARKS = "[", "warning:", "note:", "nothing to resume: all units are complete"


class Labrig:
    """`labrig` as a process of its own, whose room is looked at when it is left."""

    def __init__(
        self, folder: Path, arguments: Sequence[object], dies_at_byte: int | None = None
    ) -> None:
        self._bench, self._err = folder / "bench.json", folder / "stderr.txt"
        self._bench.unlink(missing_ok=True)
        told = json.dumps({"bench": str(self._bench), "dies_at_byte": dies_at_byte})
        command = [sys.executable, "-m", __name__, told, *map(str, arguments)]
        with self._err.open("wb") as err:
            self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=err)

    def runs_until(self, reached: Callable[[], bool]) -> bool:
        """Whether `reached` came true before it ended."""
        while self._process.poll() is None:
            if reached():
                return True
            time.sleep(LOOK_S)
        return False

    def kill(self) -> None:
        self._process.kill()

    def code(self) -> int:
        return self._process.wait()

    @property
    def complaints(self) -> list[str]:
        """Return its messages beside its progress, and what it only remarks on."""
        lines = self._err.read_text().splitlines()
        return [line for line in lines if not line.startswith(REMARKS)]

    @property
    def bench(self) -> dict[str, Any]:
        """The room as it was left; nothing if it was not opened."""
        return dict(json.loads(self._bench.read_text())) if self._bench.exists() else {}


@dataclass(frozen=True)
class Ended:
    """End of a process: exit code, messages beside progress and remarks, and the room it left."""

    code: int
    complaints: list[str]
    bench: dict[str, Any]


def forked_labrig(folder: Path, arguments: Sequence[object]) -> Ended:
    """`labrig ARGUMENTS` in a child of this process, which begins at once."""
    bench, err = folder / "bench.json", folder / "stderr.txt"
    bench.unlink(missing_ok=True)
    told = json.dumps({"bench": str(bench), "dies_at_byte": None})
    _, status = os.waitpid(forked(lambda: _child(told, [*map(str, arguments)]), err), 0)
    lines = err.read_text(encoding="utf-8").splitlines()
    return Ended(
        os.waitstatus_to_exitcode(status),
        [line for line in lines if not line.startswith(REMARKS)],
        dict(json.loads(bench.read_text(encoding="utf-8"))) if bench.exists() else {},
    )


def _child(told: str, arguments: list[str]) -> int:
    """`labrig ARGUMENTS`, whose room is looked at in the end; it may die in mid-write."""
    settings = json.loads(told)
    bench, left_bytes = Path(settings["bench"]), settings["dies_at_byte"]

    @contextmanager
    def looked_at(*arguments: Any, **keys: Any) -> Iterator[Bench]:
        with open_bench(*arguments, **keys) as stand:
            assert stand.room is not None
            if left_bytes is not None:
                _die_writing(stand.disk, left_bytes)
            try:
                yield stand
            finally:
                bench.write_text(json.dumps(_left(stand)), encoding="utf-8")

    recording.open_bench = looked_at  # type: ignore[attr-defined]
    return guarded(arguments)


def _left(stand: Bench) -> dict[str, Any]:
    """Return the room's true state, whatever relay, servo and driver report."""
    assert stand.room is not None
    room, now_s = stand.room.room, stand.clock.now()
    doors = {"door": room.door, "shield": room._doors.shield}
    angles = {name: None if door is None else door.angle(now_s) for name, door in doors.items()}
    lights = {"lamp_on": room.lamp_on, "leds_lit": sorted(room.leds.lit)}
    # A unit that is done again puts its sample in anew; how often counts for nothing.
    bench = replace(room.arrangements.last, placing=0)
    return {**lights, **angles, "changer": str(bench)}


def _die_writing(disk: Any, left_bytes: int) -> None:
    whole = disk.write

    def write(file: BinaryIO, data: bytes) -> None:
        nonlocal left_bytes
        if len(data) > left_bytes:
            file.write(data[:left_bytes])
            os.kill(os.getpid(), signal.SIGKILL)
        left_bytes -= len(data)
        whole(file, data)

    disk.write = write


if __name__ == "__main__":
    sys.exit(_child(sys.argv[1], sys.argv[2:]))
