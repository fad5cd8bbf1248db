"""Transactions over PTP/IP: operation request, data phase either way, response, cancel."""

from dataclasses import dataclass, field

from ..responder import Responder
from ..vocabulary import ResponseCode
from .packets import (
    MalformedPacketError,
    Packet,
    PacketType,
    data_phase,
    parameters,
    response,
)

_DATA_TO_CAMERA = 2
_NO_DATA_OR_TO_HOST = 1
#: Announced size of data whose size the host does not know.
_UNKNOWN_SIZE = 0xFFFFFFFFFFFFFFFF
_MAX_DATA = 65536


@dataclass
class _Request:
    """An operation request whose data phase has not ended."""

    opcode: int
    transaction_id: int
    params: tuple[int, ...]
    announced_bytes: int | None = None
    data: bytearray = field(default_factory=bytearray)


class Transactions:
    """One host's transactions, a packet at a time, independent of sockets.

    Parameters
    ----------
    responder
        Responder of the camera.
    """

    def __init__(self, responder: Responder) -> None:
        self._responder = responder
        self._request: _Request | None = None
        self._answering: int | None = None

    def take(self, packet: Packet) -> list[bytes]:
        """Process one packet from the command connection; return the packets that answer it.

        Raises
        ------
        MalformedPacketError
            The packet is invalid at this point: the connection cannot go on.
        """
        match packet.kind:
            case PacketType.OPERATION_REQUEST:
                return self._begin(packet)
            case PacketType.START_DATA:
                return self._announce(packet)
            case PacketType.DATA:
                self._receive(packet)
                return []
            case PacketType.END_DATA:
                return self._finish(self._receive(packet))
            case _:
                raise MalformedPacketError

    def cancel(self, packet: Packet) -> list[bytes]:
        """Cancel a transaction; return the packets to send instead of its remaining ones.

        Nothing is cancelled if that transaction is over.
        """
        (transaction_id,) = packet.fields("I")
        if self._request is not None and self._request.transaction_id == transaction_id:
            self._request = None
            self._responder.abandon(transaction_id)
        elif self._answering != transaction_id:
            return []
        self._answering = None
        return [response(ResponseCode.TRANSACTION_CANCELLED, transaction_id)]

    def answered(self) -> None:
        """Note that all of the last answer is sent, so that it cannot be cancelled any more."""
        self._answering = None

    def _begin(self, packet: Packet) -> list[bytes]:
        (direction, opcode, transaction_id), remainder = packet.split("IHI")
        params = parameters(remainder)
        if self._request is not None:
            raise MalformedPacketError
        if direction == _DATA_TO_CAMERA:
            self._request = _Request(opcode, transaction_id, params)
            return []
        if direction != _NO_DATA_OR_TO_HOST:
            raise MalformedPacketError
        return self._execute(opcode, transaction_id, params, b"")

    def _announce(self, packet: Packet) -> list[bytes]:
        transaction_id, size = packet.fields("IQ")
        request = self._awaiting_data(transaction_id)
        if request.announced_bytes is not None or not (size <= _MAX_DATA or size == _UNKNOWN_SIZE):
            raise MalformedPacketError
        request.announced_bytes = size
        return []

    def _receive(self, packet: Packet) -> _Request:
        (transaction_id,), piece = packet.split("I")
        request = self._awaiting_data(transaction_id)
        if request.announced_bytes is None:
            raise MalformedPacketError
        request.data += piece
        if len(request.data) > min(request.announced_bytes, _MAX_DATA):
            raise MalformedPacketError
        return request

    def _finish(self, request: _Request) -> list[bytes]:
        if request.announced_bytes not in (len(request.data), _UNKNOWN_SIZE):
            raise MalformedPacketError
        self._request = None
        data = bytes(request.data)
        return self._execute(request.opcode, request.transaction_id, request.params, data)

    def _awaiting_data(self, transaction_id: int) -> _Request:
        if self._request is None or self._request.transaction_id != transaction_id:
            raise MalformedPacketError
        return self._request

    def _execute(
        self, opcode: int, transaction_id: int, params: tuple[int, ...], data: bytes
    ) -> list[bytes]:
        answer = self._responder.transaction(opcode, transaction_id, params, data)
        packets = [] if answer.data is None else list(data_phase(transaction_id, answer.data))
        packets.append(response(answer.code, transaction_id, answer.params))
        self._answering = transaction_id
        return packets
