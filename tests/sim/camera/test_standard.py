"""The simulated camera that knows the PTP standard only, asked by hand."""

import struct
from typing import Any

import pytest
import usb.core
from hypothesis import given, strategies as st

from labrig.sim.camera import BodySettings, CameraFaults, StandardHabits
from labrig.sim.camera.vocabulary import ObjectFormat
from tests.sim.camera.datasets import arrays, strings
from tests.sim.camera.host import BUSY, OK, Bench, Host

RAW, JPEG = ObjectFormat.DNG, ObjectFormat.JPEG
OPERATIONS = {
    *(0x1001, 0x1002, 0x1003, 0x1004, 0x1005, 0x1007, 0x1008, 0x1009, 0x100B, 0x100E),
    *(0x1014, 0x1015, 0x1016, 0x101B),
}
EXPOSURE_TIME, PROGRAM, ISO, F_NUMBER, DELAY = 0x500D, 0x500E, 0x500F, 0x5007, 0x5012
ADDED, COMPLETE = 0x4002, 0x400D


def bench(
    habits: StandardHabits | None = None, faults: CameraFaults | None = None, **manual_steps: Any
) -> Bench:
    return Bench(body=BodySettings(body="standard", **manual_steps), habits=habits, faults=faults)


def ready(b: Bench) -> Host:
    host = b.host()
    assert host.do(0x1002, 1, transaction_id=0).code == OK
    return host


def value(host: Host, prop: int) -> int:
    data = host.do(0x1015, prop).data
    assert data is not None
    return int.from_bytes(data, "little")


def test_it_is_known_by_other_numbers_than_the_eos_and_tells_its_serial_number_on_usb() -> None:
    device = bench().host().device
    assert (device.idVendor, device.idProduct) == (0x1209, 0x0001)
    assert (device.manufacturer, device.product) == ("labrig", "simulated PTP camera")
    assert device.serial_number == "0123abcd"


def test_device_info_names_no_extension() -> None:
    info = bench().host().do(0x1001).data
    assert info is not None
    assert struct.unpack_from("<HI", info) == (100, 0)
    (operations, events, properties, captures, _), offset = arrays(info, 11, 5)
    assert set(operations) == OPERATIONS
    assert {ADDED, COMPLETE} <= set(events)
    assert {EXPOSURE_TIME, PROGRAM, ISO, F_NUMBER} <= set(properties)
    assert captures == (RAW,)
    assert strings(info, offset) == ["labrig", "simulated PTP camera", "1.0", "0123abcd"]


@pytest.mark.parametrize("operation", [0x9110, 0x9116, 0x9128, 0x100A])
def test_it_knows_no_operation_of_canons(operation: int) -> None:
    assert ready(bench()).do(operation).code == 0x2005


def test_a_capture_is_answered_reported_and_fetched() -> None:
    b = bench()
    host = ready(b)
    assert host.do(0x1016, EXPOSURE_TIME, data=struct.pack("<I", 5000)).code == OK
    asked_s = b.clock.now()
    assert host.do(0x100E, 0, 0).code == OK
    code, handle = host.knock()
    assert code == ADDED
    assert host.knock() == (COMPLETE,)
    info = host.do(0x1008, handle)
    assert info.data is not None
    storage, object_format, _, size = struct.unpack_from("<IHHI", info.data)
    assert (storage, object_format, size) == (0x00010001, RAW, len(b.film.raw))
    assert strings(info.data, 52)[0] == "DSC_0001.DNG"
    assert host.do(0x101B, handle, 10, 20).data == b.film.raw[10:30]
    assert host.do(0x1009, handle).data == b.film.raw
    assert host.do(0x100B, handle, 0).code == OK
    assert host.do(0x1009, handle).code == 0x2009
    (taken,) = b.film.taken
    assert (taken.exposure_s, taken.iso) == (0.5, 100)
    assert taken.f_number == pytest.approx(2**2.5), "f/5.6 on the ring"
    assert taken.start_s - asked_s == pytest.approx(0.083, abs=0.01)


def test_while_it_exposes_it_says_who_it_is_and_nothing_else() -> None:
    b = bench()
    host = ready(b)
    host.do(0x1016, EXPOSURE_TIME, data=struct.pack("<I", 10_000))
    assert host.do(0x100E).code == OK
    assert host.do(0x100E).code == BUSY
    b.clock.spend(0.5)
    assert host.do(0x1004).code == BUSY
    assert host.do(0x1001).code == OK
    b.clock.spend(1.0)
    assert host.do(0x1004).code == OK


@pytest.mark.parametrize(
    ("params", "code"), [((0, 0x3801), 0x200B), ((0x00050001, 0), 0x2013), ((0, RAW), OK)]
)
def test_a_capture_goes_where_it_can(params: tuple[int, int], code: int) -> None:
    assert ready(bench()).do(0x100E, *params).code == code


@pytest.mark.parametrize(
    ("habits", "reported"),
    [
        (StandardHabits(), [ADDED, COMPLETE]),
        (StandardHabits((RAW, JPEG)), [ADDED, ADDED, COMPLETE]),
        (StandardHabits(end_reported="before"), [COMPLETE, ADDED]),
        (StandardHabits(end_reported="never"), [ADDED]),
        (StandardHabits(has_second_card=True), [ADDED, ADDED, COMPLETE]),
    ],
    ids=lambda value: "",
)
def test_makers_have_habits(habits: StandardHabits, reported: list[int]) -> None:
    host = ready(bench(habits))
    assert host.do(0x100E).code == OK
    assert [host.knock()[0] for _ in reported] == reported
    with pytest.raises(usb.core.USBTimeoutError):
        host.knock()


@pytest.mark.parametrize(
    ("prop", "data", "code"),
    [
        (EXPOSURE_TIME, struct.pack("<I", 156), OK),
        (EXPOSURE_TIME, struct.pack("<I", 157), 0x201C),
        (EXPOSURE_TIME, struct.pack("<H", 156), 0x201B),
        (PROGRAM, struct.pack("<H", 1), 0x200F),
        (DELAY, struct.pack("<I", 2000), OK),
        (DELAY, struct.pack("<I", 2001), 0x201C),
        (0x5003, b"", 0x200A),
    ],
)
def test_a_property_takes_what_it_lists(prop: int, data: bytes, code: int) -> None:
    host = ready(bench())
    before = host.do(0x1015, prop).data
    assert host.do(0x1016, prop, data=data).code == code
    after = host.do(0x1015, prop)
    assert after.data == (data if code == OK else before)


def test_descriptions_are_read_as_the_standard_writes_them() -> None:
    host = ready(bench(autofocus=True))
    described = host.do(0x1014, EXPOSURE_TIME).data
    assert described is not None
    assert struct.unpack_from("<HHBIIBH", described) == (EXPOSURE_TIME, 6, 1, 156, 156, 2, 53)
    assert len(described) == 16 + 4 * 53
    delay = host.do(0x1014, DELAY).data
    assert delay == struct.pack("<HHBIIBIII", DELAY, 6, 1, 0, 0, 1, 0, 10_000, 1000)
    assert host.do(0x1014, 0x500A).data == struct.pack("<HHBHHB", 0x500A, 4, 0, 2, 2, 0)


@pytest.mark.parametrize(
    ("set_by_hand", "prop", "expected"),
    [
        ({"exposure_mode": "Av"}, PROGRAM, 3),
        ({"exposure_mode": "B"}, PROGRAM, 0),
        ({"iso": "auto"}, ISO, 0xFFFF),
        ({"iso": 800}, ISO, 800),
        ({"autofocus": True}, 0x500A, 2),
    ],
)
def test_manual_settings_are_reported(
    set_by_hand: dict[str, Any], prop: int, expected: int
) -> None:
    assert value(ready(bench(**set_by_hand)), prop) == expected


def test_faults_of_the_body() -> None:
    host = ready(bench(faults=CameraFaults(busy_releases=1, full_spans_s=((0.0, 5.0),))))
    assert [host.do(0x100E).code for _ in range(2)] == [BUSY, 0x200C]
    host.clock.spend(5.0)
    assert host.do(0x100E).code == OK


def test_after_the_session_nobody_is_reported() -> None:
    b = bench()
    host = ready(b)
    assert host.do(0x100E).code == OK
    b.clock.spend(5.0)
    assert host.do(0x1003).code == OK
    with pytest.raises(usb.core.USBTimeoutError):
        host.knock()


@given(st.sampled_from(sorted(OPERATIONS)), st.lists(st.integers(0, 0xFFFFFFFF), max_size=5))
def test_any_parameters_are_answered(operation: int, params: list[int]) -> None:
    host = ready(bench())
    data = b"\1\0" if operation == 0x1016 else None
    answer = host.do(operation, *params, data=data)
    assert 0x2001 <= answer.code <= 0x201F
