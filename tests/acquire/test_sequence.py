"""Lamp, shield, door and camera in one timed sequence, and the order in which all become safe."""

import pytest

from labrig.acquire import (
    DOOR_CLOSE,
    DOOR_OPEN,
    LAMP_OFF,
    LAMP_ON,
    SHIELD_COVER,
    SHIELD_UNCOVER,
    Device,
    ExposureSettings,
    LateAction,
    Rig,
    Session,
    Swing,
    TakeFrame,
    at,
    run_units,
)
from labrig.acquire.rig import in_safe_order
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError, ProtocolError
from labrig.record import Attempt, RunFolder

from .fakes import NotingCamera, NotingDoor, NotingLamp, NotingShield, Watching

FRAME = TakeFrame("decay", ExposureSettings(2.0, 400, 4.0))


class Bench:
    """Everything, listed in the rig file in the wrong order."""

    def __init__(self) -> None:
        self.clock = VirtualClock(1_767_225_600.0)
        self.notes: list[str] = []
        self.lamp = NotingLamp(self.clock, self.notes.append)
        self.door = NotingDoor(self.clock, self.notes.append)
        self.shield = NotingShield(self.clock, self.notes.append)
        camera = NotingCamera(self.clock, self.notes.append)
        devices: dict[str, Device] = {
            "camera": camera, "door": self.door, "shield": self.shield, "lamp": self.lamp,
        }  # fmt: skip
        self.rig = Rig("test bench", self.clock, devices, {})
        self.watching = Watching()

    def run(self, folder: RunFolder, unit: "Shot") -> Attempt:
        with folder:
            run_units([unit], self.rig, folder, self.watching, {})
            return folder.read().completed()[unit.name]


class Shot:
    """The paper's timed shot."""

    name = "shot"

    def __init__(self, door_s: float = 0.32) -> None:
        self.door_s = door_s
        self.missed: list[LateAction] = []

    def run(self, session: Session) -> None:
        session.perform(LAMP_ON)
        session.wait(10.0, "charging")
        self.missed += session.run_sequence(
            [
                at(0.0, LAMP_OFF),
                at(0.01, SHIELD_COVER),
                at(self.door_s, DOOR_OPEN),
                at(0.6, FRAME),
            ]
        )
        session.perform(DOOR_CLOSE)
        session.perform(SHIELD_UNCOVER)


@pytest.fixture
def folder(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    return RunFolder.create(tmp_path_factory.mktemp("runs"), "shot", 1_767_225_600.0, {}, seed=1)


def test_the_measured_times_of_all_are_in_the_journal(folder: RunFolder) -> None:
    bench, shot = Bench(), Shot()
    attempt = bench.run(folder, shot)
    done = {(action.device, action.action): action for action in attempt.actions}
    assert list(done)[1:] == [
        ("lamp", "off"), ("shield", "cover"), ("door", "open"), ("door", "close"),
        ("shield", "uncover"),
    ]  # fmt: skip
    zero = done["lamp", "off"].start_time
    assert done["shield", "cover"].start_time - zero == pytest.approx(0.01, abs=1e-6)
    assert done["door", "open"].start_time - zero == pytest.approx(0.32, abs=1e-6)
    assert done["door", "open"].end_time - zero == pytest.approx(0.325, abs=1e-6)
    assert attempt.frames[0].start_time - zero == pytest.approx(0.6, abs=1e-6)
    assert shot.missed == []
    assert "door open" in bench.watching.told
    assert not any(told.startswith("warning") for told in bench.watching.told)


def test_a_step_that_missed_its_tolerance_is_recorded_said_and_returned(folder: RunFolder) -> None:
    bench, shot = Bench(), Shot()
    bench.shield.takes_s = 0.4
    attempt = bench.run(folder, shot)
    late = {action.device: action.late_s for action in attempt.actions if action.late_s > 0.001}
    assert late == pytest.approx({"door": 0.09}, abs=1e-6)
    (missed,) = shot.missed
    assert (missed.timed.action, str(missed)) == (DOOR_OPEN, "door open by 90 ms")
    (warning,) = [told for told in bench.watching.told if told.startswith("warning")]
    assert "began late: door open by 90 ms" in warning


def test_a_late_photograph_is_returned_too(folder: RunFolder) -> None:
    bench, shot = Bench(), Shot(door_s=0.58)
    bench.door.takes_s = 0.1
    attempt = bench.run(folder, shot)
    assert [str(missed) for missed in shot.missed] == ["decay frame, 2 s ISO 400 f/4 by 80 ms"]
    assert attempt.frames[0].late_s == pytest.approx(0.08, abs=1e-6)


def test_a_rig_without_a_door_is_reported_what_it_lacks(folder: RunFolder) -> None:
    bench = Bench()
    del bench.rig.devices["door"]
    with pytest.raises(ProtocolError, match="needs a door"):
        bench.run(folder, Shot())


def test_the_lamp_is_off_before_the_door_closes_whatever_the_rig_file_says() -> None:
    bench = Bench()
    bench.rig.make_safe()
    assert bench.notes == ["lamp off", "shield uncovered", "door closed", "camera safe"]
    assert in_safe_order(["viewfinder", "camera", "door", "leds"]) == [
        "leds", "door", "viewfinder", "camera",
    ]  # fmt: skip


def test_a_door_that_fails_does_not_keep_the_rest_from_being_safe() -> None:
    bench = Bench()
    bench.door.fail = DeviceError("stuck")
    with pytest.raises(DeviceError, match="door: stuck") as refusal:
        bench.rig.make_safe()
    assert refusal.value.unsafe == ("door",)
    assert bench.notes == ["lamp off", "shield uncovered", "camera safe"]
    assert isinstance(bench.door, Swing)


class TwoFrames:
    """A frame that the camera refuses, and one at the settings of before."""

    name = "shot"

    def run(self, session: Session) -> None:
        session.perform(FRAME)
        with pytest.raises(DeviceError, match="refused"):
            session.perform(TakeFrame("decay", ExposureSettings(1.0, 100, 4.0)))
        session.perform(FRAME)


class RefusingCamera(NotingCamera):
    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        super().configure(settings)
        if settings.iso == 100:
            raise DeviceError("refused half of it")
        return settings


def test_settings_that_a_camera_refused_are_made_anew_for_the_next_frame(
    folder: RunFolder,
) -> None:
    bench = Bench()
    bench.rig.devices["camera"] = RefusingCamera(bench.clock, bench.notes.append)
    with folder:
        run_units([TwoFrames()], bench.rig, folder, bench.watching, {})
    configured = [note for note in bench.notes if note.startswith("configure")]
    assert configured == [f"configure {s}" for s in (
        FRAME.settings, ExposureSettings(1.0, 100, 4.0), FRAME.settings,
    )]  # fmt: skip
