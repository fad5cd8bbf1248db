"""Exposures longer than the dial's: begun and ended by the PC, whatever happens in between."""

import math

import pytest

from labrig.acquire.values import ExposureSettings
from labrig.drivers.ptp import PtpCamera
from labrig.foundation.clock import Interrupted
from labrig.foundation.errors import DeviceError

from ..usb.wire import TRANSACTION_S
from .bench import Bench, bench, photograph
from .broken import (
    BROKEN,
    InterruptingClock,
    assert_one_helpful_line,
    assert_usable,
)
from .toy import BULB, FULL, HALF, OFF_FULL, OPERATIONS, Fault, Key, ToyEos, u32

BULB_START, BULB_END = (0x9125,), (0x9126,)
WITH_COMMANDS = (*OPERATIONS, *BULB_START, *BULB_END)
LONG = ExposureSettings(64.0, 200, 5.6)
EITHER_WAY = pytest.mark.parametrize(
    ("operations", "open_key", "close_key"),
    [(WITH_COMMANDS, BULB_START, BULB_END), (OPERATIONS, FULL, OFF_FULL)],
    ids=["commands", "button held"],
)


def long_bench(
    operations: tuple[int, ...] = WITH_COMMANDS, **settings: object
) -> tuple[Bench, PtpCamera]:
    b = bench(ToyEos(operations))
    return b, b.connect(longest_exposure="128 s", **settings)


@EITHER_WAY
def test_a_frame_says_how_long_it_was_really_exposed(
    operations: tuple[int, ...], open_key: Key, close_key: Key
) -> None:
    b, camera = long_bench(operations, shutter_lag="50 ms")
    assert camera.configure(LONG) == LONG
    assert b.toy.values[0xD102] == u32(BULB)
    camera.arm()
    b.toy.faults[close_key] = [Fault.BUSY] * 4
    before_s = b.wire.clock.now()
    frame = camera.shoot()
    exposed_s = b.toy.exposing_until_s - before_s - TRANSACTION_S
    assert exposed_s > 64.3, "busy four times, it was longer than asked for"
    assert frame.settings.exposure_s == pytest.approx(exposed_s - 0.05, abs=2 * TRANSACTION_S)
    assert frame.end_s - frame.start_s == pytest.approx(frame.settings.exposure_s)
    assert frame.start_s == pytest.approx(before_s + 0.05, abs=2 * TRANSACTION_S)
    assert frame.data == b.toy.frame(1)
    keys = [key[:2] if key[0] in (0x9128, 0x9129) else key for key in b.toy.log]
    assert (keys.count(open_key), keys.count(close_key)) == (1, 5)
    assert (HALF in keys) == (open_key is FULL), "BulbStart goes alone"
    assert b.toy.is_idle


def test_nothing_is_reported_while_the_shutter_is_open() -> None:
    b, camera = long_bench()
    camera.configure(LONG)
    camera.arm()
    armed_at = len(b.toy.log)
    camera.shoot()
    assert b.toy.log[armed_at : armed_at + 2] == [BULB_START, BULB_END]


def test_between_bulb_and_the_dial_and_back() -> None:
    b, camera = long_bench()
    short = ExposureSettings(1 / 64, 200, 5.6)
    for number, settings in enumerate((LONG, short, LONG), start=1):
        assert camera.configure(settings) == settings
        frame = camera.shoot()
        assert frame.settings.exposure_s == pytest.approx(settings.exposure_s, abs=0.01)
        assert frame.data == b.toy.frame(number)


class TestOffers:
    def test_doubling_from_64_s_to_the_longest(self) -> None:
        _, camera = long_bench()
        assert camera.capabilities().exposures_s == (1 / 128, 1 / 64, 1.0, 32.0, 64.0, 128.0)
        settings = PtpCamera.Settings.model_validate({"longest_exposure": "300 s"})
        assert settings.planned_offers().exposures_s[-4:] == (32.0, 64.0, 128.0, 256.0)

    def test_none_unless_the_rig_file_asks(self) -> None:
        b = bench(ToyEos(WITH_COMMANDS))
        assert max(b.connect().capabilities().exposures_s) == 32.0
        assert max(PtpCamera.Settings().planned_offers().exposures_s) == 32.0

    def test_none_where_the_camera_has_none(self) -> None:
        b = bench(ToyEos(WITH_COMMANDS))
        b.toy.lists[0xD102] = (0x10, 0x38)
        camera = b.connect(longest_exposure="64 s")
        assert camera.capabilities().exposures_s == (1.0, 32.0)
        (said,) = [str(found) for found in camera.findings() if "bulb" in found.what]
        assert "turn its dial to B" in said
        with pytest.raises(DeviceError, match="turn its dial to B"):
            camera.configure(LONG)

    def test_a_button_that_acts_at_once_cannot_be_held(self) -> None:
        one_stage = (*(op for op in OPERATIONS if op not in (0x9128, 0x9129)), 0x910F)
        b = bench(ToyEos(one_stage))
        assert max(b.connect(longest_exposure="64 s").capabilities().exposures_s) == 32.0

    def test_a_dial_at_b_offers_nothing_else(self) -> None:
        b = bench(ToyEos(WITH_COMMANDS))
        b.toy.values[0xD105], b.toy.values[0xD102] = u32(4), u32(BULB)
        camera = b.connect(longest_exposure="64 s")
        assert camera.capabilities().exposures_s == (64.0,)
        assert [f.what for f in camera.findings() if "dial at B" in f.what]
        frame = photograph(camera, LONG)
        assert frame.settings.exposure_s == pytest.approx(64.0, abs=0.01)
        with pytest.raises(DeviceError, match="turn its dial to M"):
            camera.configure(ExposureSettings(1.0, 200, 5.6))

    def test_a_dial_at_b_is_refused_unless_the_rig_file_asks_for_bulb(self) -> None:
        b = bench(ToyEos(WITH_COMMANDS))
        b.toy.values[0xD105] = u32(4)
        camera = b.connect()
        (refused,) = [str(found) for found in camera.findings() if found.severity == "refuse"]
        assert "dial is at B" in refused
        with pytest.raises(DeviceError, match="turn the dial to M"):
            camera.capabilities()


@pytest.mark.parametrize("fault", BROKEN, ids=lambda f: f.name.lower())
@pytest.mark.parametrize("end", ["open", "close"])
@EITHER_WAY
def test_broken_at(
    operations: tuple[int, ...], open_key: Key, close_key: Key, end: str, fault: Fault
) -> None:
    b, camera = long_bench(operations)
    b.toy.faults[open_key if end == "open" else close_key] = [fault]
    with pytest.raises(DeviceError) as error:
        photograph(camera, LONG)
    assert_one_helpful_line(error)
    broken_s = b.wire.clock.now()
    camera.make_safe()
    assert not b.toy.at_bulb
    assert b.wire.clock.now() < broken_s + 1.0
    assert_usable(b, camera)


@EITHER_WAY
def test_ctrl_c_at_every_wait_closes_the_shutter_at_once(
    operations: tuple[int, ...], open_key: Key, close_key: Key
) -> None:
    interrupted = 0
    for at_wait in range(1, 60):
        clock = InterruptingClock(10_000)
        b = bench(ToyEos(operations), clock)
        camera = b.connect(longest_exposure="64 s")
        b.toy.faults[open_key] = [Fault.BUSY]
        b.toy.faults[close_key] = [Fault.BUSY] * 2
        clock._waits_left = at_wait
        try:
            photograph(camera, LONG)
        except Interrupted:
            interrupted += 1
            interrupted_s = clock.now()
            camera.make_safe()
            assert not b.toy.at_bulb
            assert clock.now() < interrupted_s + 1.0
            assert_usable(b, camera)
        else:
            break
    assert interrupted == at_wait - 1 > 5


def test_unplugged() -> None:
    b, camera = long_bench()
    b.toy.faults[BULB_END] = [Fault.UNPLUGGED]
    with pytest.raises(DeviceError, match="cable"):
        photograph(camera, LONG)
    with pytest.raises(DeviceError, match="cable"):
        camera.make_safe()
    camera.disconnect()


def test_after_a_program_that_died_with_the_shutter_open() -> None:
    b, dead = long_bench()
    dead.configure(LONG)
    dead.arm()
    b.wire.clock.interrupt(2)  # at the next wait, which is the exposure
    with pytest.raises(Interrupted):
        dead.shoot()
    assert b.toy.exposing_until_s == math.inf
    camera = b.connect()
    assert not b.toy.at_bulb
    assert_usable(b, camera)


@pytest.mark.parametrize("hidden", [0x2002, 0x2019])
def test_a_refusal_in_the_parameter_is_one(hidden: int) -> None:
    b, camera = long_bench()
    b.toy.bulb_start_params = (hidden,)
    with pytest.raises(DeviceError, match=f"0x{hidden:X}.*or to B"):
        photograph(camera, LONG)
    b.toy.bulb_start_params = (0x2001,)
    assert_usable(b, camera)
    assert b.toy.values[0xD102] != u32(BULB)


def test_a_refusal_says_what_to_do() -> None:
    b, camera = long_bench()
    b.toy.faults[BULB_START] = [Fault.REFUSED]
    with pytest.raises(DeviceError, match=r"0x2002 GeneralError: turn its dial to M .* or to B"):
        photograph(camera, LONG)


def test_an_exposure_that_somebody_ended_at_the_camera_is_reported() -> None:
    b, camera = long_bench()
    b.toy.faults[BULB_END] = [Fault.REFUSED]
    with pytest.raises(DeviceError, match="it was ended at the camera"):
        photograph(camera, LONG)
