"""Rests on a sample changer: which time in the dark counts, in one session and after a crash."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from labrig.acquire import LAMP_OFF, LAMP_ON, Device, Rig, Session, run_units
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError, ProtocolError
from labrig.record import RunFolder

from .fakes import NotingLamp, Watching

EPOCH_S = 1_767_225_600.0
CHARGE_S, REST_S = 10.0, 100.0


class NotingChanger:
    """A sample changer that notes what it does, and whether the lamp was on then."""

    def __init__(self, notes: list[str], lamp: NotingLamp, *, keeps_dark: bool = True) -> None:
        self._notes, self._lamp, self._keeps_dark = notes, lamp, keeps_dark

    def identity(self) -> str:
        return "noting changer"

    def names(self) -> tuple[str, ...]:
        return "a", "b"

    def keeps_dark(self) -> bool:
        return self._keeps_dark

    def put(self, name: str | None) -> None:
        self._notes.append(f"{name}{' lit' if self._lamp.is_on() else ''}")

    def make_safe(self) -> None:
        self.put(None)

    def disconnect(self) -> None:
        self._notes.append("gone")


@dataclass
class Charge:
    """A sample is brought, rests, and is charged; fails, or leaves the lamp on, if told so."""

    sample: str | None
    number: int
    lasts_s: float = CHARGE_S
    fails: bool = False
    burns_on: bool = False

    @property
    def name(self) -> str:
        return f"{self.sample}-{self.number}"

    def run(self, session: Session) -> None:
        session.bring(self.sample)
        session.rest(REST_S)
        session.perform(LAMP_ON)
        session.wait(self.lasts_s, "charging")
        if self.fails:
            raise DeviceError("pulled out")
        if not self.burns_on:
            session.perform(LAMP_OFF)


class Bench:
    """A clock, a run folder and devices that are connected anew for every session."""

    def __init__(self, folder: Path, *, keeps_dark: bool = True) -> None:
        self.clock = VirtualClock(EPOCH_S)
        self.moves: list[str] = []
        self.folder = RunFolder.create(folder, "turns", EPOCH_S, {}, seed=1)
        self._keeps_dark = keeps_dark

    def run(self, *units: Charge) -> dict[str, float]:
        """Run units; return for how long each rested after its sample was brought, in seconds."""
        lamp = NotingLamp(self.clock, lambda text: None)
        changer = NotingChanger(self.moves, lamp, keeps_dark=self._keeps_dark)
        devices: dict[str, Device] = {"lamp": lamp, "sample_changer": changer}
        rig = Rig("bench", self.clock, devices, {})
        try:
            run_units(units, rig, self.folder, Watching(), {})
        except DeviceError:
            lamp.off()
            self.folder.close_open_attempts(self.clock.wall, "fail", "pulled out")
        return self.waits(units)

    def waits(self, units: Sequence[Charge]) -> dict[str, float]:
        completed, waits = self.folder.read().completed(), {}
        for unit in units:
            actions = completed[unit.name].actions if unit.name in completed else []
            brought = [one.end_time for one in actions if one.device == "sample_changer"]
            on = [one.start_time for one in actions if one.action == "on"]
            if brought:
                waits[unit.name] = on[0] - brought[-1]
        return waits


def test_the_time_in_which_another_sample_is_measured_counts(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    with bench.folder:
        waits = bench.run(
            Charge("a", 1), Charge("b", 1, lasts_s=70.0), Charge("a", 2), Charge("b", 2)
        )
        told = [
            action.action
            for attempt in bench.folder.read().completed().values()
            for action in attempt.actions
            if action.device == "protocol"
        ]
    assert waits["a-1"] == waits["b-1"] == pytest.approx(REST_S, abs=0.1), "nothing is known yet"
    # Meanwhile b rested for 100 s and was charged for 70 s.
    assert waits["a-2"] == pytest.approx(0.0, abs=0.1)
    assert waits["b-2"] == pytest.approx(REST_S - CHARGE_S, abs=0.1)
    assert [float(text.split()[4]) for text in told] == pytest.approx([170.0, 100.0], abs=0.1)


def test_without_darkness_on_the_changer_every_rest_is_waited_for(tmp_path: Path) -> None:
    bench = Bench(tmp_path, keeps_dark=False)
    with bench.folder:
        waits = bench.run(Charge("a", 1), Charge("b", 1), Charge("a", 2), Charge("b", 2))
    assert list(waits.values()) == pytest.approx([REST_S] * 4, abs=0.1)


def test_a_sample_that_stays_in_place_has_not_rested(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    with bench.folder:
        waits = bench.run(Charge("a", 1), Charge("a", 2))
    assert list(waits.values()) == pytest.approx([REST_S] * 2, abs=0.1)


def test_after_a_crash_the_sample_that_was_lit_rests_anew_and_the_other_rested(
    tmp_path: Path,
) -> None:
    bench = Bench(tmp_path)
    first, second = Charge("a", 1), Charge("b", 1)
    with bench.folder:
        # b-1 is complete, then a is lit again when the session ends.
        bench.run(first, second, Charge("a", 2, fails=True))
        bench.clock.spend(30.0)
        waits = bench.run(first, second, Charge("a", 2), Charge("b", 2))
    assert waits["a-2"] == pytest.approx(REST_S, abs=0.1)
    assert waits["b-2"] == pytest.approx(0.0, abs=0.1), "in the dark for 260 s"


def test_after_a_crash_in_the_turn_of_another_the_time_since_counts(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    first, second = Charge("a", 1), Charge("b", 1)
    with bench.folder:
        bench.run(first, Charge("b", 1, fails=True))
        bench.clock.spend(1000.0)
        # The clock counts from 1970 in the journal, and not from the session's begin.
        waits = bench.run(first, second, Charge("a", 2))
    assert waits["b-1"] == pytest.approx(REST_S, abs=0.1)
    assert waits["a-2"] == pytest.approx(0.0, abs=0.1)


def test_no_sample_is_moved_through_the_light(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    with bench.folder:
        bench.run(
            Charge(None, 1, burns_on=True),
            Charge(None, 2, burns_on=True),
            Charge("a", 1, burns_on=True),
            Charge("b", 1, burns_on=True),
            Charge(None, 3),
        )
    assert bench.moves == ["a", "b", "None"], "all are in the dark at first: the lamp burns on"


def test_a_sample_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    with bench.folder, pytest.raises(ProtocolError, match="the sample 'c', which the sample ch"):
        bench.run(Charge("c", 1))
