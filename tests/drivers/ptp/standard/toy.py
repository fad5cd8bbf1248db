"""A toy camera of the PTP standard, behind no wire at all: reports and keeps what a test says."""

import struct
from collections import deque
from dataclasses import dataclass, field

from labrig.drivers.ptp.containers import Container, Kind
from labrig.drivers.ptp.device_info import parse_device_info
from labrig.drivers.ptp.session import Session
from labrig.drivers.ptp.settings import PtpCameraSettings
from labrig.drivers.ptp.standard.camera import StandardCamera
from labrig.foundation.clock import VirtualClock

OK, NO_SUCH_OBJECT, STORE_IS_FULL, PROTECTED = 0x2001, 0x2009, 0x200C, 0x200D
ADDED, STORE_FULL, DEVICE_INFO_CHANGED, COMPLETE = 0x4002, 0x400A, 0x4008, 0x400D
RAW, JPEG, FOLDER = 0x3000, 0x3801, 0x3001
OPERATIONS = frozenset(range(0x1001, 0x1017)) | {0x101B}
DAY = "20260101T0900"


@dataclass(frozen=True)
class File:
    """A file on a card; `data` may be another length than announced."""

    name: str
    data: bytes = b"raw"
    object_format: int = RAW
    captured: str = DAY + "00"
    storage: int = 0x00010001
    announced_bytes: int | None = None

    def info(self) -> bytes:
        size = len(self.data) if self.announced_bytes is None else self.announced_bytes
        head = struct.pack("<IHHI", self.storage, self.object_format, 0, size)
        return head + bytes(26 + 14) + _text(self.name) + _text(self.captured) + _text("") * 2


@dataclass
class ToyStandard:
    """A `Link`; every capture does what `captures` says next: (seconds later, file or event).

    Its card is full when nothing is left there.
    """

    clock: VirtualClock = field(default_factory=VirtualClock)
    captures: deque[list[tuple[float, File | int]]] = field(default_factory=deque)
    files: dict[int, File] = field(default_factory=dict)
    answers_after_s: float = 0.0
    properties: dict[int, tuple[int, int]] = field(
        default_factory=lambda: {0x500D: (6, 10_000), 0x500F: (4, 400)}
    )
    #: To what properties can be set; one in `stubborn` stays as it is.
    choices: dict[int, tuple[int, ...]] = field(default_factory=dict)
    stubborn: frozenset[int] = frozenset()
    refuses_to_delete: bool = False
    operations: frozenset[int] = OPERATIONS
    reports: frozenset[int] = frozenset({ADDED, COMPLETE})
    formats: frozenset[int] = frozenset({RAW})

    def __post_init__(self) -> None:
        self.log: list[tuple[int, ...]] = []
        self.events: list[tuple[float, int, int | None]] = []
        self._handle = 0
        self._answers: deque[Container] = deque()

    def info(self) -> bytes:
        """DeviceInfo."""
        lists = (self.operations, self.reports, frozenset(self.properties), self.formats, ())
        arrays = (struct.pack(f"<I{len(codes)}H", len(codes), *codes) for codes in lists)
        names = (_text(name) for name in ("toy", "camera", "1", "1"))
        return struct.pack("<HIHBH", 100, 0, 0, 0, 0) + b"".join((*arrays, *names))

    def report(self, delay_s: float, what: File | int) -> None:
        """A file appears, or an event comes, so much later."""
        handle = None
        if isinstance(what, File):
            self._handle += 1
            handle = self._handle
            self.files[handle] = what
        code = ADDED if isinstance(what, File) else what
        self.events.append((self.clock.now() + delay_s, code, handle))
        self.events.sort(key=lambda event: event[0])

    def send(self, request: Container, data: bytes | None, doing: str) -> None:
        self.log.append((request.code, *request.params))
        code, answer = self._do(request.code, request.params, data)
        if answer is not None:
            tid = request.transaction_id
            self._answers.append(Container(Kind.DATA, request.code, tid, answer))
        self._answers.append(Container(Kind.RESPONSE, code, request.transaction_id))

    def receive(self, doing: str, timeout_s: float, at_most_bytes: int) -> Container:
        return self._answers.popleft()

    def event(self, timeout_s: float) -> Container | None:
        if not self.events or self.events[0][0] > self.clock.now() + timeout_s:
            self.clock.spend(timeout_s)
            return None
        due_s, code, handle = self.events.pop(0)
        self.clock.spend(max(0.0, due_s - self.clock.now()))
        params = b"" if handle is None else struct.pack("<I", handle)
        return Container(Kind.EVENT, code, 0xFFFFFFFF, params)

    def cancel(self, transaction_id: int) -> None:
        self._answers.clear()

    def reset(self) -> None:
        self._answers.clear()

    def close(self) -> None:
        pass

    def _do(
        self, code: int, params: tuple[int, ...], data: bytes | None
    ) -> tuple[int, bytes | None]:
        match code, params:
            case 0x1001, ():
                return OK, self.info()
            case 0x100E, _ if not self.captures:
                return STORE_IS_FULL, None
            case 0x100E, _:
                for delay_s, what in self.captures.popleft():
                    self.report(delay_s, what)
                self.clock.spend(self.answers_after_s)
                return OK, None
            case 0x1014, (prop,):
                return OK, self._described(prop)
            case 0x1015, (prop,):
                return OK, self._packed(prop, self.properties[prop][1])
            case 0x1016, (prop,) if data is not None:
                if prop not in self.stubborn:
                    data_type, _ = self.properties[prop]
                    self.properties[prop] = (data_type, int.from_bytes(data, "little"))
                return OK, None
            case ((0x1008 | 0x1009 | 0x100B | 0x101B), (handle, *_)) if handle not in self.files:
                return NO_SUCH_OBJECT, None
            case 0x1008, (handle,):
                return OK, self.files[handle].info()
            case 0x1009, (handle,):
                return OK, self.files[handle].data
            case 0x101B, (handle, offset, size):
                return OK, self.files[handle].data[offset : offset + size]
            case 0x100B, (handle, 0) if not self.refuses_to_delete:
                del self.files[handle]
                return OK, None
            case 0x100B, _:
                return PROTECTED, None
        raise AssertionError(f"0x{code:04X} is nothing that this toy knows")

    def _described(self, prop: int) -> bytes:
        data_type, value = self.properties[prop]
        choices = self.choices.get(prop, ())
        head = struct.pack("<HHB", prop, data_type, int(bool(choices)))
        form = struct.pack("<BH", 2, len(choices)) if choices else b"\0"
        return head + self._packed(prop, value, value) + form + self._packed(prop, *choices)

    def _packed(self, prop: int, *values: int) -> bytes:
        letter = {2: "B", 4: "H", 6: "I"}[self.properties[prop][0]]
        return struct.pack(f"<{len(values)}{letter}", *values)


def connect(toy: ToyStandard, **rig: object) -> StandardCamera:
    """The driver's side; rig file keys as they are written there."""
    info = parse_device_info(toy.info())
    settings = PtpCameraSettings.model_validate(rig)
    camera = StandardCamera(Session(toy, toy.clock), toy.clock, info, settings)
    camera.take_control()
    return camera


def _text(text: str) -> bytes:
    encoded = (text + "\0").encode("utf-16-le") if text else b""
    return bytes([len(encoded) // 2]) + encoded
