"""The simulated camera on the loopback network, packet by packet."""

import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from labrig.foundation.clock import Interrupted, SystemClock, VirtualClock
from labrig.foundation.errors import UsageError
from labrig.sim.camera import Pace, PtpIpServer
from tests.conftest import Ended
from tests.counterparts import transcript
from tests.counterparts.served import Film
from tests.sim.camera.ip_host import INTRODUCTION, Bench, packet, piece, request, start

OK, CANCELLED = 0x2001, 0x201F
OPEN = request(0x1002, 0, 1)
INFO = request(0x1001, 1)
TO_HOST = struct.pack("<III", 12, 0xD11C, 4)


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(Bench()) as made:
        yield made


def codes(packets: list[tuple[int, bytes]]) -> list[int]:
    """Of the responses among them."""
    return [int.from_bytes(payload[:2], "little") for kind, payload in packets if kind == 7]


def test_introduction(bench: Bench) -> None:
    line = bench.line()
    ((kind, payload),) = line.say(packet(1, INTRODUCTION))
    assert kind == 2
    assert payload[:4] == b"\1\0\0\0"
    assert payload[20:].decode("utf-16-le").startswith("Canon EOS 5D Mark II\0")
    assert payload[-4:] == b"\0\0\1\0"


def test_only_this_pc_can_reach_it(bench: Bench) -> None:
    assert bench.server.address == f"ptpip://127.0.0.1:{bench.server.port}"


def test_a_transaction_with_an_answer_and_one_with_data(bench: Bench) -> None:
    command, _ = bench.let_in()
    assert codes(command.say(OPEN)) == [OK]
    (begin, end, answer) = command.say(INFO)
    size = int.from_bytes(begin[1][4:], "little")
    assert (begin[0], end[0], answer[0]) == (9, 12, 7)
    assert size == len(end[1]) - 4
    assert codes(command.say(request(0x9114, 2, 1))) == [OK]
    said = request(0x9110, 3, direction=2) + start(3, 12)
    assert command.say(said + piece(10, 3, TO_HOST[:5])) == []
    assert codes(command.say(piece(12, 3, TO_HOST[5:]))) == [OK]
    said = request(0x9110, 4, direction=2) + start(4, 0xFFFFFFFFFFFFFFFF)
    assert codes(command.say(said + piece(12, 4, TO_HOST))) == [OK]


def test_packets_arrive_in_any_pieces(bench: Bench) -> None:
    command, _ = bench.let_in()
    said = OPEN + INFO
    heard = [answer for byte in said for answer in command.say(bytes([byte]))]
    assert codes(heard) == [OK, OK]


def test_a_question_whether_it_is_there(bench: Bench) -> None:
    for line in bench.let_in():
        assert line.say(packet(13)) == [(14, b"")]
        assert line.say(packet(14)) == []


def test_events_come_on_their_own_connection_once_until_fetched(bench: Bench) -> None:
    command, event = bench.let_in()
    command.say(OPEN)
    command.say(request(0x9114, 1, 1))
    command.say(request(0x9115, 2, 1))
    assert [kind for kind, _ in event.hear()] == [8]
    assert event.hear() == []
    command.say(request(0x9116, 3))
    command.say(request(0x9110, 4, direction=2) + start(4, 12) + piece(12, 4, TO_HOST))
    assert event.hear() == []
    bench.clock.spend(1.0)
    assert event.hear() == [(8, struct.pack("<HI", 0xC101, 0xFFFFFFFF))]


def test_one_host_at_a_time(bench: Bench) -> None:
    command, event = bench.let_in()
    other = bench.line()
    assert other.say(packet(1, INTRODUCTION)) == [(5, b"\2\0\0\0")]
    assert other.is_cut
    other = bench.line()
    assert other.say(packet(3, b"\1\0\0\0")) == [(5, b"\1\0\0\0")]
    assert other.is_cut
    assert codes(command.say(OPEN)) == [OK]
    event.close()
    command.hear()
    assert command.is_cut, "a host that loses one connection loses both"
    command, _ = bench.let_in()
    assert codes(command.say(OPEN)) == [OK], "and its session"


def test_who_says_nothing_makes_way(bench: Bench) -> None:
    silent = [bench.line() for _ in range(20)]
    command, _ = bench.let_in()
    assert codes(command.say(OPEN)) == [OK]
    assert sum(line.hear() == [] and line.is_cut for line in silent) >= 12


@pytest.mark.parametrize("kind", ["event", "command"])
def test_cancelling_a_data_phase_from_the_host(bench: Bench, kind: str) -> None:
    command, event = bench.let_in()
    command.say(OPEN)
    command.say(request(0x9110, 1, direction=2) + start(1, 12))
    heard = (event if kind == "event" else command).say(piece(11, 1)) + command.hear()
    assert codes(heard) == [CANCELLED]
    assert codes(command.say(request(0x9116, 2))) == [OK], "the cancelled one counts"


def test_cancelling_a_picture_leaves_the_rest_of_it_unsent() -> None:
    with closing(Bench(Film(size=40_000_000))) as bench:
        command, event = bench.let_in()
        command.say(OPEN)
        for tid, (opcode, *params) in enumerate([(0x9114, 1), (0x9115, 1), (0x9128, 3, 1)], 1):
            assert codes(command.say(request(opcode, tid, *params))) == [OK]
        bench.clock.spend(2.0)
        command._socket.send(request(0x1009, 4, 0x91000001))
        for _ in range(20):
            bench.work()
        event.say(piece(11, 4))
        heard = command.hear()
        assert codes(heard) == [CANCELLED]
        assert sum(len(payload) for _, payload in heard) < 40_000_000
        assert codes(command.say(request(0x9116, 5))) == [OK]
        event.say(piece(11, 5))
        assert command.hear() == [], "what is over cannot be cancelled"


@pytest.mark.parametrize(
    "said",
    [
        struct.pack("<II", 7, 6),
        struct.pack("<II", 0x7FFFFFFF, 6),
        packet(0),
        packet(15),
        packet(1, INTRODUCTION),
        packet(6, b"abc"),
        packet(6, struct.pack("<IHI", 3, 0x1001, 1)),
        packet(6, struct.pack("<IHI", 1, 0x1001, 1) + b"abc"),
        request(0x1001, 1, 1, 2, 3, 4, 5, 6),
        start(1, 12),
        piece(10, 1, b"abc"),
        request(0x9110, 1, direction=2) + request(0x1001, 2),
        request(0x9110, 1, direction=2) + start(2, 12),
        request(0x9110, 1, direction=2) + start(1, 12) + start(1, 12),
        request(0x9110, 1, direction=2) + start(1, 0x10001),
        request(0x9110, 1, direction=2) + piece(10, 1, b"abc"),
        request(0x9110, 1, direction=2) + start(1, 2) + piece(10, 1, b"abc"),
        request(0x9110, 1, direction=2) + start(1, 12) + piece(12, 1, b"abc"),
        packet(11, b"abc"),
        b"GET / HTTP/1.1\r\n\r\n",
    ],
)
def test_who_does_not_keep_to_the_protocol_is_cut_off_and_the_next_is_let_in(
    bench: Bench, said: bytes
) -> None:
    for start_with in (b"", OPEN):
        command, event = bench.let_in()
        command.say(start_with + said)
        assert command.is_cut
        event.hear()
        assert event.is_cut
    stranger = bench.line()
    stranger.say(said[:8] if said[4:8] == b"\1\0\0\0" else said)
    command, _ = bench.let_in()
    assert codes(command.say(OPEN)) == [OK]


def test_nothing_is_done_before_both_connections_are_there(bench: Bench) -> None:
    command = bench.line()
    command.say(packet(1, INTRODUCTION))
    assert command.say(OPEN) == []
    assert command.is_cut


def test_a_port_that_is_taken(bench: Bench) -> None:
    with pytest.raises(UsageError, match=f"port {bench.server.port}"):
        PtpIpServer(bench.responder, bench.clock.now, bench.server.port)


def test_it_ends_when_asked_and_leaves_its_port(bench: Bench) -> None:
    clock = SystemClock()
    threading.Timer(0.1, clock.interrupt, [2]).start()
    with pytest.raises(Interrupted):
        bench.server.serve(clock)
    port = bench.server.port
    bench.server.close()
    with pytest.raises(ConnectionError):
        socket.create_connection(("127.0.0.1", port), 5.0)


def test_the_rooms_time_follows_the_pcs() -> None:
    clock, room_clock = VirtualClock(), VirtualClock(5e8)
    clock.spend(100.0)
    pace = Pace(clock, room_clock)
    assert pace.catch_up() == 0.0
    clock.spend(2.5)
    assert room_clock.now() == 0.0, "it stands still inside a transaction"
    assert pace.catch_up() == room_clock.now() == 2.5


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--rig", "smi"], "did you mean 'sim'"),
        (["--port", "70000"], "65535"),
        (["--rig", "RIG"], "expected a simulated rig"),
        (["--port", "TAKEN"], "cannot listen on port"),
    ],
)
def test_what_the_command_refuses(
    labrig: Callable[..., Ended], bench: Bench, tmp_path: Path, arguments: list[str], said: str
) -> None:
    rig = tmp_path / "rig.yaml"
    rig.write_text("name: x\ndevices: {lamp: {driver: numato, address: COM3, relay: 1}}\n")
    known = {"RIG": str(rig), "TAKEN": str(bench.server.port)}
    ended = labrig("sim", "camera", *(known.get(argument, argument) for argument in arguments))
    assert ended.code == 2
    assert ended.err.count("\n") == 1
    assert said in ended.err


SAID = [
    line.packet
    for line in transcript.read(transcript.FOLDER / "capture_to_host.jsonl")
    if (line.sender, line.connection) == (transcript.HOST, transcript.COMMAND) and line.kind > 4
]
mutated = st.tuples(
    st.sampled_from(SAID), st.integers(0, 200), st.binary(min_size=1, max_size=4)
).map(lambda drawn: drawn[0][: drawn[1]] + drawn[2] + drawn[0][drawn[1] + len(drawn[2]) :])
well_framed = st.builds(packet, st.integers(0, 15), st.binary(max_size=40))
requests = st.builds(
    request,
    st.sampled_from([0x1001, 0x1002, 0x1003, 0x1009, 0x9107, 0x9110, 0x9116, 0x9125, 0x9128]),
    st.integers(0, 5),
    st.integers(0, 3) | st.integers(0, 0xFFFFFFFF),
    direction=st.sampled_from([1, 2]),
)


@given(
    st.booleans(),
    st.lists(st.sampled_from(SAID) | mutated | well_framed | requests, max_size=8),
    st.lists(well_framed | st.binary(max_size=20), max_size=3),
)
def test_whatever_a_host_says_the_next_one_is_served(
    introduced: bool, on_command: list[bytes], on_event: list[bytes]
) -> None:
    with closing(Bench()) as bench:
        lines = bench.let_in() if introduced else (bench.line(), bench.line())
        for line, said in zip(lines, (on_command, on_event), strict=True):
            line.say(b"".join(said))
        bench.clock.spend(1.0)
        for line in lines:
            line.hear()
            line.close()
        bench.work()
        command, _ = bench.let_in()
        assert codes(command.say(INFO[:-4] + bytes(4))) == [OK]
