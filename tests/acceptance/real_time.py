"""A decay in real time: memory, files and threads of labrig, or what becomes of it when stopped.

    python -m tests.acceptance.real_time growth [--minutes 60]
    python -m tests.acceptance.real_time stopped [--trials 6] [--seconds 120] [--seed 1]

labrig is a process of its own with its real clock. Its lamp is on an emulated board behind a
pseudo-terminal, its camera a simulated one that another process serves by PTP/IP. `growth` prints
readings of the process twelve times. `stopped` sends SIGSTOP at a random moment of the charge or
of the decay, in turns, and SIGCONT some minutes later. Wanted: where the lamp was on, the guard has
ended labrig and switched it off; after `labrig resume` all units are complete, and all frames are
as recorded.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path

from labrig.bench.guard import HANG_TIMEOUT_S
from labrig.foundation import resources
from labrig.foundation.clock import SystemClock, VirtualClock
from labrig.foundation.yaml_file import read_yaml, yaml_text
from labrig.record import read_run
from labrig.sim.camera import Pace
from labrig.sim.room import Room
from labrig.sim.simulation import Simulation
from tests.acceptance.board_on_a_terminal import RELAY, WatchedBoard
from tests.counterparts.served import EPOCH_S, served
from tests.lit_bench import wait_for_guards
from tests.terminal import on_a_terminal

SHARES = 12
PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6
#: Memory that a process takes at its leisure, beside three bytes for each byte of the journal.
SLACK_MB, PER_JOURNAL_BYTE = 8.0, 3.0
PATIENCE_S = 120.0
#: In which the guard switches the lamp off, and what a busy PC may add.
GUARDED_S = HANG_TIMEOUT_S + 10.0


class LampBoard(WatchedBoard):
    """Its relay switches the lamp of a simulated room."""

    def __init__(self, room: Room, pace: Pace) -> None:
        super().__init__()
        self._room, self._pace = room, pace

    def receive(self, data: bytes) -> bytes:
        before = len(self.switched)
        answer = super().receive(data)
        for _, on in self.switched[before:]:
            self._pace.catch_up()
            self._room.switch_lamp(on)
        return answer


class Labrig:
    """`labrig run` in real time, with its board and the camera of another process."""

    def __init__(
        self, folder: Path, address: str, camera: str, protocol: Mapping[str, object]
    ) -> None:
        self.runs, self._err = folder / "runs", folder / "stderr.txt"
        home = {"HOME": str(folder), "XDG_CONFIG_HOME": str(folder), "TRIAL": str(folder)}
        rig = {
            "name": "real time",
            "devices": {
                "lamp": {"driver": "numato", "address": address, "relay": RELAY},
                "camera": {"driver": "gphoto2_camera", "address": camera},
            },
        }
        (folder / "rig.yaml").write_text(yaml_text(rig))
        (folder / "protocol.yaml").write_text(yaml_text(protocol))
        begin = [sys.executable, "-m", "labrig"]
        environment = os.environ | home
        consent = [*begin, "rig", "use", "./rig.yaml"]
        subprocess.run(consent, cwd=folder, env=environment, capture_output=True, check=True)
        self._begin, self._folder, self._environment = begin, folder, environment
        self.process = self._started("run", "./protocol.yaml", "--rig", "./rig.yaml")

    def resume(self) -> int:
        """Go on with the run; return the exit code."""
        self.process = self._started("resume", str(self.run))
        return self.process.wait(PATIENCE_S)

    def _started(self, *arguments: str) -> "subprocess.Popen[bytes]":
        with self._err.open("wb") as err:
            return subprocess.Popen(
                [*self._begin, *arguments, "--yes", "--no-process"],
                cwd=self._folder,
                env=self._environment,
                stdout=subprocess.DEVNULL,
                stderr=err,
            )

    @property
    def said(self) -> str:
        return self._err.read_text(encoding="utf-8")

    @property
    def run(self) -> Path | None:
        """The run folder, once there is one."""
        found = [path.parent for path in self.runs.glob("*/journal.jsonl")]
        return found[0] if found else None

    def reading(self) -> tuple[float, int, int, float]:
        """Return memory in MB, open files, threads, and the journal's size in MB."""
        of = Path(f"/proc/{self.process.pid}")
        pages = int((of / "statm").read_text().split()[1])
        size = 0 if self.run is None else (self.run / "journal.jsonl").stat().st_size
        files, threads = (len(list((of / name).iterdir())) for name in ("fd", "task"))
        return pages * PAGE_MB, files, threads, size / 1e6


@contextmanager
def bench() -> Iterator[tuple[WatchedBoard, str, str]]:
    """Serve a simulated room in real time: a lamp's board, the addresses of board and camera."""
    settings = read_yaml(resources.find("config", "rig", "sim"))["simulation"]
    settings |= {"sensor": {"width": 96, "height": 64}, "initial": {"lamp": "off"}}
    room_clock = VirtualClock(EPOCH_S)
    room = Room(Simulation.model_validate(settings), room_clock, lambda channel: ())
    board = LampBoard(room, Pace(SystemClock(), room_clock))
    with served(room, room_clock) as server, on_a_terminal(board) as address:  # type: ignore[arg-type]
        yield board, address, server.address


def growth(folder: Path, minutes: float) -> bool:
    """Print readings; return whether something grew."""
    protocol = {
        "protocol": "decay", "sample": {"name": "test"}, "charge": "30 s",
        "for": f"{minutes} min", "every": "3 s", "exposure": "1/4 s",
    }  # fmt: skip
    readings = []
    print("   min  frames  memory/MB  files  threads  journal/MB")
    with bench() as (_, address, camera):
        labrig = Labrig(folder, address, camera, protocol)
        began_s = time.monotonic()
        for number in range(1, SHARES + 1):
            while (
                time.monotonic() - began_s < number * (60 * minutes) / SHARES
                and labrig.process.poll() is None
            ):
                time.sleep(0.5)
            if labrig.process.poll() is not None:
                break
            memory_mb, files, threads, journal_mb = labrig.reading()
            readings.append((memory_mb, files, threads, journal_mb))
            assert labrig.run is not None
            frames = len(list((labrig.run / "frames").iterdir()))
            passed_min = (time.monotonic() - began_s) / 60
            print(
                f"{passed_min:6.1f}{frames:8}{memory_mb:11.1f}{files:7}{threads:9}{journal_mb:13.2f}",
                flush=True,
            )
        code = labrig.process.wait(PATIENCE_S + 60)
    if not readings:
        print(f"exit code {code}: {labrig.said[-300:]}")
        return True
    first, last = readings[0], readings[-1]
    allowed_mb = PER_JOURNAL_BYTE * (last[3] - first[3]) + SLACK_MB
    wrong = {
        f"exit code {code}: {labrig.said[-300:]}": code != 0,
        "only some readings": len(readings) < SHARES,
        "files stay open": last[1] > first[1],
        "threads stay": last[2] > first[2],
        f"memory grows by more than {allowed_mb:.1f} MB": last[0] - first[0] > allowed_mb,
    }
    grew = [what for what, is_so in wrong.items() if is_so]
    print("; ".join(grew) or "nothing grows but what the journal holds")
    return bool(grew)


def stopped(folder: Path, rng: random.Random, seconds: float, *, in_charge: bool) -> str:
    """Return what went wrong when labrig was stopped for so long."""
    protocol = {
        "protocol": "decay", "sample": {"name": "test"}, "charge": "20 s",
        "for": "20 s", "every": "3 s", "exposure": "1/4 s",
    }  # fmt: skip
    with bench() as (board, address, camera):
        labrig = Labrig(folder, address, camera, protocol)
        while not any(on for _, on in board.switched) or (not in_charge and board.lamp_on):
            time.sleep(0.01)
            if labrig.process.poll() is not None:
                return f"ended with {labrig.process.returncode}: {labrig.said[-300:]}"
        time.sleep(rng.uniform(1.0, 15.0))
        labrig.process.send_signal(signal.SIGSTOP)
        asleep_s, was_lit = time.monotonic(), board.lamp_on
        time.sleep(seconds)
        off_s = [at - asleep_s for at, on in board.switched if not on and at > asleep_s]
        lit_while_stopped = board.lamp_on
        labrig.process.send_signal(signal.SIGCONT)
        try:
            code = labrig.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            labrig.process.kill()
            return f"hangs: {labrig.said[-300:]}"
        wait_for_guards(folder)
        resumed, said = (labrig.resume(), labrig.said) if code else (0, "")
        wait_for_guards(folder)
    if labrig.run is None:
        return f"nothing was recorded, exit code {code}: {labrig.said[-300:]}"
    record = read_run(labrig.run)
    frames = [frame for attempt in record.attempts for frame in attempt.frames]
    lit = f"off after {off_s[0]:.1f} s" if was_lit and off_s else "was off"
    redone = sum(not attempt.completed for attempt in record.attempts)
    units = len(record.completed())
    print(
        f"{'charge' if in_charge else 'decay':8}{seconds:6.0f} s  lamp {lit:18}exit code {code}, "
        f"{redone} of {units} units done again, {len(frames)} frames",
        flush=True,
    )
    wrong = {
        "the lamp burned while labrig was stopped": lit_while_stopped,
        f"the lamp was off only after {off_s}": was_lit and (not off_s or off_s[0] > GUARDED_S),
        "the lamp is on": board.lamp_on,
        f"exit code {code}": code != (-signal.SIGKILL if was_lit else 0),
        f"resume: exit code {resumed}, {said[-300:]}": resumed != 0,
        "a fault": "Traceback" in labrig.said or "fault in labrig" in labrig.said,
        "a frame is not as recorded": any(
            sha256(frame.path.read_bytes()).hexdigest() != frame.sha256 for frame in frames
        ),
        "a charge that was interrupted counts": was_lit and not redone,
    }
    return "; ".join(what for what, is_so in wrong.items() if is_so)


def main() -> None:
    """Print readings or trials, and what went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("growth", "stopped"))
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--trials", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if asked.what == "growth":
            sys.exit(growth(Path(name), asked.minutes))
        rng, wrong = random.Random(asked.seed), []
        for number in range(asked.trials):
            folder = Path(name) / str(number)
            folder.mkdir()
            if said := stopped(folder, rng, asked.seconds, in_charge=number % 2 == 0):
                wrong.append(f"trial {number}: {said}")
    print(f"{len(wrong)} of {asked.trials} went wrong", *wrong, sep="\n")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
