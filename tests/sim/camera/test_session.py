import struct

import pytest
import usb.core
import usb.util

from tests.sim.camera.datasets import arrays, strings
from tests.sim.camera.host import (
    AV,
    DESTINATION,
    IN,
    ISO,
    KNOCK,
    OK,
    OUT,
    SHOTS,
    TO_HOST,
    TV,
    Bench,
    Host,
)

IMPLEMENTED = {
    *(0x1001, 0x1002, 0x1003, 0x1004, 0x1005, 0x1007, 0x1008, 0x1009, 0x100B),
    *(0x1014, 0x1015, 0x1016, 0x101B, 0x9101, 0x9102, 0x9104, 0x9107, 0x910F, 0x9110, 0x9114),
    *(0x9115, 0x9116, 0x9117, 0x911A, 0x911D, 0x9125, 0x9126, 0x9127, 0x9128, 0x9129),
    0x9153,
}


def test_descriptors_are_those_of_a_5d_mark_ii() -> None:
    device = Bench().host().device
    assert (device.idVendor, device.idProduct) == (0x04A9, 0x3199)
    (interface,) = device.get_active_configuration()
    kind = (interface.bInterfaceClass, interface.bInterfaceSubClass, interface.bInterfaceProtocol)
    assert kind == (6, 1, 1)
    packets = {ep.bEndpointAddress: ep.wMaxPacketSize for ep in interface}
    assert packets == {IN: 512, OUT: 512, KNOCK: 8}
    assert device.manufacturer == "Canon Inc."
    assert device.product == "Canon Digital Camera"
    assert device.serial_number is None
    assert "04a9" in str(device).lower()


def test_device_info_is_reported_without_a_session() -> None:
    info = Bench().host().do(0x1001).data
    assert info is not None
    assert struct.unpack_from("<HIHBH", info) == (100, 0xB, 200, 0, 0)
    (operations, events, properties, _, _), offset = arrays(info, 11, 5)
    assert set(operations) == IMPLEMENTED
    assert events == (0xC101,)
    assert set(properties) == {0xD402, 0xD406, 0xD407}
    assert strings(info, offset) == ["Canon Inc.", "Canon EOS 5D Mark II", "3-2.1.2", "0123abcd"]


def test_every_operation_in_device_info_is_supported() -> None:
    for operation in IMPLEMENTED - {0x1002, 0x9110, 0x1016}:
        assert Bench().ready().do(operation).code != 0x2005


def test_nothing_but_device_info_goes_without_a_session() -> None:
    host = Bench().host()
    for operation in IMPLEMENTED - {0x1001, 0x1002, 0x9110, 0x1016}:
        assert host.do(operation, transaction_id=0).code == 0x2003


@pytest.mark.parametrize("operation", [0x1000, 0x100E, 0x9999, 0x9154])
def test_unknown_operations_are_refused_and_counted(operation: int) -> None:
    host = Bench().ready()
    assert host.do(operation, 1, 2, 3).code == 0x2005
    assert host.do(0x911D).code == OK


def test_transaction_ids_must_follow_each_other() -> None:
    host = Bench().ready()
    right = host.transaction_id
    for wrong in (0, right - 1, right + 1, 0xFFFFFFFF):
        assert host.do(0x911D, transaction_id=wrong).code == 0x2004
    assert host.do(0x911D, transaction_id=right).code == OK


def test_a_session_begins_with_transaction_zero_and_a_session_id() -> None:
    host = Bench().host()
    assert host.do(0x1002, 1, transaction_id=5).code == 0x2004
    assert host.do(0x1002, 0, transaction_id=0).code == 0x201D
    assert host.do(0x1002, 7, transaction_id=0).code == OK
    answer = host.do(0x1002, 8, transaction_id=0)
    assert (answer.code, answer.params) == (0x201E, (7,))
    assert host.do(0x1003, transaction_id=1).code == OK
    assert host.do(0x1002, 8, transaction_id=0).code == OK


def test_parameters_are_counted() -> None:
    host = Bench().ready()
    assert host.do(0x9114).code == 0x201D
    assert host.do(0x9107, 1, 2).code == 0x201D
    assert host.do(0x911D, 1).code == 0x2006
    assert host.do(0x911D, 0, 0).code == OK
    assert host.do(0x9128, 4).code == 0x201D


def test_a_killed_host_leaves_its_session_open() -> None:
    bench = Bench()
    first = bench.ready()
    with pytest.raises(usb.core.USBError, match="busy"):
        bench.host().do(0x1002, 1)
    bench.camera.lose_host()
    second = bench.host()
    assert second.do(0x1002, 1).code == 0x201E
    with pytest.raises(usb.core.USBError) as gone:
        first.do(0x911D)
    assert gone.value.errno == 19


def leave_politely(host: Host) -> None:
    usb.util.dispose_resources(host.device)


@pytest.mark.parametrize("reset", ["class request", "port"])
def test_a_reset_ends_the_session(reset: str) -> None:
    bench = Bench()
    leave_politely(bench.ready())
    host = bench.host()
    assert host.do(0x1002, 1).code == 0x201E
    if reset == "port":
        host.device.reset()
    else:
        host.device.ctrl_transfer(0x21, 0x66, 0, 0)
    assert host.do(0x1002, 1, transaction_id=0).code == OK


def test_remote_mode_is_needed_to_change_anything() -> None:
    host = Bench().host()
    host.do(0x1002, 1)
    assert host.set(TV, 0x60).code == 0x2002
    assert host.do(0x9128, 2).code == 0x2002
    assert host.do(0x9128, 1).code == 0x2002
    assert host.events() == []


def test_the_first_events_tell_everything() -> None:
    host = Bench().host()
    host.do(0x1002, 1)
    host.do(0x9114, 1)
    host.do(0x9115, 1)
    records = host.events()
    values = {struct.unpack_from("<I", p)[0]: p[4:] for code, p in records if code == 0xC189}
    assert {AV, TV, ISO, 0xD105, 0xD106, 0xD108, SHOTS, DESTINATION, 0xD120} <= set(values)
    assert values[0xD120] == struct.pack("<5I", 1, 0x10, 6, 0, 4)
    assert values[0xD105] == struct.pack("<I", 3)
    lists = {}
    for _, payload in ((c, p) for c, p in records if c == 0xC18A):
        prop, kind, n = struct.unpack_from("<III", payload)
        assert kind == 3
        if prop != 0xD120:
            lists[prop] = struct.unpack(f"<{n}I", payload[12:])
    assert {0x0C, 0x10, 0x38, 0x68, 0xA0} <= set(lists[TV])
    assert {0x20, 0x28, 0x30, 0x38, 0x40} <= set(lists[AV])
    assert {0x48, 0x50, 0x58, 0x60, 0x68} <= set(lists[ISO])
    assert set(lists[DESTINATION]) == {2, 4}
    assert host.events() == []


def test_a_new_value_is_confirmed_a_little_later() -> None:
    bench = Bench()
    host = bench.ready()
    assert host.set(ISO, 0x50).code == OK
    assert host.values() == {}
    bench.clock.spend(0.05)
    assert host.values() == {ISO: 0x50}


def test_values_that_are_not_on_the_list_are_refused() -> None:
    bench = Bench()
    host = bench.ready()
    assert host.set(TV, 0x11).code == 0x201C
    assert host.set(0xD105, 2).code == 0x200F
    assert host.set(0xDEAD, 2).code == 0x200A
    assert host.do(0x9110, data=b"").code == 0x201B
    assert host.do(0x9110, data=struct.pack("<III", 13, TV, 0x60)).code == 0x201B
    assert host.do(0x9110, data=struct.pack("<IIQ", 16, TV, 0x60)).code == 0x201C
    bench.clock.spend(0.1)
    assert host.values() == {}


def test_a_value_can_be_asked_for() -> None:
    host = Bench().ready()
    assert host.do(0x9127, DESTINATION).code == OK
    assert host.values() == {DESTINATION: TO_HOST}
    assert host.do(0x9127, 0x1234).code == 0x200A


def test_the_camera_knocks_once_when_there_is_something_to_fetch() -> None:
    bench = Bench()
    host = bench.ready()
    with pytest.raises(usb.core.USBTimeoutError):
        host.device.read(KNOCK, 64, timeout=100)
    host.set(ISO, 0x50)
    before_s = bench.clock.now()
    knock = bytes(host.device.read(KNOCK, 64, timeout=1000))
    assert knock == struct.pack("<IHHI", 12, 4, 0xC101, 0xFFFFFFFF)
    assert 0.02 < bench.clock.now() - before_s < 0.04
    with pytest.raises(usb.core.USBTimeoutError):
        host.device.read(KNOCK, 64, timeout=100)
    assert host.values() == {ISO: 0x50}


def test_asking_for_events_again_loses_none() -> None:
    bench = Bench()
    host = bench.ready()
    host.shoot()
    bench.clock.spend(1.0)
    host.do(0x9115, 1)
    assert host.photograph()[2] == "IMG_0001.DNG"


def test_the_camera_answers_without_usb_as_well() -> None:
    bench = Bench()
    responder = bench.camera.responder
    assert responder.transaction(0x911D, 0, ()).code == 0x2003
    assert responder.transaction(0x1002, 0, (1,)).code == OK
    assert responder.transaction(0x9114, 1, (1,)).code == OK
    assert responder.transaction(0x9115, 2, (1,)).code == OK
    assert responder.takes_data(0x9110)
    data = struct.pack("<III", 12, TV, 0x60)
    assert responder.transaction(0x9110, 3, (), data).code == OK
    assert responder.event_due_s() == bench.clock.now()
    assert responder.take_event() == (0xC101, ())
    code, params, records = responder.transaction(0x9116, 4, ())
    assert (code, params) == (OK, ())
    assert records is not None
    assert responder.event_due_s() == pytest.approx(0.03)


def test_silenced_the_camera_reports_nothing() -> None:
    host = Bench().ready()
    host.do(0x9115, 0)
    host.do(0x9127, ISO)
    assert host.events() == []
    with pytest.raises(usb.core.USBTimeoutError):
        host.device.read(KNOCK, 64, timeout=10)


def test_ordinary_ptp_properties() -> None:
    host = Bench().ready()
    name = "labrig\0".encode("utf-16-le")
    text = bytes([7]) + name
    assert host.do(0x1016, 0xD406, data=text).code == OK
    assert host.do(0x1015, 0xD406).data == text
    assert host.do(0x1015, 0xD407).data == struct.pack("<I", 1)
    described = host.do(0x1014, 0xD406).data
    assert described == struct.pack("<HHB", 0xD406, 0xFFFF, 1) + text + text + b"\0"
    assert host.do(0x1014, 0xD407).data == struct.pack("<HHBIIB", 0xD407, 6, 0, 1, 1, 0)
    for operation in (0x1014, 0x1015):
        assert host.do(operation, 0xD402).code == OK
        assert host.do(operation, 0x5001).code == 0x200A
    assert host.do(0x1016, 0xD406, data=b"\x09ab").code == 0x201B
    assert host.do(0x1016, 0xD402, data=text).code == 0x200F
    assert host.do(0x1016, 0x5001, data=text).code == 0x200A


def test_closing_the_session_throws_away_what_waits_for_the_host() -> None:
    bench = Bench()
    host = bench.ready()
    host.shoot()
    handle, _, _ = host.photograph()
    assert host.do(0x1003).code == OK
    assert host.do(0x1002, 1, transaction_id=0).code == OK
    assert host.do(0x1009, handle).code == 0x2009
