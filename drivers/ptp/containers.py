"""PTP containers on USB (PIMA 15740 over USB still image class 1.0, section 7): bytes and back.

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
MOST_PARAMETERS = 5

_HEADER = struct.Struct("<IHHI")


class Kind(IntEnum):
    """What a container is for."""

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
        Command, data, response or event.
    code
        Operation, response or event code; a data container repeats its operation's.
    transaction_id
        Which transaction it belongs to.
    payload
        The parameters or the data, as bytes.
    """

    kind: Kind
    code: int
    transaction_id: int
    payload: bytes = b""

    @property
    def params(self) -> tuple[int, ...]:
        """The payload read as u32 parameters; empty for a data container."""
        if self.kind is Kind.DATA:
            return ()
        return struct.unpack(f"<{len(self.payload) // 4}I", self.payload)


def command(code: int, transaction_id: int, params: tuple[int, ...]) -> Container:
    """Command `code` with its u32 parameters."""
    return Container(Kind.COMMAND, code, transaction_id, struct.pack(f"<{len(params)}I", *params))


def encode(container: Container) -> bytes:
    """The container as it goes over the bulk endpoint."""
    header = _HEADER.pack(
        HEADER_BYTES + len(container.payload),
        container.kind,
        container.code,
        container.transaction_id,
    )
    return header + container.payload


def announced_length(beginning: bytes) -> int:
    """Bytes of the whole container of which `beginning` is the first packet.

    Raises
    ------
    MalformedError
        Too short for a header, or a header that cannot be.
    """
    if len(beginning) < HEADER_BYTES:
        raise MalformedError(
            f"expected a PTP container of at least {HEADER_BYTES} bytes from the camera", beginning
        )
    length, kind, _, _ = _HEADER.unpack_from(beginning)
    most = HEADER_BYTES + 4 * MOST_PARAMETERS
    plausible = length >= HEADER_BYTES and kind in iter(Kind)
    if plausible and kind != Kind.DATA:
        plausible = length <= most and length % 4 == 0
    if not plausible:
        raise MalformedError("expected a PTP container from the camera", beginning)
    return int(length)


def decode(data: bytes) -> Container:
    """The container that `data` is, all of it.

    Raises
    ------
    MalformedError
        Not exactly one well-formed container.
    """
    length = announced_length(data)
    if length != len(data):
        raise MalformedError(f"expected a container of {length} bytes from the camera", data)
    _, kind, code, transaction_id = _HEADER.unpack_from(data)
    return Container(Kind(kind), code, transaction_id, data[HEADER_BYTES:])
