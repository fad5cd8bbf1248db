"""The thermometer beside a run: read now and then, never in the way, never its end."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from labrig.acquire import (
    LAMP_OFF,
    LAMP_ON,
    Device,
    ExposureSettings,
    ManualStep,
    PartUnit,
    Rig,
    Session,
    TakeFrame,
    Unit,
    at,
    run_units,
)
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError
from labrig.record import RunFolder, RunRecord

from .fakes import NotingCamera, NotingLamp, Watching

STARTED = 1_767_225_600.0
SETTINGS = ExposureSettings(2.0, 400, 4.0)
#: Frames at 0.5 s, 5.5 s, … and two after long gaps, which leave time for a reading.
FRAMES_S = (0.5, 5.5, 10.5, 60.0, 200.0)


class NotingThermometer:
    """Says 21 °C, at once or after a while; fails on demand."""

    def __init__(self, clock: VirtualClock, takes_s: float = 0.1) -> None:
        self.read_s: list[float] = []
        self.fail: Exception | None = None
        self._clock = clock
        self._takes_s = takes_s

    def identity(self) -> str:
        return "noting thermometer"

    def celsius(self) -> float:
        self.read_s.append(self._clock.now())
        self._clock.sleep(self._takes_s)
        if self.fail:
            raise self.fail
        return 21.0

    def make_safe(self) -> None:
        pass

    def disconnect(self) -> None:
        pass


class ChargeAndDecay:
    """Charges for ten minutes, then takes its frames."""

    name = "decay-1"

    def run(self, session: Session) -> None:
        session.perform(LAMP_ON)
        session.wait(600.0, "charging")
        session.run_sequence(
            [at(0.0, LAMP_OFF), *(at(time_s, TakeFrame("decay", SETTINGS)) for time_s in FRAMES_S)]
        )


class ByHandFirst:
    """Something is done by hand."""

    name = "changer"

    def run(self, session: Session) -> None:
        session.ask(ManualStep("put the sample in", "it is to be measured", "sample in"))


def do(
    folder: Path, thermometer: NotingThermometer | None, clock: VirtualClock, *units: Unit
) -> tuple[RunRecord, Watching]:
    notes: list[str] = []
    devices: dict[str, Device] = {
        "lamp": NotingLamp(clock, notes.append),
        "camera": NotingCamera(clock, notes.append),
    }
    if thermometer is not None:
        devices["thermometer"] = thermometer
    watching = Watching()
    with RunFolder.create(folder, "run", STARTED, {}, seed=1) as run:
        run_units(units, Rig("test bench", clock, devices, {}), run, watching, {})
        return run.read(), watching


def test_it_is_read_at_both_ends_of_a_unit_and_about_once_a_minute_in_between(
    tmp_path: Path,
) -> None:
    clock = VirtualClock(STARTED)
    record, _ = do(tmp_path, NotingThermometer(clock), clock, ChargeAndDecay())
    (attempt,) = record.attempts
    at_s = [reading.time - STARTED for reading in attempt.temperatures]
    assert {reading.temperature_c for reading in attempt.temperatures} == {21.0}
    assert at_s[0] < 1
    assert at_s[-1] == pytest.approx(attempt.frames[-1].end_time - STARTED, abs=2)
    gaps_s = [after - before for before, after in pairwise(at_s)]
    assert max(gaps_s) < 130
    assert min(gaps_s[:-1]) >= 60
    assert record.temperatures() == attempt.temperatures


@pytest.mark.parametrize("takes_s", [0.1, 8.0])
@pytest.mark.parametrize("fail", [None, DeviceError("nothing there")], ids=["well", "failing"])
def test_no_action_begins_later_for_it(
    tmp_path: Path, takes_s: float, fail: DeviceError | None
) -> None:
    times = []
    for name in ("with", "without"):
        clock = VirtualClock(STARTED)
        thermometer = NotingThermometer(clock, takes_s)
        thermometer.fail = fail
        record, _ = do(
            tmp_path / name, thermometer if name == "with" else None, clock, ChargeAndDecay()
        )
        frames = record.frames("decay")
        off = next(action for action in record.attempts[0].actions if action.action == "off")
        assert {off.late_s, *(frame.late_s for frame in frames)} == {0.0}
        times.append([frame.start_time - off.start_time for frame in frames])
        if name == "with":
            wanted_s = [frame.start_time - STARTED for frame in frames]
            for read_s in thermometer.read_s:
                assert not any(-10 < read_s - start_s < 0 for start_s in wanted_s)
    assert times[0] == pytest.approx(times[1], abs=1e-5)


@pytest.mark.parametrize(
    "fail", [DeviceError("its wire is off"), ValueError("oops")], ids=["device", "driver"]
)
def test_one_that_fails_is_reported_once_and_tried_again(tmp_path: Path, fail: Exception) -> None:
    clock = VirtualClock(STARTED)
    thermometer = NotingThermometer(clock)
    thermometer.fail = fail

    class Mend:
        name = "mend"

        def run(self, session: Session) -> None:
            thermometer.fail = None

    record, watching = do(tmp_path, thermometer, clock, ChargeAndDecay(), Mend())
    assert [attempt.exit_status for attempt in record.attempts] == ["success", "success"]
    warned = [told for told in watching.told if told.startswith("warning")]
    assert len(warned) == 1
    assert "goes on without temperatures" in warned[0]
    assert str(fail) in warned[0]
    assert len(thermometer.read_s) > 5
    assert [reading.unit for reading in record.temperatures()] == ["mend"]


def test_while_a_person_takes_their_time_it_is_read_too(tmp_path: Path) -> None:
    clock = VirtualClock(STARTED)
    thermometer = NotingThermometer(clock)

    class Slow(Watching):
        def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str:
            for _ in range(600):
                clock.spend(0.5)
                meanwhile()
            return ""

    devices: dict[str, Device] = {"thermometer": thermometer}
    with RunFolder.create(tmp_path, "run", STARTED, {}, seed=1) as run:
        run_units([ByHandFirst()], Rig("bench", clock, devices, {}), run, Slow(), {})
        assert 5 <= len(run.read().temperatures()) <= 8


def test_a_part_of_a_chain_has_its_own_readings(tmp_path: Path) -> None:
    clock = VirtualClock(STARTED)
    units = [PartUnit("a", ChargeAndDecay()), PartUnit("b", ChargeAndDecay())]
    record, _ = do(tmp_path, NotingThermometer(clock), clock, *units)
    first, second = record.part("a").temperatures(), record.part("b").temperatures()
    assert len(first) + len(second) == len(record.temperatures())
    assert first[-1].time <= second[0].time
    assert {reading.unit for reading in second} == {"decay-1"}
