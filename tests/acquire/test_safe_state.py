"""Off is tried until it is off: who is asked again, for how long, and who need not wait."""

from collections.abc import Callable

import pytest

from labrig.acquire import CAMERA, LAMP, Device, Rig
from labrig.acquire.rig import PATIENCE_S
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError, DeviceLostError, UnclearAnswerError, UsageError
from tests.acquire.fakes import NotingCamera, NotingDoor, NotingLamp


class Stubborn:
    """Fails until `clock` says `until_s`, then does as it is told."""

    def __init__(
        self, clock: VirtualClock, act: Callable[[], None], until_s: float, error: Exception
    ) -> None:
        self.tries = 0
        self._clock = clock
        self._act = act
        self._until_s = until_s
        self._error = error

    def __call__(self) -> None:
        self.tries += 1
        if self._clock.now() < self._until_s:
            self._clock.sleep(0.5)
            raise self._error
        self._act()


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


@pytest.fixture
def notes() -> list[str]:
    return []


@pytest.fixture
def rig(clock: VirtualClock, notes: list[str]) -> Rig:
    devices: dict[str, Device] = {
        "door": NotingDoor(clock, notes.append),
        "camera": NotingCamera(clock, notes.append),
        "lamp": NotingLamp(clock, notes.append),
    }
    return Rig("bench", clock, devices, {})


@pytest.mark.parametrize("error", [UnclearAnswerError("?"), DeviceError("reads on"), OSError("x")])
def test_a_lamp_that_obeys_late_is_off_and_the_door_did_not_wait_for_it(
    rig: Rig, clock: VirtualClock, notes: list[str], error: Exception
) -> None:
    stubborn = Stubborn(clock, rig[LAMP].off, 0.8 * PATIENCE_S, error)
    rig[LAMP].make_safe = stubborn  # type: ignore[method-assign]
    rig.make_safe()
    assert notes == ["door closed", "camera safe", "lamp off"]
    assert stubborn.tries > 5
    assert clock.now() < PATIENCE_S


def test_patience_ends(rig: Rig, clock: VirtualClock) -> None:
    stubborn = Stubborn(clock, rig[LAMP].off, 1e9, UnclearAnswerError("says ?"))
    rig[LAMP].make_safe = stubborn  # type: ignore[method-assign]
    with pytest.raises(DeviceLostError, match="switch off by hand: lamp: says \\?") as caught:
        rig.make_safe()
    assert caught.value.unsafe == ("lamp",)
    assert PATIENCE_S <= clock.now() < PATIENCE_S + 5


def test_what_is_gone_is_not_asked_again_and_the_others_are(rig: Rig, clock: VirtualClock) -> None:
    gone = Stubborn(clock, rig[CAMERA].arm, 1e9, DeviceLostError("gone"))
    stubborn = Stubborn(clock, rig[LAMP].off, 5.0, UnclearAnswerError("?"))
    rig[CAMERA].make_safe = gone  # type: ignore[method-assign]
    rig[LAMP].make_safe = stubborn  # type: ignore[method-assign]
    with pytest.raises(DeviceLostError, match="by hand: camera: gone"):
        rig.make_safe()
    assert gone.tries == 1
    assert clock.now() < 10.0


def test_connecting_asks_again_what_answers_unclearly(clock: VirtualClock) -> None:
    rig = Rig("bench", clock, {}, {})
    lamp = NotingLamp(clock, list[str]().append)
    lamp.channel_on = True
    lamp.make_safe = Stubborn(clock, lamp.off, 5.0, UnclearAnswerError("?"))  # type: ignore[method-assign]
    rig.connect("lamp", lambda: lamp)
    assert not lamp.channel_on


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (DeviceError("no such port"), "no such port"),
        (UsageError("no such driver"), "no such driver"),
        (KeyError("oops"), "lamp: its driver failed"),
    ],
)
def test_connecting_does_not_insist_on_what_is_not_there(
    clock: VirtualClock, error: Exception, said: str
) -> None:
    def fail() -> NotingLamp:
        raise error

    with pytest.raises((DeviceError, UsageError), match=said):
        Rig("bench", clock, {}, {}).connect("lamp", fail)
    assert clock.now() == 0.0
