"""The network side: PTP/IP (CIPA DC-005), two TCP connections to one camera.

The first carries transactions; the second their cancellation, the camera's probes of the PC, and
events.
"""

import select
import socket
import struct
from collections import deque
from collections.abc import Callable

from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceError

from ..containers import Container, Kind
from ..failures import MalformedError, NoAnswerError, UnpluggedError, shown
from . import packets
from .packets import Packet, PacketKind, split

WRITE_TIMEOUT_S = 5.0
BLOCK_BYTES = 1024 * 1024

LOOK_AT_NETWORK = "check that it is on, in the network, and free of other programs"


class PacketStream:
    """Packets over one socket, which this object owns.

    Parameters
    ----------
    connected
        Connected socket.
    name
        Name of the camera in messages.
    """

    def __init__(self, connected: socket.socket, name: str) -> None:
        connected.settimeout(WRITE_TIMEOUT_S)  # reads come when there is something to read
        self._socket = connected
        self._name = name
        self._received = bytearray()
        self._loss: str | None = None

    def fileno(self) -> int:
        """Return the socket's file descriptor, for `select`."""
        return self._socket.fileno()

    @property
    def beginning(self) -> bytes:
        """Bytes that have come of an incomplete packet."""
        return bytes(self._received)

    def write(self, packets: bytes, doing: str) -> None:
        """Send all of the data.

        Raises
        ------
        UnpluggedError
            The camera does not take it, or is gone; `doing` is its purpose in the message.
        """
        self.check(doing)
        try:
            self._socket.sendall(packets)
        except OSError as failure:
            self._loss = str(failure)  # half a packet may be out: nothing can follow it
            self.check(doing)

    def take_in(self) -> None:
        """Receive the bytes that have come; if the camera is gone, earlier bytes stay readable."""
        try:
            received = self._socket.recv(BLOCK_BYTES)
        except OSError as failure:
            self._loss = str(failure)
            return
        if not received:
            self._loss = "it has hung up"
        self._received += received

    def check(self, doing: str) -> None:
        """Check that the camera is still there.

        Raises
        ------
        UnpluggedError
            The camera is gone.
        """
        if self._loss is not None:
            raise UnpluggedError(
                f"{self._name}: {doing}: it is gone ({self._loss}): {LOOK_AT_NETWORK}"
            )

    def next_packet(self, at_most_bytes: int) -> Packet | None:
        """Return the next packet, if all of it has been taken in.

        Raises
        ------
        MalformedError
            The bytes are no packet; nothing behind them can be decoded any more.
        """
        return split(self._received, at_most_bytes)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


#: IANA's port for PTP/IP.
PORT = 15740
NAME = "labrig"
#: GUID by which a camera recognises this program, once it was allowed in.
GUID = b"labrig initiator"
#: Some cameras ask their owner first.
INTRODUCTION_TIMEOUT_S = 20.0
CANCEL_TIMEOUT_S = 5.0
#: A packet's own header and the transaction id before its data.
_AROUND_DATA_BYTES = 12
#: Longer than any packet that carries no data: an introduction with its name.
_SHORT_PACKET_BYTES = 1024
#: Longest packet while cancelling, when data of any length may still be on its way.
_MAX_PACKET_BYTES = 256 * 1024 * 1024
#: An EOS reports without end what nobody listens to, because it says it again when asked.
_MAX_EVENTS_KEPT = 256
_REFUSALS = {
    1: "it does not know this PC: allow 'labrig' in its network menu",
    2: "another program uses it: close that",
}


class IpLink:
    """Containers to and from one camera on the network.

    Parameters
    ----------
    dial
        Function that makes one TCP connection to the camera.
    address
        Address of the camera, for messages.
    clock
        Clock of the time-outs.

    Raises
    ------
    DeviceError
        No camera is at the address, or it refuses the PC.
    """

    def __init__(self, dial: Callable[[], socket.socket], address: str, clock: Clock) -> None:
        self._dial = dial
        self._name = f"camera {address}"
        self._clock = clock
        self._operation = 0
        self._streams: list[PacketStream] = []
        self._events: deque[Packet] = deque(maxlen=_MAX_EVENTS_KEPT)
        self._introduce()

    def send(self, request: Container, data: bytes | None, doing: str) -> None:
        """Send one command, and its data if it has some.

        Raises
        ------
        DeviceError
            The camera does not take it; `doing` is its purpose in the message.
        """
        self._operation = request.code
        self._command(doing).write(packets.request(request, data), doing)

    def receive(self, doing: str, timeout_s: float, at_most_bytes: int) -> Container:
        """Return the next data or response, each packet of it within `timeout_s`.

        Raises
        ------
        DeviceError
            Nothing came, it is out of order, or longer than announced or than `at_most_bytes`.
        """
        longest = at_most_bytes + _AROUND_DATA_BYTES + _SHORT_PACKET_BYTES
        packet = self._next(doing, timeout_s, longest)
        if packet.kind == PacketKind.OPERATION_RESPONSE:
            return packets.response(packet)
        if packet.kind != PacketKind.START_DATA:
            raise self._out_of_order(doing, "data or a response", packet)
        transaction_id, announced = packet.fields("IQ")
        if announced > at_most_bytes and announced != packets.UNKNOWN_LENGTH:
            raise MalformedError(
                f"{self._name}: {doing}: expected at most {at_most_bytes} bytes, it announces "
                f"{announced}",
                packet.payload,
            )
        data = bytearray()
        while packet.kind != PacketKind.END_DATA:
            packet = self._next(doing, timeout_s, longest)
            data += self._piece(packet, transaction_id, doing)
            if len(data) > min(announced, at_most_bytes):
                break
        if len(data) != announced and not len(data) <= at_most_bytes < announced:
            raise MalformedError(
                f"{self._name}: {doing}: expected {announced} bytes as announced", bytes(data)
            )
        return Container(Kind.DATA, self._operation, transaction_id, bytes(data))

    def event(self, timeout_s: float) -> Container | None:
        """Return the next event, None if the camera reports none within `timeout_s`.

        Raises
        ------
        DeviceError
            The camera is gone, or the packet is no event.
        """
        doing = "waiting for an event"
        deadline_s = self._clock.now() + timeout_s
        self._command(doing)
        self._poll_events(self._streams[1], doing)
        while not self._events and self._take_in(doing, deadline_s):
            self._poll_events(self._streams[1], doing)
        return packets.event(self._events.popleft()) if self._events else None

    def cancel(self, transaction_id: int) -> None:
        """Make the camera cancel `transaction_id` and discard what it still sends.

        Raises
        ------
        DeviceError
            The camera does not confirm it.
        """
        doing = "cancelling a transaction"
        deadline_s = self._clock.now() + CANCEL_TIMEOUT_S
        self._command(doing)
        packet = packets.encode(PacketKind.CANCEL, struct.pack("<I", transaction_id))
        self._streams[1].write(packet, doing)
        is_over = False
        while not is_over:
            remaining_s = deadline_s - self._clock.now()
            answer = self._next(doing, max(0.0, remaining_s), _MAX_PACKET_BYTES)
            if answer.kind == PacketKind.OPERATION_RESPONSE:
                is_over = packets.response(answer).transaction_id == transaction_id

    def reset(self) -> None:
        """Close the connection, which ends the camera's session, and dial again.

        Raises
        ------
        DeviceError
            The camera refuses this PC.
        """
        self.close()
        self._introduce()

    def close(self) -> None:
        """Close the connection."""
        for stream in self._streams:
            stream.close()
        self._streams.clear()
        self._events.clear()

    def _introduce(self) -> None:
        doing = "introducing this PC"
        try:
            command = self._add_stream()
            command.write(packets.init_command_request(GUID, NAME), doing)
            ack = self._welcome(command, PacketKind.INIT_COMMAND_ACK, doing)
            number = struct.pack("<I", packets.connection_number(ack))
            event = self._add_stream()
            event.write(packets.encode(PacketKind.INIT_EVENT_REQUEST, number), doing)
            self._welcome(event, PacketKind.INIT_EVENT_ACK, doing)
        except BaseException:
            self.close()
            raise

    def _add_stream(self) -> PacketStream:
        stream = PacketStream(self._dial(), self._name)
        self._streams.append(stream)
        return stream

    def _welcome(self, stream: PacketStream, expected: PacketKind, doing: str) -> Packet:
        packet = self._wait_for_packet(stream, doing, INTRODUCTION_TIMEOUT_S, _SHORT_PACKET_BYTES)
        if packet.kind == PacketKind.INIT_FAIL:
            (reason,) = packet.fields("I")
            remedy = _REFUSALS.get(reason, "switch it off and on")
            raise DeviceError(f"{self._name}: {doing}: refused with reason {reason}: {remedy}")
        if packet.kind != expected:
            raise self._out_of_order(doing, expected.name, packet)
        return packet

    def _command(self, doing: str) -> PacketStream:
        if not self._streams:
            raise UnpluggedError(f"{self._name}: {doing}: not connected: {LOOK_AT_NETWORK}")
        return self._streams[0]

    def _next(self, doing: str, timeout_s: float, at_most_bytes: int) -> Packet:
        return self._wait_for_packet(self._command(doing), doing, timeout_s, at_most_bytes)

    def _wait_for_packet(
        self, awaited: PacketStream, doing: str, timeout_s: float, at_most_bytes: int
    ) -> Packet:
        deadline_s = self._clock.now() + timeout_s
        while (packet := awaited.next_packet(at_most_bytes)) is None:
            for stream in self._streams[1:]:
                if stream is not awaited:
                    self._poll_events(stream, doing)
            if not self._take_in(doing, deadline_s):
                only = f", only {shown(awaited.beginning)}" if awaited.beginning else ""
                raise NoAnswerError(
                    f"{self._name}: {doing}: no answer within {timeout_s:g} s{only}: "
                    f"{LOOK_AT_NETWORK}"
                )
        return packet

    def _take_in(self, doing: str, deadline_s: float) -> bool:
        """Receive bytes on either connection; return False if none come until then."""
        for stream in self._streams:
            stream.check(doing)
        remaining_s = deadline_s - self._clock.now()
        readable, _, _ = select.select(self._streams, [], [], max(0.0, remaining_s))
        for stream in readable:
            stream.take_in()
        return remaining_s > 0 and bool(readable)

    def _poll_events(self, stream: PacketStream, doing: str) -> None:
        while (packet := stream.next_packet(_SHORT_PACKET_BYTES)) is not None:
            if packet.kind == PacketKind.PING:
                stream.write(packets.encode(PacketKind.PONG), doing)
            elif packet.kind == PacketKind.EVENT:
                self._events.append(packet)

    def _piece(self, packet: Packet, transaction_id: int, doing: str) -> bytes:
        is_data = packet.kind in (PacketKind.DATA, PacketKind.END_DATA)
        if not is_data or packet.fields("I") != (transaction_id,):
            raise self._out_of_order(doing, f"data of transaction {transaction_id}", packet)
        piece = packet.payload[4:]
        if not piece and packet.kind == PacketKind.DATA:
            raise self._out_of_order(doing, "some data", packet)  # else it need never end
        return piece

    def _out_of_order(self, doing: str, expected: str, packet: Packet) -> MalformedError:
        return MalformedError(
            f"{self._name}: {doing}: expected {expected}, it sent a packet of kind {packet.kind}",
            packet.payload,
        )
