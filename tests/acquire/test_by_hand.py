"""What a person does between measurements: asked once, recorded, taken back, never asked again."""

import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import pytest

from labrig.acquire import (
    LAMP_ON,
    ExposureSettings,
    ManualStep,
    Rig,
    Session,
    TakeFrame,
    run_units,
)
from labrig.foundation.clock import Interrupted, VirtualClock
from labrig.foundation.errors import DeviceError
from labrig.record import RunFolder, RunRecord

from .fakes import NotingCamera, NotingLamp, Watching


@dataclass
class Filter:
    """A filter put in by hand, one photograph through it."""

    number: int

    @property
    def name(self) -> str:
        return f"filter-{self.number}"

    def run(self, session: Session) -> None:
        step = ManualStep(f"put filter {self.number} in", "it is next", f"filter {self.number}")
        session.ask(step)
        session.perform(LAMP_ON)
        session.perform(TakeFrame(self.name, ExposureSettings(1.0, 100, 4.0)))


class Changer:
    def __init__(self) -> None:
        self.did: list[str] = []
        self.fail: Exception | None = None

    def identity(self) -> str:
        return "changer"

    def do(self, task: str) -> None:
        if self.fail:
            raise self.fail
        self.did.append(task)

    def make_safe(self) -> None:
        pass

    def disconnect(self) -> None:
        pass


class Bench:
    def __init__(self, path: Path) -> None:
        self.clock = VirtualClock(1_767_225_600.0)
        self.lamp = NotingLamp(self.clock, lambda text: None)
        camera = NotingCamera(self.clock, lambda text: None)
        self.rig = Rig("test bench", self.clock, {"lamp": self.lamp, "camera": camera}, {})
        self.folder = RunFolder.create(path, "filters", 1_767_225_600.0, {}, seed=1)
        self.watching = Watching()

    def run(self, answers: list[str | None], count: int = 3) -> RunRecord:
        self.watching.answers = answers
        units = [Filter(number) for number in range(1, count + 1)]
        self.rig.make_safe()
        run_units(units, self.rig, self.folder, self.watching, {})
        return self.folder.read()

    @property
    def asked(self) -> list[str]:
        return [told for told in self.watching.told if told.startswith("by hand")]


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    with made.folder:
        yield made


def test_each_step_and_its_remark_are_in_the_journal(bench: Bench) -> None:
    record = bench.run(["", "scratched", ""])
    said = [
        action.action
        for attempt in record.completed().values()
        for action in attempt.actions
        if action.is_manual
    ]
    assert said == ["put filter 1 in", "put filter 2 in (scratched)", "put filter 3 in"]
    assert bench.asked == [
        "by hand: put filter 1 in; before: None",
        "by hand: put filter 2 in; before: put filter 1 in",
        "by hand: put filter 3 in; before: put filter 2 in (scratched)",
    ]


def test_the_last_step_can_be_taken_back(bench: Bench) -> None:
    record = bench.run(["", "", None, "", ""])
    assert [told.split(";")[0] for told in bench.asked] == [
        f"by hand: put filter {number} in" for number in (1, 2, 3, 2, 3)
    ]
    assert list(record.completed()) == ["filter-1", "filter-2", "filter-3"]
    assert [attempt.unit for attempt in record.attempts if attempt.completed] == [
        "filter-1", "filter-2", "filter-2", "filter-3",
    ]  # fmt: skip
    first, second = (attempt for attempt in record.attempts if attempt.unit == "filter-2")
    assert record.completed()["filter-2"].uid == second.uid != first.uid
    assert len(record.frames("filter-2")) == 1
    (aborted,) = [attempt for attempt in record.attempts if attempt.exit_status == "abort"]
    assert aborted.reason == "taken back: 'put filter 2 in'; filter-2 is done again"


def test_two_steps_are_taken_back_one_after_the_other(bench: Bench) -> None:
    bench.run(["", "", None, None, "", "", ""])
    numbers = [told.split(";")[0].split()[-2] for told in bench.asked]
    assert "".join(numbers) == "1232123"


def test_the_lamp_is_off_while_somebody_takes_a_step_back(bench: Bench) -> None:
    channel_on = []
    ask = bench.watching.ask

    def look(step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        channel_on.append(bench.lamp.channel_on)
        return ask(step, last, meanwhile)

    bench.watching.ask = look  # type: ignore[method-assign]
    bench.run(["", "", None, ""])
    assert channel_on == [False, True, True, False, True]


def test_a_process_that_dies_after_a_step_was_taken_back_does_not_count_it(bench: Bench) -> None:
    class DiedError(Exception):
        pass

    def die(step: ManualStep, last: str | None, meanwhile: object) -> NoReturn:
        raise DiedError

    asked = bench.watching.ask
    answers: list[str | None] = ["", "", None]

    def answer(step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        return answers.pop(0) if answers else die(step, last, meanwhile)

    bench.watching.ask = answer  # type: ignore[method-assign]
    with pytest.raises(DiedError):
        bench.run([])
    assert list(bench.folder.read().completed()) == ["filter-1"]
    bench.folder.close_open_attempts(bench.clock.wall, "abort", "it died")
    bench.watching.ask = asked  # type: ignore[method-assign]
    record = bench.run([])
    assert [told.split(";")[0] for told in bench.asked] == [
        "by hand: put filter 2 in", "by hand: put filter 3 in",
    ]  # fmt: skip
    assert sorted(record.completed()) == ["filter-1", "filter-2", "filter-3"]


def test_a_completed_unit_is_not_asked_for_again(bench: Bench) -> None:
    bench.run([], count=2)
    bench.watching.told.clear()
    bench.run([], count=3)
    assert bench.asked == ["by hand: put filter 3 in; before: put filter 2 in"]


def test_ctrl_c_at_the_question_stops(bench: Bench) -> None:
    bench.clock.interrupt(signal.SIGINT)
    with pytest.raises(Interrupted):
        bench.run([])


def test_what_would_fall_asleep_is_kept_awake_while_nobody_answers(bench: Bench) -> None:
    awake: list[float] = []
    camera = bench.rig.devices["camera"]
    camera.keep_awake = lambda: awake.append(bench.clock.now())  # type: ignore[attr-defined]

    def away(step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str:
        for _ in range(1000):
            bench.clock.spend(0.1)
            meanwhile()
        return ""

    bench.watching.ask = away  # type: ignore[method-assign]
    bench.run([], count=1)
    assert awake == pytest.approx([30.0, 60.0, 90.0], abs=0.3)


def test_hands_do_it_after_the_answer_and_their_failure_names_them(bench: Bench) -> None:
    changer = Changer()
    bench.rig.devices["changer"] = changer
    bench.run([], count=2)
    assert changer.did == ["filter 1", "filter 2"]
    changer.fail = RuntimeError("jammed")
    with pytest.raises(DeviceError, match="changer: its driver failed"):
        bench.run([], count=3)
