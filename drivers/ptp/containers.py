"""PTP containers on USB (PIMA 15740 over USB still image class 1.0, section 7): encoding, decoding.

Layout, little-endian: u32 length of everything, u16 kind, u16 code, u32 transaction id, then u32
parameters or, in a data container, the payload.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

from .failures import MalformedError

#: Bytes before parameters or payload.
HEADER_BYTES = 12
#: A command, response or event carries at most this many parameters (PIMA 15740, 9.3).
MAX_PARAMETERS = 5

_HEADER = struct.Struct("<IHHI")


class Kind(IntEnum):
    """Kind of a container."""

    COMMAND = 1
    DATA = 2
    RESPONSE = 3
    EVENT = 4


@dataclass(frozen=True)
class Container:
    """One container.

    Attributes
    ----------
    kind
        Kind of the container: command, data, response or event.
    code
        Operation, response or event code; a data container repeats its operation's.
    transaction_id
        Id of the transaction to which the container belongs.
    payload
        Bytes of the parameters or the data.
    """

    kind: Kind
    code: int
    transaction_id: int
    payload: bytes = b""

    @property
    def params(self) -> tuple[int, ...]:
        """Parameters of the payload as u32 numbers; empty for a data container."""
        if self.kind is Kind.DATA:
            return ()
        return struct.unpack(f"<{len(self.payload) // 4}I", self.payload)


def command(code: int, transaction_id: int, params: tuple[int, ...]) -> Container:
    """Return a container of command `code` with its u32 parameters."""
    return Container(Kind.COMMAND, code, transaction_id, struct.pack(f"<{len(params)}I", *params))


def encode(container: Container) -> bytes:
    """Return the bytes of the container on the bulk endpoint."""
    header = _HEADER.pack(
        HEADER_BYTES + len(container.payload),
        container.kind,
        container.code,
        container.transaction_id,
    )
    return header + container.payload


def announced_length(beginning: bytes) -> int:
    """Return the length in bytes of the whole container of which `beginning` is the first packet.

    Raises
    ------
    MalformedError
        The packet is too short for a header, or its header is impossible.
    """
    if len(beginning) < HEADER_BYTES:
        raise MalformedError(
            f"expected a PTP container of at least {HEADER_BYTES} bytes from the camera", beginning
        )
    length, kind, _, _ = _HEADER.unpack_from(beginning)
    longest = HEADER_BYTES + 4 * MAX_PARAMETERS
    plausible = length >= HEADER_BYTES and kind in iter(Kind)
    if plausible and kind != Kind.DATA:
        plausible = length <= longest and length % 4 == 0
    if not plausible:
        raise MalformedError("expected a PTP container from the camera", beginning)
    return int(length)


def decode(data: bytes) -> Container:
    """Return the container that makes up all of `data`.

    Raises
    ------
    MalformedError
        `data` is not exactly one well-formed container.
    """
    length = announced_length(data)
    if length != len(data):
        raise MalformedError(f"expected a container of {length} bytes from the camera", data)
    _, kind, code, transaction_id = _HEADER.unpack_from(data)
    return Container(Kind(kind), code, transaction_id, data[HEADER_BYTES:])
