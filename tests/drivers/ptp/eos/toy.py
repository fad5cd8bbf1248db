"""A toy EOS on the wire: enough of a camera to fail in every way that the driver must survive."""

import math
import struct
from collections import defaultdict
from enum import Enum, auto

from ..usb.wire import PACKET, Wire

OK, GENERAL_ERROR, NO_SUCH_OBJECT, BUSY = 0x2001, 0x2002, 0x2009, 0x2019
ALREADY_OPEN, CANCELLED = 0x201E, 0x201F
OPERATIONS = (
    0x1001, 0x1002, 0x1003, 0x9107, 0x9110, 0x9114, 0x9115, 0x9116, 0x9117, 0x911A, 0x911D,
    0x9128, 0x9129,
)  # fmt: skip
HALF, FULL, OFF_HALF, OFF_FULL = (0x9128, 1), (0x9128, 2), (0x9129, 1), (0x9129, 2)
RAW, JPEG = struct.pack("<5I", 1, 16, 6, 0, 4), struct.pack("<5I", 1, 16, 1, 0, 3)
BULB = 0x0C
DEVELOPING_S = 0.3

Key = tuple[int, ...]


class Fault(Enum):
    """What goes wrong with one transaction."""

    BUSY = auto()
    REFUSED = auto()
    STALLED = auto()
    #: Done, but not answered.
    SILENT = auto()
    #: Answered with bytes that are no container.
    GARBAGE = auto()
    #: Answered after left-overs of an earlier transaction.
    LATE_LEFTOVER = auto()
    UNPLUGGED = auto()


class ToyEos:
    """The camera's side of the wire. Asserts that the driver keeps to the protocol."""

    def __init__(self, operations: tuple[int, ...] = OPERATIONS) -> None:
        self.operations = operations
        self.model = "Canon EOS Toy"
        self.faults: defaultdict[Key, list[Fault]] = defaultdict(list)
        self.log: list[Key] = []
        self.values = {
            0xD101: u32(0x28), 0xD102: u32(0x70), 0xD103: u32(0x48), 0xD105: u32(3),
            0xD106: u32(1), 0xD11B: u32(5000), 0xD11C: u32(2), 0xD120: JPEG, 0xD1B0: u32(2),
        }  # fmt: skip
        self.lists: dict[int, tuple[int, ...]] = {
            0xD101: (0x28, 0x30),
            0xD102: (0x0C, 0x10, 0x38, 0x68, 0x70),
            0xD103: (0x00, 0x48, 0x50, 0x78),
        }
        self.stubborn: set[int] = set()
        self.reports_changes_only = False
        self.session_open = False
        self.next_id = 0
        self.buttons: set[int] = set()
        self.exposures = 0
        self.exposing_until_s = -1.0
        self.frame_bytes = 3000
        self.announced_extra_bytes = 0
        self.cards = [0x00010001]
        self.name = b"IMG_0001.CR2"
        self.never_delivers = False
        self.refuses_idle_let_go = False
        self.release_result = 0
        self.bulb_start_params: tuple[int, ...] = ()
        self.stored: dict[int, bytes] = {}
        self.events: list[bytes] = []
        self.status = OK
        self._developing: list[float] = []
        self._command: tuple[Key, int] | None = None
        self._unsent_data = b""

    @property
    def at_bulb(self) -> bool:
        """Whether the shutter is open until it is told to close."""
        return self.exposing_until_s == math.inf

    @property
    def is_idle(self) -> bool:
        """Nobody holds button or shutter, nothing is announced that could be fetched now."""
        return not self.buttons and not self.stored and not self.at_bulb

    def frame(self, number: int) -> bytes:
        """The bytes of the nth frame since power-on."""
        return (b"frame %06d " % number * (self.frame_bytes // 12 + 1))[: self.frame_bytes]

    # the wire

    def written(self, wire: Wire, data: bytes) -> None:
        length, kind, code, tid = struct.unpack_from("<IHHI", data)
        assert length == len(data)
        if kind == 1:
            assert self._command is None, "a command within a transaction"
            params = struct.unpack_from(f"<{(length - 12) // 4}I", data, 12)
            assert tid == (0 if code == 0x1002 else self.next_id)
            self.next_id = tid + 1
            self._command = ((code, *params), tid)
            self.log.append((code, *params))
            if code == 0x9110:  # data will follow
                if self.faults[(code,)][:1] == [Fault.STALLED]:
                    self.faults[(code,)].pop(0)
                    self._stall(wire)
                return
            self._answer(wire, b"")
        else:
            assert kind == 2
            assert self._command is not None
            assert self._command == ((code,), tid)
            self._answer(wire, data[12:])

    def control(self, wire: Wire, request: int, data: bytes) -> bytes:
        if request == 0x64:
            assert struct.unpack("<HI", data)[0] == 0x4001
            self._abort(wire)
        elif request == 0x66:
            self._abort(wire)
            self.session_open = False
            self.buttons.clear()
            if self.at_bulb:
                self._end_bulb(wire.clock.now())
        else:
            assert request == 0x67
            if self.status == CANCELLED and not wire.halted:
                self.status = OK
            return struct.pack("<HH", 4, self.status)
        return b""

    def _abort(self, wire: Wire) -> None:
        self._command = None
        wire.to_host.clear()

    def _stall(self, wire: Wire) -> None:
        self._command = None
        self.status = CANCELLED
        wire.halted = True

    def _fault(self, key: Key) -> Fault | None:
        waiting = self.faults[key[:2] if key[0] in (0x9128, 0x9129) else key[:1]]
        return waiting.pop(0) if waiting else None

    def _answer(self, wire: Wire, incoming: bytes) -> None:
        assert self._command is not None
        key, tid = self._command
        fault = self._fault(key)
        if fault is Fault.STALLED:
            self._stall(wire)
            return
        if fault is Fault.UNPLUGGED:
            wire.unplugged = True
            return
        answer: tuple[int, tuple[int, ...], bytes | None]
        if fault is Fault.BUSY or fault is Fault.REFUSED:
            answer = (BUSY if fault is Fault.BUSY else GENERAL_ERROR), (), None
        else:
            answer = self._do(wire, key, incoming)
        code, params, data = answer
        if fault is Fault.SILENT:
            if data:  # half of the data came
                whole = (12 + len(data)) // 2 // PACKET * PACKET
                wire.to_host.append(_container(2, key[0], tid, data)[: max(whole, 0)] or b"")
            return
        self._command = None
        if fault is Fault.GARBAGE:
            wire.send(b"\xee" * 700)
            return
        if fault is Fault.LATE_LEFTOVER:
            wire.send(_container(2, 0x9107, tid ^ 0x4000, b"x" * 2000))
            wire.send(_container(3, OK, tid ^ 0x4000, b""))
            wire.send(_container(4, 0xC101, 0, b""))
        if data is not None:
            wire.send(_container(2, key[0], tid, data))
        wire.send(_container(3, code, tid, struct.pack(f"<{len(params)}I", *params)))

    # the camera

    def _do(
        self, wire: Wire, key: Key, incoming: bytes
    ) -> tuple[int, tuple[int, ...], bytes | None]:
        now_s = wire.clock.now()
        operation, params = key[0], key[1:]
        if operation == 0x1002:
            if self.session_open:
                return ALREADY_OPEN, (), None
            self.session_open = True
            return OK, (), None
        assert self.session_open
        if operation == 0x1004:
            return OK, (), struct.pack(f"<I{len(self.cards)}I", len(self.cards), *self.cards)
        assert operation in self.operations
        data: bytes | None = None
        result: tuple[int, ...] = ()
        if operation == 0x1001:
            data = self._device_info()
        elif operation == 0x1003:
            self.session_open = False
        elif operation == 0x9115 and params == (1,):
            self.events = [_value(p, v) for p, v in self.values.items()]
            self.events += [choices_changed(p, codes) for p, codes in self.lists.items()]
        elif operation == 0x9116:
            data = self._take_events(now_s)
        elif operation == 0x9110:
            size, prop = struct.unpack_from("<II", incoming)
            assert size == len(incoming)
            if prop not in self.stubborn:
                is_news = self.values[prop] != incoming[8:]
                self.values[prop] = incoming[8:]
                if is_news or not self.reports_changes_only:
                    self.events.append(_value(prop, incoming[8:]))
        elif operation == 0x9127:
            self.events.append(_value(params[0], self.values[params[0]]))
        elif operation in (0x9107, 0x101B):
            data = self.stored[params[0]][params[1] : params[1] + params[2]]
        elif operation == 0x9104:
            data = self.stored[params[0]]
        elif operation == 0x9117:
            if self.stored.pop(params[0], None) is None:
                return NO_SUCH_OBJECT, (), None
        elif operation == 0x9128:
            if now_s < self.exposing_until_s:
                return BUSY, (), None
            self.buttons.add(params[0])
            if params[0] == 2:
                assert 1 in self.buttons
                self._expose(now_s)
        elif operation == 0x9129:
            if self.refuses_idle_let_go and params[0] not in self.buttons:
                return GENERAL_ERROR, (), None
            self.buttons.discard(params[0])
            if params[0] == 2 and self.at_bulb:
                self._end_bulb(now_s)
        elif operation == 0x9125:
            if self.values[0xD102] != u32(BULB):
                return GENERAL_ERROR, (), None
            if now_s < self.exposing_until_s:
                return BUSY, (), None
            self._expose(now_s)
            result = self.bulb_start_params
        elif operation == 0x9126:
            if not self.at_bulb:
                return GENERAL_ERROR, (), None
            self._end_bulb(now_s)
        elif operation == 0x910F:
            result = (self.release_result,)
            if not self.release_result:
                self._expose(now_s)
        return OK, result, data

    def _expose(self, now_s: float) -> None:
        (code,) = struct.unpack("<I", self.values[0xD102])
        self.exposures += 1
        self.exposing_until_s = math.inf if code == BULB else now_s + 2.0 ** -((code - 0x38) / 8)
        if not self.never_delivers and not self.at_bulb:
            self._developing.append(self.exposing_until_s + DEVELOPING_S)

    def _end_bulb(self, now_s: float) -> None:
        self.exposing_until_s = now_s
        self._developing.append(now_s + DEVELOPING_S)

    def offer(self, number: int) -> None:
        """Announce the nth frame."""
        handle = 0x91000000 + number
        self.stored[handle] = self.frame(number)
        size = self.frame_bytes + self.announced_extra_bytes
        image_format = 0x3801 if self.name.endswith(b"JPG") else 0xB103
        payload = struct.pack("<5I", handle, image_format, 0, size, 0) + self.name + b"\0"
        self.events.append(_record(0xC186, payload))

    def _take_events(self, now_s: float) -> bytes:
        while self._developing and self._developing[0] <= now_s:
            self._developing.pop(0)
            self.offer(self.exposures)
        taken, self.events = b"".join(self.events), []
        return taken + _record(0, b"")

    def _device_info(self) -> bytes:
        codes = struct.pack(f"<I{len(self.operations)}H", len(self.operations), *self.operations)
        texts = b"".join(map(_text, ("Canon Inc.", self.model, "3-1.0.7", "42")))
        head = struct.pack("<HIH", 100, 0xB, 200) + b"\0" + bytes(2)
        return head + codes + bytes(16) + texts


def u32(value: int) -> bytes:
    return struct.pack("<I", value)


def _container(kind: int, code: int, tid: int, payload: bytes) -> bytes:
    return struct.pack("<IHHI", 12 + len(payload), kind, code, tid) + payload


def _record(code: int, payload: bytes) -> bytes:
    return struct.pack("<II", 8 + len(payload), code) + payload


def _value(prop: int, value: bytes) -> bytes:
    return _record(0xC189, u32(prop) + value)


def choices_changed(prop: int, codes: tuple[int, ...]) -> bytes:
    return _record(0xC18A, struct.pack(f"<3I{len(codes)}I", prop, 3, len(codes), *codes))


def _text(text: str) -> bytes:
    return bytes([len(text) + 1]) + (text + "\0").encode("utf-16-le")
