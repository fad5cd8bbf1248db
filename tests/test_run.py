"""A protocol on a simulated bench, stopped at any point: safe, resumable, nothing counted twice."""

import math
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import event_model
import pytest

from labrig.acquire import LAMP, read_rig_file
from labrig.bench import Recording, open_bench, resume_run
from labrig.foundation.clock import VirtualClock
from labrig.record import read_run
from labrig.record.journal import read_journal
from tests.conftest import Ended
from tests.run_folders import lamp_after, lamp_is_on, make_folder, quietly

CAMPAIGN = pytest.mark.campaign
UNITS = ["dark", "decay-1", "decay-2"]


@pytest.fixture
def quick(make_protocol: Callable[..., Path]) -> Path:
    return make_protocol(repeats=2, charge="60 s", **{"for": "20 s"})


def outline(value: object) -> object:
    """Keys and types of a document."""
    if isinstance(value, dict):
        return tuple((key, outline(inner)) for key, inner in value.items())
    return type(value)


@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=CAMPAIGN) for n in range(1, 4))])
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("times", [1, 10])
def test_stopped_at_any_wait_the_lamp_is_off_and_the_rest_can_be_done(
    quick: Path,
    make_rig: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    seed: int,
    signum: int,
    times: int,
) -> None:
    rng = random.Random(f"{seed} {signum} {times}")
    folder = make_folder(quick, tmp_path)
    waits_left = rng.randint(1, 900)
    pause = VirtualClock._pause_until

    def stopping_pause(clock: VirtualClock, deadline_s: float) -> None:
        nonlocal waits_left
        waits_left -= 1
        if waits_left <= 0 and waits_left > -times:
            os.kill(os.getpid(), signum)
        pause(clock, deadline_s)

    def stop() -> None:
        monkeypatch.setattr(VirtualClock, "_pause_until", stopping_pause)

    assert not lamp_after(folder, make_rig(), stop)
    before = read_run(folder).completed()
    monkeypatch.setattr(VirtualClock, "_pause_until", pause)
    if list(before) != UNITS:  # a complete run has nothing to connect for
        assert not lamp_after(folder, make_rig(initial={"lamp": "on"}), lambda: None)
    record = read_run(folder)
    assert list(record.completed()) == UNITS
    assert len(record.frames("decay")) == 2 * 4
    for name, attempt in before.items():
        assert record.completed()[name].uid == attempt.uid
    # Of events a schema looks at keys and types only, and they are what takes time.
    unlike = {
        outline(doc) if name == "event" else doc["uid"]: (name, doc)
        for name, doc in read_journal(folder / "journal.jsonl").documents
    }
    for name, doc in unlike.values():
        event_model.schema_validators[event_model.DocumentNames[name]].validate(doc)


@pytest.mark.parametrize(
    "seed", [*range(3), *(pytest.param(n, marks=CAMPAIGN) for n in range(3, 8))]
)
def test_an_exception_anywhere_in_a_driver_ends_safely(
    quick: Path,
    make_rig: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    seed: int,
) -> None:
    folder = make_folder(quick, tmp_path)
    waits_left: float = random.Random(seed).randint(1, 700)
    pause = VirtualClock._pause_until

    def failing_pause(clock: VirtualClock, deadline_s: float) -> None:
        nonlocal waits_left
        waits_left -= 1
        if waits_left <= 0 and deadline_s - clock.now() < 0.5:  # only drivers wait so shortly
            waits_left = math.inf
            raise RuntimeError("a bug in a driver")
        pause(clock, deadline_s)

    def stop() -> None:
        monkeypatch.setattr(VirtualClock, "_pause_until", failing_pause)

    assert not lamp_after(folder, make_rig(), stop)
    assert not lamp_after(folder, make_rig(), lambda: None)
    assert list(read_run(folder).completed()) == UNITS


def test_the_lamp_that_a_crash_left_on_is_switched_off_at_connect(
    make_rig: Callable[..., Path],
) -> None:
    rig = make_rig(initial={"lamp": "on"})
    with open_bench(read_rig_file(rig), str(rig)) as stand:
        assert lamp_is_on(stand)
        with stand.devices() as devices:
            assert not lamp_is_on(stand)
            devices[LAMP].on()
            assert lamp_is_on(stand)
        assert not lamp_is_on(stand)


def test_the_same_rig_and_protocol_give_the_same_bytes(
    quick: Path, make_rig: Callable[..., Path], tmp_path: Path
) -> None:
    contents = []
    for name in ("a", "b"):
        folder = Recording.prepare(quick, make_rig(), tmp_path / name).record(quietly)
        (folder / "made.txt").unlink()  # by the PC's clock
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        contents.append({path.relative_to(folder): path.read_bytes() for path in files})
    assert contents[0] == contents[1]


def test_after_kill_9_the_run_is_resumed(
    quick: Path, make_rig: Callable[..., Path], tmp_path: Path
) -> None:
    """A real process, really killed, at a moment that nobody chose."""
    runs = tmp_path / "runs"
    process = subprocess.Popen(
        [sys.executable, "-m", "labrig", "run", quick, "--rig", make_rig(), "--runs", runs],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    frames_seen = 0
    for line in process.stderr:
        frames_seen += "frame " in line
        if frames_seen > 6:
            break
    time.sleep(0.01)
    process.kill()
    process.wait()
    process.stderr.close()
    (folder,) = runs.iterdir()
    before = read_run(folder).completed()
    resume_run(folder, quietly)
    record = read_run(folder)
    assert list(record.completed()) == UNITS
    assert len(record.frames("decay")) == 2 * 4
    for name, attempt in before.items():
        assert record.completed()[name].uid == attempt.uid


def test_ctrl_c_ends_it_with_its_code_and_one_line(
    labrig: Callable[..., Ended],
    make_protocol: Callable[..., Path],
    make_rig: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waits = 0
    pause = VirtualClock._pause_until

    def stopping_pause(clock: VirtualClock, deadline_s: float) -> None:
        nonlocal waits
        waits += 1
        if 100 <= waits < 110:
            os.kill(os.getpid(), signal.SIGINT)
        pause(clock, deadline_s)

    monkeypatch.setattr(VirtualClock, "_pause_until", stopping_pause)
    ended = labrig("run", make_protocol(), "--rig", make_rig(), "--runs", tmp_path / "runs")
    assert ended.code == 130
    assert_stopped_in_one_line(ended.err)


@pytest.mark.parametrize(
    ("signum", "code"),
    [pytest.param(signal.SIGINT, 130, marks=CAMPAIGN), (signal.SIGTERM, 143)],
)
def test_a_stopped_process_leaves_with_its_code_and_one_line(
    make_protocol: Callable[..., Path],
    make_rig: Callable[..., Path],
    tmp_path: Path,
    signum: int,
    code: int,
) -> None:
    protocol = make_protocol(repeats=20)
    process = subprocess.Popen(
        [sys.executable, "-m", "labrig", "run", protocol, "--rig", make_rig(),
         "--runs", tmp_path / "runs"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    assert process.stderr is not None
    for line in process.stderr:
        if "frame 3 " in line:
            break
    for _ in range(10):
        process.send_signal(signum)
    out, err = process.communicate(timeout=60)
    assert process.returncode == code
    assert_stopped_in_one_line(err)
    assert "Traceback" not in out


def assert_stopped_in_one_line(err: str) -> None:
    complaints = [line for line in err.splitlines() if not line.startswith("[")]
    assert len(complaints) == 1, err
    assert "safe state reached" in complaints[0]
    assert "labrig resume" in complaints[0]
