"""What happens on the bench when something fails: exit code, line, what is kept, the lamp."""

import errno
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from hashlib import sha256
from itertools import pairwise
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
import serial

from labrig.acquire import LAMP, read_rig_file
from labrig.acquire.rig import device_errors
from labrig.bench import Bench, open_bench
from labrig.cli.progress import PlainProgress
from labrig.foundation.clock import SystemClock
from labrig.foundation.yaml_file import read_yaml
from labrig.record import PC_CLOCK, RunRecord, read_run
from labrig.record.history import interruptions
from labrig.record.journal import read_journal
from labrig.sim.boards import SerialCable
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

Make = Callable[..., Path]
Labrig = Callable[..., Ended]

CAMPAIGN = pytest.mark.campaign


@pytest.fixture
def protocol(make_protocol: Make) -> Path:
    return make_protocol(charge="30 s", exposure="1/4 s", **{"for": "20 s"})


@pytest.fixture
def metered(make_protocol: Make) -> Path:
    return make_protocol("metered.yaml", charge="60 s", exposure="auto", daylight=True,
                         **{"for": "20 s"})  # fmt: skip


@pytest.fixture
def rig(make_rig: Make) -> Callable[..., Path]:
    """A bench that is warm in a moment, with these faults."""

    def write(*faults: Any, **simulation: Any) -> Path:
        path = make_rig(faults=list(faults), **simulation)
        content = read_quickly(path.read_text())
        content["devices"]["lamp"]["warm_up"] = "5 s"
        content["devices"]["camera"]["warm_up"] = "5 s"
        path.write_text(write_quickly(content))
        return path

    return write


@pytest.fixture
def stands(monkeypatch: pytest.MonkeyPatch) -> list[Bench]:
    """All benches that were opened: their rooms know whether the lamp burns."""
    opened: list[Bench] = []

    @contextmanager
    def remembered(*arguments: Any, **keys: Any) -> Iterator[Bench]:
        with open_bench(*arguments, **keys) as stand:
            opened.append(stand)
            yield stand

    monkeypatch.setattr("labrig.bench.recording.open_bench", remembered)
    return opened


def lamp_is_on(stand: Bench) -> bool:
    assert stand.room is not None
    return stand.room.room.lamp_on


def complaint(ended: Ended) -> str:
    """The one line, or nothing."""
    lines = [line for line in ended.err.splitlines() if not line.startswith("[")]
    assert len(lines) == (ended.code != 0), ended.err
    return "".join(lines)


def recorded(runs: Path) -> RunRecord:
    """The one run, all of whose acknowledged frames are there and what they were."""
    (folder,) = runs.iterdir()
    record = read_run(folder)
    for attempt in record.attempts:
        for frame in attempt.frames:
            assert sha256(frame.path.read_bytes()).hexdigest() == frame.sha256
    return record


def without_faults(run: Path) -> None:
    """Somebody mends what is broken."""
    content = read_yaml(run / "rig.yaml")
    content["simulation"] |= {"faults": [], "initial": {"lamp": "off"}}
    (run / "rig.yaml").write_text(write_quickly(content))


@pytest.fixture(scope="module")
def undisturbed() -> dict[str, RunRecord]:
    """Runs of protocols on a bench without faults, by the protocol's text."""
    return {}


@pytest.fixture
def moment(
    labrig: Labrig, rig: Make, tmp_path: Path, undisturbed: dict[str, RunRecord]
) -> Callable[..., float]:
    """When a lamp is switched in an undisturbed run of a protocol, seconds after the epoch."""

    def find(protocol: Path, unit: str, action: str) -> float:
        text = protocol.read_text(encoding="utf-8")
        if text not in undisturbed:
            runs = tmp_path / "undisturbed"
            assert labrig("run", protocol, "--rig", rig(), "--runs", runs, "--no-process").code == 0
            undisturbed[text] = recorded(runs)
        actions = undisturbed[text].completed()[unit].actions
        epoch = datetime(2026, 1, 1, tzinfo=UTC).timestamp()
        return next(each.start_time - epoch for each in actions if each.action == action)

    return find


@pytest.mark.parametrize(
    ("fault", "code", "said", "kept"),
    [
        ("lamp_dead", 3, "the lamp did not light", ["dark"]),
        ("relay_dead", 3, "the contact of its relay", ["dark"]),
        ("light_left_on", 3, "a light is on in the room, or the lamp is on", []),
        ("camera_busy", 3, "DeviceBusy", []),
        ("camera_full", 3, "StoreFull", []),
        ({"relays_unplugged": {"at": "30 s"}}, 3, "switch off by hand", ["dark"]),
        pytest.param(
            {"relays_silent": {"at": "30 s"}}, 3, "switch off by hand", ["dark"], marks=CAMPAIGN
        ),
        ({"relays_echo_lost": {"at": "30 s"}}, 3, "did not echo", ["dark"]),
        ({"camera_unplugged": {"at": "30 s"}}, 3, "gone", ["dark"]),
        ({"disk_full": {"at": "30 s"}}, 5, "No space left on device", ["dark"]),
    ],
    ids=str,
)
def test_a_fault_that_stays_ends_the_run_which_goes_on_when_it_is_mended(
    labrig: Labrig,
    rig: Make,
    protocol: Path,
    stands: list[Bench],
    tmp_path: Path,
    fault: Any,
    code: int,
    said: str,
    kept: list[str],
) -> None:
    runs = tmp_path / "runs"
    ended = labrig("run", protocol, "--rig", rig(fault), "--runs", runs, "--no-process")
    assert ended.code == code, ended.err
    line = complaint(ended)
    assert said in line
    before = recorded(runs)
    assert f"labrig resume {before.folder}" in line
    assert list(before.completed()) == kept
    # A full disk has no room for the line that closes the attempt either: that is done at resume.
    assert before.attempts[-1].exit_status == (None if code == 5 else "fail")
    out_of_reach = "switch off by hand" in line and fault != {"relays_echo_lost": {"at": "30 s"}}
    assert lamp_is_on(stands[-1]) == (out_of_reach and "lamp:" in line)
    without_faults(before.folder)
    again = labrig("resume", before.folder, "--no-process", "--edited")
    assert again.code == 0, again.err
    after = recorded(runs)
    assert list(after.completed()) == ["dark", "decay-1"]
    for name in kept:
        assert after.completed()[name].uid == before.completed()[name].uid
    assert not lamp_is_on(stands[-1])


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        pytest.param(
            {"relays_silent": {"at": "30 s", "for": "60 s"}},
            "decay-1 is done again",
            marks=CAMPAIGN,
        ),
        pytest.param(
            {"relays_echo_lost": {"at": "30 s", "for": "30 s"}},
            "decay-1 is done again",
            marks=CAMPAIGN,
        ),
        ({"relays_unplugged": {"at": "30 s", "for": "60 s"}}, "the unit decay-1 is done again"),
        ({"camera_unplugged": {"after_bytes": 90_000, "for": "5 s"}}, "is done again"),
        ({"camera_busy": {"at": "42 s", "for": "2.5 s"}}, "1 of 4 frames began late"),
        ({"disk_slow": {"takes": "3 s"}}, "the disk cannot keep up, it took up to 3 s for a frame"),
        ({"lamp_dead": {"at": "1 s", "for": "5 s"}}, ""),
        ({"clock_back": {"at": "30 s"}}, "was set back by 1 h: times of day in this run go on"),
        ({"clock_ahead": {"at": "30 s", "by": "90 s"}}, "was set ahead by 1 min 30 s"),
        ({"pc_asleep": {"at": "2 s"}}, "slept for 1 h (switch its energy saving off)"),
        ({"pc_asleep": {"at": "30 s", "for": "5 s"}}, "the unit decay-1 is done again"),
        ({"pc_asleep": {"at": "30 s", "for": "100 ms"}}, ""),
    ],
    ids=str,
)
def test_a_fault_that_passes_costs_time_and_no_data(
    labrig: Labrig,
    rig: Make,
    protocol: Path,
    stands: list[Bench],
    tmp_path: Path,
    fault: Any,
    said: str,
) -> None:
    ended = labrig("run", protocol, "--rig", rig(fault), "--runs", tmp_path / "runs",
                   "--no-process")  # fmt: skip
    assert ended.code == 0, ended.err
    warned = [line for line in ended.err.splitlines() if "warning" in line]
    assert any(said in line for line in warned) if said else not warned
    record = recorded(tmp_path / "runs")
    assert list(record.completed()) == ["dark", "decay-1"]
    assert len(record.frames("decay")) == 4
    times = [doc["time"] for _, doc in read_journal(record.folder / "journal.jsonl").documents]
    assert times == sorted(times)
    assert not lamp_is_on(stands[-1])


@pytest.mark.parametrize("error", [MemoryError("74 GB"), OSError(errno.ENOMEM, "no memory")])
def test_lack_of_memory_with_the_lamp_on_ends_the_run_with_one_line(
    labrig: Labrig,
    rig: Make,
    protocol: Path,
    stands: list[Bench],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    error: Exception,
) -> None:
    doing = PlainProgress.doing

    def short_of_memory(self: PlainProgress, what: str, until_s: float | None = None) -> None:
        if "charging" in what:
            assert lamp_is_on(stands[-1])
            raise error
        doing(self, what, until_s)

    with monkeypatch.context() as while_charging:
        while_charging.setattr(PlainProgress, "doing", short_of_memory)
        runs = tmp_path / "runs"
        ended = labrig("run", protocol, "--rig", rig(), "--runs", runs, "--no-process")
    assert ended.code == 5, ended.err
    assert "too little memory" in complaint(ended)
    assert not lamp_is_on(stands[-1])
    assert [attempt.exit_status for attempt in recorded(runs).attempts] == ["success", "fail"]
    assert labrig("resume", recorded(runs).folder, "--no-process", "--edited").code == 0


def test_a_thread_that_cannot_be_started_is_lack_of_memory(
    labrig: Labrig, monkeypatch: pytest.MonkeyPatch
) -> None:
    def start(thread: Thread) -> None:
        raise RuntimeError("can't start new thread")  # as Python says it

    monkeypatch.setattr(Thread, "start", start)
    ended = labrig("rig", "view", "sim", "--no-browser", "--port", "0")
    assert ended.code == 5
    assert "too little memory left (can't start new thread)" in complaint(ended)


def test_a_driver_that_lacks_memory_is_not_blamed() -> None:
    with pytest.raises(MemoryError), device_errors("camera"):
        raise MemoryError


def test_a_step_of_the_clock_stands_in_the_result(
    labrig: Labrig, rig: Make, protocol: Path, tmp_path: Path
) -> None:
    ahead = {"clock_ahead": {"at": "30 s", "by": "2 h"}}
    ended = labrig("run", protocol, "--rig", rig(ahead), "--runs", tmp_path / "runs")
    assert ended.code == 0, ended.err
    record = recorded(tmp_path / "runs")
    (step,) = [one for one in record.attempts[-1].actions if one.device == PC_CLOCK]
    assert step.action == "set ahead by 2 h"
    summary = (record.folder / "result" / "summary.txt").read_text(encoding="utf-8")
    assert "set ahead by 2 h in decay-1" in summary


def test_a_sleep_is_in_the_record_from_which_the_report_tells_it(
    labrig: Labrig, rig: Make, protocol: Path, tmp_path: Path
) -> None:
    bench = rig({"pc_asleep": {"at": "30 s", "for": "2 h"}})
    runs = tmp_path / "runs"
    assert labrig("run", protocol, "--rig", bench, "--runs", runs, "--no-process").code == 0
    _, slept, again = recorded(runs).attempts
    assert (slept.unit, slept.exit_status) == ("decay-1", "fail")
    assert "slept for 2 h" in slept.reason
    assert again.start["time"] > slept.start["time"] + 7200.0, "the room went on meanwhile"
    assert "slept for 2 h" in interruptions(recorded(runs))[0].reason


def test_a_lamp_that_another_program_switches_off_ends_the_run(
    labrig: Labrig,
    rig: Make,
    make_protocol: Make,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    doing, meddled = PlainProgress.doing, list[str]()

    def meddle(self: PlainProgress, what: str, until_s: float | None = None) -> None:
        doing(self, what, until_s)
        if "charging" in what and not meddled:
            meddled.append(what)
            with serial.serial_for_url("sim://room/relays") as port:
                port.write(b"\rrelay off 0\r")

    monkeypatch.setattr(PlainProgress, "doing", meddle)
    protocol = make_protocol(charge="10 min", exposure="1/4 s", **{"for": "20 s"})
    runs = tmp_path / "runs"
    ended = labrig("run", protocol, "--rig", rig(), "--runs", runs, "--no-process")
    assert ended.code == 3, ended.err
    assert "was switched on 1 min ago and reads off" in complaint(ended)
    record = recorded(runs)
    assert list(record.completed()) == ["dark"]
    assert labrig("resume", record.folder, "--no-process", "--edited").code == 0
    assert list(recorded(runs).completed()) == ["dark", "decay-1"]


def test_late_frames_are_in_the_record(
    labrig: Labrig, rig: Make, protocol: Path, tmp_path: Path
) -> None:
    runs = tmp_path / "runs"
    slow = {"disk_slow": {"takes": "3 s"}}
    assert labrig("run", protocol, "--rig", rig(slow), "--runs", runs, "--no-process").code == 0
    frames = recorded(runs).frames("decay")
    assert all(frame.disk_s == pytest.approx(3.0, abs=1e-3) for frame in frames)
    gaps_s = [b.start_time - a.start_time for a, b in pairwise(frames)]
    assert min(gaps_s) > 6.0, "frame and line each took 3 s; frames were planned every 5 s"
    late_s = [frame.late_s for frame in frames]
    assert late_s == sorted(late_s)
    assert late_s[0] > 2.0


def test_a_bulb_that_blows_while_charging_is_seen_in_the_first_frame(
    labrig: Labrig, rig: Make, metered: Path, moment: Callable[..., float], tmp_path: Path
) -> None:
    off_s = moment(metered, "decay-1", "off")
    blown = {"lamp_dead": {"at": f"{off_s - 40} s"}}
    ended = labrig("run", metered, "--rig", rig(blown), "--runs", tmp_path / "runs", "--no-process")
    assert "warning: the glow is less than half as bright as before" in ended.err
    # Nor is there a daylight picture.
    assert ended.code == 3, ended.err
    assert "it did not light at all" in ended.err


@pytest.mark.parametrize(
    "unit",
    [pytest.param("meter", marks=CAMPAIGN), "decay-1", pytest.param("daylight", marks=CAMPAIGN)],
)
def test_a_welded_relay_is_seen_by_the_camera(
    labrig: Labrig,
    rig: Make,
    metered: Path,
    moment: Callable[..., float],
    stands: list[Bench],
    tmp_path: Path,
    unit: str,
) -> None:
    """The register reads off, and the driver believes it."""
    welded = {"relay_welded": {"at": f"{moment(metered, unit, 'on') + 1} s"}}
    runs = tmp_path / "runs"
    ended = labrig("run", metered, "--rig", rig(welded), "--runs", runs, "--no-process")
    assert ended.code == 3
    assert "pull its plug" in complaint(ended)
    assert unit not in recorded(runs).completed()
    assert lamp_is_on(stands[-1])
    (run,) = runs.iterdir()
    without_faults(run)
    assert labrig("resume", run, "--no-process", "--edited").code == 0
    assert not lamp_is_on(stands[-1])


def test_a_lamp_that_burns_before_the_run_is_seen_before_it_charges(
    labrig: Labrig, rig: Make, protocol: Path, stands: list[Bench], tmp_path: Path
) -> None:
    bench = rig("relay_welded", initial={"lamp": "on"})
    ended = labrig("run", protocol, "--rig", bench, "--runs", tmp_path / "runs", "--no-process")
    assert ended.code == 3
    assert "the lamp is on although its relay reads off" in complaint(ended)
    (attempt,) = recorded(tmp_path / "runs").attempts
    assert attempt.unit == "dark"


@pytest.mark.parametrize(
    ("concentration", "code", "said"), [(0.5, 4, "still glows too brightly"), (0.02, 0, "glows")]
)
def test_a_glow_from_earlier_is_not_taken_for_a_lamp(
    labrig: Labrig,
    rig: Make,
    protocol: Path,
    tmp_path: Path,
    concentration: float,
    code: int,
    said: str,
) -> None:
    bench = rig(initial={"lamp": "off", "concentration": concentration}, sample="stickers")
    ended = labrig("run", protocol, "--rig", bench, "--runs", tmp_path / "runs", "--no-process")
    assert ended.code == code, ended.err
    assert said in ended.err
    assert "lamp is on" not in ended.err


def test_a_light_switched_on_during_the_decay_is_seen(
    labrig: Labrig, rig: Make, protocol: Path, moment: Callable[..., float], tmp_path: Path
) -> None:
    light = {"light_left_on": {"at": f"{moment(protocol, 'decay-1', 'off') + 8} s"}}
    ended = labrig("run", protocol, "--rig", rig(light), "--runs", tmp_path / "runs",
                   "--no-process")  # fmt: skip
    assert ended.code == 3
    assert "another light is on" in complaint(ended)


def test_times_of_faults_are_the_walls_so_that_what_is_over_stays_over(
    labrig: Labrig, rig: Make, protocol: Path, tmp_path: Path
) -> None:
    runs = tmp_path / "runs"
    bench = rig({"camera_busy": {"at": "43 s", "for": "10 s"}})
    assert labrig("run", protocol, "--rig", bench, "--runs", runs, "--no-process").code == 3
    (run,) = runs.iterdir()
    assert "DeviceBusy" in read_run(run).attempts[-1].reason
    assert labrig("resume", run, "--no-process", "--edited").code == 0


@pytest.mark.parametrize(
    ("step", "warned"), [("clock_back", True), pytest.param("clock_ahead", False, marks=CAMPAIGN)]
)
def test_a_clock_that_was_stepped_between_run_and_resume_harms_nothing(
    labrig: Labrig, rig: Make, protocol: Path, tmp_path: Path, step: str, warned: bool
) -> None:
    runs = tmp_path / "runs"
    bench = rig({"camera_busy": {"at": "43 s", "for": "10 s"}}, {step: {"at": "20 s", "by": "1 h"}})
    assert labrig("run", protocol, "--rig", bench, "--runs", runs, "--no-process").code == 3
    before = recorded(runs)
    ended = labrig("resume", before.folder, "--no-process", "--edited")
    assert ended.code == 0, ended.err
    assert ("was set back" in ended.err) is warned
    attempt = recorded(runs).completed()["decay-1"]
    stepped_s = attempt.start["time"] - before.last_time
    assert stepped_s == pytest.approx(-3600 if warned else 3600, abs=60)
    off = next(action for action in attempt.actions if action.action == "off")
    times_s = [frame.start_time - off.start_time for frame in attempt.frames]
    assert [times_s[0], times_s[-1]] == pytest.approx([0.56, 15.56], abs=0.02)


def test_a_board_that_is_silent_for_a_moment_is_asked_again(rig: Make) -> None:
    bench = rig({"relays_silent": {"at": "10 s", "for": "4 s"}})
    with open_bench(read_rig_file(bench), str(bench)) as stand, stand.devices() as devices:
        devices[LAMP].on()
        stand.clock.sleep_until(10.5)
        devices.make_safe()
        assert not lamp_is_on(stand)


def test_stray_bytes_cost_a_unit_and_not_the_run(
    labrig: Labrig, rig: Make, protocol: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    carry = SerialCable.carry
    strays = [b"!", b">"]

    def disturbed(self: SerialCable, data: bytes) -> bytes:
        answer = carry(self, data)
        return strays.pop() + answer if data.startswith(b"relay on") and strays else answer

    monkeypatch.setattr(SerialCable, "carry", disturbed)
    ended = labrig("run", protocol, "--rig", rig(), "--runs", tmp_path / "runs", "--no-process")
    assert ended.code == 0, ended.err
    record = recorded(tmp_path / "runs")
    assert list(record.completed()) == ["dark", "decay-1"]
    assert [attempt.exit_status for attempt in record.attempts].count("fail") == 2


def test_who_stops_waiting_for_a_lost_relay_is_reported_that_the_lamp_may_be_on(
    labrig: Labrig,
    rig: Make,
    protocol: Path,
    stands: list[Bench],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    warn = PlainProgress.warn

    def impatient(self: PlainProgress, text: str) -> None:
        warn(self, text)
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(PlainProgress, "warn", impatient)
    bench = rig({"relays_unplugged": {"at": "30 s"}})
    ended = labrig("run", protocol, "--rig", bench, "--runs", tmp_path / "runs", "--no-process")
    assert lamp_is_on(stands[-1])
    assert ended.code == 3
    assert "switch off by hand: lamp" in complaint(ended)


def test_a_clock_that_is_stepped_does_not_bend_a_running_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = SystemClock()
    before = clock.wall()
    monkeypatch.setattr("time.time", lambda: 0.0)
    assert 0.0 <= clock.wall() - before < 60.0
