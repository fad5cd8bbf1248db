"""Everything that can go wrong between a camera and a PC, at every step of a frame."""

import errno
from contextlib import suppress
from typing import Any

import pytest

from labrig.acquire.values import ExposureSettings
from labrig.drivers.ptp import PtpCamera
from labrig.foundation.clock import Interrupted, VirtualClock
from labrig.foundation.errors import DeviceError

from ..usb.wire import OneDevice, Wire
from .bench import ADDRESS, SHORT, bench, photograph
from .broken import (
    BROKEN,
    InterruptingClock,
    assert_one_helpful_line,
    assert_usable,
)
from .toy import FULL, HALF, OFF_FULL, OFF_HALF, OPERATIONS, Fault, Key, ToyEos, u32

STEPS: dict[str, Key] = {
    "set property": (0x9110,),
    "events": (0x9116,),
    "keep on": (0x911D,),
    "half press": HALF,
    "full press": FULL,
    "let go full": OFF_FULL,
    "let go half": OFF_HALF,
    "frame data": (0x9107,),
    "transfer complete": (0x9117,),
}


@pytest.mark.parametrize("fault", BROKEN, ids=lambda f: f.name.lower())
@pytest.mark.parametrize("step", STEPS.values(), ids=STEPS.keys())
def test_broken_at(step: Key, fault: Fault) -> None:
    b = bench()
    camera = b.connect()
    b.toy.faults[step] = [fault]
    with pytest.raises(DeviceError) as error:
        photograph(camera)
    assert_one_helpful_line(error)
    assert_usable(b, camera)


@pytest.mark.parametrize("fault", [Fault.BUSY, Fault.LATE_LEFTOVER], ids=lambda f: f.name.lower())
@pytest.mark.parametrize("step", STEPS.values(), ids=STEPS.keys())
def test_harmless_at(step: Key, fault: Fault) -> None:
    b = bench()
    camera = b.connect()
    b.toy.faults[step] = [fault, fault]
    assert photograph(camera).data == b.toy.frame(1)
    assert_usable(b, camera)


@pytest.mark.parametrize("step", STEPS.values(), ids=STEPS.keys())
def test_busy_for_ever_at(step: Key) -> None:
    b = bench()
    camera = b.connect()
    b.toy.faults[step] = [Fault.BUSY] * 1000
    with pytest.raises(DeviceError, match="0x2019 DeviceBusy"):
        photograph(camera)
    b.toy.faults.clear()
    assert_usable(b, camera)


@pytest.mark.parametrize(
    ("cards", "is_reported"), [([], True), ([0x10000], True), ([0x10001], False)]
)
def test_busy_for_want_of_a_card(cards: list[int], is_reported: bool) -> None:
    b = bench()
    camera = b.connect()
    b.toy.cards = cards
    b.toy.faults[STEPS["full press"]] = [Fault.BUSY] * 1000
    with pytest.raises(DeviceError) as error:
        photograph(camera)
    assert ("no card" in str(error.value)) == is_reported


@pytest.mark.parametrize("step", STEPS.values(), ids=STEPS.keys())
def test_unplugged_at(step: Key) -> None:
    b = bench()
    camera = b.connect()
    b.toy.faults[step] = [Fault.UNPLUGGED]
    with pytest.raises(DeviceError, match="cable") as error:
        photograph(camera)
    assert_one_helpful_line(error)
    with pytest.raises(DeviceError, match="cable"):
        camera.make_safe()
    camera.disconnect()


@pytest.mark.parametrize("fault", BROKEN, ids=lambda f: f.name.lower())
def test_make_safe_tries_everything(fault: Fault) -> None:
    b = bench()
    camera = b.connect()
    camera.arm()
    b.toy.faults[OFF_HALF] = [fault]
    with pytest.raises(DeviceError, match="camera not known to be safe"):
        camera.make_safe()
    assert b.toy.values[0xD1B0] == bytes(4)  # the viewfinder is off all the same
    assert_usable(b, camera)


@pytest.mark.parametrize("fault", BROKEN, ids=lambda f: f.name.lower())
@pytest.mark.parametrize("step", [HALF, FULL, OFF_HALF], ids=["half press", "full press", "let go"])
def test_nothing_to_let_go_of_is_safe(step: Key, fault: Fault) -> None:
    b = bench()
    b.toy.refuses_idle_let_go = True
    camera = b.connect()
    b.toy.faults[step] = [fault]
    with pytest.raises(DeviceError):
        photograph(camera)
    assert_usable(b, camera)


@pytest.mark.parametrize("key", [(0x9116,), (0x9110,)], ids=["events", "set property"])
@pytest.mark.parametrize("at", range(5))
def test_what_a_lost_answer_said_is_not_believed_to_be_as_before(key: Key, at: int) -> None:
    b = bench()
    camera = b.connect()
    camera.configure(SHORT)
    b.toy.faults[key] = [*[Fault.LATE_LEFTOVER] * at, Fault.SILENT]
    with suppress(DeviceError):
        camera.configure(ExposureSettings(1.0, 100, 4.0))
    b.toy.faults.clear()
    camera.make_safe()
    assert camera.configure(SHORT) == SHORT
    assert [b.toy.values[prop] for prop in (0xD102, 0xD103, 0xD101)] == [
        *map(u32, (0x68, 0x50, 0x30))
    ]


@pytest.mark.parametrize("operations", [OPERATIONS, (*OPERATIONS, 0x9127)], ids=["no", "yes"])
def test_what_is_set_already_may_be_passed_over_in_silence(operations: tuple[int, ...]) -> None:
    """A camera that can be asked (0x9127) is asked, any other believed when it answers OK."""
    b = bench(ToyEos(operations))
    b.toy.reports_changes_only = True
    camera = b.connect()
    camera.configure(SHORT)
    b.toy.faults[(0x9116,)] = [Fault.SILENT]
    with pytest.raises(DeviceError):
        camera.configure(SHORT)
    camera.make_safe()
    assert camera.configure(SHORT) == SHORT
    assert ((0x9127, 0xD102) in b.toy.log) == (0x9127 in operations)


def test_make_safe_resets_a_camera_that_cannot_be_cancelled() -> None:
    b = bench()
    camera = b.connect()
    camera.arm()
    b.toy.faults[FULL] = [Fault.SILENT]
    with pytest.raises(DeviceError):
        camera.shoot()
    b.toy.status = 0x2019
    reset = b.toy.control

    def recovers_by_reset(wire: Wire, request: int, data: bytes) -> bytes:
        if request == 0x66:
            b.toy.status = 0x2001
        return reset(wire, request, data)

    b.toy.control = recovers_by_reset  # type: ignore[method-assign]
    assert_usable(b, camera)


def test_hopeless_camera_is_reported_by_make_safe() -> None:
    b = bench()
    camera = b.connect()
    b.toy.faults[(0x9116,)] = [Fault.SILENT]
    with pytest.raises(DeviceError):
        camera.capabilities()
    b.toy.status = 0x2019
    with pytest.raises(DeviceError, match="0x2019 DeviceBusy"):
        camera.make_safe()
    camera.disconnect()


class TestConnecting:
    OPENING = ((0x1002,), (0x1001,), (0x9114,), (0x9115,), (0x9116,), (0x9110,), (0x911A,))

    @pytest.mark.parametrize("fault", BROKEN, ids=lambda f: f.name.lower())
    @pytest.mark.parametrize("step", OPENING, ids=lambda k: f"{k[0]:X}")
    def test_broken_at(self, step: Key, fault: Fault) -> None:
        b = bench()
        b.toy.faults[step] = [fault]
        if step == (0x1002,):
            camera = b.connect()  # a reset helps
        else:
            with pytest.raises(DeviceError) as error:
                b.connect()
            assert_one_helpful_line(error)
            assert not b.wire.claimed
            camera = b.connect()
        assert_usable(b, camera)

    def test_after_a_program_that_died_with_the_button_down(self) -> None:
        b = bench()
        dead = b.connect()
        dead.arm()
        b.wire.send(b"half a frame" * 100)
        camera = b.connect()
        assert not b.toy.buttons
        assert_usable(b, camera)

    def test_switched_off(self) -> None:
        b = bench()
        b.wire.unplugged = True
        with pytest.raises(DeviceError, match="switch the camera on"):
            b.connect()

    @pytest.mark.parametrize(
        ("number", "message"), [(errno.EBUSY, "gvfs"), (errno.EACCES, "udev"), (None, "unplug")]
    )
    def test_not_ours(self, number: int | None, message: str) -> None:
        b = bench()
        b.wire.claim_errno = number
        if number is None:
            b.wire.claim_errno = errno.ENOMEM
        with pytest.raises(DeviceError, match=message):
            b.connect()

    def test_another_kind_of_camera(self) -> None:
        b = bench(ToyEos(tuple(op for op in OPERATIONS if op not in (0x9116, 0x9128))))
        with pytest.raises(DeviceError, match=r"0x9116, 0x9128 with 0x9129, or 0x910F"):
            b.connect()
        assert not b.toy.session_open


def test_ctrl_c_at_every_wait() -> None:
    """Whatever was going on: safe afterwards, and no frame is ever taken for another."""
    interrupted = 0
    for at_wait in range(1, 200):
        b = bench(clock=InterruptingClock(at_wait))
        b.toy.frame_bytes = 2_500_000
        b.toy.faults[FULL] = [Fault.BUSY] * 2
        b.toy.faults[(0x9110,)] = [Fault.BUSY]
        b.toy.faults[(0x9117,)] = [Fault.BUSY]
        try:
            camera = b.connect()
        except Interrupted:
            interrupted += 1
            assert not b.wire.claimed
            continue
        try:
            photograph(camera)
        except Interrupted:
            interrupted += 1
            assert_usable(b, camera)
        else:
            break
    assert interrupted > 10
    assert interrupted == at_wait - 1


def test_ctrl_c_during_a_long_exposure_costs_no_wait_for_it() -> None:
    clock = VirtualClock()
    b = bench(clock=clock)
    camera = b.connect()
    camera.configure(type(SHORT)(32.0, 100, 4.0))
    camera.arm()
    press = b.toy._expose

    def expose_and_interrupt(now_s: float) -> None:
        press(now_s)
        clock.interrupt(2)

    b.toy._expose = expose_and_interrupt  # type: ignore[method-assign]
    with pytest.raises(Interrupted):
        camera.shoot()
    b.toy._expose = press  # type: ignore[method-assign]
    interrupted_s = clock.now()
    camera.make_safe()
    assert clock.now() < interrupted_s + 1.0
    assert_usable(b, camera)
    assert b.toy.exposures == 2


class Asked(OneDevice):
    """The bench asks every device for its serial number first, as it does with twins."""

    def usb(self, address: str, serial_of: Any = None) -> Any:
        device = super().usb(address)
        assert serial_of(device) == "42"
        return device


@pytest.mark.parametrize("left_open", [False, True])
def test_a_camera_that_was_asked_who_it_is_is_left_as_somebody_left_it(left_open: bool) -> None:
    b = bench()
    b.toy.session_open = left_open
    PtpCamera(ADDRESS, PtpCamera.Settings(), Asked(b.wire))
    assert (OFF_HALF in b.toy.log) is left_open, "a dead program may hold the button"
