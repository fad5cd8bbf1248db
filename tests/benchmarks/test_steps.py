"""What planning and running cost for each step, besides what the devices take."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import BinaryIO, TypeVar

import pytest

from labrig.acquire import (
    LAMP_OFF,
    LAMP_ON,
    Rig,
    Session,
    TimedAction,
    at,
    plan,
    read_rig_file,
    run_units,
)
from labrig.acquire.values import Frame
from labrig.foundation import resources
from labrig.foundation.clock import VirtualClock
from labrig.optics import SpectrometerReading
from labrig.protocols.decay.protocol import Decay
from labrig.record import ActionRecord, FrameRecord, RunFolder, SpectrumRecord
from tests.acquire.fakes import Watching

Against = Callable[..., None]
T = TypeVar("T")

STEPS = 2000


def test_planned_steps(against: Against) -> None:
    path = resources.folder("config") / "sim.yaml"
    rig = read_rig_file(path)
    protocol = Decay.model_validate(
        {
            "protocol": "decay",
            "sample": {"name": "long"},
            "every": "5 s",
            "for": f"{5 * STEPS} s",
            "exposure": "1 s",
        }
    )
    steps = len(plan(protocol, rig, str(path)).steps)
    frames = protocol.frame_times_s()

    def bare() -> list[tuple[float, str]]:
        clock, out = VirtualClock(), []
        for time_s in frames:
            clock.sleep_until(time_s)
            out.append((clock.now(), str(protocol.settings(1.0))))
        return out

    against(
        lambda: plan(protocol, rig, str(path)),
        {"the bare loop: wait, note the time": bare},
        rounds=15,
        what="planned step",
        each=steps,
    )


class NothingLamp:
    """Does nothing, in no time."""

    def identity(self) -> str:
        return "nothing"

    def on(self) -> None:
        pass

    def off(self) -> None:
        pass

    def reads_back(self) -> bool:
        return False

    def is_on(self) -> bool:
        return False

    def make_safe(self) -> None:
        pass

    def disconnect(self) -> None:
        pass


class NothingRecorded:
    """A recorder that keeps nothing."""

    def acted(
        self, device: str, action: str, start_s: float, end_s: float, late_s: float, task: str = ""
    ) -> None:
        pass

    def photographed(self, role: str, frame: Frame, late_s: float) -> None:
        pass

    def spectrum(
        self, role: str, reading: SpectrometerReading, start_s: float, end_s: float, late_s: float
    ) -> None:
        pass

    def temperature(self, celsius: float, at_s: float) -> None:
        pass

    def last_manual_step(self) -> None:
        return None

    def frames(self, role: str) -> Sequence[FrameRecord]:
        return ()

    def frame_times(self, role: str) -> Sequence[tuple[str, float]]:
        return ()

    def spectra(self, role: str) -> Sequence[SpectrumRecord]:
        return ()

    def actions(self, device: str) -> Sequence[ActionRecord]:
        return ()

    def all_actions(self, device: str) -> Sequence[ActionRecord]:
        return ()

    def decide(self, name: str, on_bench: Callable[[], T], when_planned: T) -> T:
        return when_planned

    def seed(self) -> int:
        return 0


class NoDisk:
    """Forgets what it is given."""

    def write(self, file: BinaryIO, data: bytes) -> None:
        pass


SEQUENCE = [at(0.01 * n, LAMP_ON if n % 2 else LAMP_OFF) for n in range(STEPS)]


def bare_loop(lamp: NothingLamp, sequence: Sequence[TimedAction]) -> None:
    clock = VirtualClock()
    for timed in sequence:
        clock.sleep_until(timed.at_s)
        if timed.action is LAMP_ON:
            lamp.on()
        else:
            lamp.off()


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[RunFolder]:
    texts = {"protocol.yaml": "", "rig.yaml": ""}
    with RunFolder.create(tmp_path, "steps", 0.0, texts, None, NoDisk()) as made:
        yield made


def test_steps_of_a_session(against: Against) -> None:
    lamp = NothingLamp()

    def run() -> None:
        rig = Rig("nothing", VirtualClock(), {"lamp": lamp}, {})
        Session(rig, NothingRecorded(), Watching()).run_sequence(SEQUENCE)

    against(
        run,
        {"the bare loop: wait, act": lambda: bare_loop(lamp, SEQUENCE)},
        rounds=30,
        what="step of a session, nothing recorded",
        each=STEPS,
    )


@dataclass(frozen=True)
class OneSequence:
    """A unit of nothing else."""

    name: str

    def run(self, session: Session) -> None:
        session.run_sequence(SEQUENCE)


def test_steps_of_a_run(folder: RunFolder, against: Against) -> None:
    """Recorded as event-model documents; what the disk takes is measured elsewhere."""
    lamp, numbers = NothingLamp(), count()

    def run() -> None:
        rig = Rig("nothing", VirtualClock(1.7e9), {"lamp": lamp}, {})
        run_units([OneSequence(f"unit {next(numbers)}")], rig, folder, Watching(), {})

    against(
        run,
        {"the bare loop: wait, act": lambda: bare_loop(lamp, SEQUENCE)},
        rounds=10,
        what="step of a run, recorded, disk left out",
        each=STEPS,
    )
