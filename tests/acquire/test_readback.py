"""The lamp is read back while it is relied upon, where its board tells."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from labrig.acquire import LAMP_OFF, LAMP_ON, Rig, Session, at, run_units
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError
from labrig.record import RunFolder, RunRecord

from .fakes import NotingLamp, Watching

CHARGE_S = 600.0


class SharedLamp(NotingLamp):
    """Somebody else switches it, too: at each of `at_s`, in seconds of the clock."""

    def __init__(self, clock: VirtualClock, at_s: Sequence[float]) -> None:
        super().__init__(clock, lambda text: None)
        self.at_s = list(at_s)
        self.read_s: list[float] = []
        self.tells = True

    def reads_back(self) -> bool:
        return self.tells

    def is_on(self) -> bool:
        now_s = self._clock.now()
        self.read_s.append(now_s)
        while self.at_s and self.at_s[0] <= now_s:
            self.at_s.pop(0)
            self.channel_on = not self.channel_on
        return self.channel_on


class Charge:
    """A charge, a sequence that ends it, a wait in darkness."""

    name = "charge"

    def run(self, session: Session) -> None:
        session.perform(LAMP_ON)
        session.wait(CHARGE_S, "charging")
        session.run_sequence([at(0.0, LAMP_OFF)])
        session.wait(CHARGE_S, "dark")


def charged(path: Path, lamp: SharedLamp, clock: VirtualClock) -> RunRecord:
    folder = RunFolder.create(path, "charge", 0.0, {}, seed=1)
    with folder:
        run_units([Charge()], Rig("bench", clock, {"lamp": lamp}, {}), folder, Watching(), {})
        return folder.read()


def test_it_is_read_about_once_a_minute_and_before_it_is_switched(tmp_path: Path) -> None:
    clock = VirtualClock()
    lamp = SharedLamp(clock, [])
    assert list(charged(tmp_path, lamp, clock).completed()) == ["charge"]
    charging = [at_s for at_s in lamp.read_s if at_s < CHARGE_S + 0.5]
    assert charging == pytest.approx([0.0, *range(60, 600, 60), CHARGE_S], abs=0.5)


@pytest.mark.parametrize("reads_back", [True, False])
def test_its_guard_is_released_in_the_dark_where_the_lamp_is_read_back(
    tmp_path: Path, reads_back: bool
) -> None:
    clock, told = VirtualClock(), []
    lamp = SharedLamp(clock, [])
    lamp.tells = reads_back
    rig = Rig("bench", clock, {"lamp": lamp}, {})
    rig.lights_may_be_on = lambda may_be: told.append((may_be, lamp.channel_on, clock.now()))
    folder = RunFolder.create(tmp_path, "charge", 0.0, {}, seed=1)
    with folder:
        run_units([Charge()], rig, folder, Watching(), {})
    reports = [(may_be, is_on) for may_be, is_on, _ in told]
    if reads_back:
        assert reports == [(False, False), (True, False), (True, True), (False, False)]
        assert [at_s for *_, at_s in told] == pytest.approx([0.0, 0.0, 600.0, 600.0], abs=0.01)
    else:
        assert all(may_be for may_be, _ in reports)


@pytest.mark.parametrize(("at_s", "noticed_s"), [(100.0, 120.0), (599.0, 600.0), (700.0, 720.0)])
def test_what_somebody_else_switched_ends_the_unit(
    tmp_path: Path, at_s: float, noticed_s: float
) -> None:
    clock = VirtualClock()
    with pytest.raises(DeviceError, match="something else has switched it") as caught:
        charged(tmp_path, SharedLamp(clock, [at_s]), clock)
    assert clock.now() == pytest.approx(noticed_s, abs=1.0)
    was = "on" if at_s < CHARGE_S else "off"
    assert f"was switched {was}" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_no_board_tells_is_not_asked(tmp_path: Path) -> None:
    clock = VirtualClock()
    lamp = SharedLamp(clock, [100.0])
    lamp.tells = False
    assert list(charged(tmp_path, lamp, clock).completed()) == ["charge"]
    assert lamp.read_s == []
