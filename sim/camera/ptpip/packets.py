"""PTP/IP packets (CIPA DC-005): u32 length of everything, u32 type, payload; little-endian."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

_HEADER = struct.Struct("<II")
#: Longest packet from a host, a name or a property; a longer one is damaged.
_MAX_FROM_HOST = 65536
_MAX_PARAMETERS = 5
#: A photograph goes out in pieces of this many bytes, so that a host can cancel between them.
_PIECE_BYTES = 65536
_VERSION = 0x00010000


class PacketType(IntEnum):
    """Type of a packet."""

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


class FailReason(IntEnum):
    """Reason for which a host is refused."""

    REJECTED = 1
    BUSY = 2


class MalformedPacketError(Exception):
    """Bytes that are no packet, or a packet that is invalid at this point."""


@dataclass(frozen=True)
class Packet:
    """One packet as it came from the host."""

    kind: int
    payload: bytes

    def fields(self, layout: str) -> tuple[int, ...]:
        """Return the payload, which is exactly these numbers in `struct`'s letters."""
        try:
            return struct.unpack("<" + layout, self.payload)
        except struct.error:
            raise MalformedPacketError from None

    def split(self, layout: str) -> tuple[tuple[int, ...], bytes]:
        """Return the numbers at the start of the payload, and the rest of it."""
        size = struct.calcsize("<" + layout)
        return Packet(self.kind, self.payload[:size]).fields(layout), self.payload[size:]


class PacketReader:
    """Reader that splits the bytes of a TCP connection into packets."""

    def __init__(self) -> None:
        self._received = bytearray()

    def feed(self, received: bytes) -> None:
        """Take in bytes."""
        self._received += received

    def next_packet(self) -> Packet | None:
        """Return the next complete packet.

        Raises
        ------
        MalformedPacketError
            The length is impossible; the start of the next packet is unknown.
        """
        if len(self._received) < _HEADER.size:
            return None
        length, kind = _HEADER.unpack_from(self._received)
        if not _HEADER.size <= length <= _MAX_FROM_HOST:
            raise MalformedPacketError
        if len(self._received) < length:
            return None
        packet = Packet(kind, bytes(self._received[_HEADER.size : length]))
        del self._received[:length]
        return packet


def parameters(payload: bytes) -> tuple[int, ...]:
    """Return at most five u32 parameters.

    Raises
    ------
    MalformedPacketError
        There are more parameters, or incomplete ones.
    """
    count, remainder = divmod(len(payload), 4)
    if remainder or count > _MAX_PARAMETERS:
        raise MalformedPacketError
    return struct.unpack(f"<{count}I", payload)


def packet(kind: PacketType, payload: bytes = b"") -> bytes:
    """Return the bytes of one packet."""
    return _HEADER.pack(_HEADER.size + len(payload), kind) + payload


def init_command_ack(connection: int, guid: bytes, name: str) -> bytes:
    """Return the packet that introduces the camera."""
    text = (name + "\0").encode("utf-16-le")
    payload = struct.pack("<I", connection) + guid + text + struct.pack("<I", _VERSION)
    return packet(PacketType.INIT_COMMAND_ACK, payload)


def init_fail(reason: FailReason) -> bytes:
    """Return the packet that refuses the host."""
    return packet(PacketType.INIT_FAIL, struct.pack("<I", reason))


def response(code: int, transaction_id: int, params: tuple[int, ...] = ()) -> bytes:
    """Return the packet that ends a transaction."""
    return packet(
        PacketType.OPERATION_RESPONSE,
        struct.pack(f"<HI{len(params)}I", code, transaction_id, *params),
    )


def event(code: int, params: tuple[int, ...] = ()) -> bytes:
    """Return an event that belongs to no transaction."""
    return packet(PacketType.EVENT, struct.pack(f"<HI{len(params)}I", code, 0xFFFFFFFF, *params))


def data_phase(transaction_id: int, data: bytes) -> Iterator[bytes]:
    """Return the packets of a data phase to the host."""
    yield packet(PacketType.START_DATA, struct.pack("<IQ", transaction_id, len(data)))
    head = struct.pack("<I", transaction_id)
    last_at = max(0, len(data) - 1) // _PIECE_BYTES * _PIECE_BYTES
    for at in range(0, last_at, _PIECE_BYTES):
        yield packet(PacketType.DATA, head + data[at : at + _PIECE_BYTES])
    yield packet(PacketType.END_DATA, head + data[last_at:])
