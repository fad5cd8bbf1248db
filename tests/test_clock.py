"""Clocks wait, and are the only place where a run is interrupted."""

import signal

import pytest

from labrig.clock import Clock, Interrupted, SystemClock, VirtualClock


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
