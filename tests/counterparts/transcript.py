"""Transcripts: complete PTP/IP sessions as JSON lines, one packet each."""

import json
import struct
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

FOLDER = Path(__file__).with_name("transcripts")
HOST, CAMERA = "host", "camera"
COMMAND, EVENT = "command", "event"
TYPES = (
    *("-", "InitCommandRequest", "InitCommandAck", "InitEventRequest", "InitEventAck"),
    *("InitFail", "OperationRequest", "OperationResponse", "Event", "StartData", "Data"),
    *("Cancel", "EndData", "Ping", "Pong"),
)


@dataclass(frozen=True)
class Line:
    """One packet.

    Attributes
    ----------
    t_s
        When the camera saw it or sent it, on its own clock.
    sender
        `host` or `camera`.
    connection
        `command` or `event`.
    type
        For the reader; the packet itself says so, too.
    hex
        All bytes of the packet.
    """

    t_s: float
    sender: str
    connection: str
    type: str
    hex: str

    @property
    def packet(self) -> bytes:
        return bytes.fromhex(self.hex)

    @property
    def kind(self) -> int:
        return int(struct.unpack_from("<I", self.packet, 4)[0])

    @property
    def payload(self) -> bytes:
        return self.packet[8:]


def line(t_s: float, sender: str, connection: str, packet: bytes) -> Line:
    (kind,) = struct.unpack_from("<I", packet, 4)
    return Line(t_s, sender, connection, TYPES[kind], packet.hex())


def write(path: Path, lines: Iterable[Line]) -> None:
    path.write_text("".join(json.dumps(asdict(each)) + "\n" for each in lines), encoding="utf-8")


def read(path: Path) -> list[Line]:
    return [Line(**json.loads(text)) for text in path.read_text(encoding="utf-8").splitlines()]


def paths() -> list[Path]:
    return sorted(FOLDER.glob("*.jsonl"))
