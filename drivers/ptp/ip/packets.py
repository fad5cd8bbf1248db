"""PTP/IP packets (CIPA DC-005): encoding and decoding.

Layout, little-endian: u32 length of everything, u32 kind, then the payload of the kind.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

from ..containers import MAX_PARAMETERS, Container, Kind
from ..failures import MalformedError

HEADER_BYTES = 8
VERSION = 0x00010000
#: Data phase of an `OperationRequest`: whether the PC sends data.
NO_DATA_FROM_PC, DATA_FROM_PC = 1, 2
#: Length of data that the camera does not know yet.
UNKNOWN_LENGTH = 0xFFFFFFFFFFFFFFFF
_GUID_BYTES = 16

_HEADER = struct.Struct("<II")


class PacketKind(IntEnum):
    """Kind of a packet."""

    INIT_COMMAND_REQUEST = 1
    INIT_COMMAND_ACK = 2
    INIT_EVENT_REQUEST = 3
    INIT_EVENT_ACK = 4
    INIT_FAIL = 5
    OPERATION_REQUEST = 6
    OPERATION_RESPONSE = 7
    EVENT = 8
    START_DATA = 9
    DATA = 10
    CANCEL = 11
    END_DATA = 12
    PING = 13
    PONG = 14


@dataclass(frozen=True)
class Packet:
    """One packet; a kind that the standard does not define stays a number."""

    kind: int
    payload: bytes = b""

    def fields(self, layout: str) -> tuple[int, ...]:
        """Return the numbers at the begin of the payload, in `struct`'s letters.

        Raises
        ------
        MalformedError
            The payload is too short for them.
        """
        size = struct.calcsize("<" + layout)
        if len(self.payload) < size:
            raise MalformedError(
                f"the camera's packet of kind {self.kind} is too short: expected {size} bytes or "
                "more",
                self.payload,
            )
        return struct.unpack_from("<" + layout, self.payload)


def encode(kind: PacketKind, payload: bytes = b"") -> bytes:
    """Return the bytes of a packet on the network."""
    return _HEADER.pack(HEADER_BYTES + len(payload), kind) + payload


def split(received: bytearray, at_most_bytes: int) -> Packet | None:
    """Remove the packet at the begin of `received` and return it; None if it is incomplete.

    Raises
    ------
    MalformedError
        Its length is impossible, or more than `at_most_bytes`; `received` is left as it is.
    """
    if len(received) < HEADER_BYTES:
        return None
    length, kind = _HEADER.unpack_from(received)
    if not HEADER_BYTES <= length <= at_most_bytes:
        raise MalformedError(
            f"expected a PTP/IP packet of {HEADER_BYTES} to {at_most_bytes} bytes, the camera "
            f"announces {length}",
            bytes(received),
            "check that the address is a camera's",
        )
    if len(received) < length:
        return None
    packet = Packet(kind, bytes(received[HEADER_BYTES:length]))
    del received[:length]
    return packet


def init_command_request(guid: bytes, name: str) -> bytes:
    """Return the packet that introduces the PC."""
    text = (name + "\0").encode("utf-16-le")
    return encode(PacketKind.INIT_COMMAND_REQUEST, guid + text + struct.pack("<I", VERSION))


def connection_number(ack: Packet) -> int:
    """Return the camera's number for the PC, from its InitCommandAck.

    Raises
    ------
    MalformedError
        The packet is cut short.
    """
    return ack.fields(f"I{_GUID_BYTES}x")[0]


def request(command: Container, data: bytes | None) -> bytes:
    """Return an operation request with its data phase, if the PC sends one, in one piece."""
    direction = NO_DATA_FROM_PC if data is None else DATA_FROM_PC
    tid = command.transaction_id
    head = struct.pack("<IHI", direction, command.code, tid)
    packets = encode(PacketKind.OPERATION_REQUEST, head + command.payload)
    if data is not None:
        packets += encode(PacketKind.START_DATA, struct.pack("<IQ", tid, len(data)))
        packets += encode(PacketKind.END_DATA, struct.pack("<I", tid) + data)
    return packets


def response(packet: Packet) -> Container:
    """Return the response container in an OperationResponse.

    Raises
    ------
    MalformedError
        The packet is too short, or its parameters are incomplete.
    """
    return _with_params(Kind.RESPONSE, packet)


def event(packet: Packet) -> Container:
    """Return the event container in an Event packet.

    Raises
    ------
    MalformedError
        The packet is too short, or its parameters are incomplete.
    """
    return _with_params(Kind.EVENT, packet)


def _with_params(kind: Kind, packet: Packet) -> Container:
    code, transaction_id = packet.fields("HI")
    params = packet.payload[6:]
    if len(params) % 4 or len(params) > 4 * MAX_PARAMETERS:
        raise MalformedError(
            f"expected at most {MAX_PARAMETERS} parameters of 4 bytes in the camera's "
            f"{kind.name.lower()}",
            packet.payload,
        )
    return Container(kind, code, transaction_id, params)
