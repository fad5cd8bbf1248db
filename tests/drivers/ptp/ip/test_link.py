"""The driver's side of PTP/IP: byte by byte, with cameras that misbehave, on real sockets."""

import socket
import struct
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import CAMERA, ExposureSettings, read_rig_file
from labrig.bench import open_bench
from labrig.drivers.ptp.codes import Standard
from labrig.drivers.ptp.containers import Container, Kind, command
from labrig.drivers.ptp.failures import MalformedError, NoAnswerError, UnpluggedError
from labrig.drivers.ptp.ip import link as ip_link
from labrig.drivers.ptp.ip.packets import PacketKind, encode
from labrig.drivers.ptp.session import Session, Timeouts
from labrig.foundation.clock import SystemClock
from labrig.foundation.errors import DeviceError, DeviceLostError, UsageError
from tests.counterparts import transcript
from tests.counterparts.served import STANDARD, Film, Taken, served

from .wire import ACK, saying

SOON_S = 0.02
#: How a message shows bytes.
SHOWN = r"got (nothing|([0-9]+ bytes )?'[0-9a-f ]+( …)?')"
OK, CANCELLED = 0x2001, 0x201F


def response(code: int, transaction_id: int, *params: int) -> bytes:
    payload = struct.pack(f"<HI{len(params)}I", code, transaction_id, *params)
    return encode(PacketKind.OPERATION_RESPONSE, payload)


def data(transaction_id: int, announced: int, *pieces: bytes) -> bytes:
    head = struct.pack("<I", transaction_id)
    start = encode(PacketKind.START_DATA, head + struct.pack("<Q", announced))
    between = b"".join(encode(PacketKind.DATA, head + piece) for piece in pieces[:-1])
    return start + between + encode(PacketKind.END_DATA, head + pieces[-1])


@pytest.fixture(autouse=True)
def permitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """The user consented to the network: `tests/test_consent.py` has those who did not."""
    monkeypatch.setattr("labrig.consent.has_consent", lambda sentence: True)


@pytest.fixture
def rig(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a rig with one camera at an address."""

    def write(address: str) -> Path:
        path = tmp_path / "rig.yaml"
        path.write_text(
            f"name: x\ndevices:\n  camera: {{driver: ptp_camera, address: '{address}'}}\n"
        )
        return path

    return write


def test_what_is_reported_first() -> None:
    with saying() as camera:
        camera.link()
        on_command, on_event = camera.heard()
    name = b"l\0a\0b\0r\0i\0g\0\0\0"
    assert on_command == bytes.fromhex("2a00000001000000") + ip_link.GUID + name + b"\0\0\1\0"
    assert on_event.hex() == "0c0000000300000001000000"


def test_events_come_while_waiting_for_them_and_while_waiting_for_an_answer() -> None:
    added = encode(PacketKind.EVENT, struct.pack("<HII", 0x4002, 7, 0x12))
    over = encode(PacketKind.EVENT, struct.pack("<HI", 0x400D, 7))
    with saying(response(OK, 3), added + encode(PacketKind.PING) + over) as camera:
        link = camera.link()
        link.send(command(0x100E, 3, ()), None, "x")
        assert link.receive("x", SOON_S, 0).code == OK
        first, second = link.event(SOON_S), link.event(SOON_S)
        assert link.event(SOON_S) is None
        camera.ends[1].sendall(added)
        assert link.event(SOON_S) == first == Container(Kind.EVENT, 0x4002, 7, b"\x12\0\0\0")
        assert second == Container(Kind.EVENT, 0x400D, 7)
        camera.ends[1].sendall(encode(PacketKind.EVENT, b"abc"))
        with pytest.raises(MalformedError, match="61 62 63"):
            link.event(SOON_S)
        camera.hang_up()
        with pytest.raises(UnpluggedError):
            link.event(SOON_S)


def test_a_request_with_and_without_data() -> None:
    with saying() as camera:
        link = camera.link()
        camera.heard()
        link.send(command(0x1002, 0, (1,)), None, "x")
        assert camera.heard()[0].hex() == "16000000060000000100000002100000000001000000"
        link.send(command(0x9110, 7, ()), b"abc", "x")
        assert camera.heard()[0].hex() == (
            "1200000006000000" "02000000" "1091" "07000000"
            "1400000009000000" "07000000" "0300000000000000"
            "0f0000000c000000" "07000000" "616263"
        )  # fmt: skip


@pytest.mark.parametrize("announced", [6, 0xFFFFFFFFFFFFFFFF])
def test_data_in_pieces_then_the_response(announced: int) -> None:
    said = data(3, announced, b"ab", b"cd", b"ef") + response(OK, 3, 5, 6)
    with saying(said) as camera:
        link = camera.link()
        link.send(command(0x9107, 3, ()), None, "x")
        assert link.receive("x", SOON_S, 6) == Container(Kind.DATA, 0x9107, 3, b"abcdef")
        answer = link.receive("x", SOON_S, 6)
    assert (answer.kind, answer.code, answer.params) == (Kind.RESPONSE, OK, (5, 6))


@pytest.mark.parametrize(
    "said",
    [
        data(3, 7, b"more than allowed"),
        data(3, 5, b"few"),
        data(3, 3, b"many"),
        data(3, 0xFFFFFFFFFFFFFFFF, b"more than allowed"),
        data(3, 4, b"", b"abcd"),
        data(3, 4, b"ab")[:-6] + struct.pack("<I", 4) + b"ab",
        encode(PacketKind.START_DATA, b"abc"),
        encode(PacketKind.START_DATA, bytes(12)) + response(OK, 0),
        encode(PacketKind.OPERATION_RESPONSE, b"abc"),
        encode(PacketKind.OPERATION_RESPONSE, bytes(7)),
        encode(PacketKind.OPERATION_RESPONSE, bytes(30)),
        encode(PacketKind.END_DATA, bytes(4)),
        struct.pack("<II", 7, 7),
        struct.pack("<II", 0xFFFFFFFF, 7),
        b"HTTP/1.1 400 Bad Request\r\n\r\n",
    ],
)
def test_what_is_out_of_order_is_one_line(said: bytes) -> None:
    with saying(said) as camera, pytest.raises(MalformedError, match=SHOWN) as caught:
        camera.link().receive("x", SOON_S, 6)
    assert "\n" not in str(caught.value)


def test_silence_and_hanging_up() -> None:
    with saying(response(OK, 3)[:-1]) as camera:
        link = camera.link()
        with pytest.raises(NoAnswerError, match=r"no answer within 0\.02 s, only '0e 00 00 00 07"):
            link.receive("x", SOON_S, 6)
        camera.hang_up()
        with pytest.raises(UnpluggedError, match="hung up"):
            link.receive("x", SOON_S, 6)
        with pytest.raises(UnpluggedError):
            link.send(command(0x1001, 4, ()), None, "x")


def test_a_camera_that_says_its_last_word_and_hangs_up_is_heard() -> None:
    with saying(response(OK, 3)) as camera:
        link = camera.link()
        camera.hang_up()
        assert link.receive("x", SOON_S, 6).transaction_id == 3


def test_the_cameras_questions_are_answered_and_its_events_passed_over() -> None:
    event = encode(PacketKind.EVENT, struct.pack("<HI", 0xC101, 0xFFFFFFFF))
    with saying(b"", event + encode(PacketKind.PING) + event) as camera:
        link = camera.link()
        with pytest.raises(NoAnswerError):
            link.receive("x", SOON_S, 6)
        assert camera.heard()[1].endswith(encode(PacketKind.PONG))


def test_cancelling_passes_over_what_is_left_up_to_the_response() -> None:
    left = data(3, 8, b"ab", b"cdefgh")
    with saying(left + response(CANCELLED, 3) + response(OK, 4)) as camera:
        link = camera.link()
        camera.heard()
        link.cancel(3)
        assert camera.heard() == [b"", encode(PacketKind.CANCEL, struct.pack("<I", 3))]
        assert link.receive("x", SOON_S, 6).transaction_id == 4


@pytest.mark.parametrize(
    ("ack", "said"),
    [
        (encode(PacketKind.INIT_FAIL, bytes([1, 0, 0, 0])), "allow 'labrig'"),
        (encode(PacketKind.INIT_FAIL, bytes([2, 0, 0, 0])), "another program uses it"),
        (encode(PacketKind.INIT_FAIL, bytes([9, 0, 0, 0])), "reason 9"),
        (encode(PacketKind.INIT_FAIL), "too short"),
        (encode(PacketKind.INIT_EVENT_ACK), "expected INIT_COMMAND_ACK"),
        (encode(PacketKind.INIT_COMMAND_ACK), "too short"),
        (b"SSH-2.0-OpenSSH_9.2\r\n", "check that the address is a camera's"),
        (ACK[:-1], "no answer"),
    ],
)
def test_who_does_not_let_us_in(ack: bytes, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ip_link, "INTRODUCTION_TIMEOUT_S", SOON_S)
    with saying(ack=ack) as camera, pytest.raises(DeviceError, match=said) as caught:
        camera.link()
    assert "\n" not in str(caught.value)


def test_pictures_over_the_loopback_network(rig: Callable[[str], Path]) -> None:
    film = Film(size=2_628_910)
    settings = ExposureSettings(1 / 64, 400, 4.0)
    with served(film) as server:
        path = rig(server.address)
        with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as devices:
            camera = devices[CAMERA]
            assert "5D Mark II" in camera.identity()
            for _ in range(2):
                assert camera.configure(settings) == settings
                camera.arm()
                frame = camera.shoot()
                assert frame.data == film.delivered[-1]
                assert frame.suffix == ".dng"
    assert film.taken == [Taken(1 / 64, 400, 4.0)] * 2


def test_a_broken_connection_is_mended_on_the_way_to_the_safe_state(
    rig: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    # What the simulated camera has left over comes at once.
    monkeypatch.setattr("labrig.drivers.ptp.eos.frames.LEFT_OVER_S", 0.1)
    film = Film()
    settings = ExposureSettings(1 / 64, 400, 4.0)
    with served(film) as server:
        path = rig(server.address)
        with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as devices:
            devices[CAMERA].configure(settings)
            assert server._host is not None
            server._host.command._socket.shutdown(socket.SHUT_RDWR)
            with pytest.raises(DeviceError, match="it is gone") as caught:
                devices[CAMERA].configure(ExposureSettings(1 / 8, 400, 4.0))
            assert "\n" not in str(caught.value)
            devices.make_safe()
            devices[CAMERA].configure(settings)
            assert devices[CAMERA].shoot().data == film.delivered[-1]


def test_a_camera_that_knows_the_standard_only_photographs(rig: Callable[[str], Path]) -> None:
    film = Film(size=300_000)
    settings = ExposureSettings(1 / 8, 400, 4.0)
    with served(film, body=STANDARD) as server:
        path = rig(server.address)
        with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as devices:
            for _ in range(2):
                assert devices[CAMERA].configure(settings) == settings
                frame = devices[CAMERA].shoot()
                assert frame.data == film.delivered[-1]
                assert frame.settings == settings
    assert film.taken == [Taken(1 / 8, 400, 4.0)] * 2


def test_a_camera_that_is_switched_off_is_one_line(rig: Callable[[str], Path]) -> None:
    settings = ExposureSettings(1 / 8, 400, 4.0)

    def session() -> None:
        with ExitStack() as power:
            path = rig(power.enter_context(served(Film())).address)
            with open_bench(read_rig_file(path), str(path)) as bench, bench.devices() as devices:
                power.close()
                devices[CAMERA].configure(settings)

    with pytest.raises(DeviceLostError) as caught:
        session()
    assert "\n" not in str(caught.value)


def test_one_program_after_another_not_two_at_once(rig: Callable[[str], Path]) -> None:
    with served(Film()) as server:
        path = rig(server.address)
        file = read_rig_file(path)
        host, port = server.address.removeprefix("ptpip://").split(":")

        def dial() -> socket.socket:
            return socket.create_connection((host, int(port)))

        for _ in range(2):
            with open_bench(file, str(path)) as bench, bench.devices():
                with pytest.raises(UsageError, match="held by another labrig"):  # noqa: SIM117
                    with open_bench(file, str(path)) as second, second.devices():
                        pass
                # a program that knows nothing of labrig's locks
                with pytest.raises(DeviceError, match="another program uses it"):
                    ip_link.IpLink(dial, server.address, SystemClock())


def test_nobody_listens(rig: Callable[[str], Path]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    path = rig(f"ptpip://127.0.0.1:{port}")
    with (
        open_bench(read_rig_file(path), str(path)) as bench,
        pytest.raises(DeviceError, match="nobody answers"),
        bench.devices(),
    ):
        pass


@pytest.mark.parametrize(
    "address", ["ptpip://", "ptpip://:15740", "ptpip://host:port", "ptpip://h:99999", "ptpip://h/x"]
)
def test_what_is_no_network_address(rig: Callable[[str], Path], address: str) -> None:
    path = rig(address)
    with (
        open_bench(read_rig_file(path), str(path)) as bench,
        pytest.raises(UsageError, match="no network address"),
        bench.devices(),
    ):
        pass


def test_a_reset_hangs_up_and_dials_again() -> None:
    with served(Film()) as server:
        clock = SystemClock()
        link = ip_link.IpLink(
            lambda: socket.create_connection(("127.0.0.1", server.port), 5.0), "x", clock
        )
        session = Session(link, clock)
        session.open()
        session.transact(Standard.GetDeviceInfo)
        session.start_over()
        assert session.transact(Standard.GetDeviceInfo).data
        link.close()


ANSWERS = b"".join(
    line.packet
    for line in transcript.read(transcript.FOLDER / "connect.jsonl")
    if line.sender == transcript.CAMERA and line.connection == transcript.COMMAND and line.kind > 4
)
IN_A_HURRY = Timeouts(answer_s=0.005, busy_s=0.0)


@given(
    st.lists(st.tuples(st.integers(0, len(ANSWERS) - 1), st.integers(0, 255)), max_size=4),
    st.integers(0, len(ANSWERS)),
    st.binary(max_size=40),
)
def test_mutated_answers_are_device_errors_and_never_hang(
    changes: list[tuple[int, int]], cut: int, tail: bytes
) -> None:
    said = bytearray(ANSWERS)
    for at, byte in changes:
        said[at] = byte
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ip_link, "INTRODUCTION_TIMEOUT_S", 0.005)
        patch.setattr(ip_link, "CANCEL_TIMEOUT_S", 0.005)
        with saying(bytes(said[:cut]) + tail, tail) as camera:
            try:
                session = Session(camera.link(), SystemClock())
                for operation in (0x1001, 0x1002, 0x1001, 0x9114, 0x9115, 0x9116, 0x9116):
                    named = Standard(operation) if operation < 0x9000 else Standard.GetDeviceInfo
                    session.transact(named, timeouts=IN_A_HURRY)
            except DeviceError as error:
                assert "\n" not in str(error)
