"""Run folders of tests."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from labrig.acquire import PlanClock, RunObserver, plan, read_protocol, read_rig_file
from labrig.bench import Bench, open_bench
from labrig.bench.execution import execute
from labrig.foundation.clock import Clock, Interrupted
from labrig.foundation.errors import DeviceError
from labrig.record import RunFolder
from tests.acquire.fakes import Watching


@contextmanager
def quietly(plan_clock: PlanClock, clock: Clock) -> Iterator[RunObserver]:
    yield Watching()


def lamp_after(folder: Path, rig: Path, stop: Callable[[], None]) -> bool:
    """Begin or go on with the run in `folder`, stopped by `stop`; is the lamp on in the end?"""
    protocol, rig_file = read_protocol(folder / "protocol.yaml"), read_rig_file(rig)
    with open_bench(rig_file, str(rig)) as stand, RunFolder(folder, stand.seed) as run:
        stop()
        try:
            execute(run, protocol, stand, plan(protocol, rig_file, str(rig)), quietly)
        except (Interrupted, DeviceError) as error:
            assert "\n" not in str(error)
            assert f"labrig resume {folder}" in str(error) or "nothing was" in str(error)
        return lamp_is_on(stand)


def lamp_is_on(stand: Bench) -> bool:
    """The lamp as the room has it, whatever relay and driver say."""
    assert stand.room is not None
    return stand.room.room.lamp_on


def make_folder(protocol: Path, tmp_path: Path) -> Path:
    texts = {"protocol.yaml": protocol.read_text(encoding="utf-8"), "rig.yaml": ""}
    with RunFolder.create(tmp_path / "runs", "test", 1_767_225_600.0, texts, seed=1) as folder:
        return folder.path
