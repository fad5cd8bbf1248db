"""The paper's bench with trap door, lamp shield and a mute relay board: checked, planned, run."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import (
    DOOR_CLOSE,
    DOOR_OPEN,
    LAMP_OFF,
    LAMP_ON,
    SHIELD_COVER,
    SHIELD_UNCOVER,
    ExposureSettings,
    ProtocolModel,
    RigFile,
    Session,
    TakeFrame,
    Unit,
    at,
    plan,
    read_rig_file,
    run_units,
)
from labrig.bench import open_bench
from labrig.foundation.errors import DeviceError, ProtocolError, UsageError
from labrig.record import RunFolder, RunRecord
from labrig.sim.door import FRAME_S
from tests.acquire.fakes import Watching
from tests.conftest import Ended
from tests.frame_middle import middle_dn
from tests.quick_yaml import read_quickly, write_quickly

Make = Callable[..., Path]
SERVO = "sim://room/servo"
DEVICES = {
    "lamp": {"driver": "lcus", "address": "sim://room/lcus", "relay": 1},
    "shield": {
        "driver": "maestro", "address": SERVO, "channel": 1, "travel": "280 ms",
        "covering": "1000 us", "uncovering": "2000 us",
    },
    "door": {
        "driver": "maestro", "address": SERVO, "channel": 0, "travel": "280 ms",
        "closed": "1000 us", "open": "2000 us",
    },
}  # fmt: skip


@pytest.fixture
def rig(make_rig: Make) -> Make:
    """The shipped simulated rig with these devices; `devices` are changed, the room as told."""

    def write(devices: dict[str, Any] | None = None, **simulation: Any) -> Path:
        room = {"lamp": {"board": "lcus"}, "door": {}, "shield": {"channel": 1}}
        path = make_rig(**(room | simulation))
        content = read_quickly(path.read_text())
        changed = devices or {}
        content["devices"] |= {key: DEVICES[key] | changed.get(key, {}) for key in DEVICES}
        content["simulation"]["epoch"] = "2026-01-01T00:00:00Z"
        path.write_text(write_quickly(content))
        return path

    return write


class TimedShot:
    """Charge, then the paper's shot with a shield; three frames."""

    name = "shot"

    def run(self, session: Session) -> None:
        session.perform(LAMP_ON)
        session.wait(300.0, "charging")
        frame = TakeFrame("decay", ExposureSettings(1.0, 400, 4.0))
        session.run_sequence(
            [
                at(0.0, LAMP_OFF),
                at(0.02, SHIELD_COVER),
                at(0.32, DOOR_OPEN),
                at(0.6, frame),
                at(5.6, frame),
            ]
        )
        session.perform(DOOR_CLOSE)
        session.perform(frame)
        session.perform(SHIELD_UNCOVER)


class ShotProtocol(ProtocolModel):
    """One shot."""

    def units(self) -> Sequence[Unit]:
        return [TimedShot()]


def recorded(rig: Path, runs: Path, unit: Unit | None = None) -> tuple[RunRecord, Any]:
    """What was recorded of a shot, and the true door."""
    with (
        open_bench(read_rig_file(rig), str(rig)) as bench,
        bench.devices() as devices,
        RunFolder.create(runs, "shot", bench.clock.wall(), {}, seed=1) as folder,
    ):
        run_units([unit or TimedShot()], devices, folder, Watching(), {})
        assert bench.room is not None
        return folder.read(), bench.room.room.door


def test_a_check_exercises_all_and_says_what_only_the_camera_can_tell(
    labrig: Callable[..., Ended], rig: Make
) -> None:
    ended = labrig("rig", "check", rig(), "--json")
    assert (ended.code, ended.err) == (0, "")
    report = json.loads(ended.out)
    devices = {device["key"]: device for device in report["devices"]}
    (finding,) = devices["lamp"]["findings"]
    assert finding["severity"] == "warn"
    assert "never acknowledges" in finding["what"]
    assert "camera" in finding["remedy"]
    for key, ways in (("door", ("open", "close")), ("shield", ("cover", "uncover"))):
        measured = {one["what"]: one["value"] for one in devices[key]["measured"]}
        assert list(measured) == [
            *(f"{way}, read back" for way in ways),
            "travel, from the rig file",
        ]
        assert "280 ms" in measured["travel, from the rig file"]


def test_a_board_that_answers_is_fine(labrig: Callable[..., Ended], rig: Make) -> None:
    report = json.loads(labrig("rig", "check", rig(lcus="text"), "--json").out)
    (lamp,) = [device for device in report["devices"] if device["key"] == "lamp"]
    assert [finding["severity"] for finding in lamp["findings"]] == ["fine"]
    assert "8 relays" in lamp["identity"]


def test_a_check_leaves_what_a_crash_left_behind_safe(
    labrig: Callable[..., Ended], rig: Make
) -> None:
    path = rig(initial={"lamp": "on", "door": "open"}, servo={"time_out": "10 min"})
    assert labrig("rig", "check", path).code == 0
    with open_bench(read_rig_file(path), str(path)) as bench:
        assert bench.room is not None
        with bench.devices():
            assert not bench.room.room.lamp_on
            door = bench.room.room.door
            assert door is not None
            assert door.angle(bench.clock.now()) == 0.0


def test_a_shot_is_planned_and_one_that_cannot_be_is_not(rig: Make) -> None:
    path = rig()
    laid_out = plan(ShotProtocol(protocol="shot"), read_rig_file(path), str(path))
    steps = [(step.device, step.action) for step in laid_out.steps if step.device != "-"]
    assert steps[1:4] == [("lamp", "off"), ("shield", "cover"), ("door", "open")]
    times = {step.device: step.at_s for step in laid_out.steps[2:6]}
    assert times["door"] - times["lamp"] == pytest.approx(0.32)
    without = read_rig_file(path).model_dump(exclude_none=True)
    del without["devices"]["door"]
    with pytest.raises(ProtocolError, match="needs a door, the rig 'simulated dark room' has none"):
        plan(ShotProtocol(protocol="shot"), RigFile.model_validate(without), str(path))


def test_the_journal_has_the_times_at_which_the_true_door_moved(rig: Make, tmp_path: Path) -> None:
    record, door = recorded(rig(), tmp_path / "runs")
    attempt = record.completed()["shot"]
    epoch_s = 1_767_225_600.0
    asked = [
        (action.start_time - epoch_s, action.end_time - epoch_s)
        for action in attempt.actions
        if action.device == "door"
    ]
    started = [swing.start_s for swing in door.swings[1:]]
    assert len(started) == 2
    for (begin_s, end_s), start_s in zip(asked, started, strict=True):
        assert begin_s <= start_s <= end_s + FRAME_S
    assert all(action.late_s < 1e-3 for action in attempt.actions)
    opened_late, opened, closed = (middle_dn(frame.path) for frame in attempt.frames)
    assert opened_late > opened > 20
    assert closed < 0.5 * opened, "the door closes in the first 280 ms of that frame"


def test_a_stuck_and_a_slow_door_hide_the_sample(rig: Make, tmp_path: Path) -> None:
    first = {}
    for fault in ("none", "stuck", "slow"):
        faults = {
            "none": [], "stuck": ["door_stuck"], "slow": [{"door_slow": {"takes": "1.5 s"}}],
        }[fault]  # fmt: skip
        record, _ = recorded(rig(faults=faults), tmp_path / fault)
        first[fault] = middle_dn(record.completed()["shot"].frames[0].path)
    assert first["stuck"] == pytest.approx(0, abs=3)
    assert 3 < first["slow"] < 0.7 * first["none"]


def test_a_watchdog_that_is_too_short_ends_the_shot(rig: Make, tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="serial time-out, the watchdog, has run out"):
        recorded(rig(servo={"time_out": "20 s"}), tmp_path / "runs")


def test_the_watchdog_is_fed_during_long_waits(rig: Make, tmp_path: Path) -> None:
    record, _ = recorded(rig(servo={"time_out": "60 s"}), tmp_path / "runs")
    assert list(record.completed()) == ["shot"]


def test_the_watchdog_is_fed_between_frames(rig: Make, tmp_path: Path) -> None:
    """Frames that follow each other closely for long leave no long wait."""

    class Decay(TimedShot):
        def run(self, session: Session) -> None:
            frame = TakeFrame("decay", ExposureSettings(1.0, 400, 4.0))
            frames = [at(0.6 + 10.0 * number, frame) for number in range(16)]
            session.run_sequence([at(0.0, DOOR_OPEN), *frames])

    record, door = recorded(rig(servo={"time_out": "60 s"}), tmp_path / "runs", Decay())
    assert len(record.frames("decay")) == 16
    assert len(door.swings) == 2, "it opened and stayed so"


@pytest.mark.parametrize(
    ("devices", "said"),
    [
        ({"door": {"open": "1000 us"}}, "two different positions"),
        ({"door": {"open": "5 ms"}}, "devices.door"),
        ({"door": {"driver": "lcus"}}, "the driver 'lcus' is no door"),
        ({"lamp": {"relay": 0}}, "relay"),
    ],
)
def test_what_is_wrong_in_the_rig_file(rig: Make, devices: dict[str, Any], said: str) -> None:
    path = rig(devices)
    with (
        pytest.raises(UsageError) as refusal,
        open_bench(read_rig_file(path), str(path)) as bench,
        bench.devices(),
    ):
        pass
    assert said in str(refusal.value)
