"""Bytes and tables: what goes in comes out, and nothing a camera sends breaks more than a frame."""

import struct
from contextlib import suppress
from fractions import Fraction

import pytest
from hypothesis import example, given, settings, strategies as st

from labrig.drivers.ptp.containers import Container, Kind, command, decode, encode
from labrig.drivers.ptp.device_info import parse_device_info
from labrig.drivers.ptp.eos.codes import (
    F_NUMBERS,
    ISOS,
    aperture_code,
    iso_code,
    shutter_code,
    shutter_time_s,
    third_stop_codes,
)
from labrig.drivers.ptp.eos.events import (
    ChoicesChanged,
    Event,
    ObjectOffered,
    Other,
    ValueChanged,
    parse_events,
)
from labrig.foundation.errors import DeviceError

from .eos.bench import bench, photograph
from .usb.wire import Wire

quiet = settings(deadline=None, database=None, derandomize=True)
u32s = st.integers(0, 0xFFFFFFFF)
names = st.text(alphabet=st.characters(min_codepoint=33, max_codepoint=126), max_size=20)


def record(code: int, payload: bytes) -> bytes:
    return struct.pack("<II", 8 + len(payload), code) + payload


def written(event: Event) -> bytes:
    """An event as a camera writes it."""
    match event:
        case ValueChanged(prop, value):
            return record(0xC189, struct.pack("<I", prop) + value)
        case ChoicesChanged(prop, codes):
            head = struct.pack("<III", prop, 3, len(codes))
            return record(0xC18A, head + struct.pack(f"<{len(codes)}I", *codes))
        case ObjectOffered(handle, object_format, size, name):
            head = struct.pack("<5I", handle, object_format, 0, size, 0)
            return record(0xC186, head + name.encode() + b"\0")
        case Other(code, payload):
            return record(code, payload)


events = st.one_of(
    st.builds(ValueChanged, u32s, st.binary(max_size=40)),
    st.builds(ChoicesChanged, u32s, st.lists(u32s, max_size=60).map(tuple)),
    st.builds(
        ObjectOffered, u32s, st.integers(0, 0xFFFF).filter(lambda f: f != 0x3001), u32s, names
    ),
    st.builds(Other, st.integers(0xC190, 0xC1A5), st.binary(max_size=40)),
)


class TestContainers:
    @quiet
    @given(st.sampled_from(Kind), st.integers(0, 0xFFFF), u32s, st.lists(u32s, max_size=5))
    def test_round_trip(self, kind: Kind, code: int, tid: int, params: list[int]) -> None:
        payload = struct.pack(f"<{len(params)}I", *params)
        container = Container(kind, code, tid, payload)
        assert decode(encode(container)) == container
        assert container.params == (() if kind is Kind.DATA else tuple(params))

    @quiet
    @given(u32s, st.binary(max_size=2000))
    def test_data_round_trip(self, tid: int, data: bytes) -> None:
        container = Container(Kind.DATA, 0x9107, tid, data)
        assert decode(encode(container)) == container

    def test_command_as_the_standard_writes_it(self) -> None:
        open_session = bytes.fromhex("10000000 0100 0210 00000000 01000000")
        assert encode(command(0x1002, 0, (1,))) == open_session

    @quiet
    @given(st.binary(max_size=64))
    def test_anything_is_a_container_or_a_device_error(self, data: bytes) -> None:
        with suppress(DeviceError):
            assert encode(decode(data)) == data

    @pytest.mark.parametrize(
        "wrong",
        [
            "",
            "0b000000 0300 0120 000000",  # shorter than a header
            "0c000000 0500 0120 00000000",  # no such kind
            "0d000000 0300 0120 00000000 00",  # half a parameter
            "24000000 0300 0120 00000000" + "00" * 24,  # six parameters
            "10000000 0300 0120 00000000",  # cut short
            "0c000000 0300 0120 00000000 00",  # goes on
        ],
    )
    def test_strict(self, wrong: str) -> None:
        with pytest.raises(DeviceError, match="expected"):
            decode(bytes.fromhex(wrong))


class TestEvents:
    @quiet
    @given(st.lists(events, max_size=20), st.booleans(), st.binary(max_size=10))
    def test_round_trip(self, told: list[Event], ended: bool, rest: bytes) -> None:
        data = b"".join(map(written, told))
        if ended:
            data += record(0, b"") + rest
        assert parse_events(data) == tuple(told)

    def test_files_in_every_layout(self) -> None:
        offered = ObjectOffered(0x91000001, 0xB103, 25_000_000, "IMG_0001.CR2")
        name, size = b"IMG_0001.CR2\0\0\0\0", 25_000_000
        added = struct.pack("<8I", 0x91000001, 0x10001, 0xB103, 0, 0, size, 0, 0) + name
        added_64 = struct.pack("<9I", 0x91000001, 0x10001, 0xB103, 0, 0, size, 0, 0, 0) + name
        requested = struct.pack("<5I", 0x91000001, 0xB103, 0, size, 0) + name
        layouts = {0xC181: added, 0xC1A7: added_64, 0xC186: requested, 0xC1A9: requested}
        for code, payload in layouts.items():
            assert parse_events(record(code, payload)) == (offered,)

    def test_new_folders_and_strange_lists_are_no_news(self) -> None:
        folder = struct.pack("<8I", 0x91000001, 0x10001, 0x3001, 0, 0, 0, 0, 0) + b"100CANON\0"
        texts = struct.pack("<III", 0xD1D0, 7, 2) + b"text"
        data = record(0xC181, folder) + record(0xC18A, texts)
        assert parse_events(data) == (Other(0xC181, folder), Other(0xC18A, texts))

    @pytest.mark.parametrize(
        "wrong",
        [
            b"\x08",
            struct.pack("<II", 7, 0xC189),
            struct.pack("<II", 100, 0xC189),
            record(0xC189, b"\x01"),
            record(0xC18A, struct.pack("<III", 0xD102, 3, 2) + b"\x68\0\0\0"),
            record(0xC18A, struct.pack("<III", 0xD102, 3, 0xFFFFFFFF)),
            record(0xC186, bytes(10)),
        ],
    )
    def test_strict(self, wrong: bytes) -> None:
        with pytest.raises(DeviceError, match="camera"):
            parse_events(wrong)

    @quiet
    @given(st.lists(events, max_size=4), st.data())
    def test_damage_is_an_event_list_or_a_device_error(
        self, told: list[Event], data: st.DataObject
    ) -> None:
        raw = bytearray(b"".join(map(written, told)) + record(0, b""))
        at = data.draw(st.integers(0, len(raw) - 1))
        raw[at] = data.draw(st.integers(0, 255))
        with suppress(DeviceError):
            parse_events(bytes(raw[: data.draw(st.integers(0, len(raw)))]))


def test_a_camera_that_babbles_costs_neither_time_nor_memory() -> None:
    b = bench()
    camera = b.connect()
    many = (written(ValueChanged(prop, b"x" * 40)) for prop in range(0x20000, 0x22000))
    b.toy.events.append(b"".join(many))
    assert camera.capabilities().isos
    files = (written(ObjectOffered(n, 0xB103, 1000, f"{n}.CR2")) for n in range(5_000))
    b.toy.events.append(b"".join(files))
    with pytest.raises(DeviceError, match="at most 1000 frames in the camera, it offers 5000"):
        photograph(camera)
    photograph(camera)


def test_no_file_is_as_large_as_that() -> None:
    b = bench()
    b.toy.announced_extra_bytes = 1 << 31
    with pytest.raises(DeviceError, match=r"at most 536870912 bytes, the camera announces 21474"):
        photograph(b.connect())


@quiet
@given(st.binary(max_size=300))
def test_any_device_info_is_one_line_or_a_device_error(data: bytes) -> None:
    with suppress(DeviceError):
        assert "\n" not in str(parse_device_info(data))


class TestTables:
    def test_shutter_times_are_exact_powers_of_two(self) -> None:
        stops = {0: Fraction(0), 3: Fraction(1, 3), 4: Fraction(1, 2), 5: Fraction(2, 3)}
        for code in range(0x100):
            known = 0x10 <= code <= 0xA0 and code % 8 in stops
            expected = 2.0 ** -float(code // 8 - 7 + stops[code % 8]) if known else None
            assert shutter_time_s(code) == expected

    @pytest.mark.parametrize(
        ("code", "time_s", "label_s"),
        [
            (0x10, 32, 30),
            (0x38, 1, 1),
            (0x68, 1 / 64, 1 / 60),
            (0x70, 1 / 128, 1 / 125),
            (0xA0, 1 / 8192, 1 / 8000),
            (0x13, 2 ** (14 / 3), 25),
            (0x14, 2**4.5, 20 * 1.1),
            (0x1D, 2 ** (10 / 3), 10),
            (0x1B, 2 ** (11 / 3), 13),
        ],
    )
    def test_known_shutter_codes(self, code: int, time_s: float, label_s: float) -> None:
        assert shutter_time_s(code) == pytest.approx(time_s, rel=1e-12)
        assert shutter_code(label_s, range(0x100)) == code

    def test_every_shutter_time_finds_its_code(self) -> None:
        for code in range(0x100):
            if (time_s := shutter_time_s(code)) is not None:
                assert shutter_code(time_s, range(0x100)) == code
        assert shutter_code(1.0, ()) is None
        assert shutter_code(64.0, range(0x100)) is None
        assert len(third_stop_codes()) == 3 * 18 + 1

    def test_labels_find_their_codes(self) -> None:
        for code, label in F_NUMBERS.items():
            found = aperture_code(label, F_NUMBERS)
            assert found is not None
            assert F_NUMBERS[found] == label
            assert aperture_code(label, [code]) == code
            true = 2 ** ((code - 8) / 16) if code % 8 == 0 else label
            assert label == pytest.approx(true, rel=0.03)
        for code, iso in ISOS.items():
            assert iso_code(iso, ISOS) == code
        assert aperture_code(5.3, F_NUMBERS) is None
        assert iso_code(111, ISOS) is None


class DamagingWire(Wire):
    """Turns one byte of one transfer to the PC into another, or cuts it off there."""

    damaged_transfer = -1
    position = 0
    byte: int | None = 0

    def send(self, transfer: bytes) -> None:
        self.damaged_transfer -= 1
        if self.damaged_transfer == 0:
            at = self.position % len(transfer)
            new = b"" if self.byte is None else bytes([self.byte]) + transfer[at + 1 :]
            transfer = transfer[:at] + new
        super().send(transfer)


@settings(quiet, max_examples=40)
@given(
    transfer=st.integers(1, 60),
    position=st.one_of(st.integers(0, 13), st.integers(0, 4000)),
    byte=st.one_of(st.none(), st.integers(0, 255)),
)
@example(transfer=48, position=6, byte=0)  # half press taken, answered with another code than OK
def test_damage_anywhere_is_survived(transfer: int, position: int, byte: int | None) -> None:
    b = bench()
    wire = DamagingWire(b.toy, b.wire.clock)
    wire.damaged_transfer, wire.position, wire.byte = transfer, position, byte
    b = type(b)(b.toy, wire)
    try:
        camera = b.connect()
    except DeviceError:
        return
    with suppress(DeviceError):
        photograph(camera)
    with suppress(DeviceError):
        camera.make_safe()
    camera.make_safe()
    assert not b.toy.buttons
    camera.disconnect()
    assert not wire.claimed
