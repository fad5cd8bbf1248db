"""Units on a bench: order, timing, safety, and what a run folder holds after an interruption."""

import signal
from collections.abc import Sequence
from pathlib import Path

import pytest

from labrig.acquire import (
    LAMP_OFF,
    LAMP_ON,
    Device,
    ExposureSettings,
    Rig,
    Session,
    TakeFrame,
    at,
    run_units,
)
from labrig.foundation.clock import Interrupted, VirtualClock
from labrig.foundation.errors import DeviceError, ProtocolError
from labrig.record import RunFolder

from .fakes import NotingCamera, NotingLamp, Watching

SETTINGS = ExposureSettings(2.0, 400, 4.0)


class Flash:
    """Lamp on, lamp off, two frames."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.seen: Sequence[object] = ()

    def run(self, session: Session) -> None:
        session.perform(LAMP_ON)
        session.wait(10.0, "charging")
        session.run_sequence(
            [
                at(0.0, LAMP_OFF),
                at(0.5, TakeFrame("decay", SETTINGS)),
                at(5.5, TakeFrame("decay", SETTINGS)),
            ]
        )
        self.seen = session.frames("decay")


class StoppingClock(VirtualClock):
    """Is interrupted at its n-th wait."""

    def __init__(self, stop_at: int) -> None:
        super().__init__(1_767_225_600.0)
        self.waits = 0
        self._stop_at = stop_at

    def _pause_until(self, deadline_s: float) -> None:
        self.waits += 1
        if self.waits == self._stop_at:
            for _ in range(10):
                self.interrupt(signal.SIGINT)
        super()._pause_until(deadline_s)


def make_rig(clock: VirtualClock, notes: list[str]) -> tuple[Rig, NotingLamp]:
    lamp = NotingLamp(clock, notes.append)
    devices: dict[str, Device] = {"lamp": lamp, "camera": NotingCamera(clock, notes.append)}
    return Rig("test bench", clock, devices, {}), lamp


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    return RunFolder.create(tmp_path, "flash", 1_767_225_600.0, {}, seed=1)


def test_frames_begin_at_their_times_and_the_camera_is_ready_beforehand(
    folder: RunFolder,
) -> None:
    clock, notes = VirtualClock(1_767_225_600.0), list[str]()
    rig, _ = make_rig(clock, notes)
    with folder:
        run_units([Flash("a")], rig, folder, Watching(), {})
        attempt = folder.read().completed()["a"]
    lamp_off = next(action for action in attempt.actions if action.action == "off")
    starts = [frame.start_time - lamp_off.start_time for frame in attempt.frames]
    assert starts == pytest.approx([0.5, 5.5], abs=1e-6)
    assert all(frame.late_s < 1e-6 for frame in attempt.frames)
    armed, off = notes.index("arm"), notes.index("lamp off")
    assert armed < off, "setting the camera must not cost time after lamp off"


def test_a_frame_that_cannot_begin_in_time_is_taken_and_recorded_as_late(
    folder: RunFolder,
) -> None:
    clock, notes = VirtualClock(), list[str]()
    rig, _ = make_rig(clock, notes)

    class Hasty(Flash):
        def run(self, session: Session) -> None:
            session.run_sequence([at(t, TakeFrame("decay", SETTINGS)) for t in (0.0, 1.0)])

    with folder:
        run_units([Hasty("a")], rig, folder, Watching(), {})
        late = [frame.late_s for frame in folder.read().frames("decay")]
    assert late == pytest.approx([0.0, 2.0])


@pytest.mark.parametrize("stop_at", range(1, 16))
def test_interrupted_anywhere_then_resumed_every_unit_is_there_once(
    folder: RunFolder, stop_at: int
) -> None:
    clock, notes = StoppingClock(stop_at), list[str]()
    rig, lamp = make_rig(clock, notes)
    units = [Flash("a"), Flash("b")]
    with folder:
        try:
            run_units(units, rig, folder, Watching(), {})
        except Interrupted as stop:
            assert stop.signum == signal.SIGINT
        rig.make_safe()
        assert not lamp.channel_on
        folder.close_open_attempts(clock.wall, "abort", "test")
        before = folder.read().completed()
        watching = Watching()
        run_units(units, rig, folder, watching, {})
        record = folder.read()
    assert list(record.completed()) == ["a", "b"]
    assert len(record.frames("decay")) == 4
    for name, attempt in before.items():
        assert record.completed()[name].uid == attempt.uid, "a completed unit is not redone"
        assert not any(told.startswith(f"unit {name} ") for told in watching.told)
    assert len(units[1].seen) == 4, "a unit sees the frames of the completed ones"


def test_whatever_a_driver_raises_is_a_device_error_and_the_lamp_goes_off(
    folder: RunFolder,
) -> None:
    clock, notes = VirtualClock(), list[str]()
    rig, lamp = make_rig(clock, notes)
    lamp.fail = RuntimeError("bug in a driver")
    with folder, pytest.raises(DeviceError, match="lamp: its driver failed"):
        run_units([Flash("a")], rig, folder, Watching(), {})
    rig.make_safe()
    assert not lamp.channel_on


def test_safety_tries_every_device_and_names_those_that_failed() -> None:
    clock, notes = VirtualClock(), list[str]()
    rig, lamp = make_rig(clock, notes)
    clock.interrupt(signal.SIGINT)

    def broken() -> None:
        raise OSError("gone")

    lamp.make_safe = broken  # type: ignore[method-assign]
    with pytest.raises(DeviceError, match="switch off by hand: lamp: OSError"):
        rig.make_safe()
    assert "camera safe" in notes


def test_a_missing_device_is_named(folder: RunFolder) -> None:
    clock = VirtualClock()
    rig = Rig("bare bench", clock, {"camera": NotingCamera(clock, list[str]().append)}, {})
    with folder, pytest.raises(ProtocolError, match="needs a lamp, the rig 'bare bench' has none"):
        run_units([Flash("a")], rig, folder, Watching(), {})


def test_a_unit_that_is_done_again_draws_the_same_seed(folder: RunFolder) -> None:
    clock, notes = VirtualClock(), list[str]()
    rig, _ = make_rig(clock, notes)
    drawn: list[tuple[str, int]] = []

    class Chancy(Flash):
        def run(self, session: Session) -> None:
            drawn.append((self.name, session.seed("begins")))
            if len(drawn) == 2:
                raise DeviceError("camera: gone")

    with folder:
        with pytest.raises(DeviceError):
            run_units([Chancy("a"), Chancy("b")], rig, folder, Watching(), {})
        folder.close_open_attempts(clock.wall, "fail", "test")
        run_units([Chancy("a"), Chancy("b")], rig, folder, Watching(), {})
        texts = [action.action for action in folder.read().completed()["b"].actions]
    (first, before), (failed, lost), (again, after) = drawn
    assert (first, failed, again) == ("a", "b", "b")
    assert lost == after != before
    assert texts == [f"seed of begins: {after}"]
