"""Clocks wait, and are the only place where a run is interrupted."""

import ctypes
import signal
import time
from types import SimpleNamespace
from typing import Any

import pytest

from labrig.foundation.clock import (
    SLEEP_CLOCKS,
    Clock,
    Interrupted,
    Slept,
    SystemClock,
    VirtualClock,
)
from labrig.foundation.errors import DeviceError


@pytest.mark.parametrize("clock", [SystemClock(), VirtualClock(1e9)], ids=["system", "virtual"])
def test_waits_end_at_their_deadline_and_wall_time_follows(clock: Clock) -> None:
    before_s, before_wall = clock.now(), clock.wall()
    clock.sleep_until(before_s + 0.12)
    assert clock.now() - before_s >= 0.12
    assert clock.wall() - before_wall == pytest.approx(clock.now() - before_s, abs=0.01)
    clock.sleep_until(before_s)  # the past needs no waiting


@pytest.mark.parametrize("clock", [SystemClock(), VirtualClock()], ids=["system", "virtual"])
def test_an_interruption_is_raised_once_at_the_next_wait(clock: Clock) -> None:
    clock.interrupt(signal.SIGTERM)
    with pytest.raises(Interrupted) as caught:
        clock.sleep(1000.0)
    assert caught.value.signum == signal.SIGTERM
    clock.sleep(0.0)


def test_nothing_interrupts_behind_a_shield() -> None:
    clock = VirtualClock()
    with clock.shielded():
        clock.interrupt(signal.SIGINT)
        clock.sleep(5.0)
        assert clock.now() == 5.0
    with pytest.raises(Interrupted):
        clock.sleep(0.0)


def test_a_transaction_costs_time_and_is_not_interrupted() -> None:
    clock = VirtualClock()
    clock.interrupt(signal.SIGINT)
    clock.spend(2.5)
    assert clock.now() == 2.5


class SleepyClock(VirtualClock):
    """Sleeps as told."""

    asleep_s = 0.0

    def slept_s(self) -> float:
        return self.asleep_s


def test_sleep_is_noticed_at_the_next_wait_and_once() -> None:
    clock = SleepyClock()
    clock.asleep_s = 50.0

    def timed() -> None:
        clock.sleep(5.0)
        clock.asleep_s += 3600.0
        with clock.shielded():
            clock.sleep(5.0)
        clock.sleep(1000.0)

    with pytest.raises(Slept) as caught, clock.noticing_sleep():
        timed()
    assert caught.value.slept_s == 3600.0
    assert clock.now() == 10.0
    clock.sleep(5.0)


def test_sleep_after_the_last_wait_is_noticed_at_the_end() -> None:
    clock = SleepyClock()
    with pytest.raises(Slept), clock.noticing_sleep():
        clock.asleep_s += 1.0


def test_nobody_is_reported_of_sleep_who_did_not_ask_or_of_a_hiccup() -> None:
    clock = SleepyClock()
    clock.asleep_s += 3600.0
    clock.sleep(5.0)
    assert clock.now() == 5.0
    with clock.noticing_sleep():
        clock.asleep_s += 0.1
        clock.sleep(5.0)
    assert clock.now() == 10.0


def test_what_went_wrong_is_more_than_the_sleep() -> None:
    clock = SleepyClock()

    def failing() -> None:
        clock.asleep_s += 3600.0
        raise DeviceError("gone")

    with pytest.raises(DeviceError), clock.noticing_sleep():
        failing()


class Pc:
    """A PC whose clocks are read by each system's own calls."""

    def __init__(self, platform: str, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s, self.asleep_s = 1000.0, 10.0
        if platform == "win32":
            kernel32 = SimpleNamespace(
                GetTickCount64=Function(lambda: int(1e3 * self.now_s)),
                QueryUnbiasedInterruptTime=self.unbiased,
            )
            windll = SimpleNamespace(kernel32=kernel32)
            monkeypatch.setattr(ctypes, "windll", windll, raising=False)
            monkeypatch.setattr(time, "perf_counter", lambda: self.now_s)
            return
        through_sleep, awake = SLEEP_CLOCKS[platform]
        monkeypatch.setattr(time, through_sleep, "through sleep", raising=False)
        monkeypatch.setattr(time, awake, "awake", raising=False)
        monkeypatch.setattr(time, "clock_gettime", self.gettime)

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s
        self.asleep_s += duration_s

    def gettime(self, clock: str) -> float:
        return {"through sleep": self.now_s, "awake": self.now_s - self.asleep_s}[clock]

    def unbiased(self, ticks: Any) -> int:
        ticks._obj.value = int(1e7 * (self.now_s - self.asleep_s))
        return 1


class Function:
    """A function of a DLL, whose result has a type."""

    restype: Any = None

    def __init__(self, call: Any) -> None:
        self._call = call

    def __call__(self) -> Any:
        assert self.restype is ctypes.c_uint64, "a DLL gives 32 bits unless it is told"
        return self._call()


@pytest.mark.parametrize("platform", ["linux", "darwin", "win32"])
def test_each_system_is_asked_how_long_it_slept(
    monkeypatch: pytest.MonkeyPatch, platform: str
) -> None:
    pc = Pc(platform, monkeypatch)
    clock = SystemClock(platform)
    before_s, before_wall = clock.now(), clock.wall()
    with clock.noticing_sleep():
        clock.sleep(0.0)
    with pytest.raises(Slept) as caught, clock.noticing_sleep():
        pc.sleep(3600.0)
    assert caught.value.slept_s == pytest.approx(3600.0, abs=0.01)
    assert clock.now() - before_s == pytest.approx(3600.0), "time goes on in sleep"
    assert clock.wall() - before_wall == pytest.approx(3600.0)


@pytest.mark.parametrize("by_s", [3600.0, -3600.0, 1.5])
def test_a_step_of_the_time_of_day_is_noticed_once(
    monkeypatch: pytest.MonkeyPatch, by_s: float
) -> None:
    clock, time_of_day = SystemClock(), time.time
    assert clock.step_s() == 0.0
    monkeypatch.setattr(time, "time", lambda: time_of_day() + by_s)
    assert clock.step_s() == pytest.approx(by_s, abs=0.1)
    assert clock.step_s() == 0.0


def test_a_clock_that_is_adjusted_slowly_was_not_stepped(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, time_of_day = SystemClock(), time.time
    for adjusted_s in (0.4, 0.8, 1.2, 1.6):
        monkeypatch.setattr(time, "time", lambda by_s=adjusted_s: time_of_day() + by_s)
        assert clock.step_s() == 0.0


def test_a_system_that_does_not_tell_is_taken_to_be_awake() -> None:
    clock = SystemClock("plan9")
    began_s = clock.now()
    with clock.noticing_sleep():
        clock.sleep(0.01)
    assert clock.now() - began_s >= 0.01
