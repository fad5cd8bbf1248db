"""A host that speaks PTP over pyusb by hand, a phase at a time; knows nothing of sim's encoders."""

import struct
from dataclasses import dataclass
from typing import Any

import usb.core

from labrig.foundation.clock import VirtualClock
from labrig.sim.camera import BodySettings, CameraFaults, SimulatedCamera, StandardHabits

IN, OUT, KNOCK = 0x81, 0x02, 0x83
PACKET = 512
HOST_DISK = (0x0FFFFFFF, 0x1000, 1)

AV, TV, ISO, DRIVE, SHOTS, DESTINATION = 0xD101, 0xD102, 0xD103, 0xD106, 0xD11B, 0xD11C
TO_CARD, TO_HOST = 2, 4
OK, BUSY = 0x2001, 0x2019


@dataclass(frozen=True)
class Taken:
    start_s: float
    exposure_s: float
    iso: int
    f_number: float
    asked_at_s: float


class Film:
    """A sensor that remembers how it was used."""

    def __init__(self, clock: VirtualClock, raw: bytes) -> None:
        self.clock = clock
        self.raw = raw
        self.taken: list[Taken] = []

    def photograph(self, start_s: float, exposure_s: float, iso: int, f_number: float) -> bytes:
        self.taken.append(Taken(start_s, exposure_s, iso, f_number, self.clock.now()))
        return self.raw


@dataclass(frozen=True)
class Answer:
    code: int
    params: tuple[int, ...]
    data: bytes | None


class Bench:
    """A clock, a camera on it, and one host at a time."""

    def __init__(
        self,
        raw: bytes = b"RAW" * 1000,
        seed: int = 1,
        faults: CameraFaults | None = None,
        body: BodySettings | None = None,
        habits: StandardHabits | None = None,
    ) -> None:
        self.clock = VirtualClock(epoch_s=1_767_225_600.0)
        self.film = Film(self.clock, raw)
        self.camera = SimulatedCamera(
            self.clock,
            self.film,
            serial="0123abcd",
            seed=seed,
            faults=faults or CameraFaults(),
            body=body or BodySettings(),
            habits=habits or StandardHabits(),
        )

    def host(self) -> "Host":
        return Host(self.clock, usb.core.find(backend=self.camera.backend))

    def ready(self, destination: int = TO_HOST) -> "Host":
        """A host in a session that has read the flood and is told of every file."""
        host = self.host()
        assert host.do(0x1002, 1, transaction_id=0).code == OK
        assert host.do(0x9114, 1).code == OK
        assert host.do(0x9115, 1).code == OK
        host.set(DESTINATION, destination)
        assert host.do(0x911A, *HOST_DISK).code == OK
        self.clock.spend(0.1)
        host.events()
        return host


class Host:
    """One pyusb device and the next transaction id."""

    def __init__(self, clock: VirtualClock, device: Any) -> None:
        self.clock = clock
        self.device = device
        self.transaction_id = 0

    def send(self, kind: int, code: int, payload: bytes, transaction_id: int) -> None:
        container = struct.pack("<IHHI", 12 + len(payload), kind, code, transaction_id) + payload
        self.device.write(OUT, container)
        if len(container) % PACKET == 0:
            self.device.write(OUT, b"")

    def command(self, code: int, *params: int, transaction_id: int | None = None) -> int:
        used = self.transaction_id if transaction_id is None else transaction_id
        self.transaction_id = used + 1
        self.send(1, code, struct.pack(f"<{len(params)}I", *params), used)
        return used

    def receive(self, chunk: int = 1 << 20) -> tuple[int, int, int, bytes]:
        """One container: kind, code, transaction id, payload."""
        received = b""
        while True:
            part = bytes(self.device.read(IN, chunk))
            received += part
            if len(part) < chunk:
                break
        length, kind, code, transaction_id = struct.unpack_from("<IHHI", received)
        assert length == len(received)
        return kind, code, transaction_id, received[12:]

    def answer(self, transaction_id: int, chunk: int = 1 << 20) -> Answer:
        data = None
        kind, code, used, payload = self.receive(chunk)
        if kind == 2:
            data = payload
            kind, code, used, payload = self.receive(chunk)
        assert (kind, used) == (3, transaction_id)
        return Answer(code, struct.unpack(f"<{len(payload) // 4}I", payload), data)

    def do(
        self,
        code: int,
        *params: int,
        data: bytes | None = None,
        transaction_id: int | None = None,
        chunk: int = 1 << 20,
    ) -> Answer:
        used = self.command(code, *params, transaction_id=transaction_id)
        if data is not None:
            self.send(2, code, data, used)
        return self.answer(used, chunk)

    def set(self, prop: int, value: int) -> Answer:
        return self.do(0x9110, data=struct.pack("<III", 12, prop, value))

    def events(self) -> list[tuple[int, bytes]]:
        """Code and payload of every record that is due."""
        answer = self.do(0x9116)
        assert answer.code == OK
        assert answer.data is not None
        records: list[tuple[int, bytes]] = []
        rest = answer.data
        while rest:
            size, code = struct.unpack_from("<II", rest)
            if (size, code) == (8, 0):
                assert rest[8:] == b""
                return records
            records.append((code, rest[8:size]))
            rest = rest[size:]
        raise AssertionError("no end record")

    def knock(self, timeout_s: float = 10.0) -> tuple[int, ...]:
        """The next event on the interrupt endpoint: code and parameters."""
        received = bytes(self.device.read(KNOCK, 64, round(timeout_s * 1000)))
        length, kind, code, _ = struct.unpack_from("<IHHI", received)
        assert (length, kind) == (len(received), 4)
        return (code, *struct.unpack(f"<{(length - 12) // 4}I", received[12:]))

    def values(self) -> dict[int, int]:
        """Properties that were reported to have changed, if they are numbers."""
        changed = [payload for code, payload in self.events() if code == 0xC189]
        return dict(struct.unpack("<II", payload) for payload in changed if len(payload) == 8)

    def wait_for(self, wanted: int) -> bytes:
        """Poll for one record."""
        for _ in range(10_000):
            for code, payload in self.events():
                if code == wanted:
                    return payload
            self.clock.spend(0.01)
        raise AssertionError(f"{wanted:04X} never came")

    def shoot(self, half: bool = True) -> float:
        """Both stages of the button without focusing; the time just before the full press."""
        if half:
            assert self.do(0x9128, 1, 1).code == OK
            self.clock.spend(0.05)
        pressed_s = self.clock.now()
        assert self.do(0x9128, 2, 1).code == OK
        assert self.do(0x9129, 2).code == OK
        assert self.do(0x9129, 1).code == OK
        return pressed_s

    def photograph(self) -> tuple[int, int, str]:
        """Wait for a file in the camera's memory: handle, size, name."""
        payload = self.wait_for(0xC186)
        handle, _, _, size = struct.unpack_from("<IIII", payload)
        return handle, size, payload[20:].rstrip(b"\0").decode()
