"""PTP over USB: length, type, code and transaction id before every phase of a transaction."""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import NoReturn

_HEADER = struct.Struct("<IHHI")
_MAX_PARAMETERS = 5
#: Longest container from the host, a property; a longer one is a damaged header.
_MAX_FROM_HOST = 65536
#: Bytes before the parameters or the payload.
HEADER_SIZE = _HEADER.size


class ContainerType(IntEnum):
    """Phase of a transaction."""

    COMMAND = 1
    DATA = 2
    RESPONSE = 3
    EVENT = 4


class MalformedContainerError(Exception):
    """Bytes that are no container, or not the one of this phase."""


@dataclass(frozen=True)
class Container:
    """One container as it came from the host."""

    kind: int
    code: int
    transaction_id: int
    payload: bytes

    def parameters(self) -> tuple[int, ...]:
        """The payload read as at most five parameters."""
        count, remainder = divmod(len(self.payload), 4)
        if remainder or count > _MAX_PARAMETERS:
            raise MalformedContainerError
        return struct.unpack(f"<{count}I", self.payload)


def encode(kind: ContainerType, code: int, transaction_id: int, payload: bytes) -> bytes:
    """Return the bytes of one container."""
    return _HEADER.pack(HEADER_SIZE + len(payload), kind, code, transaction_id) + payload


def encode_parameters(
    kind: ContainerType, code: int, transaction_id: int, parameters: tuple[int, ...]
) -> bytes:
    """Return the bytes of one container whose payload is parameters."""
    payload = struct.pack(f"<{len(parameters)}I", *parameters)
    return encode(kind, code, transaction_id, payload)


class Assembler:
    """Assembler of one container from the packets that the host sends.

    Parameters
    ----------
    packet_size
        The endpoint's wMaxPacketSize; only the last packet of a container may be shorter.
    """

    def __init__(self, packet_size: int) -> None:
        self._packet_size = packet_size
        self._received = bytearray()

    def discard(self) -> None:
        """Discard a container that will not be finished."""
        self._received.clear()

    def feed(self, transfer: bytes) -> Container | None:
        """Take one transfer; return the container if that was the last of it.

        An empty transfer between containers is the end of one that filled its last packet.
        """
        if not transfer and not self._received:
            return None
        self._received += transfer
        ended_short = not transfer or len(transfer) % self._packet_size != 0
        if len(self._received) < HEADER_SIZE:
            if ended_short:
                self._reject()
            return None
        length, kind, code, transaction_id = _HEADER.unpack_from(self._received)
        if not max(HEADER_SIZE, len(self._received)) <= length <= _MAX_FROM_HOST:
            self._reject()
        if len(self._received) < length:
            if ended_short:
                self._reject()
            return None
        payload = bytes(self._received[HEADER_SIZE:])
        self.discard()
        return Container(kind, code, transaction_id, payload)

    def _reject(self) -> NoReturn:
        self.discard()
        raise MalformedContainerError
