import contextlib
import struct
from itertools import pairwise

import pytest
import usb.core
from hypothesis import given, settings, strategies as st

from tests.sim.camera.host import IN, KNOCK, OK, OUT, Bench, Host

PIPE, OVERFLOW = 32, 75


def with_object(size: int) -> tuple[Host, int]:
    host = Bench(raw=bytes(i % 251 for i in range(size))).ready()
    host.shoot()
    handle, _, _ = host.photograph()
    return host, handle


def container(kind: int, code: int, transaction_id: int, payload: bytes = b"") -> bytes:
    return struct.pack("<IHHI", 12 + len(payload), kind, code, transaction_id) + payload


def clear_halts(host: Host) -> None:
    host.device.clear_halt(IN)
    host.device.clear_halt(OUT)


def status(host: Host) -> tuple[int, ...]:
    answer = bytes(host.device.ctrl_transfer(0xA1, 0x67, 0, 0, 64))
    length, code = struct.unpack_from("<HH", answer)
    assert length == len(answer)
    return (code, *struct.unpack_from(f"<{(length - 4) // 4}I", answer, 4))


def test_a_container_that_fills_its_last_packet_ends_with_an_empty_one() -> None:
    host, handle = with_object(1024 - 12)
    host.command(0x1009, handle)
    assert len(host.device.read(IN, 512)) == 512
    assert len(host.device.read(IN, 512)) == 512
    assert len(host.device.read(IN, 512)) == 0
    assert host.receive()[:2] == (3, OK)


def test_a_read_with_room_to_spare_swallows_the_empty_packet() -> None:
    host, handle = with_object(1024 - 12)
    host.command(0x1009, handle)
    assert len(host.device.read(IN, 1536)) == 1024
    assert host.receive()[:2] == (3, OK)


def test_a_read_ends_at_a_short_packet() -> None:
    host, handle = with_object(1000)
    host.command(0x1009, handle)
    assert len(host.device.read(IN, 4096)) == 1012
    assert host.receive()[:2] == (3, OK)


@pytest.mark.parametrize("room", [100, 600, 1000])
def test_a_packet_that_does_not_fit_overflows(room: int) -> None:
    host, handle = with_object(3000)
    host.command(0x1009, handle)
    with pytest.raises(usb.core.USBError) as overflow:
        host.device.read(IN, room)
    assert overflow.value.errno == OVERFLOW


def test_an_overflow_at_the_last_packet_loses_only_that() -> None:
    host, handle = with_object(600 - 12)
    host.command(0x1009, handle)
    with pytest.raises(usb.core.USBError, match="Overflow"):
        host.device.read(IN, 550)
    assert host.receive()[:2] == (3, OK)


def test_a_knock_comes_in_packets_of_eight() -> None:
    host = Bench().ready()
    host.do(0x9127, 0xD103)
    assert len(host.device.read(KNOCK, 8)) == 8
    assert len(host.device.read(KNOCK, 8)) == 4


def test_nothing_to_read_is_a_time_out_that_takes_its_time() -> None:
    bench = Bench()
    host = bench.host()
    before_s = bench.clock.now()
    with pytest.raises(usb.core.USBTimeoutError):
        host.device.read(IN, 512, timeout=250)
    assert bench.clock.now() - before_s == pytest.approx(0.25)


def test_no_new_command_is_taken_while_an_answer_waits() -> None:
    bench = Bench()
    host = bench.host()
    first = host.command(0x1001)
    before_s = bench.clock.now()
    with pytest.raises(usb.core.USBTimeoutError):
        host.device.write(OUT, container(1, 0x1001, 0), timeout=500)
    assert bench.clock.now() - before_s == pytest.approx(0.5, abs=0.01)
    assert host.answer(first).code == OK


def test_a_command_may_come_in_several_packets_only_if_they_are_full() -> None:
    host = Bench().ready()
    used = host.transaction_id
    host.command(0x1016, 0xD406)
    text = bytes([250]) + "x".encode("utf-16-le") * 250
    data = container(2, 0x1016, used, text * 3)
    host.device.write(OUT, data[:512])
    host.device.write(OUT, data[512:1024])
    host.device.write(OUT, data[1024:])
    assert host.answer(used).code == 0x201B


MALFORMED = {
    "short": b"\x0c\0\0\0",
    "length too small": struct.pack("<IHHI", 11, 1, 0x1001, 0),
    "length too great": struct.pack("<IHHI", 13, 1, 0x1001, 0),
    "huge": struct.pack("<IHHI", 0xFFFFFFFF, 1, 0x1001, 0) + bytes(500),
    "trailing bytes": container(1, 0x1001, 0) + b"x",
    "data first": container(2, 0x1001, 0),
    "half a parameter": container(1, 0x1001, 0, b"ab"),
    "six parameters": container(1, 0x1001, 0, bytes(24)),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_malformed_commands_stall_until_the_halts_are_cleared(name: str) -> None:
    host = Bench().host()
    host.device.write(OUT, MALFORMED[name])
    assert status(host) == (0x201F, OUT, IN)
    for _ in range(2):
        with pytest.raises(usb.core.USBError) as stall:
            host.device.read(IN, 512)
        assert stall.value.errno == PIPE
    with pytest.raises(usb.core.USBError) as stall:
        host.device.write(OUT, container(1, 0x1001, 0))
    assert stall.value.errno == PIPE
    clear_halts(host)
    assert status(host) == (OK,)
    assert host.do(0x1001, transaction_id=0).code == OK


def test_data_of_another_transaction_stalls_and_the_transaction_counts() -> None:
    host = Bench().ready()
    used = host.command(0x9110)
    host.device.write(OUT, container(2, 0x9110, used + 1, bytes(12)))
    with pytest.raises(usb.core.USBError, match="Pipe"):
        host.device.read(IN, 512)
    clear_halts(host)
    assert host.do(0x911D).code == OK


def cancel(host: Host, transaction_id: int) -> None:
    host.device.ctrl_transfer(0x21, 0x64, 0, 0, struct.pack("<HI", 0x4001, transaction_id))


def test_cancelling_a_data_phase_leaves_the_pipe_clean() -> None:
    host, handle = with_object(100_000)
    used = host.command(0x1009, handle)
    host.device.read(IN, 1024)
    cancel(host, used)
    assert status(host) == (0x2019,)
    host.clock.spend(0.01)
    assert status(host) == (OK,)
    with pytest.raises(usb.core.USBTimeoutError):
        host.device.read(IN, 512, timeout=10)
    answer = host.do(0x9107, handle, 0, 100_000)
    assert answer.code == OK
    assert len(answer.data or b"") == 100_000


def test_cancelling_before_the_data_was_sent() -> None:
    host = Bench().ready()
    used = host.command(0x9110)
    cancel(host, used)
    host.clock.spend(0.01)
    assert host.do(0x911D).code == OK


def test_cancelling_another_transaction_changes_nothing() -> None:
    host, handle = with_object(1000)
    used = host.command(0x1009, handle)
    cancel(host, used - 1)
    assert host.answer(used).code == OK


@pytest.mark.parametrize(
    ("kind", "request_", "data"),
    [
        (0x21, 0x64, b""),
        (0x21, 0x64, struct.pack("<HI", 0x4002, 1)),
        (0x21, 0x65, b""),
        (0x21, 0x67, b""),
        (0xA1, 0x65, 100),
        (0xA1, 0x99, 100),
        (0xC0, 0x01, 10),
        (0x80, 0x06, 10),
    ],
)
def test_unknown_requests_stall_for_once(kind: int, request_: int, data: bytes | int) -> None:
    host = Bench().host()
    with pytest.raises(usb.core.USBError) as stall:
        host.device.ctrl_transfer(kind, request_, 0, 0, data)
    assert stall.value.errno == PIPE
    assert status(host) == (OK,)


def test_every_transfer_takes_time() -> None:
    bench = Bench()
    host = bench.host()
    times_s = [bench.clock.now()]
    for act in (
        lambda: host.command(0x1001),
        lambda: host.device.read(IN, 512),
        lambda: host.device.read(IN, 512),
        lambda: status(host),
        lambda: host.device.clear_halt(IN),
        lambda: host.device.ctrl_transfer(0x21, 0x66, 0, 0),
    ):
        act()
        times_s.append(bench.clock.now())
    assert all(b - a >= 125e-6 * 0.999 for a, b in pairwise(times_s))


known_codes = st.sampled_from([0x1001, 0x1002, 0x1009, 0x1016, 0x9107, 0x9110, 0x9116, 0x9128])
almost_containers = st.builds(
    lambda length, kind, code, transaction_id, payload: (
        struct.pack("<IHHI", length or 12 + len(payload), kind, code, transaction_id) + payload
    ),
    st.sampled_from([0, 0, 0, 1, 12, 24, 512, 1024, 0xFFFFFFFF]),
    st.integers(0, 5),
    known_codes | st.integers(0, 0xFFFF),
    st.integers(0, 8),
    st.binary(max_size=40) | st.just(bytes(500)),
)
requests = st.tuples(st.sampled_from([0x21, 0xA1]), st.integers(0x60, 0x70), st.binary(max_size=8))


@settings(max_examples=30, deadline=None)
@given(st.lists(st.binary(max_size=600) | almost_containers | requests, max_size=12))
def test_whatever_the_host_sends_it_gets_usb_errors_at_worst(
    sent: list[bytes | tuple[int, int, bytes]],
) -> None:
    bench = Bench()
    host = bench.ready()
    for item in sent:
        with contextlib.suppress(usb.core.USBError):
            if isinstance(item, bytes):
                host.device.write(OUT, item, timeout=10)
            else:
                host.device.ctrl_transfer(item[0], item[1], 0, 0, item[2])
        with contextlib.suppress(usb.core.USBError):
            host.device.read(IN, 4096, timeout=10)
    host.device.reset()
    assert host.do(0x1002, 1, transaction_id=0).code in (OK, 0x2019)
